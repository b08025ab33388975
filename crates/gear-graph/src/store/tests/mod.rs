//! What the store promises when things go wrong.

mod archive;
mod verify;

use super::*;
use crate::{Report, Value};

fn big(tag: &str) -> AnyValue {
    AnyValue::new(Report(
        serde_json::json!({ "tag": tag, "filling": "x".repeat(2 * INLINE) }),
    ))
}

fn put(store: &Store, key: &str, value: &AnyValue, seconds: f64) -> Digest {
    let key = Digest::of(key.as_bytes());
    let content = store.keep(value);
    store.publish(Record::Done(Done {
        key,
        value: value.digest(),
        content,
        seconds,
        ..Done::default()
    }));
    store.flush();
    key
}

fn value_at(store: &Store, key: &Digest) -> Option<AnyValue> {
    match store.lookup(key) {
        Some(Record::Done(done)) => store.load(&done.value, &ValueType::of::<Report>()),
        _ => None,
    }
}

fn content_files(store: &Store) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for folder in std::fs::read_dir(store.path().join("contents")).unwrap() {
        for file in std::fs::read_dir(folder.unwrap().path()).unwrap() {
            files.push(file.unwrap().path());
        }
    }
    files
}

#[test]
fn another_process_finds_what_was_published() {
    let dir = tempfile::tempdir().unwrap();
    let (small, large) = (AnyValue::new(Report(serde_json::json!(1))), big("a"));
    let (k1, k2) = {
        let store = Store::open(dir.path());
        (put(&store, "small", &small, 0.1), put(&store, "large", &large, 0.1))
    };
    let store = Store::open(dir.path());
    assert_eq!(value_at(&store, &k1).unwrap().digest(), small.digest());
    assert_eq!(value_at(&store, &k2).unwrap().digest(), large.digest());
    assert!(store.warnings().is_empty());
}

#[test]
fn two_stores_open_at_once_lose_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (Store::open(dir.path()), Store::open(dir.path()));
    let mut keys = Vec::new();
    for i in 0..20 {
        let store = if i % 2 == 0 { &a } else { &b };
        keys.push(put(store, &format!("key {i}"), &big(&format!("{i}")), 0.1));
    }
    let store = Store::open(dir.path());
    assert!(keys.iter().all(|key| value_at(&store, key).is_some()));
    assert!(store.warnings().is_empty());
}

/// A run's end mends the log while the thread that paints the report still writes.
#[test]
fn mending_and_appending_at_once_do_not_wait_for_each_other() {
    let dir = tempfile::tempdir().unwrap();
    let store = std::sync::Arc::new(Store::open(dir.path()));
    let (ended, end) = std::sync::mpsc::channel();
    for mends in [true, false] {
        let (store, ended) = (std::sync::Arc::clone(&store), ended.clone());
        std::thread::spawn(move || {
            for i in 0..200 {
                if mends {
                    let _folder = log::lock_exclusive(store.path()).unwrap();
                    store.mend().unwrap();
                } else {
                    store.put_blob(&Digest::of(format!("blob {i}").as_bytes()), b"picture");
                }
            }
            ended.send(()).unwrap();
        });
    }
    for _ in 0..2 {
        end.recv_timeout(Duration::from_secs(60))
            .expect("both threads come to their end");
    }
    store.flush();
    let again = Store::open(dir.path());
    let kept = (0..200).all(|i| again.get_blob(&Digest::of(format!("blob {i}").as_bytes())).is_some());
    assert!(kept && again.warnings().is_empty());
}

/// Another process collects garbage: a run at work goes on, and writes its records later.
#[test]
fn a_folder_that_is_locked_makes_nobody_wait_who_does_not_want_to() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path());
    let elsewhere = log::lock_exclusive(dir.path()).unwrap();
    let key = Digest::of(b"key");
    store.publish(Record::Done(Done { key, ..Done::default() }));
    assert!(!store.try_flush());
    assert!(!store.flush_unless(&|| true));
    assert!(store.pending_bytes() > 0, "nothing is lost");
    assert!(Store::open(dir.path()).lookup(&key).is_none());
    drop(elsewhere);
    assert!(store.flush_unless(&|| false) && store.try_flush());
    assert!(Store::open(dir.path()).lookup(&key).is_some());
    assert!(store.warnings().is_empty());
}

#[test]
fn who_only_looks_leaves_no_trace() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("store");
    let empty = Store::look_at(&root);
    assert!(empty.lookup(&Digest::of(b"key")).is_none() && empty.keep(&big("a")).is_none());
    assert!(empty.warnings().is_empty() && !root.exists());
    let key = put(&Store::open(&root), "key", &big("a"), 0.1);
    // Not even that a content was used, or that it is damaged, is written down.
    let path = content_files(&Store::look_at(&root)).remove(0);
    let old = std::time::SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000_000);
    std::fs::File::open(&path).unwrap().set_modified(old).unwrap();
    assert!(value_at(&Store::look_at(&root), &key).is_some());
    assert_eq!(std::fs::metadata(&path).unwrap().modified().unwrap(), old);
    std::fs::write(&path, "damaged").unwrap();
    let looking = Store::look_at(&root);
    looking.put_blob(&Digest::of(b"blob"), b"bytes");
    assert!(value_at(&looking, &key).is_none() && path.exists());
    drop(looking);
    assert!(!Store::open(&root).has_blob(&Digest::of(b"blob")));
}

/// A store in a shared folder serves everybody who may read the folder.
#[cfg(unix)]
#[test]
fn files_of_a_store_are_as_readable_as_any_other() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
    std::fs::write(dir.path().join("plain"), "").unwrap();
    let plain = mode(&dir.path().join("plain"));
    let root = dir.path().join("store");
    let store = Store::open(&root);
    put(&store, "key", &big("a"), 0.1);
    store.gc(u64::MAX).unwrap(); // writes the log anew
    let content = content_files(&store).remove(0);
    for path in [root.join("CACHEDIR.TAG"), log::path(&root), root.join("lock"), content] {
        assert_eq!(mode(&path), plain, "{}", path.display());
    }
}

#[test]
fn a_blob_that_was_collected_is_not_there() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path());
    let key = Digest::of(b"picture");
    assert!(!store.has_blob(&key));
    store.put_blob(&key, &[7; 2 * INLINE]);
    assert!(store.has_blob(&key));
    store.gc(0).unwrap();
    assert!(!store.has_blob(&key));
}

#[test]
fn a_damaged_content_is_a_miss_a_warning_and_can_be_stored_again() {
    type Damage = fn(&PathBuf);
    let damages: [(&str, Damage); 4] = [
        ("truncated", |p| {
            std::fs::write(p, &std::fs::read(p).unwrap()[..100]).unwrap()
        }),
        ("flipped", |p| {
            let mut bytes = std::fs::read(p).unwrap();
            bytes[200] ^= 1;
            std::fs::write(p, bytes).unwrap();
        }),
        ("empty", |p| std::fs::write(p, b"").unwrap()),
        ("foreign", |p| std::fs::write(p, b"#!/bin/sh\n").unwrap()),
    ];
    for (name, damage) in damages {
        let dir = tempfile::tempdir().unwrap();
        let key = put(&Store::open(dir.path()), "key", &big("a"), 0.1);
        let store = Store::open(dir.path());
        damage(&content_files(&store)[0]);
        assert!(value_at(&store, &key).is_none(), "{name}");
        assert_eq!(store.warnings().len(), 1, "{name}");
        put(&store, "key", &big("a"), 0.1);
        assert!(value_at(&store, &key).is_some(), "{name}");
    }
}

#[test]
fn swapped_contents_are_misses() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path());
    let keys = [put(&store, "a", &big("a"), 0.1), put(&store, "b", &big("b"), 0.1)];
    let files = content_files(&store);
    let bytes: Vec<_> = files.iter().map(|f| std::fs::read(f).unwrap()).collect();
    std::fs::write(&files[0], &bytes[1]).unwrap();
    std::fs::write(&files[1], &bytes[0]).unwrap();
    assert!(keys.iter().all(|key| value_at(&store, key).is_none()));
    assert_eq!(store.warnings().len(), 2);
}

#[test]
fn a_missing_content_is_a_miss_for_the_value_only() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path());
    let key = put(&store, "key", &big("a"), 0.1);
    std::fs::remove_file(&content_files(&store)[0]).unwrap();
    assert!(matches!(store.lookup(&key), Some(Record::Done(done)) if done.value == big("a").digest()));
    assert!(value_at(&store, &key).is_none());
    assert!(store.warnings().is_empty(), "an evicted content is nothing to warn of");
}

#[test]
fn a_record_that_promises_another_value_is_not_believed() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path());
    let content = store.keep(&big("a"));
    let key = Digest::of(b"key");
    let value = big("b").digest();
    store.publish(Record::Done(Done {
        key,
        value,
        content,
        ..Done::default()
    }));
    assert!(value_at(&store, &key).is_none());
    assert_eq!(store.warnings().len(), 1);
}

#[test]
fn a_damaged_log_costs_what_it_recorded_and_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    let keys = {
        let store = Store::open(dir.path());
        ["a", "b", "c"].map(|name| put(&store, name, &big(name), 0.1))
    };
    let path = log::path(dir.path());
    let mut bytes = std::fs::read(&path).unwrap();
    let third = bytes.len() / 3;
    bytes[third + 20] ^= 0xff;
    std::fs::write(&path, bytes).unwrap();
    let store = Store::open(dir.path());
    assert_eq!(store.warnings().len(), 1);
    assert_eq!(keys.iter().filter(|key| value_at(&store, key).is_some()).count(), 2);
    // It can be appended to all the same.
    let key = put(&store, "d", &big("d"), 0.1);
    assert!(value_at(&Store::open(dir.path()), &key).is_some());
}

#[test]
fn a_store_that_cannot_be_made_warns_and_keeps_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    std::fs::write(&file, b"in the way").unwrap();
    let store = Store::open(file.join("store"));
    let key = put(&store, "key", &big("a"), 0.1);
    store.put_blob(&key, &[0; 10_000]);
    assert!(value_at(&store, &key).is_none() && store.get_blob(&key).is_none());
    assert_eq!(store.warnings().len(), 1, "said once");
}

#[test]
fn blobs_are_kept_by_key() {
    let dir = tempfile::tempdir().unwrap();
    let (k1, k2) = (Digest::of(b"1"), Digest::of(b"2"));
    let store = Store::open(dir.path());
    store.put_blob(&k1, b"small");
    store.put_blob(&k2, &[7; 100_000]);
    let store = Store::open(dir.path());
    assert_eq!(store.get_blob(&k1).unwrap(), b"small");
    assert_eq!(store.get_blob(&k2).unwrap(), [7; 100_000]);
    assert!(store.get_blob(&Digest::of(b"3")).is_none());
    assert_eq!(store.stat().blobs, 2);
}

#[test]
fn collection_removes_what_is_cheap_per_byte_and_keeps_its_digest() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path());
    let dear = put(&store, "dear", &big("dear"), 100.0);
    let cheap = put(&store, "cheap", &big("cheap"), 0.001);
    let collected = store.gc(14_000).unwrap();
    assert_eq!(collected.files, 1);
    let store = Store::open(dir.path());
    assert!(value_at(&store, &dear).is_some());
    assert!(value_at(&store, &cheap).is_none());
    assert!(store.lookup(&cheap).is_some(), "still known by its digest");
    assert!(store.stat().content_bytes <= 14_000);
    assert_eq!(store.tidy().unwrap(), None);
    let small = Store::open(dir.path()).with_limit(1000);
    assert_eq!(small.tidy().unwrap().unwrap().files, 1);
}

#[test]
fn clearing_leaves_an_empty_store_that_works() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path());
    put(&store, "key", &big("a"), 0.1);
    store.clear().unwrap();
    let store = Store::open(dir.path());
    let stat = store.stat();
    assert_eq!((stat.actions, stat.blobs, stat.contents, stat.log_bytes), (0, 0, 0, 0));
    let key = put(&store, "key", &big("a"), 0.1);
    assert_eq!(
        value_at(&store, &key).unwrap().get::<Report>().unwrap().digest(),
        big("a").digest()
    );
}

#[test]
fn a_damaged_log_is_mended_by_the_next_run_and_told_of_once() {
    let dir = tempfile::tempdir().unwrap();
    let key = put(&Store::open(dir.path()), "key", &big("a"), 0.1);
    let path = log::path(dir.path());
    let mut bytes = std::fs::read(&path).unwrap();
    bytes.extend(&bytes.clone()[..50]); // a batch that was cut off
    std::fs::write(&path, bytes).unwrap();
    let store = Store::open(dir.path());
    assert_eq!(store.warnings().len(), 1);
    store.tidy().unwrap();
    let store = Store::open(dir.path());
    assert_eq!(store.warnings(), [""; 0]);
    assert!(value_at(&store, &key).is_some());
}

#[test]
fn a_store_is_not_made_in_a_folder_that_has_contents_of_its_own() {
    let dir = tempfile::tempdir().unwrap();
    let mine = dir.path().join("contents/ab/mine.txt");
    std::fs::create_dir_all(mine.parent().unwrap()).unwrap();
    std::fs::write(&mine, "mine").unwrap();
    let store = Store::open(dir.path());
    assert!(store.warnings()[0].contains("no store"));
    put(&store, "key", &big("a"), 0.1);
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "nothing was added");
    assert!(!Store::exists(dir.path()));
}

#[test]
fn what_the_store_did_not_put_there_is_never_removed() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path());
    put(&store, "key", &big("a"), 0.1);
    let mine = content_files(&store)[0].with_file_name("mine.txt");
    std::fs::write(&mine, "mine").unwrap();
    let old = std::time::SystemTime::now() - Duration::from_secs(1_000_000);
    std::fs::File::open(&mine).unwrap().set_modified(old).unwrap();
    store.gc(0).unwrap();
    store.clear().unwrap();
    assert_eq!(content_files(&store), [mine]);
}

#[test]
fn another_versions_log_is_a_clean_miss() {
    let dir = tempfile::tempdir().unwrap();
    let key = put(&Store::open(dir.path()), "key", &big("a"), 0.1);
    std::fs::rename(log::path(dir.path()), dir.path().join("actions-0.log")).unwrap();
    let store = Store::open(dir.path());
    assert!(store.lookup(&key).is_none());
    assert_eq!(store.warnings(), [""; 0]);
    put(&store, "key", &big("a"), 0.1);
    assert!(value_at(&Store::open(dir.path()), &key).is_some());
}

#[test]
fn records_of_a_kind_that_is_not_known_are_passed_over_with_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    let key = put(&Store::open(dir.path()), "key", &big("a"), 0.1);
    let mut bytes = std::fs::read(log::path(dir.path())).unwrap();
    bytes::write_frame(&mut bytes, |w| {
        w.byte(99)
            .digest(&Digest::of(b"later"))
            .text("what a later version writes");
    });
    std::fs::write(log::path(dir.path()), bytes).unwrap();
    let store = Store::open(dir.path());
    assert!(value_at(&store, &key).is_some());
    assert!(store.lookup(&Digest::of(b"later")).is_none());
    assert_eq!(store.warnings().len(), 1);
}

#[test]
fn logs_that_changed_places_are_misses_with_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path());
    let key = Digest::of(b"key");
    store.publish_origin(&Origin {
        key,
        ..Origin::default()
    });
    put(&store, "key", &big("a"), 0.1);
    let (actions, origins) = (log::path(dir.path()), log::origins_path(dir.path()));
    let (a, b) = (std::fs::read(&actions).unwrap(), std::fs::read(&origins).unwrap());
    std::fs::write(&actions, b).unwrap();
    std::fs::write(&origins, a).unwrap();
    let store = Store::open(dir.path());
    assert!(store.lookup(&key).is_none());
    assert_eq!(store.warnings().len(), 1);
    assert_eq!(store.origins(), []);
}

#[test]
fn a_log_that_lost_its_bytes_is_told_of() {
    let dir = tempfile::tempdir().unwrap();
    put(&Store::open(dir.path()), "key", &big("a"), 0.1);
    std::fs::write(log::path(dir.path()), b"").unwrap();
    assert_eq!(Store::open(dir.path()).warnings().len(), 1);
    // A collection that leaves nothing leaves no empty log.
    let store = Store::open(dir.path());
    store.gc(0).unwrap();
    assert_eq!(Store::open(dir.path()).warnings(), [""; 0]);
}

#[test]
fn of_contents_of_equal_worth_those_that_rest_longest_go_first() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path());
    let keys = [put(&store, "a", &big("a"), 1.0), put(&store, "b", &big("b"), 1.0)];
    // The clock of the first is set back a month, then it is read: it counts as used now. The second rests.
    let month = std::time::SystemTime::now() - Duration::from_secs(30 * 86_400);
    for file in content_files(&store) {
        std::fs::File::open(file).unwrap().set_modified(month).unwrap();
    }
    assert!(value_at(&store, &keys[0]).is_some());
    store.gc(14_000).unwrap();
    let store = Store::open(dir.path());
    assert!(value_at(&store, &keys[0]).is_some());
    assert!(value_at(&store, &keys[1]).is_none());
}
