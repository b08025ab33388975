//! What every value type promises.

use crate::Value;

/// Checks what every value type promises: encoding loses nothing, garbage is an error and not a panic, digests tell its
/// extreme cases apart, and a summary says something.
///
/// # Panics
/// If the type breaks a promise.
pub fn assert_codec<T: Value>(values: impl IntoIterator<Item = T>) {
    let extremes = T::extremes();
    for (i, (name, value)) in extremes.iter().enumerate() {
        for (other_name, other) in &extremes[..i] {
            assert_ne!(
                value.digest(),
                other.digest(),
                "the extremes `{name}` and `{other_name}` of {} have one digest",
                T::TYPE
            );
        }
    }
    for value in values.into_iter().chain(extremes.into_iter().map(|(_, value)| value)) {
        assert!(
            !value.summary().is_empty() || T::TYPE == "Report",
            "a {} has no summary",
            T::TYPE
        );
        let bytes = value
            .encode()
            .unwrap_or_else(|error| panic!("a {} does not encode: {error}", T::TYPE));
        let back = T::decode(&bytes).unwrap_or_else(|error| panic!("a {} does not decode: {error}", T::TYPE));
        assert_eq!(back.digest(), value.digest(), "a {} changed by encoding", T::TYPE);
        for cut in [0, 1, bytes.len() / 2, bytes.len().saturating_sub(1)] {
            // Truncated bytes may happen to be a value; they must not be a crash.
            let _ = T::decode(&bytes[..cut.min(bytes.len())]);
        }
    }
    let _ = T::decode(b"not a value");
}
