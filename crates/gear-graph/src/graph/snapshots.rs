//! Snapshots in a graph file: which ports are pinned, and how far they may move.
//!
//! ```yaml
//! snapshots:
//!   mask: foreground.mask
//!   grounded: {port: recompose.grounded, norm: rms, tolerance: 0.002, size: 64}
//! ```
//!
//! Neither runs nor keys know of them: `gear snap` runs a graph with its snapshots in place of its outputs.

use super::file::{self, Entries};
use super::nearest;
use crate::{Problem, Spanned, Tree, TreeKind};

/// How the distance of a value from its snapshot is measured, over a small raster of it or over its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Norm {
    /// The largest difference.
    Max,
    /// The root of the mean square difference.
    Rms,
    /// The mean difference.
    Mean,
    /// The root of the sum of square differences, as a share of that of the snapshot itself.
    Relative,
}

impl Norm {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Max, Self::Rms, Self::Mean, Self::Relative];

    /// Its name in graph files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Max => "max",
            Self::Rms => "rms",
            Self::Mean => "mean",
            Self::Relative => "relative",
        }
    }

    /// What it is, for the schema.
    pub(super) fn doc(self) -> &'static str {
        match self {
            Self::Max => "The largest difference.",
            Self::Rms => "The root of the mean square difference.",
            Self::Mean => "The mean difference.",
            Self::Relative => "The root mean square difference as a share of the snapshot's own.",
        }
    }
}

/// A port that is pinned.
#[derive(Clone, Debug, PartialEq)]
pub struct GraphSnapshot {
    /// Its name, which is that of its files.
    pub name: String,
    pub(crate) slot: u32,
    /// The norm.
    pub norm: Norm,
    /// How far a value may be from its snapshot in the norm.
    pub tolerance: f64,
    /// Longer side of the raster that is kept, in pixels.
    pub size: usize,
}

/// Where a snapshot does not say.
pub(super) const NORM: Norm = Norm::Rms;
/// A tenth of an 8-bit code: rounding passes, and what an eye could see in a picture does not.
pub(super) const TOLERANCE: f64 = 4e-4;
/// A picture that shows what it is, in some kilobytes.
pub(super) const SIZE: usize = 48;
/// The smallest and the largest raster.
pub(super) const SIZES: (usize, usize) = (1, 512);

/// A snapshot as the file has it.
pub struct FileSnapshot<'t> {
    pub name: &'t Spanned<String>,
    pub port: Spanned<&'t str>,
    pub norm: Norm,
    pub tolerance: f64,
    pub size: usize,
}

/// Reads one. `None` if it has no port.
pub(super) fn read<'t>(
    name: &'t Spanned<String>,
    tree: &'t Tree,
    problems: &mut Vec<Problem>,
) -> Option<FileSnapshot<'t>> {
    let what = format!("snapshot `{}`", name.value);
    let expected = "`node.port`";
    if matches!(tree.kind, TreeKind::Text(_)) {
        return Some(FileSnapshot {
            name,
            port: file::text(tree, &what, expected, problems)?,
            norm: NORM,
            tolerance: TOLERANCE,
            size: SIZE,
        });
    }
    let entries: Entries<'t> = file::map(tree, &what, problems)?;
    file::keys(entries, &what, &["port", "norm", "tolerance", "size"], problems);
    let norm = file::get(entries, "norm").map(|tree| norm(tree, &what, problems));
    let tolerance = file::get(entries, "tolerance").map(|tree| {
        let fits = |x: f64| x >= 0.0 && x.is_finite();
        number(
            tree,
            &format!("`tolerance` of {what}"),
            "a number from 0",
            fits,
            problems,
        )
    });
    let size = file::get(entries, "size").map(|tree| {
        let (low, high) = SIZES;
        let fits = |x: f64| x.fract() == 0.0 && (low as f64..=high as f64).contains(&x);
        let range = format!("a whole number from {low} to {high}");
        number(tree, &format!("`size` of {what}"), &range, fits, problems)
    });
    let Some(port) = file::get(entries, "port") else {
        problems.push(
            Problem::error(
                "missing-port",
                format!("{what} has no port"),
                name.span,
                "`port` is missing",
            )
            .help(format!("write `{}: {{port: node.port}}`", name.value)),
        );
        return None;
    };
    Some(FileSnapshot {
        name,
        port: file::text(port, &what, expected, problems)?,
        norm: norm.flatten().unwrap_or(NORM),
        tolerance: tolerance.flatten().unwrap_or(TOLERANCE),
        size: size.flatten().map_or(SIZE, |size| size as usize),
    })
}

fn norm(tree: &Tree, what: &str, problems: &mut Vec<Problem>) -> Option<Norm> {
    let names = || Norm::ALL.into_iter().map(Norm::name);
    let all = || names().collect::<Vec<_>>().join(", ");
    let found = file::text(
        tree,
        &format!("`norm` of {what}"),
        &format!("one of {}", all()),
        problems,
    )?;
    let norm = Norm::ALL.into_iter().find(|norm| norm.name() == found.value);
    if norm.is_none() {
        problems.push(
            Problem::error(
                "unknown-choice",
                format!("`norm` of {what} has no choice `{}`", found.value),
                tree.span,
                "unknown choice",
            )
            .help(match nearest(found.value, names()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("its choices are {}", all()),
            }),
        );
    }
    norm
}

fn number(
    tree: &Tree,
    what: &str,
    range: &str,
    fits: impl Fn(f64) -> bool,
    problems: &mut Vec<Problem>,
) -> Option<f64> {
    let found = match tree.kind {
        TreeKind::Integer(value) => value as f64,
        TreeKind::Float(value) => value,
        _ => {
            problems.push(Problem::error(
                "wrong-type",
                format!("{what} takes {range}, found {}", tree.describe()),
                tree.span,
                format!("expected {range}"),
            ));
            return None;
        }
    };
    if !fits(found) {
        problems.push(Problem::error(
            "parameter-out-of-range",
            format!("{what} takes {range}, found {found}"),
            tree.span,
            format!("expected {range}"),
        ));
        return None;
    }
    Some(found)
}
