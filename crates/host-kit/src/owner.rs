//! Requests and Stops to the thread that owns a device. A Stop overtakes all waiting requests.
//!
//! A single thread owns a device: only this owner thread calls the device's functions. Other threads put requests into
//! the owner's [`Queue`]. The owner takes one request at a time. A request begins when the owner takes the request from
//! the queue.
//!
//! Each Stop has a number. A Stop cancels the current request, unless the current request is an update. A Stop also
//! refuses each earlier command or update that has not begun. Therefore no command or update that was requested before
//! a Stop begins after this Stop.
//!
//! A front end stores its own data about a request in a tag, such as the client and the number of a job.
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Kind of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Command to a device. A Stop refuses a waiting command, and cancels a command that has begun.
    Command,
    /// Update of a device's program. A Stop refuses a waiting update. A Stop does not cancel an update that has begun,
    /// because a device with a half-written program would not work.
    Update,
    /// Query, which does not change anything. A Stop cancels a query that has begun. A waiting query stays in the queue
    /// after a Stop. The owner takes a query after all commands and updates.
    Question,
}

/// Reason why a request is not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// A Stop was requested after this request.
    Stopped,
    /// The requester has cancelled the request.
    Cancelled,
    /// The owner has closed the queue.
    Closed,
}

/// Function of a request. The function is called once, with the device `D` or with the reason why the request is
/// refused.
///
/// If the request is refused, the function runs in the thread that refuses it: the owner, or a thread that cancels a
/// request, requests a Stop or adds a request. This thread must not hold a lock that the function needs.
pub type Act<D> = Box<dyn FnOnce(Result<&mut D, Refused>) + Send>;

/// Value of [`Request::after`] for a request that is never refused because of a Stop.
pub const NEVER_LATE: u64 = u64::MAX;

/// Request to the owner of a device `D`, with a tag of the front end.
pub struct Request<D, T> {
    /// Kind of the request.
    pub kind: Kind,
    /// Number of the last Stop when the request was made: see [`Queue::stops`]. A later Stop refuses the request.
    /// With [`NEVER_LATE`], no Stop refuses the request. Queries do not use this number.
    pub after: u64,
    /// Data of the front end about the request.
    pub tag: T,
    /// Function of the request.
    pub act: Act<D>,
}

impl<D, T> Request<D, T> {
    /// Returns `true` if the request must be refused because it was made before the Stop with the number `stops`.
    fn is_late(&self, stops: u64) -> bool {
        self.kind != Kind::Question && self.after < stops
    }
}

/// Request that the owner currently carries out.
struct Current<T> {
    tag: T,
    is_cancelled_by_stop: bool,
    cancelled: bool,
}

struct State<D, T> {
    /// Functions of the Stops that have not begun yet, the oldest first.
    stopping: VecDeque<(T, Act<D>)>,
    waiting: VecDeque<Request<D, T>>,
    current: Option<Current<T>>,
    stops: u64,
    closed: bool,
}

/// Queue of requests to the owner of a device.
pub struct Queue<D, T>(Mutex<State<D, T>>);

impl<D, T> Default for Queue<D, T> {
    fn default() -> Self {
        let (stopping, waiting) = (VecDeque::new(), VecDeque::new());
        Self(Mutex::new(State { stopping, waiting, current: None, stops: 0, closed: false }))
    }
}

impl<D, T: Clone> Queue<D, T> {
    fn lock(&self) -> MutexGuard<'_, State<D, T>> {
        // If another thread panicked while it held the lock, the state may be incomplete. A Stop must still work.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the number of Stops that were requested so far, which is also the number of the last Stop.
    pub fn stops(&self) -> u64 {
        self.lock().stops
    }

    /// Requests a Stop. Cancels the current request, unless the current request is an update or a Stop. Puts `act`
    /// before all waiting requests except earlier Stops. Returns the number of the Stop. The caller should then call
    /// [`Queue::refuse_late`].
    ///
    /// While the owner carries out a request, the owner must poll [`Queue::stops`] or [`Queue::is_cancelled`], because
    /// `act` begins only after the current request has ended.
    pub fn stop(&self, tag: T, act: Act<D>) -> u64 {
        self.overtake(tag, act, false)
    }

    /// Like [`Queue::stop`], for Stops whose functions are equivalent: drops `act` if another Stop already waits.
    pub fn stop_alike(&self, tag: T, act: Act<D>) -> u64 {
        self.overtake(tag, act, true)
    }

    /// Like [`Queue::stop`], for a Stop without a function, for example if another program has already stopped the
    /// device. Also refuses late requests, like [`Queue::refuse_late`].
    pub fn count_stop(&self) {
        self.lock().count_stop();
        self.refuse_late();
    }

    fn overtake(&self, tag: T, act: Act<D>, alike: bool) -> u64 {
        let mut state = self.lock();
        let number = state.count_stop();
        if state.closed {
            drop(state);
            act(Err(Refused::Closed));
        } else if !alike || state.stopping.is_empty() {
            state.stopping.push_back((tag, act));
        }
        number
    }

    /// Refuses all waiting commands and updates that were requested before the last Stop. Without this call, the owner
    /// would refuse these requests later, when it takes them from the queue.
    pub fn refuse_late(&self) {
        let late = {
            let state = &mut *self.lock();
            let stops = state.stops;
            let (late, waiting): (VecDeque<_>, _) =
                std::mem::take(&mut state.waiting).into_iter().partition(|request| request.is_late(stops));
            state.waiting = waiting;
            late
        };
        // The lock of the queue is already released, because the function of a request may use the queue.
        late.into_iter().for_each(|request| (request.act)(Err(Refused::Stopped)));
    }

    /// Locks the queue and returns the permission to add one request. Returns `None` if the queue is closed.
    ///
    /// While a thread has this permission, the thread must not call other functions of the queue, because the
    /// permission holds the lock of the queue.
    pub fn place(&self) -> Option<Place<'_, D, T>> {
        Some(Place(self.lock())).filter(|place| !place.0.closed)
    }

    /// Adds a request to the queue. If the queue is closed, refuses the request at once.
    pub fn put(&self, request: Request<D, T>) {
        match self.place() {
            Some(place) => place.put(request),
            None => (request.act)(Err(Refused::Closed)),
        }
    }

    /// Takes the next request from the queue. The taken request is the current request until the owner calls
    /// [`Queue::done`]. Stops are taken first, then commands and updates, then queries.
    pub fn take(&self) -> Option<Turn<D, T>> {
        let mut state = self.lock();
        let (tag, act, refused, is_cancelled_by_stop) = match state.stopping.pop_front() {
            Some((tag, act)) => (tag, act, None, false),
            None => {
                let request = state.waiting.pop_front()?;
                let refused = request.is_late(state.stops).then_some(Refused::Stopped);
                (request.tag, request.act, refused, request.kind != Kind::Update)
            }
        };
        // A refused request never becomes the current request. Therefore no work for this request is in progress when
        // the requester receives the refusal.
        let current = Current { tag: tag.clone(), is_cancelled_by_stop, cancelled: false };
        state.current = refused.is_none().then_some(current);
        Some(Turn { tag, refused, act })
    }

    /// Marks the current request as completed. The owner calls this function after [`Turn::run`] and before the
    /// requester receives its answer.
    pub fn done(&self) {
        self.lock().current = None;
    }

    /// Returns `true` if the current request was cancelled, so it must end.
    pub fn is_cancelled(&self) -> bool {
        self.lock().current.as_ref().is_some_and(|current| current.cancelled)
    }

    /// Returns `true` if a Stop waits in the queue.
    pub fn stop_waits(&self) -> bool {
        !self.lock().stopping.is_empty()
    }

    /// Returns `true` if the current request or a waiting request has a matching tag.
    pub fn has(&self, is_it: impl Fn(&T) -> bool) -> bool {
        self.lock().tags().any(is_it)
    }

    /// Cancels the request with a matching tag. The current request is marked as cancelled, a waiting request is
    /// refused. Returns `false` if no matching request exists.
    pub fn cancel(&self, is_it: impl Fn(&T) -> bool) -> bool {
        let request = {
            let mut state = self.lock();
            if let Some(current) = state.current.as_mut().filter(|current| is_it(&current.tag)) {
                current.cancelled = true;
                return true;
            }
            let at = state.waiting.iter().position(|request| is_it(&request.tag));
            at.and_then(|at| state.waiting.remove(at))
        };
        // The lock of the queue is already released, because the function of the request may use the queue.
        request.map(|request| (request.act)(Err(Refused::Cancelled))).is_some()
    }

    /// Closes the queue: all waiting and all later requests are refused. Only the owner calls this function, before the
    /// owner ends.
    pub fn close(&self) {
        let (stopping, waiting) = {
            let mut state = self.lock();
            state.closed = true;
            // If the owner panicked while it carried out a request, this request would otherwise stay the current
            // request.
            state.current = None;
            (std::mem::take(&mut state.stopping), std::mem::take(&mut state.waiting))
        };
        let acts =
            stopping.into_iter().map(|(_, act)| act).chain(waiting.into_iter().map(|request| request.act));
        acts.for_each(|act| act(Err(Refused::Closed)));
    }
}

impl<D, T> State<D, T> {
    /// Counts a Stop, and cancels the current request unless the current request is an update or a Stop. Returns the
    /// number of the Stop.
    fn count_stop(&mut self) -> u64 {
        self.stops += 1;
        if let Some(current) = &mut self.current {
            current.cancelled |= current.is_cancelled_by_stop;
        }
        self.stops
    }

    fn tags(&self) -> impl Iterator<Item = &T> {
        let current = self.current.iter().map(|current| &current.tag);
        current.chain(self.waiting.iter().map(|request| &request.tag))
    }
}

/// Permission to add one request to a queue. The permission holds the lock of the queue.
pub struct Place<'a, D, T>(MutexGuard<'a, State<D, T>>);

impl<D, T> Place<'_, D, T> {
    /// Returns the tags of the current request and of all waiting requests. The tags of waiting Stops are not included.
    pub fn tags(&self) -> impl Iterator<Item = &T> {
        self.0.tags()
    }

    /// Returns the number of waiting requests with a kind that `is_it` accepts.
    pub fn waiting(&self, is_it: impl Fn(Kind) -> bool) -> usize {
        self.0.waiting.iter().filter(|request| is_it(request.kind)).count()
    }

    /// Adds a command or an update before all queries, and a query at the end of the queue. Refuses a command or an
    /// update that was requested before the last Stop.
    pub fn put(mut self, request: Request<D, T>) {
        if request.is_late(self.0.stops) {
            // The lock of the queue is already released, because the function of the request may use the queue.
            drop(self);
            return (request.act)(Err(Refused::Stopped));
        }
        let waiting = &mut self.0.waiting;
        let is_command = request.kind != Kind::Question;
        let behind = waiting.iter().position(|other| is_command && other.kind == Kind::Question);
        let at = behind.unwrap_or(waiting.len());
        waiting.insert(at, request);
    }
}

/// Request that the owner has taken from the queue.
pub struct Turn<D, T> {
    /// Tag of the request.
    pub tag: T,
    refused: Option<Refused>,
    act: Act<D>,
}

impl<D, T> Turn<D, T> {
    /// Carries out the request or refuses the request.
    pub fn run(self, device: &mut D) {
        (self.act)(match self.refused {
            Some(refused) => Err(refused),
            None => Ok(device),
        });
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    /// Simulated device that stores the tags of the requests that were carried out.
    type Done = Vec<u32>;
    type Log = Arc<Mutex<Vec<(u32, Option<Refused>)>>>;

    #[derive(Default)]
    struct Bench {
        queue: Queue<Done, u32>,
        log: Log,
        device: Done,
    }

    impl Bench {
        fn act(&self, tag: u32) -> Act<Done> {
            let log = self.log.clone();
            Box::new(move |device| {
                log.lock().expect("log").push((tag, device.as_ref().err().copied()));
                if let Ok(device) = device {
                    device.push(tag);
                }
            })
        }

        fn request(&self, kind: Kind, after: u64, tag: u32) {
            let act = self.act(tag);
            self.queue.put(Request { kind, after, tag, act });
        }

        fn stop(&self, tag: u32) -> u64 {
            self.queue.stop(tag, self.act(tag))
        }

        /// Carries out all waiting requests.
        fn serve(&mut self) {
            while let Some(turn) = self.queue.take() {
                turn.run(&mut self.device);
                self.queue.done();
            }
        }

        fn log(&self) -> Vec<(u32, Option<Refused>)> {
            self.log.lock().expect("log").clone()
        }
    }

    #[test]
    fn commands_are_done_before_questions_and_stops_before_both() {
        let mut bench = Bench::default();
        bench.request(Kind::Question, 0, 1);
        bench.request(Kind::Command, 0, 2);
        bench.request(Kind::Update, 0, 3);
        bench.request(Kind::Question, 0, 4);
        assert_eq!((bench.stop(5), bench.stop(6)), (1, 2));
        bench.request(Kind::Command, 2, 7);
        assert!(bench.queue.stop_waits());
        bench.serve();
        assert_eq!(bench.device, [5, 6, 7, 1, 4]);
    }

    #[test]
    fn one_waiting_stop_is_enough_if_all_do_the_same() {
        let mut bench = Bench::default();
        let stop = |bench: &Bench, tag| bench.queue.stop_alike(tag, bench.act(tag));
        assert_eq!((stop(&bench, 1), stop(&bench, 2)), (1, 2));
        let turn = bench.queue.take().expect("the first waits");
        // The first Stop has begun and no longer waits. Therefore the queue must keep the function of the third Stop.
        assert_eq!(stop(&bench, 3), 3);
        turn.run(&mut bench.device);
        bench.serve();
        assert_eq!(bench.device, [1, 3]);
    }

    #[test]
    fn what_was_requested_before_a_stop_is_not_begun_after_it() {
        let mut bench = Bench::default();
        let before = bench.queue.stops();
        bench.request(Kind::Command, before, 1);
        bench.request(Kind::Update, before, 2);
        bench.request(Kind::Question, before, 3);
        assert_eq!(bench.stop(6), before + 1);
        // This command was made before the Stop and is added after the Stop, so it must be refused.
        bench.request(Kind::Command, before, 4);
        bench.request(Kind::Command, bench.queue.stops(), 5);
        bench.serve();
        assert_eq!(bench.device, [6, 5, 3]);
        let stopped = Some(Refused::Stopped);
        assert_eq!(bench.log(), [(4, stopped), (6, None), (1, stopped), (2, stopped), (5, None), (3, None)]);
    }

    #[test]
    fn late_requests_are_refused_while_an_update_goes_on() {
        let mut bench = Bench::default();
        bench.request(Kind::Update, 0, 1);
        let turn = bench.queue.take().expect("it waits");
        bench.request(Kind::Command, 0, 2);
        bench.request(Kind::Question, 0, 3);
        bench.stop(4);
        bench.request(Kind::Command, 1, 5);
        bench.queue.refuse_late();
        assert_eq!(bench.log(), [(2, Some(Refused::Stopped))]);
        turn.run(&mut bench.device);
        bench.serve();
        assert_eq!(bench.device, [1, 4, 5, 3]);
    }

    #[test]
    fn nothing_is_done_for_a_request_that_is_refused() {
        let queue = Arc::new(Queue::<Done, u32>::default());
        let log = Log::default();
        // The function of each request uses the queue. Therefore the queue must not hold its lock when it calls the
        // function.
        let put = |tag, after| {
            let (own, log) = (queue.clone(), log.clone());
            let act: Act<Done> = Box::new(move |device| {
                assert!(!own.has(|other| *other == tag));
                log.lock().expect("log").push((tag, device.err()));
            });
            queue.put(Request { kind: Kind::Command, after, tag, act });
        };
        let mut device = Done::new();
        put(1, 0);
        queue.stop(0, Box::new(|_| {}));
        while let Some(turn) = queue.take() {
            turn.run(&mut device);
            queue.done();
        }
        put(2, 1);
        queue.stop(0, Box::new(|_| {}));
        queue.refuse_late();
        put(3, 1);
        put(4, 2);
        queue.cancel(|tag| *tag == 4);
        put(5, 2);
        queue.close();
        put(6, 2);
        let [stopped, cancelled, closed] = [Refused::Stopped, Refused::Cancelled, Refused::Closed].map(Some);
        let all = [(1, stopped), (2, stopped), (3, stopped), (4, cancelled), (5, closed), (6, closed)];
        assert_eq!(*log.lock().expect("log"), all);
    }

    #[test]
    fn a_stop_does_not_cancel_the_one_before() {
        let bench = Bench::default();
        bench.stop(1);
        let turn = bench.queue.take().expect("it waits");
        bench.stop(2);
        assert!(!bench.queue.is_cancelled());
        drop(turn);
    }

    #[test]
    fn a_stop_cancels_a_command_and_a_question_but_no_update() {
        for (kind, cancelled) in [(Kind::Command, true), (Kind::Question, true), (Kind::Update, false)] {
            let bench = Bench::default();
            bench.request(kind, 0, 1);
            let turn = bench.queue.take().expect("it waits");
            assert!(!bench.queue.is_cancelled());
            bench.stop(2);
            assert_eq!(bench.queue.is_cancelled(), cancelled, "{kind:?}");
            drop(turn);
            bench.queue.done();
            assert!(!bench.queue.is_cancelled());
        }
    }

    #[test]
    fn the_requester_cancels_its_own_request() {
        let mut bench = Bench::default();
        bench.request(Kind::Update, 0, 1);
        bench.request(Kind::Command, 0, 2);
        let turn = bench.queue.take().expect("it waits");
        assert!(bench.queue.has(|tag| *tag == 1) && bench.queue.has(|tag| *tag == 2));
        assert!(bench.queue.cancel(|tag| *tag == 2));
        assert!(!bench.queue.is_cancelled() && !bench.queue.has(|tag| *tag == 2));
        // A Stop does not cancel an update that has begun, but a user can cancel it.
        assert!(bench.queue.cancel(|tag| *tag == 1));
        assert!(bench.queue.is_cancelled());
        turn.run(&mut bench.device);
        bench.queue.done();
        assert!(!bench.queue.cancel(|tag| *tag == 1));
        assert_eq!(bench.log(), [(2, Some(Refused::Cancelled)), (1, None)]);
    }

    #[test]
    fn a_closed_queue_refuses_all_requests() {
        let mut bench = Bench::default();
        bench.request(Kind::Command, 0, 1);
        // The owner takes a request and drops it without carrying it out. After `close`, the queue must not contain
        // this request.
        drop(bench.queue.take());
        bench.request(Kind::Command, 0, 2);
        bench.stop(3);
        bench.queue.close();
        assert!(!bench.queue.has(|_| true));
        bench.stop(4);
        bench.request(Kind::Question, 0, 5);
        assert!(bench.queue.place().is_none());
        bench.serve();
        let closed = Some(Refused::Closed);
        assert_eq!((bench.log(), bench.device.len()), ([3, 2, 4, 5].map(|tag| (tag, closed)).to_vec(), 0));
    }
}
