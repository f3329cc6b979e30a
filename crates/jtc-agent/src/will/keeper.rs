//! Keeper that writes and removes the file of a last will. The keeper repeats a failed write until the disk accepts
//! it.
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::json;

use super::file::{self, Found};
use crate::line::{LineEvent, Will};
use crate::record::{Notice, Notify};

/// Time after which the keeper repeats a failed write.
const AGAIN: Duration = Duration::from_secs(5);
/// Longest wait for the disk when the keeper ends.
const LAST: Duration = Duration::from_secs(1);

/// Required contents of the file, and the start time of the motion.
type Wanted = Option<(Will, f64)>;

struct Slot {
    wanted: Wanted,
    /// `true` until the agent has applied the last will of the previous agent. Until then, the keeper must not change
    /// the file.
    held: bool,
    ended: bool,
    /// `true` after the keeper's thread has ended.
    done: bool,
}

struct Shared {
    slot: Mutex<Slot>,
    changed: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Slot> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Receiver that passes events of the serial line to the keeper. Never waits for the keeper.
pub struct Witness(Arc<Shared>);

impl Witness {
    /// Processes an event of the serial line.
    pub fn see(&self, event: &LineEvent) {
        let LineEvent::Will(will) = event else { return };
        let mut slot = self.0.lock();
        let since = slot.wanted.take().map(|(_, since)| since);
        slot.wanted = will.clone().map(|will| (will, since.unwrap_or_else(now)));
        drop(slot);
        self.0.changed.notify_all();
    }
}

/// Keeper of the last will of one serial port. If the arm moves when the keeper is dropped, the file of the last will is not removed.
pub struct Keeper(Arc<Shared>);

impl Keeper {
    /// Starts the keeper of the last will of `port` in the directory `folder`. Also returns the present contents of the file. The
    /// contents stay unchanged until [`settle`](Self::settle) is called.
    ///
    /// # Errors
    ///
    /// The operating system cannot start threads.
    pub fn begin(folder: &Path, port: &str, notify: Notify) -> io::Result<(Self, Found)> {
        let path = file::path(folder, port);
        let found = file::read(&path, port);
        let slot = Slot { wanted: None, held: true, ended: false, done: false };
        let shared = Arc::new(Shared { slot: Mutex::new(slot), changed: Condvar::new() });
        let mut writer = Writer {
            shared: shared.clone(),
            path,
            port: port.to_owned(),
            there: if found == Found::Nothing { Some(None) } else { None },
            fails: false,
            notify,
        };
        std::thread::Builder::new().name("what moves".into()).spawn(move || writer.run())?;
        Ok((Self(shared), found))
    }

    /// Returns the [`Witness`], which must receive each event of the serial line.
    pub fn witness(&self) -> Witness {
        Witness(self.0.clone())
    }

    /// Informs the keeper that the last will of the previous agent was applied. After this call, the keeper updates the file with each
    /// will that the line reports. `will` is the present last will. `since` is the start of a motion that still continues.
    pub fn settle(&self, will: Option<Will>, since: Option<f64>) {
        let mut slot = self.0.lock();
        slot.held = false;
        if slot.wanted.is_none() {
            slot.wanted = will.map(|will| (will, since.unwrap_or_else(now)));
        }
        if let (Some((_, moves_since)), Some(since)) = (&mut slot.wanted, since) {
            *moves_since = since;
        }
        drop(slot);
        self.0.changed.notify_all();
    }

    /// Informs the keeper that the arm was at rest when the agent ended.
    pub fn forget(&self) {
        self.0.lock().wanted = None;
        self.0.changed.notify_all();
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        let mut slot = self.0.lock();
        slot.ended = true;
        self.0.changed.notify_all();
        let end = Instant::now() + LAST;
        while !slot.done {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            slot = self.0.changed.wait_timeout(slot, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

/// Returns the present time, s since 1970.
fn now() -> f64 {
    host_kit::unix_time().as_secs_f64()
}

/// State of the thread that writes the file.
struct Writer {
    shared: Arc<Shared>,
    path: PathBuf,
    port: String,
    /// Present contents of the file; `None` if the contents are unknown.
    there: Option<Wanted>,
    fails: bool,
    notify: Notify,
}

impl Writer {
    fn run(&mut self) {
        // The keeper checks the folder before the first motion, so that it finds a write error early.
        let tried = file::try_out(&self.path);
        self.report(tried);
        while let Some(wanted) = self.next() {
            let done = match &wanted {
                Some((will, since)) => file::write(&self.path, &self.port, will, *since),
                None => file::remove(&self.path),
            };
            if done.is_err() {
                // The contents of the file are outdated, so the file is made invalid. If the next agent finds an invalid file, it stops
                // the arm.
                file::spoil(&self.path);
            }
            self.there = done.is_ok().then_some(wanted);
            self.report(done);
        }
        self.shared.lock().done = true;
        self.shared.changed.notify_all();
    }

    /// Waits until the contents of the file must change, and returns the new contents. Returns `None` when the keeper ends.
    fn next(&self) -> Option<Wanted> {
        let mut slot = self.shared.lock();
        let mut tried = self.fails.then(|| slot.wanted.clone());
        let end = Instant::now() + AGAIN;
        loop {
            let is_there = self.there.as_ref() == Some(&slot.wanted);
            // The keeper repeats a failed write after an interval, or at once if the required contents have changed.
            if !slot.held && !is_there && tried.as_ref() != Some(&slot.wanted) {
                return Some(slot.wanted.clone());
            }
            if slot.ended {
                return None;
            }
            let left = end.saturating_duration_since(Instant::now());
            slot = if tried.is_none() {
                self.shared.changed.wait(slot).unwrap_or_else(PoisonError::into_inner)
            } else if left.is_zero() {
                tried = None;
                continue;
            } else {
                self.shared.changed.wait_timeout(slot, left).unwrap_or_else(PoisonError::into_inner).0
            };
        }
    }

    /// Reports the first write error, and the first successful write after it.
    fn report(&mut self, done: io::Result<()>) {
        let path = self.path.display().to_string();
        match &done {
            Err(error) if !self.fails => (self.notify)(Notice {
                what: "policy-not-kept",
                facts: json!({ "file": path, "why": error.to_string() }),
                warning: Some(format!(
                    "{path}: {error}; motions still start, but if this agent is killed, the next agent may \
                     not know the policy of the client"
                )),
            }),
            Ok(()) if self.fails => {
                (self.notify)(Notice { what: "policy-kept", facts: json!({ "file": path }), warning: None });
            }
            _ => {}
        }
        self.fails = done.is_err();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, channel};

    use super::*;
    use crate::line::{Moves, Policy};

    const PORT: &str = "/dev/arm";

    fn begin(folder: &Path) -> (Keeper, Found, Receiver<Notice>) {
        let (send, notices) = channel();
        let notify = Box::new(move |notice| send.send(notice).expect("somebody reads"));
        let (keeper, found) = Keeper::begin(folder, PORT, notify).expect("a thread");
        (keeper, found, notices)
    }

    fn moves(policy: Policy) -> LineEvent {
        LineEvent::Will(Some(Will { client: "anna".into(), policy, what: Moves::Motion }))
    }

    fn until(folder: &Path, what: &str, reached: impl Fn(&Found) -> bool) {
        let end = Instant::now() + Duration::from_secs(20);
        while !reached(&file::read(&file::path(folder, PORT), PORT)) {
            assert!(Instant::now() < end, "{what}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn left(policy: Policy) -> impl Fn(&Found) -> bool {
        move |found| matches!(found, Found::Left(stored) if stored.policy == policy)
    }

    #[test]
    fn the_file_is_there_while_something_moves_and_what_moves_at_the_end_stays() {
        let dir = tempfile::tempdir().expect("a directory");
        let (keeper, found, _notices) = begin(dir.path());
        assert_eq!(found, Found::Nothing);
        keeper.settle(None, None);
        let witness = keeper.witness();
        witness.see(&moves(Policy::Pause));
        until(dir.path(), "pause", left(Policy::Pause));
        witness.see(&moves(Policy::Stop));
        until(dir.path(), "stop", left(Policy::Stop));
        witness.see(&LineEvent::Will(None));
        until(dir.path(), "rest", |found| *found == Found::Nothing);
        witness.see(&moves(Policy::Stop));
        drop(keeper);
        let (keeper, found, _notices) = begin(dir.path());
        let Found::Left(stored) = &found else { panic!("{found:?}") };
        // The file, including the start time of the motion, stays unchanged until `settle` is called, even if the
        // agent ends before that.
        drop(keeper);
        assert_eq!(begin(dir.path()).1, found);
        let (keeper, _, _notices) = begin(dir.path());
        keeper.witness().see(&moves(Policy::Stop));
        keeper.settle(None, Some(stored.since_unix_s));
        drop(keeper);
        let (keeper, again, _notices) = begin(dir.path());
        assert_eq!(again, found);
        // The file is removed when the arm is at rest.
        keeper.settle(None, Some(stored.since_unix_s));
        until(dir.path(), "nothing moves", |found| *found == Found::Nothing);
        keeper.witness().see(&moves(Policy::Continue));
        keeper.forget();
        drop(keeper);
        assert_eq!(begin(dir.path()).1, Found::Nothing);
    }

    #[test]
    fn a_folder_that_takes_nothing_is_noted_once_and_tried_again() {
        let dir = tempfile::tempdir().expect("a directory");
        let folder = dir.path().join("state");
        std::fs::write(&folder, "no folder").expect("a file");
        let (keeper, _, notices) = begin(&folder);
        let first = notices.recv().expect("a notice");
        assert!(
            first.what == "policy-not-kept"
                && first.warning.is_some_and(|w| w.contains("motions still start"))
        );
        keeper.settle(None, None);
        let witness = keeper.witness();
        for policy in [Policy::Pause, Policy::Stop, Policy::Pause] {
            witness.see(&moves(policy));
            std::thread::sleep(Duration::from_millis(20));
        }
        assert!(notices.try_recv().is_err(), "once");
        std::fs::remove_file(&folder).expect("a file");
        std::fs::create_dir(&folder).expect("a folder");
        witness.see(&moves(Policy::Stop));
        until(&folder, "there is room again", left(Policy::Stop));
        assert_eq!(notices.recv().expect("a notice").what, "policy-kept");
    }

    #[test]
    fn what_cannot_be_replaced_is_spoilt_and_in_doubt_the_arm_is_stopped() {
        let dir = tempfile::tempdir().expect("a directory");
        let (keeper, _, notices) = begin(dir.path());
        keeper.settle(None, None);
        keeper.witness().see(&moves(Policy::Continue));
        until(dir.path(), "continue", left(Policy::Continue));
        // A directory at the path of the new file simulates a full disk: from now on, the keeper cannot create this
        // file.
        let part = file::path(dir.path(), PORT).with_extension("part");
        std::fs::create_dir(&part).expect("a folder");
        keeper.witness().see(&moves(Policy::Stop));
        until(dir.path(), "doubtful", |found| matches!(found, Found::Doubtful(_)));
        assert_eq!(notices.recv().expect("a notice").what, "policy-not-kept");
        std::fs::remove_dir(&part).expect("a folder");
        keeper.witness().see(&moves(Policy::Pause));
        until(dir.path(), "there is room again", left(Policy::Pause));
    }
}
