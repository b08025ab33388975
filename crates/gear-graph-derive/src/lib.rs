//! Derive macros of node definitions: one Rust definition is the single source of a node's ports, parameters,
//! help, schema and cache key.
//!
//! The macros are used through `gear_graph`, which re-exports them and documents their attributes.

mod attributes;
mod choice;
mod params;
mod ports;

use proc_macro::TokenStream;
use syn::{DeriveInput, parse_macro_input};

/// Parameters of a node, of a loader or of a method.
///
/// On a struct with named fields, each field a `gear_graph::Param`. Doc comments become the help. Attributes of
/// a field: `#[param(default = EXPR, range = A..=B, above = A, below = B, unit = "…", name = "…")]`. A field
/// without `default` is required, unless it is an `Option`. When no field is required, `Default` is implemented.
///
/// `#[param(flatten)]` on a field whose type derives `Params` and has a `Default`: its parameters stand beside the others,
/// so that nodes can share them.
#[proc_macro_derive(Params, attributes(param))]
pub fn params(input: TokenStream) -> TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    params::derive(&input)
        .unwrap_or_else(syn::Error::into_compile_error)
        .into()
}

/// A parameter that is one of several words, or methods with parameters of their own (externally tagged).
///
/// On an enum of unit variants and variants with named fields (attributes as for `Params`). Names are the
/// variants' in kebab case, or `#[choice(name = "…")]`.
#[proc_macro_derive(Choice, attributes(choice, param))]
pub fn choice(input: TokenStream) -> TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    choice::derive(&input)
        .unwrap_or_else(syn::Error::into_compile_error)
        .into()
}

/// The input ports of a node: a struct with named fields of type `Arc<T>`, `Option<Arc<T>>`, `Lazy<T>` or
/// `Option<Lazy<T>>`, each with a doc comment.
#[proc_macro_derive(Inputs)]
pub fn inputs(input: TokenStream) -> TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    ports::inputs(&input)
        .unwrap_or_else(syn::Error::into_compile_error)
        .into()
}

/// The output ports of a node: a struct with named fields of type `Arc<T>` or `Wanted<T>`, each with a doc comment.
#[proc_macro_derive(Outputs)]
pub fn outputs(input: TokenStream) -> TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    ports::outputs(&input)
        .unwrap_or_else(syn::Error::into_compile_error)
        .into()
}
