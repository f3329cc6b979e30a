//! The bus in virtual time, compared with ISO 11898-1.

use can_link::{
    BusError, BusEvent, CanFrame, ErrorState, FaultConfig, FaultSchedule, Id, QueueError, TimedBus,
    classic_frame_bits,
};
use proptest::prelude::*;

use super::{MS, errors, frame, received, run};

/// Returns the number of bits of a frame on the bus, without the intermission.
fn bits(frame: &CanFrame) -> u64 {
    u64::from(classic_frame_bits(frame).unwrap()) - 3
}

#[test]
fn a_frame_takes_its_bits_and_the_answer_waits_for_the_intermission() {
    let mut bus = TimedBus::new(500_000, 0);
    let (a, b, c) = (bus.join(), bus.join(), bus.join());
    let (question, answer) = (frame(0x281, &[]), frame(0x0C1, &[1]));
    assert_eq!(bus.advance_to(MS), None);
    bus.queue(a, question).unwrap();
    let end = MS + bits(&question) * 2000;
    let answered = end + 3 * 2000 + bits(&answer) * 2000;
    let mut events = Vec::new();
    while let Some(event) = bus.advance_to(10 * MS) {
        assert_eq!(event.at_ns, bus.now_ns());
        if event.what == (BusEvent::Received { member: b, frame: question }) {
            bus.queue(b, answer).unwrap();
        }
        events.push((event.at_ns, event.what));
    }
    assert_eq!(
        events,
        [
            (end, BusEvent::Sent { member: a, frame: question }),
            (end, BusEvent::Received { member: b, frame: question }),
            (end, BusEvent::Received { member: c, frame: question }),
            (answered, BusEvent::Sent { member: b, frame: answer }),
            (answered, BusEvent::Received { member: a, frame: answer }),
            (answered, BusEvent::Received { member: c, frame: answer }),
        ]
    );
    assert_eq!((bus.now_ns(), bus.next_ns()), (10 * MS, None));
}

#[test]
fn the_lowest_identifier_goes_first_and_does_not_interrupt() {
    let mut bus = TimedBus::new(1_000_000, 0);
    let (a, b, listener) = (bus.join(), bus.join(), bus.join());
    let extended = |id| CanFrame::classic(Id::extended(id).unwrap(), &[]).unwrap();
    let remote = CanFrame::remote(Id::standard(0x100).unwrap(), 0).unwrap();
    // With equal base identifiers, data frames win against remote frames, and 11-bit against 29-bit identifiers.
    bus.queue(a, extended(0x100 << 18)).unwrap();
    bus.queue(b, remote).unwrap();
    let events = run(&mut bus, MS);
    assert_eq!(received(&events, listener), [remote, extended(0x100 << 18)]);
    bus.queue(a, remote).unwrap();
    bus.queue(b, frame(0x100, &[])).unwrap();
    let events = run(&mut bus, 2 * MS);
    assert_eq!(received(&events, listener), [frame(0x100, &[]), remote]);
    // A frame with a lower identifier does not interrupt a frame that is already on the bus.
    bus.queue(a, frame(0x700, &[])).unwrap();
    assert_eq!(bus.advance_to(2 * MS + 10_000), None);
    bus.queue(b, frame(0x000, &[])).unwrap();
    let events = run(&mut bus, 3 * MS);
    assert_eq!(received(&events, listener), [frame(0x700, &[]), frame(0x000, &[])]);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

    /// The frames must be sent in the order of a simple model: of the first frames of all queues, the frame with the
    /// lowest identifier is sent next, without a gap.
    #[test]
    fn frames_come_in_the_order_of_a_simple_model(ids in prop::collection::vec(prop::collection::vec(0..0x800_u32, 0..12), 2..6)) {
        let mut bus = TimedBus::new(250_000, 0);
        let listener = bus.join();
        let mut queues = Vec::new();
        for (sender, ids) in ids.iter().enumerate() {
            let member = bus.join();
            // Senders use separate identifiers, as CAN requires.
            let own = |id: &u32| frame(id / 8 * 8 + sender as u32, &[*id as u8]);
            let frames: Vec<_> = ids.iter().map(own).collect();
            for frame in &frames {
                bus.queue(member, *frame).unwrap();
            }
            queues.push(std::collections::VecDeque::from(frames));
        }
        let mut expected = Vec::new();
        let mut time = 0;
        while let Some(next) = queues.iter_mut().filter(|q| !q.is_empty()).min_by_key(|q| q[0].id()) {
            let frame = next.pop_front().unwrap();
            time += bits(&frame) * 4000;
            expected.push((time, frame));
            time += 3 * 4000;
        }
        let events = run(&mut bus, time + MS);
        let received: Vec<_> = events.iter().filter_map(|event| match event.what {
            BusEvent::Received { member, frame } if member == listener => Some((event.at_ns, frame)),
            _ => None,
        }).collect();
        prop_assert_eq!(received, expected);
        prop_assert_eq!(bus.stats().busy_ns, time);
        prop_assert!(errors(&events).is_empty());
    }

    /// Any sequence of calls must come to an end, and equal calls must produce equal events.
    #[test]
    fn any_calls_are_repeatable_and_end(calls in prop::collection::vec((0..9_u8, 0..5_usize, 0..40_u32, any::<u64>()), 1..120), seed in any::<u64>()) {
        let all = || {
            let mut bus = TimedBus::new(1_000_000, seed);
            let mut members: Vec<_> = (0..3).map(|_| bus.join()).collect();
            let mut events = Vec::new();
            let mut queued = 0_usize;
            for (what, which, id, value) in &calls {
                let member = members[which % members.len()];
                match what {
                    0..=2 => queued += usize::from(bus.queue(member, frame(*id, &value.to_le_bytes()[..which + 1])).is_ok()),
                    3 => members.push(bus.join()),
                    4 => bus.set_disturbance(f64::from(*id) / 80.0),
                    5 => { bus.set_one_shot(member, id % 2 == 0); bus.set_acknowledges(member, id % 3 != 0); }
                    6 => { bus.recover(member); if id % 8 == 0 { bus.leave(member) } else if id % 4 == 0 { bus.clear(member) } }
                    7 => bus.set_faults(member, FaultSchedule { seed: *value, send: FaultConfig { loss: 0.1, duplication: 0.2, delay_max_s: 0.001, ..FaultConfig::default() }, ..FaultSchedule::default() }),
                    _ => { let to = bus.now_ns() + value % (2 * MS); events.extend(run(&mut bus, to)) }
                }
            }
            let to = bus.now_ns() + 20 * MS;
            events.extend(run(&mut bus, to));
            prop_assert!(events.windows(2).all(|pair| pair[0].at_ns <= pair[1].at_ns));
            let sent = events.iter().filter(|event| matches!(event.what, BusEvent::Sent { .. } | BusEvent::Failed { .. })).count();
            prop_assert!(sent <= 2 * queued, "{sent} of {queued}");
            Ok((events, bus.stats()))
        };
        prop_assert_eq!(all()?, all()?);
    }
}

/// D-05: if two nodes send the same identifier with different data at the same time, the bus must report a collision.
/// Both nodes repeat their frames, so they collide again. The collisions end when one node is error passive and no
/// longer destroys the frame of the other node.
#[test]
fn d_05_a_collision_is_reported_and_costs_both_their_counters() {
    let mut bus = TimedBus::new(1_000_000, 0);
    let (a, b, listener) = (bus.join(), bus.join(), bus.join());
    let (one, other) = (frame(0x601, &[1, 0]), frame(0x601, &[1, 1]));
    bus.queue(a, one).unwrap();
    bus.queue(b, other).unwrap();
    let event = bus.advance_to(MS).expect("an error");
    assert_eq!(event.what, BusEvent::Error { error: BusError::Collision, frame: one, senders: vec![a, b] });
    assert_eq!([a, b].map(|member| bus.state(member).tec), [Some(8), Some(8)]);
    assert_eq!(bus.state(listener).rec, Some(1));
    let events = run(&mut bus, 20 * MS);
    // After 16 failures, both nodes are error passive, so their error flags no longer destroy frames. In the 17th
    // collision, the node with the dominant bit succeeds.
    assert_eq!(bus.stats().collisions, 17);
    assert_eq!(received(&events, listener), [one, other]);
    assert_eq!(received(&events, b), [one], "the member that dropped out receives it");
    assert_eq!([a, b].map(|member| bus.state(member).tec), [Some(127), Some(135)]);
    let states: Vec<_> = events
        .iter()
        .filter_map(|event| match event.what {
            BusEvent::State { member, state } if member == a => Some(state.errors),
            _ => None,
        })
        .collect();
    assert_eq!(states, [ErrorState::Warning, ErrorState::Passive, ErrorState::Warning]);
}

/// D-05: a node that drops its frame instead of repeating it leaves the bus to the other node.
#[test]
fn d_05_who_sends_once_only_gives_up_after_a_collision() {
    let mut bus = TimedBus::new(1_000_000, 0);
    let (a, b, listener) = (bus.join(), bus.join(), bus.join());
    bus.set_one_shot(b, true);
    let (one, other) = (frame(0x601, &[1]), frame(0x601, &[]));
    bus.queue(a, one).unwrap();
    bus.queue(b, other).unwrap();
    let events = run(&mut bus, MS);
    assert_eq!(errors(&events), [BusError::Collision]);
    assert!(events.iter().any(|event| event.what == BusEvent::Failed { member: b, frame: other }));
    assert_eq!(received(&events, listener), [one]);
    assert_eq!(bus.pending(b), 0);
}

/// D-05: a node that collides repeatedly finally goes bus-off.
#[test]
fn d_05_endless_collisions_end_in_bus_off() {
    let mut bus = TimedBus::new(1_000_000, 0);
    let (a, b) = (bus.join(), bus.join());
    let mut off = Vec::new();
    for _ in 0..200 {
        bus.queue(a, frame(0x601, &[0])).unwrap();
        let queued = bus.queue(b, frame(0x601, &[1]));
        let until = bus.now_ns() + 10 * MS;
        for event in run(&mut bus, until) {
            match event.what {
                BusEvent::State { member, state } if state.errors == ErrorState::BusOff => off.push(member),
                _ => {}
            }
        }
        if !off.is_empty() {
            break;
        }
        queued.unwrap();
    }
    assert_eq!(off, [b], "the one with the recessive bit");
    assert_eq!(bus.queue(b, frame(1, &[])), Err(QueueError::BusOff));
}

/// D-07: frames with identical bits are one frame on the bus.
#[test]
fn d_07_frames_alike_bit_for_bit_look_like_one() {
    let mut bus = TimedBus::new(1_000_000, 0);
    let (a, b, pc) = (bus.join(), bus.join(), bus.join());
    let report = frame(0x441, &[0x21]);
    bus.queue(a, report).unwrap();
    bus.queue(b, report).unwrap();
    let events = run(&mut bus, MS);
    assert_eq!(received(&events, pc), [report]);
    assert_eq!((received(&events, a), errors(&events)), (vec![], vec![]));
    assert_eq!((bus.stats().frames, bus.stats().shared), (1, 1));
    assert_eq!((bus.pending(a), bus.pending(b)), (0, 0));
}

/// D-03: the bus load is the number of bits sent per second divided by the bit rate.
#[test]
fn the_load_is_the_share_of_bits() {
    for bitrate in [1_000_000, 500_000, 250_000, 125_000] {
        let mut bus = TimedBus::new(bitrate, 0);
        let (a, _b) = (bus.join(), bus.join());
        let sent = frame(0x381, &[0x55; 8]);
        let earlier = bus.stats();
        for period in 1..=100 {
            bus.queue(a, sent).unwrap();
            run(&mut bus, period * 10 * MS);
        }
        let expected = f64::from(classic_frame_bits(&sent).unwrap()) * 100.0 / f64::from(bitrate);
        assert!((bus.stats().load_since(&earlier) - expected).abs() < 1e-9);
        for _ in 0..20_000 {
            bus.queue(a, sent).unwrap();
        }
        let earlier = bus.stats();
        run(&mut bus, 1100 * MS);
        assert!(bus.stats().load_since(&earlier) > 0.99);
        assert!(bus.pending(a) > 0);
    }
}

#[test]
fn leaving_cuts_a_frame_off_and_clearing_does_not() {
    let mut bus = TimedBus::new(1_000_000, 0);
    let (a, b, c) = (bus.join(), bus.join(), bus.join());
    bus.queue(a, frame(0x100, &[1])).unwrap();
    bus.queue(a, frame(0x100, &[2])).unwrap();
    assert_eq!(bus.advance_to(10_000), None);
    bus.clear(a);
    bus.queue(a, frame(0x100, &[3])).unwrap();
    let events = run(&mut bus, MS);
    assert_eq!(received(&events, b), [frame(0x100, &[1]), frame(0x100, &[3])]);
    bus.queue(a, frame(0x100, &[4])).unwrap();
    assert_eq!(bus.advance_to(MS + 10_000), None);
    bus.leave(a);
    let events = run(&mut bus, 2 * MS);
    assert_eq!((received(&events, b), errors(&events)), (vec![], vec![BusError::Disturbed]));
    assert_eq!(bus.state(c).rec, Some(1));
    assert_eq!(bus.queue(a, frame(1, &[])), Err(QueueError::Left));
    let fd = CanFrame::fd(Id::standard(1).unwrap(), &[]).unwrap();
    assert_eq!(bus.queue(b, fd), Err(QueueError::NotClassic));
}

#[test]
fn a_queue_without_end_and_a_time_without_end_are_refused() {
    let mut bus = TimedBus::new(0, 0);
    let a = bus.join();
    let full = (0..).find_map(|_| bus.queue(a, frame(1, &[])).err()).unwrap();
    assert_eq!(full, QueueError::Full(65_536));
    bus.clear(a);
    let late = FaultConfig { delay_min_s: 1e19, ..FaultConfig::default() };
    bus.set_faults(a, FaultSchedule { send: late, ..FaultSchedule::default() });
    bus.queue(a, frame(1, &[])).unwrap();
    assert_eq!(bus.advance_to(u64::MAX), None);
    assert!(bus.now_ns() > u64::MAX / 4);
}
