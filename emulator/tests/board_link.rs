//! Tests of both serial lines: gaps, long frames, the line on which each record is sent, and overload.
mod rig;

use jtc_sim::host;
use jtc_wire::{
    DataStatus, FrameStatus, FrameType, RawPoint, Response, TrajectoryState, fixed, pid_param, trajectory,
};
use openjtc_emulator::clock::{MICROSECOND, MILLISECOND, to_us};
use openjtc_emulator::{BoardConfig, Port};
use rig::{BOARDS, PORTS, Rig, elf, fast_elf, index};

const A: Port = Port::Usart2;
const B: Port = Port::Usart3;

/// Returns the only segment of a trajectory with this number of points. All points are at position 0.
fn segment(points: usize) -> Vec<u8> {
    let mut frame = vec![0; 60_000];
    let still = std::iter::repeat_n(RawPoint::default(), points);
    let n = trajectory(&mut frame, (1, 0, 1), 10, still).expect("it fits into a frame");
    frame.truncate(n);
    frame
}

/// Runs the board until the serial line of a port has been silent for this time.
fn silence(rig: &mut Rig, port: Port, ms: u64) {
    rig.wait("the line falls silent", 10_000, |rig| rig.board.pending(port) == 0);
    rig.run(ms);
}

fn no_losses(rig: &mut Rig) {
    for usart in &rig.board.machine.chip().usarts {
        assert_eq!((usart.overruns, usart.garbled, usart.missed), (0, 0, 0));
    }
}

/// J-03, J-05: the host sends the first three bytes of a frame, waits a whole number of milliseconds, and sends the
/// remaining bytes. A gap below 5 ms does not end the frame, and a longer gap ends it.
#[test]
fn j03_a_gap_below_5_ms_joins_and_one_above_cuts() {
    for port in PORTS {
        let mut rig = Rig::new(BOARDS[0]);
        rig.run(50);
        // The second part of the frame is long, so that the line does not become idle right after the gap. Therefore
        // no idle interrupt makes the firmware check the line at that time.
        let mut frame = [0; 126];
        pid_param(&mut frame, &[[8000.0, 100.0, 80.0, -1.0, 1.0]; 6]).expect("it fits");
        // The first bytes take part of the time `ms`, so the line is silent for 0.26 ms less. The test sends
        // both parts of the frame at `us` = 0, 300 or 600 µs after the start of a millisecond.
        let moments = [0, 300, 600].into_iter().flat_map(|us| [1, 3, 4, 5, 6, 8, 12].map(|ms| (us, ms)));
        for (us, ms) in moments {
            let later = |rig: &mut Rig| {
                let moment = rig.board.now_ms() * MILLISECOND + us * MICROSECOND;
                rig.board.machine.run_until(moment);
            };
            let records = |rig: &Rig| rig.hosts[index(port)].records.clone();
            rig.hosts[index(port)].records.clear();
            later(&mut rig);
            rig.write(port, &frame[..3]);
            rig.run(ms);
            later(&mut rig);
            rig.write(port, &frame[3..]);
            rig.run(60);
            let good = Response::good(FrameType::PidParam, DataStatus::NoError, 126);
            if ms <= 5 {
                assert_eq!(records(&rig), [good], "{ms} ms and {us} µs");
                continue;
            }
            let cut = Response::bad(0x07, FrameStatus::DiscontinuousFrame, 3);
            let rest = Response::bad(0, FrameStatus::IncorrectHeader, 0);
            let found = records(&rig);
            assert_eq!(found.len(), 2, "{ms} ms: {found:?}");
            assert_eq!(found[0], cut, "{ms} ms and {us} µs");
            assert_eq!(found[1].status, rest.status, "{ms} ms: the rest is not a frame");
        }
        assert_eq!(rig.status(port).jtc_init & 2, 0, "the gains were given");
    }
}

/// J-01, J-07: the board receives the longest possible frames on both lines at the same time. The board loses neither a
/// byte nor a tick.
fn longest_frames(mut rig: Rig) {
    rig.bring_up(A);
    let (accepted, refused) = (segment(1500), segment(1666));
    assert_eq!((accepted.len(), refused.len()), (54_014, 59_990));
    assert_eq!(
        rig.response(A, &accepted),
        Response::good(FrameType::Trajectory, DataStatus::NoError, 54_014)
    );
    for (a, b) in [(&refused, &refused), (&accepted, &refused)] {
        for host in &mut rig.hosts {
            host.records.clear();
        }
        rig.write(A, a);
        rig.write(B, b);
        rig.wait("both records", 6_000, |rig| rig.hosts.iter().all(|host| !host.records.is_empty()));
        rig.run(100);
        for (frame, host) in [a, b].into_iter().zip(&rig.hosts) {
            let code = if frame.len() > 55_000 { DataStatus::TooManyPoints } else { DataStatus::NoError };
            assert_eq!(host.records, [Response::good(FrameType::Trajectory, code, frame.len() as u16)]);
        }
    }
    assert_eq!(rig.status(A).trajectory, TrajectoryState::Stop, "the trajectory is there, at its start");
    no_losses(&mut rig);
}

#[test]
fn j01_frames_of_60_000_bytes_at_115_200_bd() {
    longest_frames(Rig::new(BOARDS[0]));
}

#[test]
fn j01_frames_of_60_000_bytes_at_15_mbd() {
    let rig = Rig::of(fast_elf(), &BoardConfig { baud: 15_000_000, ..Default::default() });
    longest_frames(rig);
}

/// J-04: the board sends each answer on the line of its request, in order, while frames arrive on the other line at the
/// same time.
#[test]
fn j04_every_port_gets_its_own_records() {
    let mut rig = Rig::new(BOARDS[0]);
    rig.run(50);
    let asked: [&[(FrameType, &[u8])]; 2] = [
        &[
            (FrameType::PidParamUseDefault, &fixed::PID_PARAM_USE_DEFAULT),
            (FrameType::GripperControl, &fixed::PUMP_OFF),
            (FrameType::ArmModelUseDefault, &fixed::ARM_MODEL_USE_DEFAULT),
            (FrameType::ClearOccurredErrors, &fixed::CLEAR_OCCURRED_ERRORS),
        ],
        &[
            (FrameType::TeachingModeEnable, &fixed::TEACHING_MODE_ENABLE),
            (FrameType::FrictionTableUseDefault, &fixed::FRICTION_TABLE_USE_DEFAULT),
            (FrameType::TrajSetExecStatus, &fixed::PAUSE),
        ],
    ];
    for round in 0..6 {
        for host in &mut rig.hosts {
            host.records.clear();
        }
        for (port, frames) in PORTS.into_iter().zip(asked) {
            // In each round, the host sends the frames in a different order.
            for (_, frame) in frames.iter().cycle().skip(round).take(frames.len()) {
                rig.write(port, frame);
            }
        }
        rig.run(300);
        for (host, frames) in rig.hosts.iter().zip(asked) {
            let expected = frames.iter().cycle().skip(round).take(frames.len());
            let expected: Vec<_> = expected.map(|(kind, bytes)| (*kind as u8, bytes.len() as u16)).collect();
            let records: Vec<_> = host.records.iter().map(|r| (r.frame_type, r.length)).collect();
            assert_eq!(records, expected, "round {round}");
            assert!(host.records.iter().all(|r| r.status == FrameStatus::NoError));
        }
    }
}

/// J-04: the board sends a response record "at once", that is, in the tick after the last byte of the frame.
#[test]
fn j04_a_record_waits_for_nothing_but_the_tick() {
    let mut rig = Rig::new(BOARDS[0]);
    rig.run(65);
    for shift in 0..40 {
        // The host sends the request right after a status, when the line is free again.
        let port = PORTS[shift % 2];
        rig.run(1 + shift as u64);
        rig.wait("the line is free", 50, |rig| rig.flight.status_free && rig.ticks % 40 > 25);
        let begin = rig.board.machine.now();
        rig.ask(port, &fixed::CLEAR_OCCURRED_ERRORS);
        let end = *rig.hosts[index(port)].times.last().expect("a status");
        // The expected time consists of six received bytes and 175 sent bytes at 87 µs each, and about one tick. If
        // the board has just begun to send a periodic status, the record comes up to 15.3 ms later.
        let took = to_us(end - begin);
        let without_waiting = 181 * 87 + 1_200;
        assert!(took < without_waiting + 15_300, "{took} µs");
    }
}

/// J-03, J-07: noise of any kind causes at most two error records. The board loses no frame that follows the noise,
/// with or without a gap.
#[test]
fn j03_noise_costs_no_frame_that_follows() {
    let mut rig = Rig::new(BOARDS[0]);
    rig.run(50);
    let every: Vec<u8> = (0..=255).collect();
    let header = [0x9B, 0x04, 0xEA, 0x46];
    let headers = [0x9B; 300];
    let zeros = [0; 1000];
    for (n, noise) in [&every[..], &header, &headers, &zeros, &[0x9B]].into_iter().enumerate() {
        for (gap, port) in [(8, A), (8, B), (0, A), (0, B)] {
            if gap == 0 && noise == header {
                // The header announces a frame of 59 974 bytes. The parser waits for a gap on the line before it
                // parses the bytes after this header.
                rig.write(port, noise);
            }
            rig.hosts[index(port)].records.clear();
            rig.write(port, noise);
            if gap > 0 {
                silence(&mut rig, port, gap);
            }
            rig.write(port, &fixed::CLEAR_OCCURRED_ERRORS);
            silence(&mut rig, port, 120);
            let records = &rig.hosts[index(port)].records;
            let (bad, good): (Vec<&Response>, Vec<&Response>) =
                records.iter().partition(|r| r.status != FrameStatus::NoError);
            assert_eq!(good.len(), 1, "noise {n}, gap {gap}: {records:?}");
            assert!((1..=2).contains(&bad.len()), "noise {n}, gap {gap}: {records:?}");
        }
    }
    no_losses(&mut rig);
}

/// J-07: continuous traffic on one port does not delay the tick (the rig checks this in every millisecond). A record
/// on the other port waits only for records that were queued before it.
#[test]
fn j07_a_flooding_port_does_not_starve_the_other() {
    for (flood, other) in [(A, B), (B, A)] {
        let mut rig = Rig::new(BOARDS[0]);
        rig.run(50);
        rig.write(flood, &fixed::CLEAR_OCCURRED_ERRORS.repeat(4_000));
        rig.run(500);
        for _ in 0..3 {
            let begin = rig.board.machine.now();
            rig.hosts[index(other)].records.clear();
            rig.write(other, &fixed::PID_PARAM_USE_DEFAULT);
            rig.wait("a record in spite of the flood", 400, |rig| {
                !rig.hosts[index(other)].records.is_empty()
            });
            let ms = (rig.board.machine.now() - begin) / MILLISECOND;
            println!("{flood:?} floods: answered after {ms} ms");
        }
        no_losses(&mut rig);
    }
}

/// J-04 at 15 MBd: while at most 64 records wait on a line, every frame gets its record.
#[test]
fn j04_a_host_that_pipelines_loses_no_record() {
    let mut rig = Rig::of(fast_elf(), &BoardConfig { baud: 15_000_000, ..Default::default() });
    rig.run(50);
    for round in 1..=10 {
        for port in PORTS {
            rig.write(port, &fixed::CLEAR_OCCURRED_ERRORS.repeat(64));
        }
        rig.wait("128 records", 1_000, |rig| rig.hosts.iter().all(|host| host.records.len() >= 64 * round));
        rig.run(10);
        for host in &rig.hosts {
            assert_eq!(host.records.len(), 64 * round);
            assert!(host.records.iter().all(Response::accepted));
        }
    }
    assert_eq!(rig.telemetry().records_lost, 0);
    no_losses(&mut rig);
}

/// Returns a board that moves the arm along a path. The host at port A controls the board.
fn moving(elf: openjtc_emulator::Elf, baud: u32) -> Rig {
    let mut rig = Rig::of(elf, &BoardConfig { baud, ..Default::default() });
    rig.bring_up(A);
    let from = rig.telemetry().joints.map(|joint| joint.position);
    let to = from.map(|q| q + 0.2);
    for segment in host::trajectory(&host::there_and_back(&from, &to, 2.0, 2, 50), 50, 100) {
        rig.ask(A, &segment);
    }
    rig.ask(A, &fixed::EXECUTE);
    rig.wait("the path", 1_000, |rig| rig.telemetry().point > 300);
    rig
}

/// J-04: a Stop takes effect in the tick after the last byte of the Stop frame, regardless of earlier bytes on either
/// line.
#[test]
fn j04_a_stop_waits_for_nothing() {
    let clear = fixed::CLEAR_OCCURRED_ERRORS;
    let noise = [0x55; 300];
    let header = [0x9B, 0x04, 0xEA, 0x56];
    let cases: [(u32, &[u8]); 5] = [
        (115_200, &clear.repeat(400)),
        (115_200, &noise),
        (115_200, &header),
        (15_000_000, &clear.repeat(4_000)),
        (15_000_000, &clear.repeat(40_000)),
    ];
    for (baud, before) in cases {
        for port in PORTS {
            let elf = if baud == 115_200 { elf(BOARDS[0]) } else { fast_elf() };
            let mut rig = moving(elf, baud);
            rig.write(port, &[before, &fixed::STOP].concat());
            while rig.board.pending(port) > 0 {
                rig.step();
                let stops = rig.flight.urgent.iter().any(|commands| !commands.is_empty());
                assert!(!stops || rig.board.pending(port) == 0, "not before it was sent");
                if stops {
                    break;
                }
            }
            // The last byte of the Stop frame is transmitted within this millisecond. Depending on the exact time,
            // the next tick or the tick after it finds the byte.
            let mut ticks = 0;
            while rig.flight.urgent[index(port)].is_empty() {
                ticks += 1;
                assert!(ticks <= 2, "{} bytes at {baud} Bd on {port:?}", before.len());
                rig.step();
            }
            rig.wait("standstill", 500, |rig| rig.telemetry().trajectory == jtc_core::TrajectoryState::Stop);
            rig.run(1);
            assert_eq!((rig.state(), rig.telemetry().errors), (jtc_core::ControllerState::HoldPos, 0));
        }
    }
}
