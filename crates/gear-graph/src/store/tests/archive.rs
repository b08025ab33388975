//! A store that travels as one file.

use super::*;

/// A store with a large value, a small one, a blob and a demand.
fn filled(dir: &Path) -> [Digest; 2] {
    let store = Store::open(dir);
    let keys = [
        put(&store, "large", &big("a"), 0.1),
        put(&store, "small", &AnyValue::new(Report(serde_json::json!(1))), 0.1),
    ];
    store.publish_origin(&Origin {
        key: keys[0],
        ..Origin::default()
    });
    store.publish(Record::Need(Need {
        key: Digest::of(b"need"),
        ports: vec!["a".into()],
        reason: String::new(),
    }));
    store.put_blob(&Digest::of(b"blob"), &[7; 10_000]);
    keys
}

fn import(archive: &Path) -> (tempfile::TempDir, Result<Archived, ArchiveError>) {
    let dir = tempfile::tempdir().unwrap();
    let result = Store::open(dir.path()).import(archive);
    (dir, result)
}

#[test]
fn everything_arrives() {
    let (dir, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let keys = filled(dir.path());
    let archive = to.path().join("store.tar");
    let exported = Store::open(dir.path()).export(&archive).unwrap();
    assert_eq!((exported.records, exported.contents), (4, 2));
    let (other, imported) = import(&archive);
    assert_eq!(imported.unwrap().new, 6);
    let store = Store::open(other.path());
    assert!(keys.iter().all(|key| value_at(&store, key).is_some()));
    assert_eq!(store.get_blob(&Digest::of(b"blob")).unwrap(), [7; 10_000]);
    assert!(matches!(store.lookup(&Digest::of(b"need")), Some(Record::Need(_))));
    assert_eq!(store.origins().len(), 1);
    assert_eq!(store.warnings(), [""; 0]);
    // Once more: nothing is new, nothing is appended.
    let before = store.stat();
    assert_eq!(store.import(&archive).unwrap().new, 0);
    assert_eq!(store.stat().log_bytes, before.log_bytes);
    // And what it holds makes the same archive.
    store.export(&to.path().join("again.tar")).unwrap();
    let read = |name: &str| std::fs::read(to.path().join(name)).unwrap();
    assert!(read("store.tar") == read("again.tar"));
}

#[test]
fn what_does_not_travel_is_counted() {
    let (dir, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    filled(dir.path());
    let store = Store::open(dir.path());
    assert_eq!(store.export(&to.path().join("whole.tar")).unwrap().lost, 0);
    std::fs::remove_dir_all(dir.path().join("contents")).unwrap();
    let exported = store.export(&to.path().join("rest.tar")).unwrap();
    // The large value and the blob; the small one stands in its record.
    assert_eq!((exported.lost, exported.contents), (2, 0));
}

#[test]
fn an_archive_is_verified_without_a_store() {
    let (dir, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    filled(dir.path());
    let archive = to.path().join("store.tar");
    let exported = Store::open(dir.path()).export(&archive).unwrap();
    assert_eq!(Store::check_archive(&archive).unwrap(), exported);
    let mut bytes = std::fs::read(&archive).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&archive, bytes).unwrap();
    assert!(Store::check_archive(&archive).is_err());
    assert_eq!(std::fs::read_dir(to.path()).unwrap().count(), 1, "nothing was written");
}

#[test]
fn an_import_brings_back_contents_that_were_collected() {
    let (dir, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let keys = filled(dir.path());
    let archive = to.path().join("store.tar");
    let store = Store::open(dir.path());
    store.export(&archive).unwrap();
    store.gc(0).unwrap();
    let store = Store::open(dir.path());
    assert!(value_at(&store, &keys[0]).is_none());
    store.import(&archive).unwrap();
    assert!(value_at(&Store::open(dir.path()), &keys[0]).is_some());
}

#[test]
fn whatever_happens_to_an_archive_nothing_wrong_is_imported() {
    let (dir, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    filled(dir.path());
    let archive = to.path().join("store.tar");
    Store::open(dir.path()).export(&archive).unwrap();
    let whole = std::fs::read(&archive).unwrap();
    let types = |name: &str| (name == "Report").then(ValueType::of::<Report>);
    let mut refused = 0;
    // A prime stride visits all kinds of bytes.
    for at in (0..whole.len()).step_by(211) {
        for cut in [true, false] {
            let mut bytes = whole.clone();
            if cut {
                bytes.truncate(at);
            } else {
                bytes[at] ^= 0x40;
            }
            std::fs::write(&archive, &bytes).unwrap();
            let (other, result) = import(&archive);
            let store = Store::open(other.path());
            if result.is_err() {
                refused += 1;
                assert_eq!((store.stat().actions, store.stat().contents), (0, 0), "byte {at}");
            }
            // What a flip in a header's date does is nobody's concern; what is kept is sound.
            assert_eq!(store.verify(&types, false).unwrap().problems, [""; 0], "byte {at}");
        }
    }
    assert!(refused > whole.len() / 211, "{refused}");
}

#[test]
fn other_files_are_refused_with_a_reason() {
    let to = tempfile::tempdir().unwrap();
    let file = to.path().join("file");
    let refused = |bytes: &[u8]| {
        std::fs::write(&file, bytes).unwrap();
        import(&file).1.unwrap_err().to_string()
    };
    assert!(refused(b"").contains("no archive of a store"));
    assert!(refused(&[0x89; 5000]).contains("no archive of a store"));
    assert!(import(to.path()).1.unwrap_err().to_string().contains("a folder"));
    assert!(import(&to.path().join("none")).1.is_err());

    let tar = |entries: &[(&str, &[u8])]| {
        let mut archive = tar::Builder::new(Vec::new());
        for (name, bytes) in entries {
            let mut header = tar::Header::new_gnu();
            header.set_size(bytes.len() as u64);
            archive.append_data(&mut header, name, *bytes).unwrap();
        }
        archive.into_inner().unwrap()
    };
    assert!(refused(&tar(&[("holiday.jpg", b"x")])).contains("no archive of a store"));
    let manifest = |text: &'static str| ("gear-store.json", text.as_bytes());
    let newer = manifest(r#"{"format": 2, "records": 0, "contents": 0}"#);
    assert!(refused(&tar(&[newer])).contains("format 2"));
    let empty = manifest(r#"{"format": 1, "records": 0, "contents": 0}"#);
    for name in ["contents/x", "contents/ab/cd/x.bin", "lock", "contents/ab/zz.bin"] {
        assert!(
            refused(&tar(&[empty, (name, b"x")])).contains("no part of a store"),
            "{name}"
        );
    }
    let foreign = format!("contents/{0}/{0}{1}.bin", "ab", "0".repeat(62));
    assert!(refused(&tar(&[empty, (&foreign, b"x")])).contains("checksum"));
}

#[test]
fn a_store_that_cannot_be_written_takes_no_import() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    std::fs::write(&file, b"in the way").unwrap();
    let refused = Store::open(file.join("store")).import(&file).unwrap_err();
    assert!(matches!(refused, ArchiveError::ReadOnly { .. }), "{refused}");
}
