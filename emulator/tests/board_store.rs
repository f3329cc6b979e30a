//! J-54: tests of the stored arm. To simulate a loss of power, the test copies the flash contents of an emulated board
//! to the next board. The test requests a store through the mailbox of the firmware, which is accessible only to a test
//! or a debugger.
mod rig;

use jtc_wire::{Name, SettingValue, StoreState, fixed, set_settings};
use openjtc_emulator::clock::{MICROSECOND, MILLISECOND, SECOND};
use openjtc_emulator::flash::{BANK2, Bank2, OperationKind, WORD, sr};
use openjtc_emulator::observe::ResetCause;
use openjtc_emulator::{BoardConfig, FIRST_LINE, Machine, Port};
use rig::{BOARDS, Rig, elf};

/// Exception number of the tick interrupt.
const TIM7: usize = FIRST_LINE + 55;
const IMAGE_MAX: usize = jtc_core::slots::IMAGE_MAX;
/// Flash addresses of the slots of the stored arm.
const SLOTS: [u32; 2] = [BANK2 + 6 * 0x2_0000, BANK2 + 7 * 0x2_0000];

/// The mailbox of the firmware, with its words in the order of `firmware/src/arm_store.rs`.
#[derive(Debug, PartialEq)]
struct Mailbox {
    state: u32,
    length: u32,
    sequence: u32,
    failure: u32,
    staging: u32,
    loaded: [u32; 3],
}

const ASKED: u32 = 1;
const DONE: u32 = 3;
const FAILED: u32 = 4;

fn mailbox(machine: &Machine) -> Mailbox {
    let at = machine.elf().symbol("ARM_STORE").expect("the mailbox").address;
    let word = |n: u32| machine.word(at + 4 * n).expect("memory");
    let [state, length, sequence, failure, staging] = core::array::from_fn(|n| word(n as u32));
    Mailbox { state, length, sequence, failure, staging, loaded: [word(5), word(6), word(7)] }
}

/// Returns the image that the firmware found when it started, with the sequence number of the image.
fn loaded(machine: &Machine) -> Option<(Vec<u8>, u32)> {
    let [address, length, sequence] = mailbox(machine).loaded;
    (address != 0).then(|| (machine.memory(address, length as usize).expect("memory"), sequence))
}

/// Requests a store through the mailbox, like a store request of a host.
fn ask(machine: &mut Machine, image: &[u8]) {
    let at = machine.elf().symbol("ARM_STORE").expect("the mailbox").address;
    let staging = mailbox(machine).staging;
    assert!(machine.poke(staging, image));
    assert!(machine.poke(at + 4, &(image.len() as u32).to_le_bytes()));
    assert!(machine.poke(at, &ASKED.to_le_bytes()));
}

/// Returns a board with these flash contents, some ticks after its start. Erasing a sector takes only 100 ms on this
/// board; tests that need the real erase time set it themselves.
fn board(bank2: Bank2) -> Rig {
    let mut rig = Rig::with(BOARDS[0], BoardConfig { bank2, ..Default::default() });
    rig.board.machine.chip().flash.erase_time = 100 * MILLISECOND;
    rig.wait("the board is up", 50, |rig| rig.ticks > 3);
    rig
}

fn image(length: usize, seed: u64) -> Vec<u8> {
    let mut rng = fastrand::Rng::with_seed(seed);
    (0..length).map(|_| rng.u8(..)).collect()
}

#[track_caller]
fn store(rig: &mut Rig, image: &[u8]) {
    store_after_resets(rig, image);
    clean(rig);
}

#[track_caller]
fn store_after_resets(rig: &mut Rig, image: &[u8]) {
    ask(&mut rig.board.machine, image);
    rig.wait("the image is stored", 4_000, |rig| !working(rig));
    assert_eq!(mailbox(&rig.board.machine).state, DONE);
}

fn working(rig: &Rig) -> bool {
    !matches!(mailbox(&rig.board.machine).state, DONE | FAILED)
}

/// Checks the conditions that must be true after every flash operation of a test.
#[track_caller]
fn clean(rig: &mut Rig) {
    let chip = rig.board.machine.chip();
    assert!(chip.observers.faults.is_empty(), "{:x?}", chip.observers.faults);
    let causes: Vec<_> = chip.observers.resets.iter().map(|r| r.cause).collect();
    assert_eq!(causes, [ResetCause::PowerOn]);
    assert!(chip.unknown.is_empty(), "{:x?}", chip.unknown);
    let late = chip.observers.latencies[TIM7];
    assert!(late.worst <= MICROSECOND, "the tick began late: {late:?}");
    assert!(2 * chip.iwdg.least_left > 5 * MILLISECOND, "the watchdog was near");
    let flash = &chip.flash;
    assert_eq!(flash.stalls, [], "the core stood still");
    assert_eq!(flash.ahead, 0, "bank 2 was memory that the core reads ahead");
    assert_eq!(flash.overwrites, 0, "a word was programmed twice");
    assert!(
        flash.longest_open <= MICROSECOND / 4,
        "open while busy for {} µs",
        flash.longest_open / MICROSECOND
    );
    assert!(!flash.bank1_unlocked);
    let outside = |at: u32| at < SLOTS[0];
    let wrong = flash.operations.iter().find(|operation| match operation.kind {
        OperationKind::Erase { sector } => sector < 6,
        OperationKind::Program { address } => outside(address),
    });
    assert_eq!(wrong, None, "the first sectors are not the store's");
}

/// J-54: a stored image survives a loss of power, and the previous image remains in flash until the next store.
#[test]
fn j54_a_stored_image_outlasts_the_power() {
    let mut rig = board(Bank2::default());
    assert_eq!(loaded(&rig.board.machine), None, "a new board has none");
    let images = [image(IMAGE_MAX, 1), image(1, 2), image(1000, 3), image(64, 4)];
    for (n, image) in images.iter().enumerate() {
        let sequence = n as u32 + 1;
        let before = loaded(&rig.board.machine);
        rig.board.machine.chip().flash.erase_time = 2 * SECOND;
        store(&mut rig, image);
        assert_eq!(mailbox(&rig.board.machine).sequence, sequence);
        assert_eq!(loaded(&rig.board.machine), before, "what is in use changes with the next start only");
        rig = board(rig.board.machine.cut_power(n as u64));
        assert_eq!(loaded(&rig.board.machine), Some((image.clone(), sequence)));
        clean(&mut rig);
    }
    // If two images are stored without a restart between them, the board starts with the image that was stored last.
    store(&mut rig, &images[2]);
    store(&mut rig, &images[1]);
    let rig = board(rig.board.machine.cut_power(9));
    assert_eq!(loaded(&rig.board.machine), Some((images[1].clone(), 6)));
}

/// J-50 to J-54: a host uploads an arm with frames and requests the board to store the arm. After a loss of power, the
/// board starts with this arm.
#[test]
fn j54_an_arm_that_a_host_gives_is_the_boards_after_a_loss_of_power() {
    const HOST: Port = Port::Usart3;
    let mut rig = board(Bank2::default());
    rig.ask(HOST, &fixed::GET_INFO);
    rig.run(60);
    let info = rig.hosts[1].info.expect("an Info");
    assert_eq!((info.store, info.boots, info.board.as_str()), (StoreState::Empty, 1, BOARDS[0]));
    assert_eq!(rig.hosts[0].info, None, "the other line receives nothing");

    let mut settings = [0; 26];
    let values = [
        SettingValue { setting: 33, joint: 0, value: 1.5 },
        SettingValue { setting: 8, joint: 3, value: 1.3 },
    ];
    let n = set_settings(&mut settings, values).expect("it fits");
    rig.ask(HOST, &settings[..n]);
    rig.ask(HOST, &fixed::set_name(&Name::cut("on the wall")));
    for frame in
        [fixed::FRICTION_POLYNOMIAL_USE_DEFAULT, fixed::PID_PARAM_USE_DEFAULT, fixed::ARM_MODEL_USE_DEFAULT]
    {
        rig.ask(HOST, &frame);
    }
    rig.ask(HOST, &fixed::STORE_ARM);
    rig.wait("the arm is stored", 4_000, |rig| !working(rig));
    assert_eq!(mailbox(&rig.board.machine).state, DONE);
    // The next tick detects that the image is stored.
    rig.run(2);
    rig.ask(HOST, &fixed::GET_INFO);
    rig.run(60);
    let given = rig.hosts[1].info.expect("an Info");
    assert_eq!((given.store, given.sequence, given.arm.as_str()), (StoreState::Stored, 1, "on the wall"));

    let mut rig = board(rig.board.machine.cut_power(5));
    rig.ask(HOST, &fixed::GET_INFO);
    rig.run(60);
    let again = rig.hosts[1].info.expect("an Info");
    assert_eq!((again.arm, again.defaults_stored, again.missing), (given.arm, true, 7));
    for frame in
        [fixed::FRICTION_POLYNOMIAL_USE_DEFAULT, fixed::PID_PARAM_USE_DEFAULT, fixed::ARM_MODEL_USE_DEFAULT]
    {
        rig.ask(HOST, &frame);
    }
    rig.ask(HOST, &fixed::GET_INFO);
    rig.run(60);
    let used = rig.hosts[1].info.expect("an Info");
    assert_eq!((used.hash, used.missing), (given.hash, 0));
    clean(&mut rig);
}

/// J-12: while a sector is erased, which takes seconds, every tick is on time. The number of instructions of a tick
/// changes by at most 32.
#[test]
fn j12_no_tick_is_late_while_the_flash_works() {
    let run = |ask_for: Option<&[u8]>| {
        let mut rig = board(Bank2::default());
        rig.board.machine.chip().flash.erase_time = 4 * SECOND;
        rig.board.machine.chip().observers.clear();
        if let Some(image) = ask_for {
            ask(&mut rig.board.machine, image);
        }
        rig.run(4_500);
        clean(&mut rig);
        let done = rig.board.machine.chip().flash.operations.len();
        (rig.board.machine.chip().observers.handlers[TIM7], done)
    };
    let (idle, none) = run(None);
    let (storing, operations) = run(Some(&image(IMAGE_MAX, 5)));
    assert_eq!((none, operations), (0, 1 + IMAGE_MAX / WORD + 1), "all is stored in that time");
    // The number of ticks must be equal. The number of instructions in a tick may differ slightly, because the tick
    // reads the progress of the store.
    assert_eq!(idle.calls, storing.calls);
    for (idle, storing) in [(idle.min, storing.min), (idle.max, storing.max)] {
        assert!(idle.abs_diff(storing) <= 32, "instructions of the tick: {idle} and {storing}");
    }
}

/// J-54: the power fails before, during and after every operation of a store. The board then starts with either the
/// complete old image or the complete new image, and can store another image.
#[test]
fn j54_a_power_cut_at_any_operation_leaves_one_whole_image() {
    let images = [image(200, 1), image(IMAGE_MAX, 2), image(260, 3)];
    let mut bank = Bank2::default();
    for (n, new) in images.iter().enumerate() {
        let old = n.checked_sub(1).map(|n| images[n].clone());
        let (after, cuts) = cuts(bank.clone(), new);
        let (mut olds, mut news) = (0, 0);
        for (what, bank) in cuts {
            let found = start(bank);
            match found {
                found if found == old => olds += 1,
                found => {
                    assert_eq!(found.as_ref(), Some(new), "store {n}, {what}");
                    news += 1;
                }
            }
        }
        assert!(olds > 50 && news > 5, "{olds} found the old image, {news} the new one");
        bank = after;
    }
}

/// Stores an image on a board with these flash contents. Returns the flash contents after the store. Also returns the
/// flash contents after a loss of power before, during and after operations, each with a description.
fn cuts(bank: Bank2, new: &[u8]) -> (Bank2, Vec<(String, Bank2)>) {
    let mut rig = board(bank);
    let mut cuts = vec![("before all".to_owned(), rig.board.machine.cut_power(0))];
    ask(&mut rig.board.machine, new);
    let mut seen = 0;
    while working(&rig) {
        let now = rig.board.machine.now();
        rig.board.machine.run_until(now + 20 * MICROSECOND);
        let operations = &rig.board.machine.chip().flash.operations;
        let Some(operation) = operations.get(seen).copied() else { continue };
        seen += 1;
        let what = operation.kind;
        // The power fails most often during the first operation (erasing) and the last operation (writing the
        // header). A half-erased sector can have many different contents, and the header determines if an image is
        // valid. For the data words between, a few power losses are sufficient.
        let last = 1 + 1 + new.len().div_ceil(WORD);
        let times = match seen {
            1 => 24,
            _ if seen == last => 24,
            _ if seen % (1 + last / 16) == 0 => 4,
            _ => continue,
        };
        for n in 1..=times {
            let at = operation.start + (operation.end - operation.start) * n / (times + 1);
            rig.board.machine.run_until(at);
            let bank = rig.board.machine.cut_power(seen as u64 * 100 + n);
            cuts.push((format!("{n}/{} of {what:x?}", times + 1), bank));
        }
        rig.board.machine.run_until(operation.end);
        cuts.push((format!("after {what:x?}"), rig.board.machine.cut_power(0)));
    }
    assert_eq!(mailbox(&rig.board.machine).state, DONE);
    (rig.board.machine.cut_power(0), cuts)
}

/// J-54: the button or the watchdog resets the board during a flash operation. The board then finds the old image, as
/// after a loss of power.
#[test]
fn j54_a_reset_in_the_middle_leaves_the_image_of_before() {
    let (old, new) = (image(500, 1), image(700, 2));
    let mut rig = board(Bank2::default());
    store(&mut rig, &old);
    for wait in [70, 104, 110] {
        ask(&mut rig.board.machine, &new);
        rig.run(wait);
        assert!(rig.board.machine.chip().flash.operations.len() > 1 && working(&rig), "after {wait} ms");
        rig.board.machine.reset(ResetCause::Pin);
        rig.run(20);
        assert_eq!(loaded(&rig.board.machine), Some((old.clone(), 1)), "after {wait} ms");
    }
    store_after_resets(&mut rig, &new);
    assert_eq!(start(rig.board.machine.cut_power(0)), Some(new));
}

/// Returns the arm that a board with these flash contents uses after its start.
fn start(bank: Bank2) -> Option<Vec<u8>> {
    let mut rig = board(bank);
    clean(&mut rig);
    loaded(&rig.board.machine).map(|(image, _)| image)
}

/// J-54: an unreadable word in a slot does not cause a fault. The firmware does not use the contents of this slot, and
/// can overwrite the slot.
#[test]
fn j54_a_slot_with_an_unreadable_word_is_not_used() {
    let mut rig = board(Bank2::default());
    let (old, new, third) = (image(500, 1), image(700, 2), image(900, 3));
    store(&mut rig, &old);
    store(&mut rig, &new);
    let bank = rig.board.machine.cut_power(0);
    for word in [0, 1, 7, 22] {
        let mut bank = bank.clone();
        bank.damage(SLOTS[1] + 32 * word);
        let mut rig = board(bank.clone());
        assert_eq!(loaded(&rig.board.machine), Some((old.clone(), 1)), "word {word}");
        clean(&mut rig);
        bank.damage(SLOTS[0]);
        let mut rig = board(bank);
        assert_eq!(loaded(&rig.board.machine), None, "both are damaged");
        clean(&mut rig);
        store(&mut rig, &third);
        let rig = board(rig.board.machine.cut_power(0));
        assert_eq!(loaded(&rig.board.machine), Some((third.clone(), 1)));
    }
}

/// If the flash reports an error, the firmware reports this error in its mailbox. The previous image remains in flash,
/// and the next attempt may succeed.
#[test]
fn j54_a_failed_store_leaves_the_image_of_before() {
    let (old, new) = (image(500, 1), image(700, 2));
    let mut rig = board(Bank2::default());
    store(&mut rig, &old);
    for (program, failure) in [(false, 2), (true, 3)] {
        ask(&mut rig.board.machine, &new);
        rig.wait("the operation", 4_000, |rig| {
            let operations = &rig.board.machine.chip().flash.operations;
            let last = operations.last().map(|operation| operation.kind);
            // The error must occur during a flash operation. An erase must therefore still be running. For
            // programming, it is sufficient that one word was started: the error then occurs at this word or at the
            // next word.
            last.is_some_and(|kind| matches!(kind, OperationKind::Program { .. }) == program)
                && (program || rig.board.machine.chip().flash.busy_until(0).is_some())
        });
        rig.board.machine.chip().flash.fail_next = sr::OPERR;
        rig.wait("an answer", 4_000, |rig| !working(rig));
        let answer = mailbox(&rig.board.machine);
        assert_eq!((answer.state, answer.failure), (FAILED, failure));
        clean(&mut rig);
        assert_eq!(start(rig.board.machine.cut_power(0)).as_ref(), Some(&old));
    }
    store(&mut rig, &new);
    assert_eq!(start(rig.board.machine.cut_power(0)), Some(new));
}

/// J-54: the firmware detects failures that the flash does not report. The test covers three cases: the flash no
/// longer accepts keys, a word reads back differently, and an erase operation never ends.
#[test]
fn j54_a_store_that_cannot_work_ends() {
    let fails = |mut rig: Rig, failure: u32| {
        let end = rig.board.machine.now() + 12 * SECOND;
        while working(&rig) && rig.board.machine.now() < end {
            let next = rig.board.machine.now() + 10 * MILLISECOND;
            rig.board.machine.run_until(next);
        }
        let answer = mailbox(&rig.board.machine);
        assert_eq!((answer.state, answer.failure), (FAILED, failure));
        clean(&mut rig);
    };
    let new = image(100, 1);

    let mut rig = board(Bank2::default());
    rig.board.machine.write_register(0x5200_2104, 0);
    ask(&mut rig.board.machine, &new);
    fails(rig, 1);

    let mut rig = board(Bank2::default());
    ask(&mut rig.board.machine, &new);
    let worn = |rig: &mut Rig| {
        let now = rig.board.machine.now() + 20 * MICROSECOND;
        rig.board.machine.run_until(now);
        let flash = &rig.board.machine.chip().flash;
        flash.operations.len() == 3 && flash.busy_until(now).is_none()
    };
    while !worn(&mut rig) {}
    assert!(rig.board.machine.poke(SLOTS[0] + 64, &[!new[32]]));
    fails(rig, 4);

    let mut rig = board(Bank2::default());
    rig.board.machine.chip().flash.erase_time = 60 * SECOND;
    ask(&mut rig.board.machine, &new);
    fails(rig, 5);
}

/// The firmware of every board finds an image that the firmware of another board has stored.
#[test]
fn j54_every_board_loads_it() {
    let mut rig = board(Bank2::default());
    let stored = image(IMAGE_MAX, 8);
    store(&mut rig, &stored);
    for board in BOARDS {
        let config = BoardConfig { bank2: rig.board.machine.cut_power(0), ..Default::default() };
        let mut rig = Rig::of(elf(board), &config);
        rig.wait("the board is up", 50, |rig| rig.ticks > 3);
        assert_eq!(loaded(&rig.board.machine), Some((stored.clone(), 1)), "{board}");
        clean(&mut rig);
    }
}
