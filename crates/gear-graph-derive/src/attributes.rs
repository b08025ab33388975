//! What the macros read from a definition: doc comments, field names and `#[param(…)]`.

use proc_macro2::TokenStream;
use quote::quote;
use syn::{Attribute, Data, DeriveInput, Expr, ExprLit, Field, Fields, Lit, LitStr, Meta, Type};

/// The doc comment of an item: lines joined, paragraphs kept.
pub fn doc(attributes: &[Attribute]) -> String {
    let mut lines = Vec::new();
    for attribute in attributes {
        if let Meta::NameValue(pair) = &attribute.meta
            && pair.path.is_ident("doc")
            && let Expr::Lit(ExprLit {
                lit: Lit::Str(text), ..
            }) = &pair.value
        {
            let text = text.value();
            // `lines` of an empty text gives nothing, but an empty line parts paragraphs.
            for line in text.split('\n') {
                lines.push(line.strip_prefix(' ').unwrap_or(line).trim_end().to_string());
            }
        }
    }
    lines.join("\n").trim().to_string()
}

/// The named fields of a struct.
pub fn named_fields(input: &DeriveInput) -> syn::Result<Vec<&Field>> {
    match &input.data {
        Data::Struct(data) => match &data.fields {
            Fields::Named(fields) => Ok(fields.named.iter().collect()),
            Fields::Unit => Ok(Vec::new()),
            Fields::Unnamed(_) => Err(syn::Error::new_spanned(
                &input.ident,
                "fields must have names: they are the names in the graph file",
            )),
        },
        _ => Err(syn::Error::new_spanned(
            &input.ident,
            "expected a struct with named fields",
        )),
    }
}

/// The name of a field in a graph file.
pub fn field_name(field: &Field) -> String {
    let name = field.ident.as_ref().map(ToString::to_string).unwrap_or_default();
    name.strip_prefix("r#").unwrap_or(&name).to_string()
}

/// One parameter, as its field and attributes define it.
pub struct Param<'a> {
    pub field: &'a Field,
    pub name: String,
    pub doc: String,
    pub default: Option<TokenStream>,
    pub limits: TokenStream,
    /// Whether the field is a struct of parameters that stand beside the others.
    pub flatten: bool,
}

impl<'a> Param<'a> {
    pub fn parse(field: &'a Field) -> syn::Result<Self> {
        let mut name = field_name(field);
        let mut default = None;
        let mut range = None;
        let (mut above, mut below) = (None, None);
        let mut unit = None;
        let mut flatten = false;
        for attribute in field.attrs.iter().filter(|a| a.path().is_ident("param")) {
            attribute.parse_nested_meta(|meta| {
                if meta.path.is_ident("default") {
                    default = Some(meta.value()?.parse::<Expr>()?);
                } else if meta.path.is_ident("range") {
                    range = Some(meta.value()?.parse::<Expr>()?);
                } else if meta.path.is_ident("above") {
                    above = Some(meta.value()?.parse::<Expr>()?);
                } else if meta.path.is_ident("below") {
                    below = Some(meta.value()?.parse::<Expr>()?);
                } else if meta.path.is_ident("unit") {
                    unit = Some(meta.value()?.parse::<LitStr>()?);
                } else if meta.path.is_ident("name") {
                    name = meta.value()?.parse::<LitStr>()?.value();
                } else if meta.path.is_ident("flatten") {
                    flatten = true;
                } else {
                    return Err(
                        meta.error("expected `default`, `range`, `above`, `below`, `unit`, `name` or `flatten`")
                    );
                }
                Ok(())
            })?;
        }
        let ty = &field.ty;
        if flatten {
            if default.is_some() || range.is_some() || above.is_some() || below.is_some() || unit.is_some() {
                return Err(syn::Error::new_spanned(
                    field,
                    "`flatten` stands alone: the parameters of the struct have their own attributes",
                ));
            }
            return Ok(Self {
                doc: String::new(),
                field,
                name,
                default: Some(quote!(<#ty as ::core::default::Default>::default())),
                limits: TokenStream::new(),
                flatten,
            });
        }
        let default = match default {
            Some(expr) => Some(quote!(#expr)),
            None if is_option(ty) => Some(quote!(::core::option::Option::None)),
            None => None,
        };
        let mut limits = quote!(::gear_graph::Limits::none());
        if let Some(range) = range {
            limits = quote!(#limits.within(#range));
        }
        if let Some(above) = above {
            limits = quote!(#limits.above(#above));
        }
        if let Some(below) = below {
            limits = quote!(#limits.below(#below));
        }
        if let Some(unit) = unit {
            limits = quote!(#limits.unit(#unit));
        }
        limits = quote!(#limits.or(<#ty as ::gear_graph::Param>::bounds()));
        Ok(Self {
            doc: doc(&field.attrs),
            field,
            name,
            default,
            limits,
            flatten,
        })
    }

    /// A statement that adds its `ParamSpec`s to `specs`.
    pub fn spec(&self) -> TokenStream {
        let Self { name, doc, limits, .. } = self;
        let ty = &self.field.ty;
        if self.flatten {
            return quote!(specs.extend(<#ty as ::gear_graph::Params>::specs()););
        }
        let default = match &self.default {
            Some(expr) => quote!(::core::option::Option::Some({
                let default: #ty = #expr;
                ::gear_graph::Param::write(&default)
            })),
            None => quote!(::core::option::Option::None),
        };
        quote!(specs.push(::gear_graph::ParamSpec {
            name: #name,
            doc: #doc,
            kind: <#ty as ::gear_graph::Param>::kind(),
            limits: #limits,
            default: #default,
        });)
    }

    /// An expression that reads the field from `fields`, of type `Option<ty>`.
    pub fn read(&self) -> TokenStream {
        let Self { name, limits, .. } = self;
        let ty = &self.field.ty;
        if self.flatten {
            return quote!(<#ty as ::gear_graph::Params>::take(fields));
        }
        let default = match &self.default {
            Some(expr) => quote!(::core::option::Option::Some({ let default: #ty = #expr; default })),
            None => quote!(::core::option::Option::None),
        };
        quote!(fields.take::<#ty>(#name, &#limits, #default))
    }

    /// A statement that adds `value`, a reference to the field, to `values`.
    pub fn write(&self, value: &TokenStream) -> TokenStream {
        let name = &self.name;
        if self.flatten {
            return quote!(values.extend(::gear_graph::Params::write(#value)););
        }
        quote!(values.insert(::std::string::String::from(#name), ::gear_graph::Param::write(#value));)
    }
}

fn is_option(ty: &Type) -> bool {
    matches!(ty, Type::Path(path) if path.path.segments.last().is_some_and(|s| s.ident == "Option"))
}
