//! `#[derive(Inputs)]` and `#[derive(Outputs)]`

use proc_macro2::TokenStream;
use quote::quote;
use syn::DeriveInput;

use crate::attributes::{doc, field_name, named_fields};

pub fn inputs(input: &DeriveInput) -> syn::Result<TokenStream> {
    let ident = &input.ident;
    let fields = named_fields(input)?;
    let idents: Vec<_> = fields.iter().map(|f| &f.ident).collect();
    let names: Vec<_> = fields.iter().map(|f| field_name(f)).collect();
    let docs: Vec<_> = fields.iter().map(|f| doc(&f.attrs)).collect();
    let types: Vec<_> = fields.iter().map(|f| &f.ty).collect();
    Ok(quote!(
        impl ::gear_graph::Inputs for #ident {
            fn specs() -> ::std::vec::Vec<::gear_graph::PortSpec> {
                ::std::vec![#(<#types as ::gear_graph::InputField>::spec(#names, #docs),)*]
            }

            fn take(slots: &mut ::gear_graph::Slots<'_>) -> ::core::result::Result<Self, ::gear_graph::NodeError> {
                ::core::result::Result::Ok(Self {
                    #(#idents: <#types as ::gear_graph::InputField>::take(#names, slots.next_port())?,)*
                })
            }

            fn give(self) -> ::std::vec::Vec<::gear_graph::Slot> {
                ::std::vec![#(<#types as ::gear_graph::InputField>::give(self.#idents),)*]
            }
        }
    ))
}

pub fn outputs(input: &DeriveInput) -> syn::Result<TokenStream> {
    let ident = &input.ident;
    let fields = named_fields(input)?;
    let idents: Vec<_> = fields.iter().map(|f| &f.ident).collect();
    let names: Vec<_> = fields.iter().map(|f| field_name(f)).collect();
    let docs: Vec<_> = fields.iter().map(|f| doc(&f.attrs)).collect();
    let types: Vec<_> = fields.iter().map(|f| &f.ty).collect();
    Ok(quote!(
        impl ::gear_graph::Outputs for #ident {
            fn specs() -> ::std::vec::Vec<::gear_graph::PortSpec> {
                ::std::vec![#(<#types as ::gear_graph::OutputField>::spec(#names, #docs),)*]
            }

            fn give(self) -> ::std::vec::Vec<::core::option::Option<::gear_graph::AnyValue>> {
                ::std::vec![#(<#types as ::gear_graph::OutputField>::give(self.#idents),)*]
            }
        }
    ))
}
