//! Ctrl-C: the first one cancels, and what is begun is brought to an end; the second one ends the process at once, and says
//! what is left undone.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use cli_kit::Stop;
use cli_kit::exit::FAULT;
use ucom::master::Request;

/// What is left undone if the process ends now: what, and the next command.
type Left = (String, String);

/// The same, as the thread that hears Ctrl-C sees it.
#[derive(Clone, Debug, Default)]
pub struct Undone(Arc<Mutex<Option<Left>>>);

impl Undone {
    /// From now on Ctrl-C is heard.
    pub fn listen(&self) -> std::io::Result<Stop> {
        let undone = self.clone();
        Stop::listen_with(move || {
            match undone.lock().take() {
                Some((what, next)) => eprintln!("ucom: ended at once: {what}\n      next: {next}"),
                None => eprintln!("ucom: ended at once; nothing was changed"),
            }
            FAULT
        })
    }

    /// A request begins; returns what was undone before, for [`Undone::set`] at its end. As long as something is undone, what
    /// happens inside it does not hide it.
    pub fn begin(&self, request: &Request) -> Option<Left> {
        let mut left = self.lock();
        let before = left.clone();
        if before.is_none() {
            *left = left_by(request);
        }
        before
    }

    /// What is undone from now on; `None`: nothing.
    pub fn set(&self, left: Option<Left>) {
        *self.lock() = left;
    }

    fn lock(&self) -> MutexGuard<'_, Option<Left>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn left_by(request: &Request) -> Option<Left> {
    let list = |boards: &mut dyn Iterator<Item = u8>| boards.map(|b| b.to_string()).collect::<Vec<_>>();
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
            format!("board {board} may be started; if it runs, it becomes safe without life signs"),
            format!("ucom stop {board}"),
        ),
        Request::Run(options) => {
            let boards = list(&mut options.boards.iter().map(|b| b.board));
            let what = "may run; without life signs they become safe by themselves";
            (format!("boards {} {what}", boards.join(", ")), format!("ucom stop {}", boards.join(",")))
        }
        Request::Update(options) => {
            let boards = list(&mut options.targets.iter().map(|t| t.board)).join(", ");
            let next = "the same ucom update again; boards that are done are passed over";
            (format!("boards {boards} may be without a valid application"), next.into())
        }
        Request::SetStatus { board, .. } | Request::Admin { board, .. } => {
            (format!("what board {board} took of it is not known"), format!("ucom status {board}"))
        }
        // A probe may have started a board or numbered the chain anew; and what is asked for in future.
        _ => ("what the boards do is not known".into(), "ucom scan".into()),
    };
    Some((what, next))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ucom::master::{RunBoard, RunOptions};

    /// What was begun is undone until its end, also while something inside it goes on.
    #[test]
    fn what_is_left_undone() {
        let undone = Undone::default();
        let board = |board| RunBoard { board, ..Default::default() };
        let run = RunOptions { boards: vec![board(1), board(3)], ..Default::default() };
        assert_eq!(undone.begin(&Request::Run(run)), None);
        let stop = Request::Stop { board: 1, level: ucom::master::StopLevel::Loop, force: true };
        let before = undone.begin(&stop);
        assert_eq!(before.as_ref().map(|(_, next)| next.as_str()), Some("ucom stop 1,3"));
        undone.set(before);
        assert!(undone.lock().as_ref().is_some_and(|(what, _)| what.starts_with("boards 1, 3 may run")));
        undone.set(None);
        assert_eq!(undone.begin(&Request::Scan), None);
    }
}
