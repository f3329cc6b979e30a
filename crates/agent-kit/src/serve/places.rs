//! Limits of the number of connections. Some further connections are reserved for Stop and Pause.
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::AbortHandle;
use tokio::time::Instant;

/// Largest number of connections from this computer that can serve any request. Connections from other computers have
/// a separate limit of the same size, so that they cannot block local clients.
pub(super) const CONNECTIONS_MAX: usize = 256;
/// Number of free connections below which each new connection serves only one request. The client of such a connection
/// must send its request at once.
const FEW: usize = CONNECTIONS_MAX / 2;
/// Number of further connections from this computer that serve only Stop, Pause and the other requests of
/// [`stops`](crate::access::stops). `KEPT_ELSEWHERE` is the number for other computers. If all these connections are
/// in use, a new connection replaces the oldest one that has not requested a Stop, so idle connections never prevent
/// a Stop.
///
/// All connections together stay below 1024, which is the number of files that a program may open.
const KEPT_HERE: usize = 192;
const KEPT_ELSEWHERE: usize = 64;
/// Shortest time that a local connection has for sending its request. During this time, a new connection waits
/// instead of replacing it.
const ASKS_WITHIN: Duration = Duration::from_millis(20);

/// Limits and state of the connections from this computer, or of those from other computers.
pub(super) struct Places {
    common: Arc<Semaphore>,
    kept: Mutex<Kept>,
    kept_max: usize,
    asks_within: Duration,
}

/// Connections that are reserved for Stop and Pause, oldest first.
#[derive(Default)]
struct Kept {
    open: VecDeque<Open>,
    last: u64,
}

struct Open {
    number: u64,
    since: Instant,
    abort: AbortHandle,
    /// `true` if the connection has requested a Stop. The server does not replace such a connection.
    stops: bool,
}

/// Reservation for one connection; dropping the reservation releases it.
pub(super) struct Place {
    places: Arc<Places>,
    /// `true` if few connections were free when the server accepted this connection.
    pub(super) few: bool,
    kind: Kind,
}

enum Kind {
    Common { _permit: OwnedSemaphorePermit },
    Kept { number: u64 },
}

impl Places {
    /// Creates the limits for connections from this computer.
    pub(super) fn here() -> Arc<Self> {
        Self::new(KEPT_HERE, ASKS_WITHIN)
    }

    /// Creates the limits for connections from other computers, which never delay local connections.
    pub(super) fn elsewhere() -> Arc<Self> {
        Self::new(KEPT_ELSEWHERE, Duration::ZERO)
    }

    fn new(kept_max: usize, asks_within: Duration) -> Arc<Self> {
        let common = Arc::new(Semaphore::new(CONNECTIONS_MAX));
        Arc::new(Self { common, kept: Mutex::default(), kept_max, asks_within })
    }

    /// Serves a connection if the limits permit it, or if the server can close an older connection. If all reserved
    /// connections serve a Stop, the new connection is dropped, which closes it.
    pub(super) async fn run<F: Future<Output = ()> + Send + 'static>(
        self: &Arc<Self>,
        connection: impl FnOnce(Place) -> F,
    ) {
        if let Ok(permit) = self.common.clone().try_acquire_owned() {
            let place =
                Place { places: self.clone(), few: self.are_few(), kind: Kind::Common { _permit: permit } };
            tokio::spawn(connection(place));
            return;
        }
        // During the wait, the server's threads can read requests that arrived earlier. A connection that has already
        // sent a Stop is therefore not replaced.
        let oldest = self.oldest().map(|open| open + self.asks_within);
        if let Some(due) = oldest.filter(|due| *due > Instant::now()) {
            tokio::time::sleep_until(due).await;
        }
        let mut kept = self.kept();
        if kept.open.len() >= self.kept_max {
            let Some(oldest) = kept.open.iter().position(|open| !open.stops) else { return };
            if let Some(open) = kept.open.remove(oldest) {
                open.abort.abort();
            }
        }
        kept.last += 1;
        let number = kept.last;
        let place = Place { places: self.clone(), few: true, kind: Kind::Kept { number } };
        // The lock of the list is held, so the connection cannot end before it is added to the list.
        let abort = tokio::spawn(connection(place)).abort_handle();
        kept.open.push_back(Open { number, since: Instant::now(), abort, stops: false });
    }

    /// Returns the arrival time of the connection that a new connection would replace. Returns `None` if a reserved
    /// connection is free, or if all reserved connections serve a Stop.
    fn oldest(&self) -> Option<Instant> {
        let kept = self.kept();
        let full = kept.open.len() >= self.kept_max;
        kept.open.iter().find(|open| full && !open.stops).map(|open| open.since)
    }

    fn are_few(&self) -> bool {
        self.common.available_permits() < FEW
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Place {
    /// Returns `true` if few connections are free now.
    pub(super) fn are_few(&self) -> bool {
        self.few || self.places.are_few()
    }

    /// Registers a request of the connection; `stops` is `true` for a Stop. Returns `true` if the request is served.
    pub(super) fn serves(&self, stops: bool) -> bool {
        let Kind::Kept { number } = self.kind else { return true };
        if stops {
            let mut kept = self.places.kept();
            if let Some(open) = kept.open.iter_mut().find(|open| open.number == number) {
                open.stops = true;
            }
        }
        stops
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        if let Kind::Kept { number } = self.kind {
            self.places.kept().open.retain(|open| open.number != number);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::future::pending;
    use std::sync::mpsc::channel;

    use super::*;

    /// The server serves a new connection even if many are open, unless all reserved connections serve Stops.
    #[test]
    fn the_newest_connection_has_a_place() {
        let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
        let _entered = runtime.enter();
        let places = Places::elsewhere();
        let (came, comes) = channel();
        let open = |number: usize, stops: bool| {
            let came = came.clone();
            runtime.block_on(places.run(move |place| async move {
                let served = place.serves(stops);
                // The send fails if another part of the test has already failed.
                let _ = came.send((number, place.few, served));
                pending::<()>().await;
                drop(place);
            }));
            runtime.block_on(tokio::task::yield_now());
            comes.try_recv().ok()
        };
        for number in 0..CONNECTIONS_MAX {
            // `few` is computed when the new connection already occupies one of the `CONNECTIONS_MAX` places, hence
            // `number + 1`.
            assert_eq!(open(number, false), Some((number, number + 1 > CONNECTIONS_MAX - FEW, true)));
        }
        for number in 0..10 * KEPT_ELSEWHERE {
            assert_eq!(open(number, false), Some((number, true, false)), "for Stops alone");
        }
        for number in 0..KEPT_ELSEWHERE {
            assert_eq!(
                open(number, true),
                Some((number, true, true)),
                "in place of one that asks for nothing"
            );
        }
        assert_eq!(open(0, true), None, "they are served to their end");
        assert_eq!(places.kept().open.len(), KEPT_ELSEWHERE);
        drop(runtime);
        assert_eq!((places.kept().open.len(), places.common.available_permits()), (0, CONNECTIONS_MAX));
    }
}
