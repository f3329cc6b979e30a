//! Actions of a procedure: it sends frames, waits for frames, and sleeps.
//!
//! Procedures are `async` functions without an executor. The compiler turns each procedure into a state machine.
//! [`Master`](crate::master::Master) advances this state machine when a frame arrives or a wait ends. A procedure can therefore be read as
//! a sequence of steps. A procedure never holds a lock while it waits.
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;

use crate::master::engine::event::Event;
use crate::master::engine::mailbox::{Filter, Forget, Mailbox, Received};
use crate::master::engine::shared::Core;
use crate::master::engine::times::{MS, Times};
use crate::master::error::{Error, ExchangeError, MasterError};
use crate::master::reports::ProcedureId;
use ucom::{Frame, FromBoard, Function, Profile, Sequence, ToBoard};

/// Interface of a procedure to the bus.
#[derive(Clone)]
pub(crate) struct Link {
    pub(crate) core: Arc<Mutex<Core>>,
    pub(crate) id: ProcedureId,
}

/// Locks the core of the master. The core can still be used after a panic in another thread.
pub(crate) fn lock(core: &Mutex<Core>) -> MutexGuard<'_, Core> {
    core.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Link {
    pub(crate) fn with<T>(&self, f: impl FnOnce(&mut Core) -> T) -> T {
        f(&mut lock(&self.core))
    }

    pub(crate) fn now(&self) -> u64 {
        self.with(|core| core.now)
    }

    pub(crate) fn times(&self) -> Times {
        self.with(|core| core.times)
    }

    pub(crate) fn profile(&self) -> Profile {
        self.with(|core| core.profile)
    }

    /// Returns the broadcast number, or 0 if the profile has none.
    pub(crate) fn broadcast_number(&self) -> Sequence {
        self.profile().unnumbered()
    }

    pub(crate) fn note(&self, text: String) {
        self.with(|core| core.event(Event::Note { id: self.id, text }));
    }

    /// Sends a frame and waits until the frame has left the queue.
    pub(crate) async fn send(&self, to: Sequence, message: ToBoard) {
        let serial = self.with(|core| core.queue(Some(self.id), to, message, Forget::Nothing));
        self.left(serial).await;
    }

    /// Like [`Link::send`], but discards all frames that were received before the sent frame left the queue, because
    /// they cannot be answers to it.
    pub(crate) async fn ask(&self, to: Sequence, message: ToBoard) {
        let serial = self.with(|core| core.queue(Some(self.id), to, message, Forget::All));
        self.left(serial).await;
    }

    /// Like [`Link::ask`], but keeps error frames that were received before the sent frame left the queue. Procedures
    /// send program data with `feed`, because a board can report an error in the middle of a block. The function
    /// returns the time at which the frame left the queue.
    pub(crate) async fn feed(&self, to: Sequence, message: ToBoard) -> u64 {
        let serial = self.with(|core| core.queue(Some(self.id), to, message, Forget::Answers));
        self.left(serial).await;
        self.with(|core| core.sent_at)
    }

    /// Like [`Link::send`], but sends a frame that the caller has built.
    pub(crate) async fn send_frame(&self, frame: Frame) {
        let serial = self.with(|core| core.queue_frame(Some(self.id), frame, Forget::Nothing));
        self.left(serial).await;
    }

    /// Waits until all frames that any procedure has queued so far have left the queue.
    pub(crate) async fn flush(&self) {
        let serial = self.with(|core| core.queued());
        self.left(serial).await;
    }

    pub(crate) async fn left(&self, serial: u64) {
        poll_fn(|_| if self.with(|core| core.left(serial)) { Poll::Ready(()) } else { Poll::Pending }).await;
    }

    /// Sets the filter of the mailbox to these functions from these boards, and to errors of these boards.
    pub(crate) fn listen(&self, boards: u32, functions: &[Function]) {
        self.with(|core| {
            if let Some(mailbox) = core.mailboxes.get_mut(&self.id) {
                mailbox.filter = Filter::new(boards, functions);
                mailbox.received.clear();
            }
        });
    }

    /// Returns the next frame in the mailbox; `None` if no frame arrives before `until`.
    pub(crate) async fn next(&self, until: u64) -> Option<Received> {
        self.next_of(until, |mailbox| mailbox.received.pop_front()).await
    }

    /// Waits until `take` finds a result in the mailbox; returns `None` if `take` finds no result before `until`.
    pub(crate) async fn next_of<T>(&self, until: u64, take: impl Fn(&mut Mailbox) -> Option<T>) -> Option<T> {
        poll_fn(|_| {
            self.with(|core| {
                let fired = core.fired;
                let Some(mailbox) = core.mailboxes.get_mut(&self.id) else { return Poll::Ready(None) };
                if let Some(found) = take(mailbox) {
                    mailbox.wake = None;
                    return Poll::Ready(Some(found));
                }
                if fired >= until {
                    mailbox.wake = None;
                    return Poll::Ready(None);
                }
                mailbox.wake = Some(until);
                Poll::Pending
            })
        })
        .await
    }

    /// Returns the next unparsed frame; `None` if no unparsed frame arrives before `until`.
    pub(crate) async fn next_raw(&self, until: u64) -> Option<(u64, Frame)> {
        self.next_of(until, |mailbox| mailbox.raw.as_mut().and_then(|raw| raw.pop_front())).await
    }

    /// Starts or stops the storage of unparsed frames, which [`Link::next_raw`] returns.
    pub(crate) fn tap(&self, on: bool) {
        self.with(|core| {
            if let Some(mailbox) = core.mailboxes.get_mut(&self.id) {
                mailbox.raw = on.then(Default::default);
            }
        });
    }

    /// Sleeps for `us` µs. Frames that are received during the sleep stay in the mailbox.
    pub(crate) async fn sleep(&self, us: u64) {
        self.sleep_until(self.now() + us).await;
    }

    /// Sleeps until the time `until`.
    pub(crate) async fn sleep_until(&self, until: u64) {
        poll_fn(|_| {
            self.with(|core| {
                let fired = core.fired;
                let Some(mailbox) = core.mailboxes.get_mut(&self.id) else { return Poll::Ready(()) };
                if fired >= until {
                    mailbox.wake = None;
                    return Poll::Ready(());
                }
                mailbox.wake = Some(until);
                Poll::Pending
            })
        })
        .await;
    }

    /// Waits until no frame for this procedure has arrived for `us` µs, but at most for 20 times `us`.
    pub(crate) async fn quiet(&self, us: u64) {
        let limit = self.now() + 20 * us;
        while self.next((self.now() + us).min(limit)).await.is_some() {
            if self.now() >= limit {
                break;
            }
        }
    }

    /// Runs `work`. Three errors can end `work` early:
    /// - [`MasterError::Cancelled`]: the caller cancels the procedure.
    /// - [`MasterError::Bus`]: the caller reports that the bus is lost.
    /// - [`NumberShared`](crate::master::IdentityError::NumberShared): two boards with the same number appear, and
    ///   the procedure does not tolerate shared numbers. This error is reported only once.
    ///
    /// In each case, the queued frames of the procedure are discarded.
    pub(crate) async fn or_cancel<T>(
        &self,
        work: impl Future<Output = Result<T, Error>>,
    ) -> Result<T, Error> {
        let mut work = pin!(work);
        poll_fn(|context| {
            let ended = self.with(|core| {
                let mailbox = core.mailboxes.get_mut(&self.id)?;
                let gone = mailbox.bus_gone.clone().map(|reason| Error::Master(MasterError::Bus { reason }));
                let cancelled =
                    core::mem::take(&mut mailbox.cancel).then_some(Error::Master(MasterError::Cancelled));
                let mut ended = gone.or(cancelled);
                if ended.is_none() && !mailbox.bears_shared_numbers {
                    ended = core.holders.shared(mailbox.claims).map(Error::from);
                    // If a shared number ends the procedure, the procedure undoes its changes. The shared number must
                    // not also end this clean-up.
                    mailbox.bears_shared_numbers = ended.is_some();
                }
                if ended.is_some() {
                    core.forget_queued(self.id);
                }
                ended
            });
            match ended {
                Some(error) => Poll::Ready(Err(error)),
                None => work.as_mut().poll(context),
            }
        })
        .await
    }

    /// Sets whether the procedure tolerates two boards with the same number. If `bears` is `false`, two boards with the same number end the
    /// procedure.
    pub(crate) fn bear_shared_numbers(&self, bears: bool) {
        self.with(|core| {
            if let Some(mailbox) = core.mailboxes.get_mut(&self.id) {
                mailbox.bears_shared_numbers = bears;
            }
        });
    }

    /// Returns a board number after checking it against the profile.
    pub(crate) fn board(&self, number: u8) -> Result<Sequence, ExchangeError> {
        let profile = self.profile();
        let wrong = ExchangeError::NoBoard { number, first: profile.addr_first };
        Sequence::new(number).filter(|n| profile.is_board(*n)).ok_or(wrong)
    }

    /// Converts an error that a board reports to an error of the procedure.
    pub(crate) fn device(board: u8, message: &FromBoard, during: &'static str) -> Option<ExchangeError> {
        match message {
            FromBoard::Error(code) => Some(ExchangeError::Device { board, code: *code, during }),
            _ => None,
        }
    }

    pub(crate) fn no_answer(&self, board: u8, asked: Function, tries: u32, since: u64) -> ExchangeError {
        self.with(|core| ExchangeError::NoAnswer {
            board,
            asked,
            tries,
            waited_ms: core.now.saturating_sub(since) / MS,
            last: core.last_received(board),
        })
    }
}
