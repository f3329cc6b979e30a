//! Places for connections: so many for all requests, and some that are kept for those that stop something.
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::AbortHandle;
use tokio::time::Instant;

/// Connections at once from this computer, and as many from others: these cannot keep those out.
pub(super) const CONNECTIONS_MAX: usize = 256;
/// When fewer places than that are left, a connection is for one request, that comes at once.
const FEW: usize = CONNECTIONS_MAX / 2;
/// Connections beyond these from this computer, and from others, for Stop and Pause alone. When they are taken as well, the oldest that has not
/// asked for anything is closed for the new one: those that are opened and ask for nothing keep no Stop out, however many they are. All
/// together leave some of the 1024 files that a program may open.
const KEPT_HERE: usize = 192;
const KEPT_ELSEWHERE: usize = 64;
/// What a connection of this computer has at least to ask for something, before it is closed for a new one: the new one waits so long.
const ASKS_WITHIN: Duration = Duration::from_millis(20);

/// The places for connections of one side.
pub(super) struct Places {
    common: Arc<Semaphore>,
    kept: Mutex<Kept>,
    kept_max: usize,
    asks_within: Duration,
}

/// Connections on the places that are kept, oldest first.
#[derive(Default)]
struct Kept {
    open: VecDeque<Open>,
    last: u64,
}

struct Open {
    number: u64,
    since: Instant,
    abort: AbortHandle,
    /// It has asked for a Stop: it is served to its end.
    stops: bool,
}

/// The place of a connection; free again when this is dropped.
pub(super) struct Place {
    places: Arc<Places>,
    /// Few places were left when it came.
    pub(super) few: bool,
    kind: Kind,
}

enum Kind {
    Common { _permit: OwnedSemaphorePermit },
    Kept { number: u64 },
}

impl Places {
    /// Those of this computer.
    pub(super) fn here() -> Arc<Self> {
        Self::new(KEPT_HERE, ASKS_WITHIN)
    }

    /// Those of others: nobody here waits for them.
    pub(super) fn elsewhere() -> Arc<Self> {
        Self::new(KEPT_ELSEWHERE, Duration::ZERO)
    }

    fn new(kept_max: usize, asks_within: Duration) -> Arc<Self> {
        let common = Arc::new(Semaphore::new(CONNECTIONS_MAX));
        Arc::new(Self { common, kept: Mutex::default(), kept_max, asks_within })
    }

    /// Runs a connection on a place. It is dropped, which closes it, when all places are taken by connections that stop something.
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
        // The threads that serve have the time to read what came before.
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
        // It cannot end before it is among them: they are locked.
        let abort = tokio::spawn(connection(place)).abort_handle();
        kept.open.push_back(Open { number, since: Instant::now(), abort, stops: false });
    }

    /// When the connection came that is closed for a new one, if one has to be.
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
    /// Few places are left now.
    pub(super) fn are_few(&self) -> bool {
        self.few || self.places.are_few()
    }

    /// The connection has asked for something, which `stops` or not. True: it is served.
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

    /// Whatever came before and does not end: the newest connection has a place, unless all that are kept are stopping something.
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
                // The test may have failed meanwhile.
                let _ = came.send((number, place.few, served));
                pending::<()>().await;
                drop(place);
            }));
            runtime.block_on(tokio::task::yield_now());
            comes.try_recv().ok()
        };
        for number in 0..CONNECTIONS_MAX {
            // Its own place is taken before the others are counted.
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
