//! Tests of the exact times of one board. The board must not act a microsecond too early, and `next_deadline` must
//! return the exact time.

use ucom::Frame;
use ucom::node::{Phase, Store};

use super::bus::{Board, Bus, MS, frames};

fn frame(text: &str) -> Frame {
    text.parse().unwrap()
}

/// Takes the only board off the bus, and returns the board and the current time.
fn board(mut bus: Bus) -> (Board, u64) {
    (bus.boards.remove(0), bus.now)
}

/// Confirms all frames of the board immediately, and returns these frames.
fn flush(board: &mut Board, now: u64) -> Vec<Frame> {
    let mut left = Vec::new();
    while let Some(frame) = board.poll(now) {
        board.sent(now, &frame);
        left.push(frame);
        assert!(left.len() < 1000, "frames without end");
    }
    left
}

/// D-07: a board ignores frames until its boot is complete.
#[test]
fn d07_boot_time() {
    for after in ["power-up", "PC_RESET"] {
        let (mut board, now) = board(Bus::one());
        match after {
            "power-up" => board.power_up(now),
            _ => board.receive(now, &frame("000#")),
        }
        let up = now + board.config().boot_us;
        assert_eq!(board.next_deadline(), up, "{after}");
        board.receive(now + 1, &frame("281#"));
        board.overrun(now + 2);
        for (at, phase) in [(now, Phase::Booting), (up - 1, Phase::Booting), (up, Phase::Uninitialised)] {
            assert_eq!(board.poll(at), None, "{after}");
            assert_eq!(board.phase(), phase, "{after} at {}", at - now);
        }
        assert_eq!((board.number(), board.counters().ignored), (None, 0), "{after}: not received");
    }
}

/// While the flash is busy, a booting board checks the flash state every millisecond.
#[test]
fn boot_waits_for_the_flash() {
    let (mut board, now) = board(Bus::initialised());
    let up = now + board.config().boot_us;
    board.flash.erase_us = up + 2500 - now;
    let program = board.flash.program;
    ucom::node::Flash::erase(&mut board.flash, now, ucom::Memory::Program, program).unwrap();
    board.power_up(now);
    for at in [up, up + 1000, up + 2000] {
        assert_eq!((board.poll(at), board.phase()), (None, Phase::Booting), "{}", at - up);
        assert_eq!(board.next_deadline(), at + 1000);
    }
    board.poll(up + 2499);
    assert_eq!(board.phase(), Phase::Booting);
    board.poll(up + 2500);
    assert_eq!(board.phase(), Phase::Uninitialised);
    assert_eq!(board.next_deadline(), u64::MAX, "nothing to do");
}

/// D-43: the time between two frames of a block may be exactly 200 ms, but not a microsecond more.
#[test]
fn d43_pause_inside_a_block() {
    let (mut board, now) = board(Bus::initialised());
    board.receive(now, &frame("041#"));
    assert_eq!(board.next_deadline(), u64::MAX, "no frame, no pause");
    let data = frame("2C1#4355010001000000");
    board.receive(now, &data);
    assert_eq!(board.next_deadline(), now + 200 * MS + 1);
    board.receive(now + 200 * MS, &data);
    let now = now + 200 * MS;
    assert_eq!(board.phase(), Phase::Programming);
    assert_eq!(flush(&mut board, now + 200 * MS), []);
    assert_eq!(board.next_deadline(), now + 200 * MS + 1);
    assert_eq!(flush(&mut board, now + 200 * MS + 1), frames("081#0A"));
    assert_eq!(board.phase(), Phase::Aborted);
    assert_eq!(board.next_deadline(), u64::MAX);
}

/// D-42: the board processes a block after exactly the configured time.
#[test]
fn d42_block_time() {
    let (mut board, now) = board(Bus::initialised());
    board.receive(now, &frame("041#"));
    for data in super::bus::blocks(&[1; 64], &ucom::Profile::default())[0].chunks_exact(8) {
        board.receive(now, &Frame::new(0x2C1, data).unwrap());
    }
    let looked_at = now + board.config().block_us;
    assert_eq!(board.next_deadline(), looked_at);
    assert_eq!(flush(&mut board, looked_at - 1), []);
    assert_eq!(board.next_deadline(), looked_at);
    assert_eq!(flush(&mut board, looked_at), frames("181#"));
    assert_eq!(board.next_deadline(), u64::MAX);
}

/// D-25: the application starts automatically 500 ms after INITACK has been sent.
#[test]
fn d25_hold_off() {
    let (mut board, now) = board(Bus::one());
    board.store.set_autostart(true);
    board.receive(now, &frame("281#"));
    assert_eq!(board.next_deadline(), 0, "the acknowledge can go");
    assert_eq!(flush(&mut board, now), frames("0C1#01"));
    let start = now + 500 * MS;
    assert_eq!(board.next_deadline(), start);
    for (at, phase) in [(start - 1, Phase::Idle), (start, Phase::Starting)] {
        assert_eq!(flush(&mut board, at), []);
        assert_eq!(board.phase(), phase, "{}", at - now);
    }
    assert_eq!(board.next_deadline(), start + MS, "the application is asked again");
    // Without ASTART, the application does not start automatically.
    let (mut board, now) = self::board(Bus::one());
    board.receive(now, &frame("281#"));
    assert_eq!(flush(&mut board, now), frames("0C1#01"));
    assert_eq!(board.next_deadline(), u64::MAX);
    assert_eq!((flush(&mut board, start), board.phase()), (vec![], Phase::Idle));
}

/// D-33, D-35, D-50, D-51: a running board performs its periodic actions at exact times. If the PC's heartbeat is
/// missing, the board stops its control loop at the exact time limit.
#[test]
fn d33_d35_d50_d51_beats() {
    let (mut board, start) = board(Bus::started());
    let alive = board.next_deadline();
    assert!(start < alive && alive <= start + 1000 * MS);
    assert_eq!(flush(&mut board, alive - 1), []);
    assert_eq!(flush(&mut board, alive), frames("681#"));
    assert_eq!(board.next_deadline(), alive + 1000 * MS);
    let now = alive;
    board.receive(now, &frame("541#"));
    // The first control cycle is due 1 ms after the start command. The board answers the start command after 2 ms.
    assert_eq!(board.next_deadline(), now + MS);
    assert_eq!((flush(&mut board, now + MS - 1), board.application.steps), (vec![], 0));
    assert_eq!((flush(&mut board, now + MS), board.application.steps), (vec![], 1));
    assert_eq!(flush(&mut board, now + 2 * MS - 1), []);
    assert_eq!(flush(&mut board, now + 2 * MS), frames("601#01000000"));
    assert_eq!(board.application.steps, 2);
    // The board skips missed control cycles; later cycles run at their planned times.
    assert_eq!((flush(&mut board, now + 7 * MS + 300), board.application.steps), (vec![], 3));
    assert_eq!(board.next_deadline(), now + 8 * MS);
    assert_eq!(flush(&mut board, now + 10 * MS - 1), []);
    assert_eq!(flush(&mut board, now + 10 * MS).len(), 2, "all outputs");
    assert_eq!(flush(&mut board, now + 20 * MS - 1), []);
    assert_eq!(flush(&mut board, now + 20 * MS).len(), 2);
    // From here on, the PC sends no frame, so the heartbeat of the PC is missing after 1500 ms.
    flush(&mut board, now + 1500 * MS - 1);
    assert_eq!(board.phase(), Phase::Running);
    board.poll(now + 1500 * MS);
    assert_eq!(board.phase(), Phase::Ready);
}

/// D-50: a board considers the PC lost 1500 ms after the PC's last heartbeat.
#[test]
fn d50_heartbeat_of_the_pc() {
    let (mut board, now) = board(Bus::running());
    board.receive(now, &frame("680#"));
    flush(&mut board, now + 1500 * MS - 1);
    assert_eq!(board.phase(), Phase::Running);
    // A heartbeat that arrives exactly 1500 ms after the previous heartbeat is too late.
    board.receive(now + 1500 * MS, &frame("680#"));
    assert_eq!(board.phase(), Phase::Ready);
}

/// If frames become due while the CAN controller is sending another frame, the board returns them as soon as the
/// controller has sent this frame.
#[test]
fn what_waits_goes_when_the_frame_before_has_left() {
    let programming = || {
        let mut bus = Bus::initialised();
        bus.send("041#");
        bus
    };
    let last_block = || {
        let mut bus = programming();
        let all = super::bus::blocks(&[1; 64], &ucom::Profile::default());
        for block in &all[..3] {
            assert_eq!(bus.block(block, 200), frames("181#"));
        }
        (bus, all[3])
    };
    let block = |bus: &mut Bus, block: &[u8; 64]| {
        for data in block.chunks_exact(8) {
            bus.send_frame(&Frame::new(0x2C1, data).unwrap());
        }
        bus.run(200);
    };
    type Case = (&'static str, fn() -> Bus, &'static str, &'static str);
    let cases: [Case; 7] = [
        ("error", Bus::initialised, "1C1#00", "081#07"),
        ("READY of the application", Bus::started, "301#", "501#"),
        ("heartbeat", Bus::started, "", "681#"),
        ("info", Bus::initialised, "201#", "141#2100011B34126E38"),
        ("inputs", Bus::started, "5C1#", "6C1#0000000000000000"),
        ("description", Bus::started, "581#", "581#020004000300"),
        ("flags", Bus::started, "601#00000100", "601#00000100"),
    ];
    let acknowledge = frame("0C1#01");
    for (what, state, text, expected) in cases {
        let mut bus = state();
        bus.hold = |_| true;
        bus.send("281#");
        bus.run(1);
        assert_eq!(bus.held, [(0, acknowledge)], "{what}");
        if !text.is_empty() {
            bus.send(text);
        }
        bus.run(if text.is_empty() { 1000 } else { 5 });
        let (mut board, now) = board(bus);
        board.sent(now, &acknowledge);
        assert!(board.next_deadline() <= now, "{what}: {} at {now}", board.next_deadline());
        assert_eq!(board.poll(now), Some(frame(expected)), "{what}");
    }
    // In this case, INITACK waits while a DSP_ERROR frame is in the CAN controller.
    let mut bus = Bus::initialised();
    bus.hold = |_| true;
    bus.send("1C1#00");
    bus.run(1);
    bus.send("281#");
    let (mut waiting, now) = board(bus);
    waiting.sent(now, &frame("081#07"));
    assert_eq!((waiting.next_deadline(), waiting.poll(now)), (0, Some(acknowledge)));
    // In these cases, the answers to program data (DSP_READY and DSP_PROGFINISHED) wait while INITACK is in the CAN
    // controller.
    let (whole, last) = last_block();
    let first = super::bus::blocks(&[1; 64], &ucom::Profile::default())[0];
    for (mut bus, data, expected) in [(programming(), first, "181#"), (whole, last, "101#")] {
        bus.hold = |_| true;
        bus.send("281#");
        block(&mut bus, &data);
        let (mut board, now) = board(bus);
        board.sent(now, &acknowledge);
        assert_eq!((board.next_deadline(), board.poll(now)), (0, Some(frame(expected))));
    }
}

/// D-36: after the last package of a dump, no action of the board is due, for any number of inputs.
#[test]
fn d36_a_dump_ends_with_its_last_package() {
    for (dimension, packages) in [(0, 0), (1, 1), (2, 1), (3, 1), (4, 2), (6, 2), (7, 3)] {
        let mut bus = Bus::initialised();
        let names = vec!["x"; dimension];
        bus.boards[0].application = ucom_sim::memory::MemoryApplication::new("x", &names, &[], &[]);
        bus.send("301#");
        bus.run(50);
        let (mut board, now) = board(bus);
        board.receive(now, &frame("5C1#"));
        for i in 0..packages {
            assert_eq!(board.next_deadline(), 0, "package {i} of {packages}");
            let package = board.poll(now).unwrap();
            assert_eq!((package.id(), package.data()[0]), (0x6C1, 3 * i));
            board.sent(now, &package);
        }
        if packages > 0 {
            assert!(board.next_deadline() > now, "{dimension} inputs");
        }
        assert_eq!(board.poll(now), None, "{dimension} inputs");
        assert!(board.next_deadline() > now, "{dimension} inputs");
    }
}

/// D-14: the packages of an answer follow one another without a pause. After the last package, no action of the board is due at once.
#[test]
fn d14_packages_follow_back_to_back() {
    type Case = (&'static str, fn() -> Bus, &'static str, u16, usize);
    let cases: [Case; 5] = [
        ("info", Bus::initialised, "201#", 0x141, 4),
        // The answer consists of the dimensions, a name of two packages and nine names of one package; each name also has a header.
        ("description", Bus::started, "581#", 0x581, 1 + 3 + 2 * 9),
        ("inputs", Bus::started, "5C1#", 0x6C1, 1),
        ("outputs", Bus::running, "", 0x381, 2),
        ("text", Bus::started, "601#00000100", 0x641, 4),
    ];
    for (what, state, text, id, packages) in cases {
        let mut bus = state();
        if what == "text" {
            bus.ask(text, 5);
            bus.boards[0].application.debug.push(b"three packages long".to_vec());
        }
        let (mut board, mut now) = board(bus);
        if what != "text" && !text.is_empty() {
            board.receive(now, &frame(text));
        }
        let mut package = loop {
            if let Some(frame) = board.poll(now) {
                break frame;
            }
            now = now.max(board.next_deadline());
        };
        for i in 1..=packages {
            assert_eq!(package.id(), id, "{what}, package {i}");
            assert_eq!(board.poll(now), None, "{what}, package {i} has not left");
            assert!(board.next_deadline() > now, "{what}, package {i} has not left");
            board.sent(now, &package);
            if i < packages {
                assert!(board.next_deadline() <= now, "{what}, after package {i}");
                package = board.poll(now).unwrap_or_else(|| panic!("{what}, after package {i}"));
            }
        }
        assert!(board.next_deadline() > now, "{what} is over");
        assert_eq!(board.poll(now), None, "{what} is over");
    }
}

/// D-42, D-44: each step of the board after the last block of an update is short. The board polls the flash every 500 µs. The board reads
/// the image back in steps of 1024 bytes without a pause.
#[test]
fn d44_steps_after_the_last_block() {
    let mut bus = Bus::initialised();
    bus.send("041#");
    let image: Vec<u8> = (0..2560).map(|i| (i % 251) as u8).collect();
    let all = super::bus::blocks(&image, &ucom::Profile::default());
    let (last, before) = all.split_last().unwrap();
    for block in before {
        assert_eq!(bus.block(block, 200), frames("181#"));
    }
    let (mut board, mut now) = board(bus);
    for data in last.chunks_exact(8) {
        board.receive(now, &Frame::new(0x2C1, data).unwrap());
    }
    let mut waits = Vec::new();
    let finished = loop {
        let next = board.next_deadline();
        waits.push(next.saturating_sub(now));
        assert!(waits.len() < 20, "{waits:?}");
        now = now.max(next);
        if let Some(frame) = board.poll(now) {
            break frame;
        }
    };
    assert_eq!(finished, frame("101#"));
    // Waits in µs: 400 until the block is processed, and 500 to write the block. The three pieces of the image are
    // read back without a wait. Two waits of 500 follow until the record is complete.
    assert_eq!(waits, [400, 500, 0, 0, 0, 500, 500]);
}

/// D-05: the random delays come from Marsaglia's xorshift32, which has no short cycle. If a seed would set the generator's state to 0, the
/// state is set to 1.
#[test]
fn d05_random_delays() {
    // The expected values are the published sequence of random numbers that begins at state 1.
    let expected = [270_369, 67_634_689, 2_647_435_461u32, 307_599_695, 2_398_689_233];
    let mixed = 0x21u32.wrapping_mul(0x9E37_79B9);
    for seed in [mixed ^ 1, mixed] {
        let profile = ucom::Profile { shared_backoff: 50, ..ucom::Profile::default() };
        let config = ucom::node::NodeConfig { seed, profile, ..ucom::node::NodeConfig::new(0x21) };
        let Board { flash, pins, store, mut application, .. } = board(Bus::one()).0;
        application.start_us = 0;
        let mut board = ucom::node::Node::new(config, flash, pins, store, application, 0);
        let mut now = config.boot_us;
        board.receive(now, &frame("281#"));
        assert_eq!(flush(&mut board, now), frames("0C1#01"));
        for random in expected {
            board.receive(now, &frame("301#"));
            assert_eq!(flush(&mut board, now), frames("501# 681#"));
            let due = now + u64::from(1 + random % 50) * MS;
            assert_eq!(board.next_deadline(), due, "{random}");
            assert_eq!(flush(&mut board, due), frames("601#00000000"));
            board.receive(due, &frame("1C1#8000"));
            now = due;
        }
    }
}
