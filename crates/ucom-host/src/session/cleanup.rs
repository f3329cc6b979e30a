//! List of work that would remain undone if the process ended now, and of the commands that finish this work.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::master::{Request, StopLevel};

/// Work that would remain undone if the process ended now, and the command that the user should run next.
type Cleanup = (String, String);

/// List of work that is not finished. All clones share one list, including the clone in the thread that receives Ctrl-C.
#[derive(Clone, Debug, Default)]
pub struct CleanupList(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    /// Work of the requests in progress that would remain undone, with the outermost request first.
    now: Vec<Option<Cleanup>>,
    /// Boards that still run after their request has finished.
    running: Vec<u8>,
    /// Boards that finished requests started.
    started: BTreeSet<u8>,
    /// `true` if a request has changed the state of the boards.
    changed: bool,
}

impl State {
    fn words(&self) -> String {
        // The list contains running boards even if a request that works with them is in progress.
        let runs = (!self.running.is_empty()).then(|| cleanup_of_running(&self.running));
        let under_way = self.now.iter().flatten().next().cloned().filter(|_| runs.is_none());
        let started: Vec<String> =
            self.started.iter().filter(|b| !self.running.contains(b)).map(u8::to_string).collect();
        let started = (!started.is_empty()).then(|| {
            let what = format!("started before and not stopped: {}", started.join(", "));
            (what, format!("ucom stop {}", started.join(",")))
        });
        let steps: Vec<Cleanup> = [runs, under_way, started].into_iter().flatten().collect();
        if steps.is_empty() {
            let what = if self.changed { "all started steps are complete" } else { "nothing was changed" };
            return format!("ucom: ended at once; {what}\n");
        }
        let lines =
            steps.iter().map(|(what, next)| format!("ucom: ended at once: {what}\n      next: {next}\n"));
        lines.collect()
    }
}

impl CleanupList {
    /// Returns the list as text for the operator: the work that would remain undone if the process ended now, each with the command that
    /// the user should run next.
    pub fn words(&self) -> String {
        self.lock().words()
    }

    /// Adds an action that is not a request to the list. `what` is the work that would remain undone; `next` is the command that the user
    /// should run next.
    pub fn begin_other(&self, what: &str, next: &str) {
        let mut state = self.lock();
        state.changed = true;
        state.now.push(Some((what.into(), next.into())));
    }

    /// Adds a request to the list.
    pub fn begin(&self, request: &Request) {
        let cleanup = cleanup_of(request);
        let mut state = self.lock();
        state.changed |= cleanup.is_some();
        state.now.push(cleanup);
    }

    /// Removes the request that began last from the list. Boards that the request has started, or that run, stay on the list until they are
    /// stopped.
    pub fn end(&self, request: &Request, done: bool) {
        let mut state = self.lock();
        state.now.pop();
        match request {
            _ if !done => {}
            Request::Start { board, .. } => drop(state.started.insert(*board)),
            Request::Run(options) => state.running.extend(options.boards.iter().map(|b| b.board)),
            Request::Stop { board, level: StopLevel::Application, .. } => {
                state.started.remove(board);
                state.running.retain(|b| b != board);
            }
            _ => {}
        }
    }

    /// Removes all running and started boards from the list.
    pub fn forget(&self) {
        let mut state = self.lock();
        state.running.clear();
        state.started.clear();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn cleanup_of_running(boards: &[u8]) -> Cleanup {
    let list = |separator: &str| boards.iter().map(u8::to_string).collect::<Vec<_>>().join(separator);
    let what = match boards.len() {
        1 => "may run; without heartbeats the board becomes safe by itself",
        _ => "may run; without heartbeats the boards become safe by themselves",
    };
    (format!("{} {what}", several(boards.len(), &list(", "))), format!("ucom stop {}", list(",")))
}

fn several(count: usize, list: &str) -> String {
    format!("board{} {list}", if count == 1 { "" } else { "s" })
}

/// Returns the work of a request that would remain undone; returns `None` if the request changes no board.
fn cleanup_of(request: &Request) -> Option<Cleanup> {
    let (what, next) = match request {
        Request::Scan | Request::Info { .. } | Request::Describe { .. } | Request::InitialInputs { .. } => {
            return None;
        }
        Request::Init(_) | Request::Reset { board: None, .. } => {
            ("boards may be without a number".into(), "ucom init".into())
        }
        Request::Repair { board, .. } | Request::Reset { board: Some(board), .. } => {
            (format!("board {board} may be without a number"), "ucom scan".into())
        }
        Request::XReset { board, .. } => {
            (format!("board {board} may be in its exloader"), format!("ucom start {board}"))
        }
        Request::Start { board, .. } | Request::Stop { board, .. } => (
            format!("board {board} may be started; if the board runs, it becomes safe without heartbeats"),
            format!("ucom stop {board}"),
        ),
        Request::Run(options) => {
            return Some(cleanup_of_running(&options.boards.iter().map(|b| b.board).collect::<Vec<_>>()));
        }
        Request::Update(options) if options.dry_run => return None,
        Request::Update(options) => {
            let boards: Vec<String> = options.targets.iter().map(|t| t.board.to_string()).collect();
            let next = "repeat the same ucom update; boards that are up to date are skipped";
            let boards = several(boards.len(), &boards.join(", "));
            (format!("{boards} may be without a valid application"), next.into())
        }
        Request::SetStatus { board, .. } | Request::Admin { board, .. } => {
            (format!("the state of board {board} is not known"), format!("ucom status {board}"))
        }
        Request::RawStatus { seen, .. } => {
            let boards = seen.iter().map(u8::to_string).collect::<Vec<_>>();
            let what = format!("the state of {} is not known", several(boards.len(), &boards.join(", ")));
            (what, format!("ucom status {}", boards.join(",")))
        }
        // A probe or a conformance test may have started a board or renumbered the chain.
        Request::Probe(_) | Request::Conformance(_) => {
            ("the state of the boards is not known".into(), "ucom scan".into())
        }
    };
    Some((what, next))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::master::update::{UpdateImage, UpdateOptions, UpdateTarget};
    use crate::master::{RunBoard, RunOptions};

    fn stop(board: u8) -> Request {
        Request::Stop { board, level: StopLevel::Application, force: true }
    }

    /// Boards that a finished run has started stay on the list until they are stopped.
    #[test]
    fn what_is_left_undone() {
        let cleanup = CleanupList::default();
        assert!(cleanup.words().contains("nothing was changed"));
        let board = |board| RunBoard { board, ..Default::default() };
        let run = Request::Run(RunOptions { boards: vec![board(1), board(3)], ..Default::default() });
        cleanup.begin(&run);
        cleanup.end(&run, true);
        cleanup.begin(&stop(1));
        let words = cleanup.words();
        assert!(words.contains("boards 1, 3 may run") && words.contains("ucom stop 1,3"), "{words}");
        cleanup.end(&stop(1), true);
        let words = cleanup.words();
        assert!(words.contains("board 3 may run") && words.contains("ucom stop 3\n"), "{words}");
        cleanup.forget();
        cleanup.begin(&Request::Scan);
        let words = cleanup.words();
        assert!(words.contains("all started steps are complete"), "{words}");
    }

    /// During any request, the list contains the boards that earlier requests of the same command have started.
    #[test]
    fn boards_started_before_are_named() {
        let cleanup = CleanupList::default();
        for board in [1, 2] {
            let start = Request::Start { board, force: false };
            cleanup.begin(&start);
            cleanup.end(&start, true);
        }
        cleanup.begin(&Request::Info { board: 3 });
        let words = cleanup.words();
        assert!(words.contains(": 1, 2\n") && words.contains("ucom stop 1,2"), "{words}");
        cleanup.end(&Request::Info { board: 3 }, false);
        cleanup.begin(&stop(1));
        cleanup.end(&stop(1), true);
        assert!(cleanup.words().contains("ucom stop 2\n"));
    }

    /// A dry run does not change any board, and the text of the list says this.
    #[test]
    fn a_dry_run_leaves_nothing_undone() {
        for dry_run in [true, false] {
            let cleanup = CleanupList::default();
            let image = UpdateImage { bytes: [7; 64].into(), address_words: 0 };
            let targets = vec![UpdateTarget { board: 4, flash_number: None }];
            let options = UpdateOptions { dry_run, ..UpdateOptions::new(targets, image, 0) };
            cleanup.begin(&Request::Update(options));
            let words = cleanup.words();
            assert_eq!(words.contains("nothing was changed"), dry_run, "{words}");
            assert_eq!(words.contains("board 4 may be without a valid application"), !dry_run, "{words}");
        }
    }
}
