//! Files under construction: names below the output folder with their bytes.

/// One file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File {
    /// Path below the output folder, with `/`.
    pub name: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

impl File {
    /// A file.
    pub fn new(name: impl Into<String>, bytes: Vec<u8>) -> Self {
        Self {
            name: name.into(),
            bytes,
        }
    }
}

/// Several files as one run of bytes, for the store: for each, both lengths, the name, the bytes.
pub fn pack(files: &[File]) -> Vec<u8> {
    let size = files.iter().map(|file| 16 + file.name.len() + file.bytes.len()).sum();
    let mut packed = Vec::with_capacity(size);
    for file in files {
        packed.extend((file.name.len() as u64).to_le_bytes());
        packed.extend((file.bytes.len() as u64).to_le_bytes());
        packed.extend(file.name.as_bytes());
        packed.extend(&file.bytes);
    }
    packed
}

/// What [`pack`] packed; `None` for anything else.
pub fn unpack(mut packed: &[u8]) -> Option<Vec<File>> {
    let mut files = Vec::new();
    while !packed.is_empty() {
        let (name_length, rest) = packed.split_first_chunk()?;
        let (length, rest) = rest.split_first_chunk()?;
        let (name, rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*name_length)).ok()?)?;
        let (bytes, rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
        files.push(File::new(std::str::from_utf8(name).ok()?, bytes.to_vec()));
        packed = rest;
    }
    Some(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_packed_is_unpacked() {
        let files = vec![File::new("views/yaw+30.png", vec![1, 2, 3]), File::new("leer", vec![])];
        assert_eq!(unpack(&pack(&files)), Some(files));
        assert_eq!(unpack(&[]), Some(vec![]));
    }

    #[test]
    fn what_was_cut_off_is_refused() {
        let packed = pack(&[File::new("a.png", vec![7; 40])]);
        for end in 1..packed.len() {
            assert_eq!(unpack(&packed[..end]), None, "{end}");
        }
        assert_eq!(unpack(&[255; 40]), None);
    }
}
