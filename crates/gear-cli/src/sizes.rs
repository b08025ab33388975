//! Bytes and times, as people write and read them.

/// Reads `64KiB`, `1.5 GB`, `123B`: bytes, powers of 1024 with `i`, powers of 1000 without. A number alone is bytes, and
/// refused below 1 MiB (0 apart).
pub fn parse(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let number = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = text[number.len()..].to_ascii_lowercase();
    let expected = || format!("expected a number of bytes such as 500MiB or 2GiB, found `{text}`");
    let factor: f64 = match unit.as_str() {
        "" | "b" => 1.0,
        "k" | "kib" => 1024.0,
        "m" | "mib" => 1024.0 * 1024.0,
        "g" | "gib" => 1024.0 * 1024.0 * 1024.0,
        "t" | "tib" => 1024.0 * 1024.0 * 1024.0 * 1024.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        _ => return Err(expected()),
    };
    let number: f64 = number.trim().parse().map_err(|_| expected())?;
    let bytes = number * factor;
    // Who writes `2` means gigabytes more often than bytes.
    if unit.is_empty() && bytes > 0.0 && bytes < 1024.0 * 1024.0 {
        return Err(format!(
            "`{text}` has no unit; write `{text}GiB` or `{text}MiB`, and `{text}B` for bytes"
        ));
    }
    if bytes.is_finite() && (0.0..1e18).contains(&bytes) {
        Ok(bytes as u64)
    } else {
        Err(expected())
    }
}

/// `12.3 MiB`.
pub fn bytes(bytes: u64) -> String {
    let mut value = bytes as f64;
    let mut units = ["B", "KiB", "MiB", "GiB", "TiB"].iter();
    let mut unit = units.next().unwrap_or(&"B");
    while value >= 1024.0
        && let Some(next) = units.next()
    {
        value /= 1024.0;
        unit = next;
    }
    match *unit {
        "B" => format!("{bytes} B"),
        unit => format!("{value:.1} {unit}"),
    }
}

/// `1 node`, `2 nodes`.
pub fn counted(count: usize, thing: &str) -> String {
    format!("{count} {thing}{}", if count == 1 { "" } else { "s" })
}

/// How long ago, in one unit: `3 hours`.
pub fn span(seconds: u64) -> String {
    let (count, unit) = match seconds {
        0..60 => (seconds, "second"),
        60..3600 => (seconds / 60, "minute"),
        3600..86_400 => (seconds / 3600, "hour"),
        _ => (seconds / 86_400, "day"),
    };
    counted(usize::try_from(count).unwrap_or(usize::MAX), unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_read_as_people_write_them() {
        assert_eq!(parse("0"), Ok(0));
        assert_eq!(parse("123B"), Ok(123));
        assert_eq!(parse("2000000"), Ok(2_000_000));
        let told = parse("2").unwrap_err();
        assert!(told.contains("`2GiB`") && told.contains("`2B`"), "{told}");
        assert_eq!(parse("64KiB"), Ok(65_536));
        assert_eq!(parse("1.5 GB"), Ok(1_500_000_000));
        assert_eq!(parse("2g"), Ok(2 << 30));
        for bad in ["", "GiB", "-1", "1 parsec", "1e300", "NaN", "inf"] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn sizes_read_back_as_they_are_told() {
        for (n, text) in [(0, "0 B"), (1023, "1023 B"), (1536, "1.5 KiB"), (8 << 30, "8.0 GiB")] {
            assert_eq!(bytes(n), text);
            assert_eq!(parse(text), Ok(n));
        }
    }

    #[test]
    fn spans_are_told_in_one_unit() {
        assert_eq!(span(1), "1 second");
        assert_eq!(span(7300), "2 hours");
        assert_eq!(span(200_000), "2 days");
    }
}
