//! Clients of the socketcand protocol on a bus that the host program runs itself.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use can_link::{BusEvent, CanBus, CanFrame, ClientEvent, ErrorState, Id, SocketcandGateway, TimedBus, open};
use test_kit::patience::LONGEST;

use super::{numbered, take, until};

#[test]
fn a_host_can_run_the_bus_itself() {
    let mut gateway = SocketcandGateway::bind("127.0.0.1:0", &["can0", "can1"]).unwrap();
    let joined = |gateway: &mut SocketcandGateway, name| {
        let bus = open(&gateway.url(name)).unwrap();
        let event = gateway.next(LONGEST).unwrap();
        assert_eq!(event.event, ClientEvent::Joined);
        (bus, event.client, event.channel)
    };
    let (mut a, id_a, channel) = joined(&mut gateway, "can0");
    assert_eq!(channel, 0);
    let (mut b, id_b, _) = joined(&mut gateway, "can0");
    let (mut other, _, channel) = joined(&mut gateway, "can1");
    assert_eq!(channel, 1);
    assert_ne!(id_a, id_b);
    a.send(&numbered(1)).unwrap();
    let event = gateway.next(LONGEST).unwrap();
    assert_eq!((event.channel, event.client, event.event), (0, id_a, ClientEvent::Frame(numbered(1))));
    // No client has received the frame yet, because the host program decides when the frame is on the bus.
    gateway.deliver(0, &numbered(2), None);
    gateway.deliver(0, &numbered(1), Some(id_a));
    gateway.deliver(0, &numbered(3), None);
    assert_eq!([take(&mut a), take(&mut a)], [numbered(2), numbered(3)]);
    assert_eq!([take(&mut b), take(&mut b), take(&mut b)], [numbered(2), numbered(1), numbered(3)]);
    assert_eq!(other.receive(Duration::ZERO).unwrap(), None);
    gateway.deliver_to(id_b, &numbered(5));
    gateway.deliver(0, &numbered(6), None);
    assert_eq!([take(&mut b), take(&mut b)], [numbered(5), numbered(6)]);
    assert_eq!(take(&mut a), numbered(6));
    drop(a);
    let event = gateway.next(LONGEST).unwrap();
    assert_eq!((event.client, event.event), (id_a, ClientEvent::Left));
    assert_eq!(gateway.next(Duration::ZERO), None);
    // The host program takes no events, so the event queue is full. The gateway must still end without waiting
    // forever.
    std::thread::scope(|scope| {
        scope.spawn(move || while b.send(&numbered(4)).is_ok() {});
        until(|| gateway.stats().received > 1000);
        drop(gateway);
    });
}

/// Each client is a member of a bus in virtual time. The test answers the clients' frames like a board.
#[test]
fn clients_are_members_of_a_bus_in_virtual_time() {
    let mut gateway = SocketcandGateway::bind("127.0.0.1:0", &["can0"]).unwrap();
    let url = gateway.url("can0");
    let stop = AtomicBool::new(false);
    let count = 200;
    let stats = std::thread::scope(|scope| {
        let host = scope.spawn(|| {
            let mut bus = TimedBus::new(1_000_000, 1);
            let board = bus.join();
            let mut members = BTreeMap::new();
            while !stop.load(Ordering::Relaxed) {
                let mut wait = Duration::from_millis(1);
                while let Some(event) = gateway.next(std::mem::take(&mut wait)) {
                    match event.event {
                        ClientEvent::Joined => drop(members.insert(event.client, bus.join())),
                        ClientEvent::Left => {
                            members.remove(&event.client).into_iter().for_each(|m| bus.leave(m))
                        }
                        ClientEvent::Frame(frame) => bus.queue(members[&event.client], frame).unwrap(),
                    }
                }
                let now = bus.now_ns();
                while let Some(event) = bus.advance_to(now + 1_000_000) {
                    let BusEvent::Received { member, frame } = event.what else { continue };
                    if member == board && frame.id().value() == 0x100 {
                        let answer = CanFrame::classic(Id::standard(0x80).unwrap(), frame.data()).unwrap();
                        bus.queue(board, answer).unwrap();
                    }
                    for (client, _) in members.iter().filter(|(_, its)| **its == member) {
                        gateway.deliver_to(*client, &frame);
                    }
                }
            }
            bus.stats()
        });
        let (mut tool, mut listener) = (open(&url).unwrap(), open(&url).unwrap());
        for number in 0..count {
            tool.send(&numbered(number)).unwrap();
            assert_eq!(take(&mut tool).data(), number.to_be_bytes());
            assert_eq!(take(&mut listener), numbered(number));
            assert_eq!(take(&mut listener).id().value(), 0x80);
        }
        drop((tool, listener));
        stop.store(true, Ordering::Relaxed);
        host.join().unwrap()
    });
    assert_eq!(stats.frames, u64::from(2 * count));
}

/// A client must receive reports about bus-off and recovery of its own controller, in order with its frames. Other
/// clients must not receive these reports.
#[test]
fn a_client_receives_its_own_bus_off() {
    let mut gateway = SocketcandGateway::bind("127.0.0.1:0", &["can0"]).unwrap();
    let mut own = open(&gateway.url("can0")).unwrap();
    let client = gateway.next(LONGEST).unwrap().client;
    let mut other = open(&gateway.url("can0")).unwrap();
    gateway.next(LONGEST).unwrap();
    let states = [ErrorState::BusOff, ErrorState::Active];
    for (number, state) in (0..).zip(states) {
        gateway.report_state(client, state);
        gateway.deliver(0, &numbered(number), None);
        assert_eq!(take(&mut own), numbered(number));
        assert_eq!(own.state().errors, state);
        assert_eq!(take(&mut other), numbered(number));
        assert_eq!(other.state().errors, ErrorState::Unknown);
    }
    assert_eq!((own.times_bus_off(), other.times_bus_off()), (1, 0));
}
