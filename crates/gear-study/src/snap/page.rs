//! The page of a comparison: before, after and difference of every snapshot that moved.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gear_report::picture::Picture;
use minijinja::{Environment, Value, context};

use super::{Compared, Comparison, SnapError, State, line};

/// As many numbers as are listed of one snapshot.
const MOST_NUMBERS: usize = 40;

/// The page, one file that needs nothing else.
pub fn page(title: &str, comparison: &Comparison) -> Result<String, SnapError> {
    let mut environment = Environment::new();
    environment.add_template("snapshots.html", include_str!("page.html"))?;
    let mut snapshots = Vec::new();
    for snapshot in &comparison.snapshots {
        snapshots.push(shown(snapshot)?);
    }
    let passes = comparison.snapshots.iter().filter(|s| s.state.passes()).count();
    Ok(environment.get_template("snapshots.html")?.render(context! {
        title => title,
        count => comparison.snapshots.len(),
        passes => passes,
        snapshots => snapshots,
        unknown => comparison.unknown.clone(),
    })?)
}

fn shown(snapshot: &Compared) -> Result<Value, SnapError> {
    let failed = |e: gear_report::PictureError| SnapError::Picture { cause: e.to_string() };
    let raster = |reduced: &Option<super::Reduced>| reduced.as_ref().and_then(|r| r.raster.clone());
    let (before, after) = (raster(&snapshot.pinned), raster(&snapshot.found));
    let mut pictures = Vec::new();
    if let Some(before) = &before {
        pictures.push(context! { what => "before", uri => uri(&before.picture().map_err(failed)?) });
    }
    if let Some(after) = &after {
        pictures.push(context! { what => "after", uri => uri(&after.picture().map_err(failed)?) });
    }
    if let (Some(before), Some(after)) = (&before, &after)
        && let Some((picture, scale)) = after.difference(before)
    {
        let what = format!("difference: grey is none, white is {scale:.2e} or more, black the opposite");
        pictures.push(context! { what => what, uri => uri(&picture.map_err(failed)?) });
    }
    let numbers: Vec<_> = snapshot
        .numbers
        .iter()
        .take(MOST_NUMBERS)
        .map(|n| context! { path => n.path.as_str(), before => n.before.to_string(), after => n.after.to_string() })
        .collect();
    Ok(context! {
        name => snapshot.name.as_str(),
        line => line(snapshot),
        good => snapshot.state.passes(),
        same => matches!(snapshot.state, State::Same),
        pictures => pictures,
        numbers => numbers,
        more => snapshot.numbers.len().saturating_sub(MOST_NUMBERS),
    })
}

/// Base64 needs no escaping.
fn uri(picture: &Picture) -> Value {
    let mime = picture.format.mime();
    Value::from_safe_string(format!("data:{mime};base64,{}", STANDARD.encode(&picture.bytes)))
}
