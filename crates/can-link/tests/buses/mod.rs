//! Tests of all kinds of buses from the user's side: adapters, servers and clients on real connections, and the bus in
//! virtual time.

mod slcan;
mod socketcand;
mod socketcand_client;
mod socketcand_gateway;
mod timed_bus;
mod timed_confinement;

use std::time::Duration;

use can_link::{
    BusError, BusEvent, CanBus, CanFrame, Id, MemberId, SocketcandServer, TimedBus, TimedEvent, VirtualHub,
};
use test_kit::patience::Patience;

const MS: u64 = 1_000_000;

fn frame(id: u32, data: &[u8]) -> CanFrame {
    CanFrame::classic(Id::standard(id).unwrap(), data).unwrap()
}

fn numbered(number: u32) -> CanFrame {
    frame(0x100, &number.to_be_bytes())
}

/// Returns the next frame of a bus in real time.
fn take(bus: &mut impl CanBus) -> CanFrame {
    let mut patience = Patience::begin();
    loop {
        if let Some(frame) = patience.wait("a frame", |time| bus.receive(time)).unwrap() {
            return frame;
        }
    }
}

/// Waits until `done` returns `true`. The pauses of this function are shorter than the pauses of `patience::until`,
/// because some tests wait thousands of times.
#[track_caller]
fn until(mut done: impl FnMut() -> bool) {
    let mut patience = Patience::begin();
    while !done() {
        patience.wait("other threads", |_| std::thread::sleep(Duration::from_millis(1)));
    }
}

/// Creates a server of the socketcand protocol and its bus.
fn socketcand_bench() -> (SocketcandServer, VirtualHub) {
    let hub = VirtualHub::new();
    let server = SocketcandServer::bind("127.0.0.1:0", &[("can0", &hub)]).unwrap();
    (server, hub)
}

/// Returns the events of a bus in virtual time up to this time.
fn run(bus: &mut TimedBus, until_ns: u64) -> Vec<TimedEvent> {
    std::iter::from_fn(|| bus.advance_to(until_ns)).collect()
}

/// Returns the frames that a member received.
fn received(events: &[TimedEvent], by: MemberId) -> Vec<CanFrame> {
    let frame = |event: &TimedEvent| match event.what {
        BusEvent::Received { member, frame } if member == by => Some(frame),
        _ => None,
    };
    events.iter().filter_map(frame).collect()
}

fn errors(events: &[TimedEvent]) -> Vec<BusError> {
    let error = |event: &TimedEvent| match event.what {
        BusEvent::Error { error, .. } => Some(error),
        _ => None,
    };
    events.iter().filter_map(error).collect()
}
