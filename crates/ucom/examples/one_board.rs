//! Simulates one board on an in-memory bus. The PC resets the board, assigns it a number, starts its application and
//! its control loop, and then stops sending.
//!
//! `cargo run -p ucom --example one_board` prints the frames with their times. In the output, `<` marks frames of the
//! PC, and `>` marks frames of the board.

use ucom::node::{Node, NodeConfig, Record};
use ucom::{Admin, Frame, Profile, Sequence, ToBoard};
use ucom_sim::memory::{MemoryApplication, MemoryFlash, MemoryStore, WirePins};

fn main() {
    let profile = Profile::default();
    let number = Sequence::new(1).expect("1 is at most 31");

    // A board consists of a state machine and four hardware parts. In this example, the hardware parts are simulated in memory.
    let mut flash = MemoryFlash::default();
    flash.install(Record { program_id: 0x1234, date: 0x386E, address: 0, words: 4 }, &[0; 8]);
    let pins = WirePins::chain(1).remove(0);
    let store = MemoryStore { autostart: false, description: b"UCoM2 head pan".to_vec() };
    let application = MemoryApplication::new("head pan", &["position"], &["position", "current"], &["kp"]);
    let mut board = Node::new(NodeConfig::new(0x0021), flash, pins, store, application, 0);

    let script = [
        (300, ToBoard::Reset, Sequence::ZERO),
        (50, ToBoard::Init, number),
        (50, ToBoard::Info, number),
        (50, ToBoard::Start, number),
        (50, ToBoard::DumpIo, number),
        (15, ToBoard::Admin(Admin { run: true, active: true, ..Admin::default() }), number),
    ];
    let mut now_us = 100_000;
    for (wait_ms, message, to) in script {
        let frame = message.encode(to, &profile);
        print('<', now_us, &frame);
        board.receive(now_us, &frame);
        now_us = pass(&mut board, now_us, wait_ms);
    }
    println!("the PC falls silent; outputs every 10 ms are not shown");
    pass(&mut board, now_us, 2000);
    println!("status: {}", board.status());
}

/// Advances the simulated time by `ms` milliseconds. The time jumps from one due action of the board to the next.
fn pass(
    board: &mut Node<MemoryFlash, WirePins, MemoryStore, MemoryApplication>,
    mut now_us: u64,
    ms: u64,
) -> u64 {
    let end = now_us + 1000 * ms;
    while now_us < end {
        if let Some(frame) = board.poll(now_us) {
            if frame.id() != 0x381 {
                print('>', now_us, &frame);
            }
            // The frame takes about 55 µs plus 10 µs for each data byte at 1 Mbit/s.
            now_us += 55 + 10 * u64::from(frame.dlc());
            board.sent(now_us, &frame);
        } else {
            now_us = board.next_deadline().clamp(now_us + 1, end);
        }
    }
    end
}

fn print(who: char, now_us: u64, frame: &Frame) {
    let name = frame.address().map_or("", |(function, _)| function.name());
    println!("{:9.3} ms {who} {:<22} {name}", now_us as f64 / 1000.0, frame.to_string());
}
