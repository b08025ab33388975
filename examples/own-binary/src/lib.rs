//! A team's own binary: `gear` plus a type of value and two nodes of its own. Copy the folder, rename the crate, and put
//! your nodes in the place of these.
//!
//! | file | what it holds |
//! |---|---|
//! | `main.rs` | the binary, ten lines |
//! | `palette.rs` | a type of value: the colours of a picture |
//! | `dominant_colours.rs` | a node that finds them |
//! | `colour_card.rs` | a node that paints them |
//! | `palette.yaml` | a graph with both |
//!
//! ```sh
//! cargo run --bin own-gear -- run examples/own-binary/palette.yaml --input painting=sample:court-lady --out out
//! ```

mod colour_card;
mod dominant_colours;
mod palette;

pub use colour_card::ColourCard;
pub use dominant_colours::DominantColours;
pub use palette::{Palette, Tone};

use gear_graph::Registry;

/// Adds the nodes, and with them the types at their ports, to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<DominantColours>().node::<ColourCard>();
}
