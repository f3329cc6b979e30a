//! Tests with a million random frames, and a test of the size of a board.

use ucom::node::Phase;
use ucom::{Frame, Profile};

use super::bus::{Board, Bus};

/// Random generator splitmix64, which returns the same numbers for the same seed.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }
}

/// D-20: a million random frames arrive at any time. The status byte of a board is always consistent, and no two
/// boards have the same number. Outputs are active only while the control loop runs, and boards send only frames of
/// the protocol.
#[test]
fn d20_a_million_random_frames() {
    let seed = std::env::var("UCOM_SEED").ok().and_then(|text| text.parse().ok()).unwrap_or(2026);
    println!("UCOM_SEED={seed}");
    let mut random = Random(seed);
    let mut bus = Bus::new(&[0x21, 0x42, 0x63], Profile::default());
    let mut seen = std::collections::BTreeMap::new();
    for i in 0..1_000_000u32 {
        // Most frames of the test are valid messages, because random identifiers alone never bring a board out of state S1.
        let function = if random.below(8) == 0 { random.below(32) } else { random.below(28) };
        let sequence = if random.below(8) == 0 { random.below(64) } else { random.below(4) };
        let (len, data) = match random.below(3) {
            0 => (random.below(9) as usize, random.next()),
            1 => (8, random.next() & 0x0101_0101_0101_0101),
            _ => (0, 0),
        };
        let id = (function << 6 | sequence) as u16 & 0x7FF;
        // The test skips most resets, because with frequent resets all boards would remain in state S1.
        if id >> 6 == 0 && random.below(50) != 0 {
            continue;
        }
        let frame = match (id >> 6, random.below(4)) {
            (7, 0..=2) => Frame::new(id, &[1 << random.below(8), random.next() as u8 & 1 << random.below(8)]),
            _ => Frame::new(id, &data.to_le_bytes()[..len]),
        }
        .unwrap();
        for board in &mut bus.boards {
            board.receive(bus.now, &frame);
        }
        bus.check();
        if random.below(4) == 0 {
            bus.run_us(random.below(3000));
        }
        if random.below(5000) == 0 {
            bus.run(random.below(2500));
        }
        if random.below(20_000) == 0 {
            let now = bus.now;
            bus.boards[random.below(3) as usize].restart(now);
        }
        for board in &bus.boards {
            *seen.entry(format!("{:?}", board.phase())).or_insert(0u32) += 1;
            let application = &board.application;
            assert!(!application.active || board.phase() == Phase::Running, "frame {i}: {frame}");
            assert_eq!(application.running, board.phase() == Phase::Running, "frame {i}: {frame}");
        }
        for (_, frame) in bus.received.drain(..) {
            assert!(ucom::FromBoard::decode(&frame, &Profile::default()).is_ok(), "{frame}");
        }
    }
    println!("{seen:?}");
    for phase in ["Uninitialised", "Idle", "Programming", "Aborted", "Starting", "Ready", "Running"] {
        assert!(seen.get(phase).is_some_and(|count| *count > 1000), "{phase} was hardly reached: {seen:?}");
    }
}

/// The state of a board fits into 4 KiB, without its flash and the buffers of its application.
#[test]
fn size_of_a_board() {
    use ucom_sim::memory::{MemoryApplication, MemoryFlash, MemoryStore, WirePins};
    let parts = size_of::<MemoryFlash>()
        + size_of::<WirePins>()
        + size_of::<MemoryStore>()
        + size_of::<MemoryApplication>();
    let node = size_of::<Board>() - parts;
    println!("{node} bytes");
    assert!(node <= 4096, "{node} bytes");
}
