//! Lease holder that continuously uploads segments.
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use jtc_client::{AgentPort, Options};
use jtc_host::Port as _;
use jtc_wire::{FRAME_MAX, RawPoint, fixed, trajectory};

use crate::common::Served;
use crate::line::Watch;

/// Points per segment. The transmission of a segment with this number of points takes five seconds.
const POINTS: usize = 1600;
/// If a segment is not on the line after this time, a Stop has removed the segment from the queue.
const AGAIN: Duration = Duration::from_millis(30);

/// A client that holds the lease until it is dropped.
pub(crate) struct Operator {
    uploads: Arc<AtomicBool>,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Operator {
    pub(crate) fn come(served: &Served, watch: &Watch) -> Self {
        let token = Some(served.tokens.operator.clone());
        let options = Options { name: "anna".into(), token, ..Options::default() };
        let url = served.url();
        let mut port = AgentPort::open(&url, &options).expect("it is let in");
        port.write_all(&fixed::CLEAR_OCCURRED_ERRORS).expect("it is there");
        let mut segment = vec![0; FRAME_MAX];
        let n = trajectory(&mut segment, (0, 0, 9), 1, [RawPoint::default(); POINTS]).expect("it fits");
        segment.truncate(n);
        let (uploads, ended) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let (wanted, end, watch) = (uploads.clone(), ended.clone(), watch.clone());
        let thread = std::thread::spawn(move || {
            let (mut sent_at, mut buffer) = (Instant::now(), [0; 4096]);
            while !end.load(Ordering::Relaxed) {
                port.read(&mut buffer, Duration::from_millis(5)).expect("it is there");
                let due = wanted.load(Ordering::Relaxed) && sent_at.elapsed() > AGAIN;
                if due && !watch.look().is_in_a_frame() {
                    // After a Stop the agent refuses earlier requests, so each upload uses a new client.
                    drop(port);
                    port = AgentPort::open(&url, &options).expect("it is let in");
                    port.write_all(&segment).expect("it is there");
                    sent_at = Instant::now();
                }
            }
        });
        Self { uploads, ended, thread: Some(thread) }
    }

    pub(crate) fn upload(&self, wanted: bool) {
        self.uploads.store(wanted, Ordering::Relaxed);
    }
}

impl Drop for Operator {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("nobody has disturbed it");
        }
    }
}
