//! `#[derive(Params)]`

use proc_macro2::TokenStream;
use quote::quote;
use syn::DeriveInput;

use crate::attributes::{Param, doc, named_fields};

pub fn derive(input: &DeriveInput) -> syn::Result<TokenStream> {
    let name = &input.ident;
    let doc = doc(&input.attrs);
    let params = named_fields(input)?
        .into_iter()
        .map(Param::parse)
        .collect::<syn::Result<Vec<_>>>()?;
    let specs = params.iter().map(Param::spec);
    let idents: Vec<_> = params.iter().map(|p| &p.field.ident).collect();
    let reads = params.iter().map(Param::read);
    let writes = params.iter().map(|param| {
        let ident = &param.field.ident;
        param.write(&quote!(&self.#ident))
    });
    let default = params
        .iter()
        .map(|p| p.default.clone())
        .collect::<Option<Vec<_>>>()
        .map(|defaults| {
            quote!(
                impl ::core::default::Default for #name {
                    fn default() -> Self {
                        Self { #(#idents: #defaults,)* }
                    }
                }
            )
        });
    Ok(quote!(
        impl ::gear_graph::Params for #name {
            const DOC: &'static str = #doc;

            fn specs() -> ::std::vec::Vec<::gear_graph::ParamSpec> {
                let mut specs = ::std::vec::Vec::new();
                #(#specs)*
                specs
            }

            fn take(fields: &mut ::gear_graph::Fields<'_, '_>) -> ::core::option::Option<Self> {
                #(let #idents = #reads;)*
                ::core::option::Option::Some(Self { #(#idents: #idents?,)* })
            }

            fn write(&self) -> ::gear_graph::ParamValues {
                let mut values = ::gear_graph::ParamValues::new();
                #(#writes)*
                values
            }
        }

        #default
    ))
}
