//! Tests of the flight recorder in the rig: contents, stop conditions, and memory that is readable after any reset (J-56).
use crate::rig;

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hash, Hasher};

use jtc_core::recorder::{
    AFTER_ERROR_MS, BLOCK_WORDS, Block, Log, Outcome, Record, Recorder, Replay, SNAPSHOT_MS,
};
use jtc_core::{Config, ControllerState, Payload, settings};
use jtc_wire::{
    Answer, DataStatus, ExecCommand, FrameRef, FrameType, LOG_NO_BLOCK, LogPage, LogState, StoreState,
};
use rig::Rig;

const BLOCKS: usize = 96;

fn memory() -> [Vec<Block>; 2] {
    // Returns memory pieces of different sizes with old contents, because memory contains random data at power-up.
    [vec![[0x4A46_0001; BLOCK_WORDS]; BLOCKS - 5], vec![[0xA5A5_5A5A; BLOCK_WORDS]; 5]]
}

fn recorded() -> Rig {
    let mut rig = Rig::new(Config::avena());
    rig.recorder = Some(Recorder::new(memory(), false));
    rig
}

/// Returns a rig in HoldPos that was recorded since its start.
fn holding() -> Rig {
    let mut rig = recorded();
    rig.defaults();
    rig.run(700);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    rig
}

fn recorder(rig: &Rig) -> &Recorder<Vec<Block>, 2> {
    rig.recorder.as_ref().unwrap()
}

fn blocks(rig: &Rig) -> Vec<Block> {
    recorder(rig).blocks().copied().collect()
}

/// Returns a hash of each tick of a log, and the ticks after which a snapshot follows.
fn contents(blocks: &[Block]) -> (Vec<u64>, Vec<u64>) {
    let (mut ticks, mut snapshots) = (Vec::new(), Vec::new());
    for record in Log::new(blocks) {
        match record {
            Record::Tick { inputs, check } => {
                let mut hasher = DefaultHasher::new();
                for frame in inputs.bus() {
                    (frame.id, frame.data()).hash(&mut hasher);
                }
                for event in inputs.host() {
                    (event.line, event.overtaken, event.frame_type, event.bytes()).hash(&mut hasher);
                }
                let states = (inputs.safety_input, inputs.missed_ticks, inputs.status_free, check);
                states.hash(&mut hasher);
                ticks.push(hasher.finish());
            }
            Record::Snapshot(snapshot) => snapshots.push(snapshot.tick()),
        }
    }
    (ticks, snapshots)
}

/// Returns the ticks of a replay, after a check that the replay does not differ from the log.
fn replayed(rig: &Rig) -> Vec<u64> {
    let blocks = blocks(rig);
    let hash = rig.controller.points_hash();
    let steps = Replay::new(Log::new(&blocks), rig.controller.clone(), Some(hash));
    steps
        .inspect(|step| assert_ne!(step.outcome, Outcome::Differs, "tick {}", step.telemetry.tick))
        .map(|step| step.telemetry.tick)
        .collect()
}

#[test]
fn j56_the_log_stops_300_ms_after_the_first_error_and_is_kept_until_it_is_cleared() {
    let mut rig = holding();
    rig.press_stop(1);
    let error = rig.controller.telemetry().tick;
    assert_ne!(rig.errors(), 0);
    rig.run(usize::from(AFTER_ERROR_MS) - 1);
    assert_eq!(recorder(&rig).state(), LogState::Recording);
    rig.run(1);
    assert_eq!(recorder(&rig).state(), LogState::Error);
    let ticks = replayed(&rig);
    assert_eq!(ticks.last(), Some(&(error + u64::from(AFTER_ERROR_MS))));
    assert!(ticks.windows(2).all(|pair| pair[1] == pair[0] + 1), "every tick once");

    // After the log has stopped, it must not change when the error ends, when another error occurs, or while time
    // passes.
    let before = blocks(&rig);
    rig.clear(true, 0x7F);
    rig.run(600);
    rig.press_stop(1);
    rig.run(1_000);
    assert_eq!((blocks(&rig), recorder(&rig).state()), (before.clone(), LogState::Error));
    // A reset of any kind must not change the log either.
    for failed in [false, true] {
        let memory = rig.recorder.take().unwrap().into_memory();
        rig.recorder = Some(Recorder::new(memory, failed));
        assert_eq!((blocks(&rig), recorder(&rig).state()), (before.clone(), LogState::Error));
    }
    rig.send(FrameType::ClearLog, &[]);
    rig.run(5);
    assert_eq!(recorder(&rig).state(), LogState::Recording);
    // When the new log begins, the old error is still latched. This error must not stop the new log.
    rig.run(1_000);
    assert_eq!(recorder(&rig).state(), LogState::Recording);
}

/// An emergency stop while the device starts is an error and stops the log. When the torque comes on, a new log must
/// begin, so that the recorder can record a later error.
#[test]
fn j56_a_log_without_torque_gives_way_when_torque_comes_on() {
    let mut rig = recorded();
    rig.run(50);
    rig.press_stop(5);
    rig.run(400);
    assert_eq!(recorder(&rig).state(), LogState::Error);
    rig.clear(true, 0x7F);
    rig.defaults();
    rig.until(2_000, |rig| rig.state() == ControllerState::HoldPos);
    rig.run(400);
    assert_eq!(recorder(&rig).state(), LogState::Recording);
    rig.press_stop(5);
    rig.run(400);
    assert_eq!(recorder(&rig).state(), LogState::Error);
    assert!(replayed(&rig).len() > 600);
}

#[test]
fn j56_a_reset_keeps_the_log_of_a_device_that_failed_and_begins_anew_otherwise() {
    let mut rig = holding();
    let last = rig.controller.telemetry().tick;
    let memory = rig.recorder.take().unwrap().into_memory();
    rig.recorder = Some(Recorder::new(memory.clone(), true));
    assert_eq!(recorder(&rig).state(), LogState::Reset);
    assert_eq!(replayed(&rig).last(), Some(&last), "up to the tick before the reset");
    rig.recorder = Some(Recorder::new(memory, false));
    assert_eq!(recorder(&rig).state(), LogState::Recording);
    assert_eq!(recorder(&rig).blocks().count(), 0);
    // Memory contains random data at power-up.
    for failed in [false, true] {
        let recorder = Recorder::new(self::memory(), failed);
        assert_eq!((recorder.state(), recorder.blocks().count()), (LogState::Recording, 0));
    }
}

/// Returns the blocks that a recorder finds in this memory after a reset.
fn found(memory: &[Vec<Block>; 2]) -> Vec<Block> {
    Recorder::new(memory.clone(), true).blocks().copied().collect()
}

/// The recorded data of a tick become valid with the last word of the tick, and not before.
#[test]
fn j56_a_log_that_is_cut_in_the_middle_of_a_tick_is_whole_up_to_the_tick_before() {
    const MAGIC: usize = 0;
    const COMMIT: usize = 2;
    let mut rig = holding();
    let mut cuts = 0;
    for _ in 0..120 {
        rig.run(9);
        let before = recorder(&rig).memory().clone();
        rig.tick();
        let after = recorder(&rig).memory();
        let places = (0..2).flat_map(|piece| {
            (0..before[piece].len())
                .flat_map(move |block| (0..BLOCK_WORDS).map(move |word| (piece, block, word)))
        });
        let changed: Vec<_> = places
            .filter(|&(piece, block, word)| before[piece][block][word] != after[piece][block][word])
            .collect();
        assert!(changed.iter().any(|&(_, _, word)| word == COMMIT));
        let (ticks, snapshots) = contents(&found(&before));
        // A tick that begins a block changes many words. The test leaves out only some of these words.
        for leave_out in (0..changed.len()).step_by(1 + changed.len() / 8) {
            let mut cut = before.clone();
            for (n, &(piece, block, word)) in changed.iter().enumerate() {
                if n != leave_out && word != COMMIT && word != MAGIC {
                    cut[piece][block][word] = after[piece][block][word];
                }
            }
            // Before the recorder overwrites a block, it marks the block as invalid.
            for &(piece, block, _) in changed.iter().filter(|(_, _, word)| *word == MAGIC) {
                cut[piece][block][MAGIC] = 0;
            }
            let (left, left_snapshots) = contents(&found(&cut));
            let kept = ticks.len().min(left.len());
            assert!(left[..] == ticks[ticks.len() - kept..], "{changed:?} without {leave_out}");
            assert_eq!(left_snapshots.last(), snapshots.last());
            cuts += 1;
        }
    }
    assert!(cuts > 200, "{cuts}");
}

/// After any damage of the memory, the reader must return only data that were written. The reader must return all data
/// from undamaged blocks that follow a snapshot.
#[test]
fn j56_damaged_memory_costs_the_blocks_that_are_damaged_and_no_others() {
    let mut rig = holding();
    rig.run(1_500);
    let whole = blocks(&rig);
    let (ticks, _) = contents(&whole);
    let known: BTreeSet<&u64> = ticks.iter().collect();
    let snapshots = whole.iter().filter(|block| block[3] as u16 != 0xFFFF).count();
    assert!(snapshots >= 3 && ticks.len() > 1_000);
    for n in 0..400usize {
        let mut damaged = whole.clone();
        let (block, word, bit) = (n * 7 % whole.len(), n * 13 % BLOCK_WORDS, n % 32);
        damaged[block][word] ^= 1 << bit;
        let (left, _) = contents(&damaged);
        assert!(left.iter().all(|tick| known.contains(tick)), "block {block}, word {word}, bit {bit}");
        // After the damaged block, the reader must return the next snapshot and all data that follow it.
        let behind = whole[block + 1..].iter().position(|block| block[3] as u16 != 0xFFFF);
        if let Some(first) = behind.map(|first| block + 1 + first) {
            assert!(left.ends_with(&contents(&whole[first..]).0));
        }
    }
    // The test removes blocks at the start or at the end of the log. The reader must return only ticks of the
    // remaining blocks.
    for cut in 0..whole.len() {
        assert!(ticks.ends_with(&contents(&whole[cut..]).0));
        assert!(ticks.starts_with(&contents(&whole[..cut]).0));
    }
    let mut random = 0x1234_5678u32;
    let mut next = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        random.rotate_left(16)
    };
    for n in 0..50 {
        let mut noise = whole.clone();
        for block in &mut noise {
            // In this test, the memory contains random words. In every second case, the heads of the blocks stay
            // unchanged. The reader must not panic.
            block[if n % 2 == 0 { 5 } else { 0 }..].fill_with(&mut next);
        }
        contents(&noise);
    }
}

/// Returns a page of the log, as a host receives it.
fn page(rig: &mut Rig, block: u32, offset: u16) -> (LogState, u32, u16, u32, Vec<u8>) {
    let body: Vec<u8> = [&block.to_be_bytes()[..], &offset.to_be_bytes()].concat();
    rig.send_on(1, FrameType::GetLog, &body);
    for _ in 0..50 {
        rig.tick();
        if rig.last.answer_line == Some(1) {
            let bytes = rig.controller.answer_frame();
            assert!(bytes.len() <= 256);
            if let Some(Answer::Log(page)) = FrameRef::new_checked(bytes).and_then(Answer::parse) {
                let LogPage { state, block, offset, end, bytes, .. } = page;
                return (state, block, offset, end, bytes.to_vec());
            }
        }
    }
    panic!("no answer");
}

/// Returns the whole log, after reading it page by page.
fn fetched(rig: &mut Rig) -> Vec<Block> {
    let (mut block, mut bytes, mut all) = (0, Vec::new(), Vec::new());
    loop {
        let (_, at, offset, end, part) = page(rig, block, bytes.len() as u16);
        if at != block {
            assert_eq!((offset, bytes.len()), (0, 0));
            block = at;
        }
        if part.is_empty() {
            assert_eq!(at, end);
            return all;
        }
        bytes.extend(part);
        if bytes.len() == 4 * BLOCK_WORDS {
            let words = bytes.as_chunks::<4>().0;
            all.push(core::array::from_fn(|n| u32::from_le_bytes(words[n])));
            (block, bytes) = (block + 1, Vec::new());
        }
    }
}

#[test]
fn j56_a_log_is_read_in_pages_while_recording_rests() {
    let mut rig = holding();
    rig.run(2_500);
    let before = blocks(&rig);
    let read = fetched(&mut rig);
    // The host must get all ticks before its request of the first page, and at most a few more.
    let (before, read) = (contents(&before).0, contents(&read).0);
    assert!(read.starts_with(&before) && read.len() < before.len() + 10);
    // After the pause, recording must continue without a command, and must begin with a snapshot.
    let rested = rig.controller.telemetry().tick;
    rig.run(2_500);
    let ticks = replayed(&rig);
    let gap = ticks.windows(2).find(|pair| pair[1] != pair[0] + 1).expect("recording has rested");
    assert!(gap[0] < rested && gap[1] < rested + 2_010, "{gap:?}");
    assert_eq!(ticks.last(), Some(&rig.controller.telemetry().tick));
}

#[test]
fn j56_an_error_is_recorded_also_while_a_host_reads() {
    let mut rig = holding();
    rig.run(300);
    page(&mut rig, 0, 0);
    rig.press_stop(1);
    let error = rig.controller.telemetry().tick;
    // The host continues to read pages, but this must not pause the recording after an error.
    for _ in 0..20 {
        page(&mut rig, 0, 0);
    }
    rig.run(400);
    assert_eq!(recorder(&rig).state(), LogState::Error);
    let ticks = replayed(&rig);
    assert!(ticks.contains(&error) && ticks.last() == Some(&(error + u64::from(AFTER_ERROR_MS))));
}

#[test]
fn j56_where_the_log_is_can_be_asked_without_a_rest() {
    let mut rig = holding();
    let (state, _, _, end, bytes) = page(&mut rig, LOG_NO_BLOCK, 0);
    assert_eq!((state, bytes.len()), (LogState::Recording, 0));
    assert!(end > 0);
    let tick = rig.controller.telemetry().tick;
    rig.run(10);
    assert!(replayed(&rig).contains(&(tick + 5)));
}

#[test]
fn j56_j50_a_device_without_a_recorder_refuses_what_is_asked_of_one() {
    use jtc_wire::DataStatus::NotAllowed;
    let mut rig = Rig::holding();
    assert_eq!(rig.ask(FrameType::GetLog, &[0; 6]), NotAllowed);
    assert_eq!(rig.ask(FrameType::ClearLog, &[]), NotAllowed);
}

#[test]
fn j56_two_seconds_are_kept_and_snapshots_come_in_time_whatever_hosts_send() {
    let mut rig = holding();
    // The recorder of this test has as many blocks as the recorders on the boards.
    rig.recorder = Some(Recorder::new([vec![[0; BLOCK_WORDS]; 63], vec![[0; BLOCK_WORDS]; 94]], false));
    let begin = rig.controller.telemetry().tick;
    for n in 0..3_000u32 {
        match n % 3 {
            0 => rig.send(FrameType::GripperControl, &[(n % 2) as u8, 0, 0, 0]),
            1 => rig.send_on(1, FrameType::PidParamUseDefault, &[]),
            _ => rig.send_on(1, FrameType::TrajSetExecStatus, &[ExecCommand::Stop as u8]),
        }
        rig.tick();
    }
    let blocks = blocks(&rig);
    let (_, snapshots) = contents(&blocks);
    let since: Vec<_> = snapshots.iter().copied().filter(|tick| *tick > begin).collect();
    assert!(since.len() >= 3, "{snapshots:?}");
    let kept = rig.controller.telemetry().tick - since[0];
    assert!(kept > 2_000, "{kept} ms");
    assert!(since.windows(2).all(|pair| pair[1] - pair[0] <= 2 * u64::from(SNAPSHOT_MS)), "{snapshots:?}");
}

/// A snapshot is taken while a payload is being blended into the model. The replay continues this blend (J-60). After the next snapshot,
/// each tick is identical in every bit.
#[test]
fn j56_a_payload_on_its_way_is_replayed() {
    let mut rig = holding();
    let body: Vec<u8> =
        settings::payload_values(&Payload { mass: 1.5, com: [0.02, -0.01, 0.05], ..Payload::NONE })
            .flat_map(|value| value.emit())
            .collect();
    assert_eq!(rig.ask(FrameType::SetSettings, &body), DataStatus::NoError);
    let given = rig.controller.telemetry().tick;
    rig.run(1_500);
    let blocks = blocks(&rig);
    let first = contents(&blocks).1.into_iter().find(|tick| *tick > given).expect("a snapshot");
    assert!(first < given + 300, "it comes while the payload is on its way: {given} {first}");
    // The controller of the replay has no payload at first. This controller must get the payload from the snapshot.
    let mut other = Rig::new(Config::avena());
    other.defaults();
    let replay = Replay::new(Log::new(&blocks), other.controller, None);
    let same = replay.filter(|step| step.telemetry.tick > first && step.outcome == Outcome::Same).count();
    assert_eq!(same as u64, rig.controller.telemetry().tick - first);
    assert_eq!(replayed(&rig).last(), Some(&rig.controller.telemetry().tick));
}

/// An emergency stop at power-up would stop the log after 300 ms. If the error is cleared and the torque comes on
/// before that time, the log continues.
#[test]
fn j56_an_error_before_there_is_torque_does_not_stop_the_log() {
    let mut rig = Rig::new(Config::avena());
    // The recorder of this test has as many blocks as the recorders on the boards.
    rig.recorder = Some(Recorder::new([vec![[0; BLOCK_WORDS]; 63], vec![[0; BLOCK_WORDS]; 94]], false));
    rig.defaults();
    rig.until(2_000, |rig| rig.state() == ControllerState::Init && rig.controller.telemetry().tick > 50);
    rig.press_stop(5);
    rig.clear(true, 0x7F);
    let ticks = rig.until(2_000, |rig| rig.state() == ControllerState::HoldPos);
    assert!(ticks < AFTER_ERROR_MS.into(), "torque comes before the log would stop: {ticks} ms");
    rig.run(1_000);
    assert_eq!(recorder(&rig).state(), LogState::Recording);
    rig.press_stop(1);
    let error = rig.controller.telemetry().tick;
    rig.run(400);
    assert_eq!(recorder(&rig).state(), LogState::Error);
    assert!(replayed(&rig).contains(&error));
}

/// In some ticks, hosts send a read request together with another request. The replay must process the requests in
/// their order, although its controller has no recorder.
#[test]
fn j56_requests_beside_others_are_replayed_in_their_turns() {
    let get_log: Vec<u8> = [&LOG_NO_BLOCK.to_be_bytes()[..], &[0; 2]].concat();
    let pairs: [[(FrameType, &[u8]); 2]; 4] = [
        [(FrameType::GetLog, &get_log), (FrameType::GetLog, &get_log)],
        [(FrameType::GetLog, &get_log), (FrameType::GetInfo, &[])],
        [(FrameType::GetInfo, &[]), (FrameType::GetInfo, &[])],
        [(FrameType::GetPoints, &[0, 0]), (FrameType::GetArm, &[0, 0])],
    ];
    for pair in pairs {
        let mut rig = holding();
        for k in 0..12 {
            for (frame_type, body) in pair {
                rig.send_on(1, frame_type, body);
            }
            let jog: Vec<u8> = [0.1f32; 6].iter().flat_map(|velocity| velocity.to_be_bytes()).collect();
            rig.send(FrameType::Jog, &jog);
            rig.status_free = k % 3 != 1;
            rig.run(37);
        }
        let blocks = blocks(&rig);
        let mut other = Rig::new(Config::avena());
        other.defaults();
        other.run(700);
        let steps: Vec<_> = Replay::new(Log::new(&blocks), other.controller, None).collect();
        let differs = steps.iter().filter(|step| step.outcome == Outcome::Differs).count();
        assert!(steps.len() > 400 && differs == 0, "{pair:?}: {differs} of {} ticks differ", steps.len());
    }
}

/// Returns a disabled or held rig that received a StoreArm after `wait` ticks. After the StoreArm, the rig has run for at least half a
/// second.
fn storing(state: ControllerState, wait: usize) -> Rig {
    let mut rig = recorded();
    rig.controller.set_store_state(StoreState::Empty, 0);
    rig.defaults();
    rig.until(2_000, |rig| rig.state() == ControllerState::HoldPos);
    // When the torque came on, the recorder discarded the earlier log.
    rig.run(600);
    let stored = state == ControllerState::Init;
    if stored {
        assert_eq!(rig.ask(FrameType::Disable, &[]), DataStatus::NoError);
        rig.until(500, |rig| rig.state() == state);
    }
    rig.run(wait);
    let expected = if stored { DataStatus::NoError } else { DataStatus::NotAllowed };
    assert_eq!(rig.ask(FrameType::StoreArm, &[]), expected);
    rig.run(700);
    rig
}

/// A device needs several ticks to store an arm. A replay has no memory for an arm and refuses a StoreArm at once.
/// The replay must not report this as a difference, even if a snapshot is taken while the device stores the arm.
/// After the next snapshot, all outputs must be equal.
#[test]
fn j56_j54_a_store_of_the_arm_is_not_a_difference() {
    for state in [ControllerState::Init, ControllerState::HoldPos] {
        let rig = storing(state, 0);
        let sent = rig.controller.telemetry().tick - 700;
        let snapshot = contents(&blocks(&rig)).1.into_iter().find(|tick| *tick > sent).expect("a snapshot");
        for before in 0..8 {
            let rig = storing(state, (snapshot - sent + before) as usize);
            let blocks = blocks(&rig);
            let mut other = Rig::new(Config::avena());
            other.defaults();
            other.run(700);
            let steps: Vec<_> = Replay::new(Log::new(&blocks), other.controller, None).collect();
            let differs = steps.iter().filter(|step| step.outcome == Outcome::Differs).count();
            assert_eq!(differs, 0, "{state:?}, {before}: {differs} of {} ticks differ", steps.len());
            let last = steps.last().map(|step| (step.telemetry.tick, step.outcome));
            let now = rig.controller.telemetry().tick;
            assert_eq!(last, Some((now, Outcome::Same)), "{state:?}, {before}");
        }
    }
}
