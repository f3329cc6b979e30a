//! Tests of recordings on a slow, small or full disk.
use std::sync::Mutex;
use std::sync::mpsc::channel;

use jtc_host::recording::Recording;
use jtc_wire::{ControllerState, TrajectoryState};

use super::*;

fn sample(i: u32) -> Box<Sample> {
    Box::new(Sample {
        time_s: f64::from(i) * 0.04,
        state: ControllerState::Operate.into(),
        trajectory: TrajectoryState::Execute.into(),
        point: i,
        ..Sample::default()
    })
}

fn finished() -> Ending {
    Ending { outcome: "finished".into(), ..Ending::default() }
}

/// Returns a writer of recordings, and the receiver of its notices.
fn writer(retention: Retention) -> (Writer, Receiver<Notice>) {
    let (notices, reported) = channel();
    let notify = Box::new(move |notice| notices.send(notice).expect("it is awaited"));
    (Writer::new(retention, notify, Duration::ZERO), reported)
}

fn files(dir: &tempfile::TempDir) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(dir.path()).unwrap().map(|entry| entry.unwrap().path());
    let mut all: Vec<PathBuf> = entries.filter(|path| path.extension().is_some()).collect();
    all.sort();
    all
}

/// If the disk is blocked, it does not delay other threads, and the writer counts the lost samples. The queue always has a free entry for
/// the end of a recording.
#[test]
fn what_finds_no_room_is_counted() {
    let (mut disk, messages) = Disk::new();
    disk.open(RecordingInfo::default());
    (0..100_000).for_each(|i| disk.write(&sample(i)));
    disk.lose(5);
    disk.close(finished());
    drop(disk);
    let all: Vec<Message> = messages.iter().collect();
    let samples = all.iter().filter(|message| matches!(message, Message::Sample(_))).count();
    assert!(samples < WAITING_MAX && all.len() == samples + 2);
    assert!(matches!(all.first(), Some(Message::Begin(_))));
    let Some(Message::End(_, lost)) = all.last() else { panic!("it does not end") };
    assert_eq!(*lost, 100_005 - samples as u64);
}

/// All recording files together stay within the limit. A long motion continues in the next file. No sample is missing or duplicated.
#[test]
fn recordings_stay_within_their_limit() {
    const LIMIT: u64 = 400_000;
    let dir = tempfile::tempdir().unwrap();
    let (mut writer, reported) = writer(Retention::open(dir.path(), LIMIT).unwrap());
    writer.take(Message::Begin(Box::default()));
    let mut seen = std::collections::BTreeSet::new();
    for i in 0..20_000 {
        writer.take(Message::Sample(sample(i)));
        if i % 50 == 49 {
            writer.flush();
            let bytes: u64 = files(&dir).iter().map(|path| path.metadata().unwrap().len()).sum();
            assert!(bytes <= LIMIT, "{bytes} bytes");
        }
    }
    writer.take(Message::End(finished(), 3));
    let whole = files(&dir);
    assert!((2..=6).contains(&whole.len()), "{whole:?}");
    for (k, path) in whole.iter().enumerate() {
        let recording = Recording::read(path).unwrap();
        let last = k + 1 == whole.len();
        assert_eq!(recording.cut, None);
        assert_eq!(recording.ending.outcome, if last { "finished" } else { "continued" });
        assert_eq!(recording.ending.lost_samples, if last { 3 } else { 0 });
        assert!(recording.samples.iter().all(|sample| seen.insert(sample.point)), "one is there twice");
    }
    assert_eq!(seen.last(), Some(&19_999));
    assert_eq!(seen.len() as u32, 20_000 - seen.first().unwrap(), "one is missing");
    let notices: Vec<Notice> = reported.try_iter().collect();
    assert!(notices.iter().any(|notice| notice.what == "recording-removed"));
    let warned: Vec<&str> = notices.iter().filter_map(|notice| notice.warning.as_deref()).collect();
    assert!(warned.len() == 1 && warned[0].contains("3 samples are missing"), "{warned:?}");
}

/// A full disk is reported once. When the disk has space again, recording continues, even in the middle of a motion.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_reported_once_and_recording_goes_on() {
    static FULL: Mutex<bool> = Mutex::new(true);
    let dir = tempfile::tempdir().unwrap();
    let retention = Retention::open(dir.path(), 1_000_000).unwrap().making(|path| {
        let file = std::fs::File::create_new(path)?;
        if *FULL.lock().unwrap() { std::fs::File::options().write(true).open("/dev/full") } else { Ok(file) }
    });
    let (mut writer, reported) = writer(retention);
    for _ in 0..2 {
        writer.take(Message::Begin(Box::default()));
        (0..100).for_each(|i| writer.take(Message::Sample(sample(i))));
        writer.take(Message::End(finished(), 0));
    }
    let notices: Vec<Notice> = reported.try_iter().collect();
    assert_eq!(notices.iter().map(|notice| notice.what).collect::<Vec<_>>(), ["recording-stopped"]);
    assert!(notices[0].warning.as_ref().is_some_and(|w| w.contains("No space left")), "{notices:?}");
    assert!(files(&dir).is_empty(), "a file without a sample is none: {:?}", files(&dir));
    writer.take(Message::Begin(Box::default()));
    (0..100).for_each(|i| writer.take(Message::Sample(sample(i))));
    *FULL.lock().unwrap() = false;
    (100..200).for_each(|i| writer.take(Message::Sample(sample(i))));
    writer.take(Message::End(finished(), 0));
    let notices: Vec<Notice> = reported.try_iter().collect();
    let (what, warning) = (notices.iter().map(|n| n.what).collect::<Vec<_>>(), &notices[1].warning);
    assert_eq!(what, ["recording-again", "recorded"]);
    assert!(warning.as_ref().is_some_and(|words| words.contains("100 samples are missing")), "{warning:?}");
    let recording = Recording::read(&files(&dir)[0]).unwrap();
    assert_eq!((recording.samples.len(), recording.ending.lost_samples), (100, 100));
}
