//! The values that every graph may use.

mod number;
mod report;

pub use number::Number;
pub use report::{Report, ReportFile};
