//! What people look at: the page of a run, its pictures and plots.
//!
//! [`Page`] is plain data: a graph to draw, pictures, numbers. [`Page::render`] turns it into one HTML file that
//! holds everything it shows (styles, script, pictures) and so opens from disk, without a network, for as long as
//! browsers read HTML. Nothing here knows how a run is executed; whoever ran the graph fills the page in.
//!
//! * [`picture`] turns rasters into the JPEG and PNG bytes that a page embeds,
//! * [`drawing`] lays a graph out in layers and draws it as SVG,
//! * [`plot`] draws curves as SVG,
//! * [`page`] is the page and its template,
//! * [`document`] is text, tables and pictures as Markdown or HTML,
//! * [`sheet`] puts pictures in a grid,
//! * [`precision`] draws error against cost.

pub mod document;
pub mod drawing;
pub mod page;
pub mod picture;
pub mod plot;
pub mod precision;
pub mod sheet;

pub use document::{Block, Document, Table};
pub use drawing::{Drawing, Shape, Standing};
pub use page::{Comparison, Cost, Figure, Measure, Page, PageError, Row};
pub use picture::{Picture, PictureError};
