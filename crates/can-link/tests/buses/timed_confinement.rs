//! Fault confinement of the bus in virtual time: error counters, bus-off, recovery, disturbed frames.

use can_link::{BusError, BusEvent, ErrorState, FaultConfig, FaultSchedule, Id, TimedBus, TimedEvent};

use super::{MS, errors, frame, received, run};

#[test]
fn who_is_alone_tries_for_ever_and_becomes_passive_but_never_bus_off() {
    let mut bus = TimedBus::new(1_000_000, 0);
    let alone = bus.join();
    bus.queue(alone, frame(0x680, &[])).unwrap();
    let events = run(&mut bus, 100 * MS);
    assert!(errors(&events).len() > 500 && errors(&events).iter().all(|e| *e == BusError::NotAcknowledged));
    assert_eq!((bus.state(alone).errors, bus.state(alone).tec), (ErrorState::Passive, Some(128)));
    // An error passive node waits for eight more bits before each attempt.
    let times: Vec<_> = events
        .iter()
        .filter(|event| matches!(event.what, BusEvent::Error { .. }))
        .map(|event| event.at_ns)
        .collect();
    let (active, passive) = (times[1] - times[0], times[101] - times[100]);
    assert_eq!(passive - active, 8000);
    // The member `mute` does not acknowledge frames, so the frame fails again and again. When `listener` joins, which
    // acknowledges, both members must receive the frame.
    let mute = bus.join();
    bus.set_acknowledges(mute, false);
    assert!(received(&run(&mut bus, 101 * MS), mute).is_empty());
    let listener = bus.join();
    let events = run(&mut bus, 102 * MS);
    assert_eq!(received(&events, listener), [frame(0x680, &[])]);
    assert_eq!(received(&events, mute), [frame(0x680, &[])]);
    assert_eq!(bus.state(alone).errors, ErrorState::Warning);
}

#[test]
fn a_wire_that_is_always_disturbed_ends_in_bus_off_and_recovery_brings_back() {
    let mut bus = TimedBus::new(1_000_000, 7);
    let (a, b) = (bus.join(), bus.join());
    bus.set_disturbance(1.0);
    bus.queue(a, frame(0x100, &[1])).unwrap();
    bus.queue(a, frame(0x101, &[2])).unwrap();
    let events = run(&mut bus, 50 * MS);
    assert_eq!(errors(&events), [BusError::Disturbed; 32]);
    let failed = events.iter().filter(|event| matches!(event.what, BusEvent::Failed { .. })).count();
    assert_eq!((failed, bus.state(a).errors), (2, ErrorState::BusOff));
    assert_eq!(bus.state(b).rec, Some(32));
    bus.set_disturbance(0.0);
    // A member in bus-off must neither receive nor acknowledge frames.
    bus.queue(b, frame(0x200, &[])).unwrap();
    assert!(
        run(&mut bus, 51 * MS)
            .iter()
            .all(|event| matches!(event.what, BusEvent::Error { .. } | BusEvent::State { .. }))
    );
    bus.recover(a);
    let events = run(&mut bus, 100 * MS);
    let is_back = |event: &TimedEvent| matches!(event.what, BusEvent::State { member, .. } if member == a);
    let back = events.iter().position(is_back).unwrap();
    // Only member `b` sends, and no member acknowledges its frame. Each attempt ends with 11 recessive bits, so
    // member `a` must recover after 128 attempts.
    assert_eq!(errors(&events[..back]), [BusError::NotAcknowledged; 128]);
    assert_eq!(received(&events, a), [frame(0x200, &[])]);
    bus.queue(a, frame(0x100, &[1])).unwrap();
    assert_eq!(received(&run(&mut bus, 110 * MS), b), [frame(0x100, &[1])]);
}

#[test]
fn recovery_on_an_idle_bus_takes_1408_bit_times() {
    let mut bus = TimedBus::new(500_000, 7);
    let (a, _b) = (bus.join(), bus.join());
    bus.set_disturbance(1.0);
    bus.queue(a, frame(0x100, &[1])).unwrap();
    run(&mut bus, 100 * MS);
    assert_eq!(bus.state(a).errors, ErrorState::BusOff);
    bus.recover(a);
    let back = bus.advance_to(200 * MS).unwrap();
    assert_eq!((back.at_ns, bus.state(a).errors), (100 * MS + 1408 * 2000, ErrorState::Active));
}

/// ISO 11898-1: on a busy bus, each frame ends with one sequence of 11 recessive bits (including the intermission). A
/// controller therefore recovers after 128 frames.
#[test]
fn recovery_on_a_busy_bus_takes_128_frames() {
    let mut bus = TimedBus::new(1_000_000, 7);
    let (a, b, c) = (bus.join(), bus.join(), bus.join());
    bus.set_recovers_by_itself(true);
    bus.set_disturbance(1.0);
    bus.queue(a, frame(0x100, &[1])).unwrap();
    while bus.state(a).errors != ErrorState::BusOff {
        bus.advance_to(50 * MS);
    }
    bus.set_disturbance(0.0);
    // The frame of the bus-off member waits for the recovery. The frames of the other member are not delayed.
    bus.queue(a, frame(0x001, &[])).unwrap();
    for _ in 0..200 {
        bus.queue(b, frame(0x200, &[0x55; 8])).unwrap();
    }
    let events = run(&mut bus, 100 * MS);
    let received = received(&events, c);
    let first = received.iter().position(|frame| frame.id() == Id::standard(1).unwrap()).unwrap();
    assert_eq!(first, 128, "frames before the first one of the member that was bus-off");
    assert_eq!(bus.state(a).errors, ErrorState::Active);
}

/// A reset member must be on the bus again at once, with all counters at 0.
#[test]
fn a_reset_member_is_on_the_bus_again() {
    let mut bus = TimedBus::new(1_000_000, 7);
    let (a, b) = (bus.join(), bus.join());
    bus.set_disturbance(1.0);
    bus.queue(a, frame(0x100, &[1])).unwrap();
    run(&mut bus, 50 * MS);
    assert_eq!(bus.state(a).errors, ErrorState::BusOff);
    bus.set_disturbance(0.0);
    bus.clear(a);
    assert_eq!((bus.state(a).tec, bus.state(a).rec), (Some(0), Some(0)));
    bus.queue(a, frame(0x100, &[2])).unwrap();
    assert_eq!(received(&run(&mut bus, 60 * MS), b), [frame(0x100, &[2])]);
}

#[test]
fn disturbed_frames_come_through_in_the_end() {
    let mut bus = TimedBus::new(1_000_000, 3);
    let (a, b) = (bus.join(), bus.join());
    bus.set_disturbance(0.1);
    let frames: Vec<_> = (0..500).map(|n: u16| frame(0x100, &n.to_be_bytes())).collect();
    for frame in &frames {
        bus.queue(a, *frame).unwrap();
    }
    let events = run(&mut bus, 1000 * MS);
    assert_eq!(received(&events, b), frames);
    assert!((20..120).contains(&errors(&events).len()), "{}", errors(&events).len());
    assert_eq!(bus.stats().disturbed as usize, errors(&events).len());
}

#[test]
fn faults_of_a_member_are_those_of_a_gateway_and_cost_no_counters() {
    let mut bus = TimedBus::new(1_000_000, 0);
    let (a, b) = (bus.join(), bus.join());
    let receive = FaultConfig {
        loss: 0.2,
        duplication: 0.1,
        delay_min_s: 0.001,
        delay_max_s: 0.001,
        ..FaultConfig::default()
    };
    bus.set_faults(b, FaultSchedule { seed: 5, receive, ..FaultSchedule::default() });
    for n in 0..200_u16 {
        bus.queue(a, frame(0x100, &n.to_be_bytes())).unwrap();
    }
    let events = run(&mut bus, 100 * MS);
    let stats = bus.fault_stats(b).1;
    assert_eq!((stats.frames, bus.stats().frames), (200, 200));
    assert!(stats.lost > 10 && stats.doubled > 5);
    assert_eq!(received(&events, b).len() as u64, 200 - stats.lost + stats.doubled);
    assert_eq!((errors(&events), bus.state(b).rec), (vec![], Some(0)));
    // Each frame must arrive 1 ms after the end of its transmission on the bus.
    let sent: Vec<_> =
        events.iter().filter(|e| matches!(e.what, BusEvent::Sent { .. })).map(|e| e.at_ns).collect();
    let times = events.iter().filter(|e| matches!(e.what, BusEvent::Received { .. })).map(|e| e.at_ns);
    assert!(times.into_iter().all(|at| sent.contains(&(at - MS))));
    // A fault before the queue changes only the payload. On the bus, the frame is a valid frame, and it is received
    // without an error.
    bus.set_faults(
        a,
        FaultSchedule {
            seed: 5,
            send: FaultConfig { corruption: 1.0, ..FaultConfig::default() },
            ..FaultSchedule::default()
        },
    );
    bus.set_faults(b, FaultSchedule::default());
    bus.queue(a, frame(0x100, &[0])).unwrap();
    let frames = received(&run(&mut bus, 200 * MS), b);
    assert_eq!(frames[0].data()[0].count_ones(), 1);
}
