//! J-07: tests with any bytes on the serial lines and any frames on the joint bus. The program does not hang, no tick
//! is missed, and no reset occurs. In every tick, the outputs of the board equal the outputs of a controller on the
//! PC with the same inputs; the module `rig` checks this.
mod rig;

use std::path::Path;

use can_link::{CanFrame, Id};
use jtc_wire::fuzzing::{Event, body_frame, events, sealed, stream_regions};
use jtc_wire::{FRAME_MAX, FrameStatus, fixed};
use openjtc_emulator::clock::{MICROSECOND, to_ns};
use openjtc_emulator::{BoardConfig, FIRST_LINE, Port};
use rig::{BOARDS, PORTS, Rig, fast_elf, index};

const TIM7: usize = FIRST_LINE + 55;

fn fast() -> Rig {
    Rig::of(fast_elf(), &BoardConfig { baud: 15_000_000, ..Default::default() })
}

/// Returns all stored inputs of a fuzz target, with their file names.
fn kept(target: &str) -> Vec<(String, Vec<u8>)> {
    let fuzz = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fuzz"));
    let mut inputs = Vec::new();
    for kind in ["corpus", "regressions"] {
        let Ok(files) = std::fs::read_dir(fuzz.join(kind).join(target)) else { continue };
        for file in files {
            let path = file.expect("a readable directory").path();
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            inputs.push((name, std::fs::read(&path).expect("a readable file")));
        }
    }
    assert!(!inputs.is_empty(), "nothing is kept for {target}");
    inputs.sort();
    inputs
}

/// Checks the state at the end of a test: one tick per millisecond, no restart, no fault, and a board that answers.
fn unharmed(mut rig: Rig) {
    for port in PORTS {
        rig.wait("the line falls silent", 60_000, |rig| rig.board.pending(port) == 0);
    }
    // The last bytes may be the beginning of a frame. A gap of 20 ms ends this frame.
    rig.run(20);
    rig.wait("every record", 60_000, |rig| {
        for host in &mut rig.hosts {
            host.records.clear();
        }
        let before = rig.hosts.each_ref().map(|host| host.times.len());
        rig.run(45);
        rig.hosts.iter().zip(before).all(|(host, n)| host.records.is_empty() && host.times.len() > n)
    });
    for port in PORTS {
        let response = rig.response(port, &fixed::CLEAR_OCCURRED_ERRORS);
        assert_eq!(response.status, FrameStatus::NoError);
    }
    let (ticks, ms) = (rig.ticks, rig.board.now_ms());
    assert!(ticks <= ms && ticks + 5 >= ms, "{ticks} ticks in {ms} ms");
    let chip = rig.board.machine.chip();
    assert_eq!((chip.observers.resets.len(), chip.observers.faults.len()), (1, 0));
    assert!(chip.unknown.is_empty() && chip.unclocked.is_empty());
    assert!(chip.usarts.iter().all(|u| u.overruns == 0), "a byte was lost");
    let late = to_ns(chip.observers.latencies[TIM7].worst);
    println!("the tick began at most {late} ns late");
    assert!(late < 1_000, "{late} ns");
}

/// J-03, J-04, J-05: the records on the line equal the records of a parser on the PC that receives the same bytes.
/// Two differences are allowed: the board may merge noise records, and it may lose records while more than 64 records
/// are waiting.
#[test]
fn j03_records_of_kept_streams_are_those_of_the_reference() {
    let mut rig = fast();
    rig.run(20);
    for (n, (name, input)) in kept("stream_parser").into_iter().enumerate() {
        let port = PORTS[n % 2];
        let regions = stream_regions(&input);
        let mut expected = Vec::new();
        let lost_before = rig.telemetry().records_lost as usize;
        rig.hosts[index(port)].records.clear();
        for region in &regions {
            rig.write(port, region);
            rig.wait("the line falls silent", 5_000, |rig| rig.board.pending(port) == 0);
            rig.run(8);
            for event in events(std::slice::from_ref(region), FRAME_MAX) {
                expected.push(match event {
                    Event::Frame(bytes) => (bytes[1], FrameStatus::NoError, bytes.len() as u16),
                    Event::Bad(bad) => (bad.frame_type, bad.status, bad.length),
                });
            }
            // At this bit rate, the board sends a record every millisecond. Therefore, 80 ms are enough for the 64
            // records that can wait.
            rig.run(80);
        }
        rig.run(10);
        let records = rig.hosts[index(port)].records.iter();
        let records: Vec<_> = records.map(|r| (r.frame_type, r.status, r.length)).collect();
        let lost = rig.telemetry().records_lost as usize - lost_before;
        // If a noise record is still waiting, the board adds new noise to this record. The board does not merge other
        // records.
        let noise = |record: &&(u8, FrameStatus, u16)| record.0 == 0;
        let count = |all: &[(u8, FrameStatus, u16)]| all.iter().filter(|record| !noise(record)).count();
        assert!(count(&records) + lost >= count(&expected), "{name}: {records:?} instead of {expected:?}");
        assert_eq!(
            records.iter().any(|r| noise(&r)),
            expected.iter().any(|r| noise(&r)),
            "{name}: noise is answered"
        );
        let mut rest = expected.iter();
        let in_order = records.iter().all(|record| rest.any(|other| other == record));
        assert!(in_order, "{name}: {records:?} instead of {expected:?}");
    }
    unharmed(rig);
}

/// J-07: the board executes the stored inputs of the fuzz target `frame_bodies`, which are valid frames with
/// arbitrary contents.
#[test]
fn j07_kept_frames_with_any_body() {
    let mut rig = fast();
    rig.bring_up(Port::Usart2);
    for (n, (_, input)) in kept("frame_bodies").into_iter().enumerate() {
        if let Some(frame) = body_frame(&input) {
            rig.write(PORTS[n % 2], &frame);
            rig.run(2);
        }
    }
    unharmed(rig);
}

/// J-07: random bytes put both serial lines under full load, with the 15 MBd firmware and with the firmware of
/// another board at the default bit rate.
#[test]
fn j07_random_bytes() {
    for (seed, mut rig, bytes) in [(1, fast(), 150_000), (2, Rig::new(BOARDS[2]), 6_000)] {
        println!("seed {seed}");
        let mut rng = fastrand::Rng::with_seed(seed);
        rig.bring_up(Port::Usart3);
        for port in PORTS {
            // The random bytes contain many header bytes, because the parser reacts to headers.
            let noise: Vec<u8> =
                (0..bytes).map(|_| if rng.u8(..) < 40 { 0x9B } else { rng.u8(..) }).collect();
            rig.write(port, &noise);
        }
        unharmed(rig);
    }
}

/// J-07: the board receives frames with a valid CRC, and with a random type, length and body.
#[test]
fn j07_random_frames_of_hosts() {
    let mut rng = fastrand::Rng::with_seed(3);
    let mut rig = fast();
    rig.bring_up(Port::Usart2);
    for n in 0..600 {
        let lengths = [0, 1, 4, 4, 8, 44, 96, 120, 144, 532, 10_560, rng.usize(0..3_000)];
        let body: Vec<u8> = (0..lengths[rng.usize(0..lengths.len())]).map(|_| rng.u8(..)).collect();
        rig.write(PORTS[n % 2], &sealed(rng.u8(0..0x14), &body));
        rig.run(1);
    }
    unharmed(rig);
}

/// J-15: random CAN frames arrive on the joint bus between the frames of the simulated nodes.
#[test]
fn j15_random_frames_on_the_joint_bus() {
    for seed in 4..7 {
        println!("seed {seed}");
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut rig = Rig::new(BOARDS[0]);
        rig.bring_up(Port::Usart2);
        for _ in 0..1_500 {
            for _ in 0..rng.usize(0..6) {
                let frame = random_frame(&mut rng);
                let chip = rig.board.machine.chip();
                let ready = chip.now() + rng.u64(0..1_000) * MICROSECOND;
                chip.fdcan.wire.put(ready, frame);
            }
            rig.step();
        }
        // When the random frames end, the joint bus recovers, and a host can clear the errors.
        rig.wait("the bus is free", 1_000, |rig| rig.board.machine.chip().fdcan.wire.waiting() < 8);
        rig.run(50);
        rig.ask(Port::Usart2, &jtc_sim::host::clear_all());
        rig.wait_for_hold(15_000);
        unharmed(rig);
    }
}

fn random_frame(rng: &mut fastrand::Rng) -> CanFrame {
    const LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 16, 20, 24, 48, 64];
    let id = match rng.u8(0..4) {
        0 => rng.u32(0..0x800),
        // The test sends answers with identifiers of existing and non-existing nodes.
        _ => [0x200, 0x200, 0x210, 0x2F0][rng.usize(0..4)] + rng.u32(0..9),
    };
    let standard = Id::standard(id).expect("11 bits");
    let length = LENGTHS[rng.usize(0..16)];
    let data: Vec<u8> =
        (0..length).map(|_| [0, 0xFF, 0x80, rng.u8(..), rng.u8(..)][rng.usize(0..5)]).collect();
    let frame = match rng.u8(0..8) {
        0 => CanFrame::classic(standard, &data[..length.min(8)]),
        1 => CanFrame::remote(standard, length.min(8)),
        2 => Id::extended(id << 18).and_then(|id| CanFrame::fd(id, &data)),
        _ => CanFrame::fd(standard, &data),
    };
    frame.expect("a length that it can have")
}
