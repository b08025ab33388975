//! Finding and removing what is wrong.

use super::*;

fn types(name: &str) -> Option<ValueType> {
    (name == "Report").then(ValueType::of::<Report>)
}

/// As a run would publish it, with its type.
fn publish(store: &Store, key: &str, value: &AnyValue, promised: Digest) {
    store.publish(Record::Done(Done {
        key: Digest::of(key.as_bytes()),
        value: promised,
        content: store.keep(value),
        label: format!("{key}: Test.out"),
        type_name: "Report".into(),
        ..Done::default()
    }));
    store.flush();
}

#[test]
fn a_sound_store_is_clean() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path());
    let small = AnyValue::new(Report(serde_json::json!(1)));
    publish(&store, "large", &big("a"), big("a").digest());
    publish(&store, "small", &small, small.digest());
    store.put_blob(&Digest::of(b"blob"), &[7; 10_000]);
    let verified = store.verify(&types, false).unwrap();
    assert_eq!(verified.problems, [""; 0]);
    assert_eq!((verified.records, verified.contents, verified.values), (3, 2, 2));
    assert_eq!(store.verify(&|_| None, false).unwrap().unknown_types["Report"], 2);
}

#[test]
fn every_damage_is_found_and_repaired() {
    type Damage = fn(&Store);
    let cases: [(&str, Damage, &str); 6] = [
        ("a flipped bit", |s| edit(s, |bytes| bytes[200] ^= 1), "checksum"),
        (
            "a truncated content",
            |s| edit(s, |bytes| bytes.truncate(9)),
            "checksum",
        ),
        ("an empty content", |s| edit(s, Vec::clear), "checksum"),
        (
            "a torn log",
            |s| {
                let path = log::path(s.path());
                let bytes = std::fs::read(&path).unwrap();
                std::fs::write(path, &bytes[..bytes.len() - 5]).unwrap();
            },
            "no records",
        ),
        (
            "damaged origins",
            |s| std::fs::write(log::origins_path(s.path()), b"what is this").unwrap(),
            "no records",
        ),
        (
            "a record that promises another value",
            |s| publish(s, "liar", &big("b"), Digest::of(b"something else")),
            "another Report",
        ),
    ];
    for (name, damage, expected) in cases {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path());
        publish(&store, "kept", &AnyValue::new(Report(serde_json::json!(1))), {
            AnyValue::new(Report(serde_json::json!(1))).digest()
        });
        publish(&store, "key", &big("a"), big("a").digest());
        damage(&store);
        let store = Store::open(dir.path());
        let verified = store.verify(&types, false).unwrap();
        assert_eq!(verified.problems.len(), 1, "{name}: {:?}", verified.problems);
        assert!(
            verified.problems[0].contains(expected),
            "{name}: {:?}",
            verified.problems
        );
        store.verify(&types, true).unwrap();
        let store = Store::open(dir.path());
        assert_eq!(store.verify(&types, false).unwrap().problems, [""; 0], "{name}");
        assert!(store.lookup(&Digest::of(b"kept")).is_some(), "{name}");
        assert!(store.lookup(&Digest::of(b"liar")).is_none(), "{name}");
    }
}

fn edit(store: &Store, change: impl Fn(&mut Vec<u8>)) {
    let path = &content_files(store)[0];
    let mut bytes = std::fs::read(path).unwrap();
    change(&mut bytes);
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn foreign_files_are_told_of_and_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path());
    publish(&store, "key", &big("a"), big("a").digest());
    std::fs::write(dir.path().join("contents/notes.txt"), "mine").unwrap();
    let verified = store.verify(&types, true).unwrap();
    assert_eq!(verified.foreign, ["contents/notes.txt"]);
    assert_eq!(verified.problems, [""; 0]);
    assert!(dir.path().join("contents/notes.txt").exists());
}
