//! `#[derive(Choice)]`

use proc_macro2::TokenStream;
use quote::quote;
use syn::{Data, DeriveInput, Fields, LitStr, Variant};

use crate::attributes::{Param, doc};

pub fn derive(input: &DeriveInput) -> syn::Result<TokenStream> {
    let Data::Enum(data) = &input.data else {
        return Err(syn::Error::new_spanned(
            &input.ident,
            "expected an enum: its variants are the choices",
        ));
    };
    let ident = &input.ident;
    let (mut specs, mut reads, mut writes) = (Vec::new(), Vec::new(), Vec::new());
    for variant in &data.variants {
        let name = variant_name(variant)?;
        let doc = doc(&variant.attrs);
        let id = &variant.ident;
        match &variant.fields {
            Fields::Unit => {
                specs.push(quote!(::gear_graph::Variant {
                    name: #name, doc: #doc, params: ::std::vec::Vec::new(),
                }));
                reads.push(quote!(#name => { fields.finish(); ::core::option::Option::Some(Self::#id) }));
                writes.push(quote!(Self::#id => ::gear_graph::ParamValue::from(#name)));
            }
            Fields::Named(named) => {
                let params = named.named.iter().map(Param::parse).collect::<syn::Result<Vec<_>>>()?;
                let param_specs = params.iter().map(Param::spec);
                let param_reads = params.iter().map(Param::read);
                let idents: Vec<_> = params.iter().map(|p| &p.field.ident).collect();
                let param_writes = params.iter().map(|param| {
                    let ident = &param.field.ident;
                    param.write(&quote!(#ident))
                });
                specs.push(quote!(::gear_graph::Variant {
                    name: #name,
                    doc: #doc,
                    params: {
                        let mut specs = ::std::vec::Vec::new();
                        #(#param_specs)*
                        specs
                    },
                }));
                reads.push(quote!(#name => {
                    #(let #idents = #param_reads;)*
                    fields.finish();
                    ::core::option::Option::Some(Self::#id { #(#idents: #idents?,)* })
                }));
                writes.push(quote!(Self::#id { #(#idents,)* } => {
                    let mut values = ::gear_graph::ParamValues::new();
                    #(#param_writes)*
                    ::gear_graph::tagged(#name, values)
                }));
            }
            Fields::Unnamed(_) => {
                return Err(syn::Error::new_spanned(
                    variant,
                    "a variant is a bare word or has named fields; for a number or `auto` use `OrAuto<f64>`",
                ));
            }
        }
    }
    Ok(quote!(
        impl ::gear_graph::Param for #ident {
            fn kind() -> ::gear_graph::ParamKind {
                ::gear_graph::ParamKind::Choice {
                    variants: ::std::vec![#(#specs,)*],
                }
            }

            fn read(
                tree: &::gear_graph::Tree,
                limits: &::gear_graph::Limits,
                reader: &mut ::gear_graph::Reader<'_>,
            ) -> ::core::option::Option<Self> {
                let _ = limits;
                let variants = match <Self as ::gear_graph::Param>::kind() {
                    ::gear_graph::ParamKind::Choice { variants } => variants,
                    _ => ::std::vec::Vec::new(),
                };
                reader.choice(tree, &variants, |name, fields| match name {
                    #(#reads,)*
                    _ => ::core::option::Option::None,
                })
            }

            fn write(&self) -> ::gear_graph::ParamValue {
                match self { #(#writes,)* }
            }
        }
    ))
}

fn variant_name(variant: &Variant) -> syn::Result<String> {
    let mut name = kebab(&variant.ident.to_string());
    for attribute in variant.attrs.iter().filter(|a| a.path().is_ident("choice")) {
        attribute.parse_nested_meta(|meta| {
            if meta.path.is_ident("name") {
                name = meta.value()?.parse::<LitStr>()?.value();
                Ok(())
            } else {
                Err(meta.error("expected `name`"))
            }
        })?;
    }
    Ok(name)
}

fn kebab(ident: &str) -> String {
    let mut name = String::new();
    for (i, c) in ident.chars().enumerate() {
        if c.is_uppercase() && i > 0 {
            name.push('-');
        }
        name.extend(c.to_lowercase());
    }
    name
}
