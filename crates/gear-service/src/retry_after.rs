//! How long a server asks to be left alone: `Retry-After`, RFC 9110, section 10.2.3.

use std::time::{Duration, SystemTime};

/// The pause that `said` asks for: seconds, or a date of HTTP in any of its three forms.
///
/// A date is counted from the `Date` of the same answer where there is one, since two clocks need not agree, else from
/// `now`. A date that has passed says nothing, as do negative seconds and what is neither: the pause is ours to choose.
pub fn pause(said: &str, date: Option<&str>, now: SystemTime) -> Option<Duration> {
    if let Ok(seconds) = said.parse::<f64>() {
        let sound = seconds.is_finite() && (0.0..1e9).contains(&seconds);
        return sound.then(|| Duration::from_secs_f64(seconds));
    }
    let until = httpdate::parse_http_date(said).ok()?;
    let from = date
        .and_then(|date| httpdate::parse_http_date(date).ok())
        .unwrap_or(now);
    until.duration_since(from).ok().filter(|pause| !pause.is_zero())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of RFC 9110, section 5.6.7: Sun, 06 Nov 1994 08:49:37 GMT.
    const EXAMPLE: u64 = 784_111_777;

    fn at(seconds: u64) -> SystemTime {
        SystemTime::UNIX_EPOCH + Duration::from_secs(seconds)
    }

    #[test]
    fn seconds_and_every_form_of_a_date_are_read() {
        let seconds = |said: &str| pause(said, None, at(EXAMPLE - 23)).map(|pause| pause.as_secs_f64());
        assert_eq!(seconds("120"), Some(120.0));
        assert_eq!(seconds("0"), Some(0.0));
        assert_eq!(seconds("0.5"), Some(0.5));
        for date in [
            "Sun, 06 Nov 1994 08:49:37 GMT",
            "Sunday, 06-Nov-94 08:49:37 GMT",
            "Sun Nov  6 08:49:37 1994",
        ] {
            assert_eq!(seconds(date), Some(23.0), "{date}");
        }
        for nothing in [
            "",
            "-1",
            "1e12",
            "inf",
            "NaN",
            "soon",
            "Sun, 06 Nov 1994",
            "Sun, 32 Nov 1994 08:49:37 GMT",
        ] {
            assert_eq!(seconds(nothing), None, "{nothing}");
        }
    }

    #[test]
    fn a_date_counts_from_the_server_s_own_clock() {
        let said = "Sun, 06 Nov 1994 08:49:37 GMT";
        let date = Some("Sun, 06 Nov 1994 08:49:30 GMT");
        assert_eq!(pause(said, date, at(EXAMPLE + 5000)), Some(Duration::from_secs(7)));
        assert_eq!(
            pause(said, Some("no date"), at(EXAMPLE - 3)),
            Some(Duration::from_secs(3))
        );
        assert_eq!(pause(said, None, at(EXAMPLE + 1)), None, "it has passed");
        assert_eq!(pause(said, Some(said), at(0)), None, "it is now");
    }
}
