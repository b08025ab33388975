//! Content digests: BLAKE3, 32 bytes.

use std::fmt;

/// The BLAKE3 digest of a value's canonical content, or of a key.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Digest(pub [u8; 32]);

impl Digest {
    /// Digest of raw bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }

    /// Lower-case hexadecimal, 64 characters.
    pub fn hex(&self) -> String {
        blake3::Hash::from_bytes(self.0).to_hex().to_string()
    }
}

impl Digest {
    /// Reads what [`Digest::hex`] wrote.
    pub fn from_hex(hex: &str) -> Option<Self> {
        let lower = hex.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        let hash = blake3::Hash::from_hex(hex).ok().filter(|_| lower)?;
        Some(Self(*hash.as_bytes()))
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", &self.hex()[..16])
    }
}

/// Builds a [`Digest`] from typed parts. Every part is prefixed by its length, so that
/// no two different sequences of parts hash alike.
#[derive(Default)]
pub struct Hasher(blake3::Hasher);

impl Hasher {
    /// A hasher for one kind of content; `domain` separates kinds.
    pub fn new(domain: &str) -> Self {
        let mut hasher = Self::default();
        hasher.bytes(domain.as_bytes());
        hasher
    }

    /// Adds a byte string.
    pub fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
        self
    }

    /// Adds an integer.
    pub fn u64(&mut self, x: u64) -> &mut Self {
        self.0.update(&x.to_le_bytes());
        self
    }

    /// Adds f32 samples by their bits (length first). NaNs hash by their bits too.
    pub fn f32s(&mut self, xs: &[f32]) -> &mut Self {
        self.u64(xs.len() as u64);
        if cfg!(target_endian = "little") {
            // In one piece: BLAKE3 is several times as fast over long stretches as over short ones.
            self.0.update(bytemuck::cast_slice(xs));
        } else {
            xs.chunks(1 << 14).for_each(|chunk| {
                let bytes: Vec<u8> = chunk.iter().flat_map(|x| x.to_le_bytes()).collect();
                self.0.update(&bytes);
            });
        }
        self
    }

    /// Adds another digest.
    pub fn digest(&mut self, digest: &Digest) -> &mut Self {
        self.0.update(&digest.0);
        self
    }

    /// The digest of everything added so far.
    pub fn finish(&self) -> Digest {
        Digest(*self.0.finalize().as_bytes())
    }
}
