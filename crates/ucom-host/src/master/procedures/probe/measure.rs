//! Queries that a probe sends. The probe stores the answers as raw payloads, because the probe measures how they must be interpreted.

use crate::master::engine::{Core, Link, MS, Times};
use crate::master::error::{Error, MasterError, RunningError};
use crate::master::procedures::ask_reports::{REPORTS, collect_reports};
use crate::master::procedures::control::start_application;
use crate::master::procedures::exchange::{admin, info, mca_start, numbers};
use crate::master::procedures::init::init;
use crate::master::procedures::probe::judge::Seen;
use crate::master::procedures::probe::judge::{alive, judge, status_of};
use crate::master::procedures::stop::stop_board;
use crate::master::reports::{InitOptions, Outcome, ProbeOptions, ProbeReport, Reports, StopLevel};
use std::collections::BTreeMap;
use ucom::profile::AliveMode;
use ucom::{Admin, Frame, FromBoard, Function, Payload, Profile, Sequence, Status, ToBoard};

/// Number of queries that the probe sends to each board. The probe sends several queries, so that the loss of one frame does not determine
/// the result.
const ROUNDS: usize = 3;

/// Runs a probe, and returns its findings or the error that ended it. In both cases, the profile of the session does
/// not change. Every board that the probe started is stopped again, unless the bus has failed.
pub(crate) async fn probe(link: Link, options: ProbeOptions) -> Result<Outcome, Error> {
    let (before, mut begun) = (link.profile(), None);
    let result = link.or_cancel(measure(&link, &options, &mut begun)).await;
    if let Some((board, back)) = begun
        && !matches!(result, Err(Error::Master(MasterError::Bus { .. })))
    {
        link.bear_shared_numbers(true);
        let stopped = async { stop_board(&link, board, back).await.map(drop) };
        if let Err(error) = link.or_cancel(stopped).await {
            link.note(format!("the application of board {board} may still run: {error}"));
        }
    }
    use_profile(&link, before);
    result.map(Outcome::Probe)
}

/// Returns an error if control loops run and `force` is not set, because the next steps would end the loops or
/// interrupt their heartbeats.
fn no_loop_runs(link: &Link, options: &ProbeOptions) -> Result<(), Error> {
    let running = |core: &mut Core| {
        let running = core.boards.iter().filter(|(_, board)| board.is_known() && board.running(core.now));
        running.map(|(number, _)| number).collect::<Vec<u8>>()
    };
    let boards = link.with(running);
    match boards.is_empty() || options.force {
        true => Ok(()),
        false => Err(RunningError::LoopRuns { boards }.into()),
    }
}

/// Collects the observations of a probe. If the probe starts a board, `begun` stores the board and the stop level that undoes the start.
async fn measure(
    link: &Link,
    options: &ProbeOptions,
    begun: &mut Option<(u8, StopLevel)>,
) -> Result<ProbeReport, Error> {
    let mut seen = Seen { before: link.profile(), image: options.image.clone(), ..Default::default() };
    // The probe must receive all frames in raw form, so it must not refuse a frame because of its length.
    use_profile(link, Profile { dlc_strict: false, ..seen.before });
    seen.reports = all_reports(link).await;
    let mut numbered = None;
    if options.init {
        no_loop_runs(link, options)?;
        link.become_master(options.force).await?;
        seen.raised = pin_raised(link).await?;
        // This step assigns numbers to all boards of the chain. Values that the present profile interprets wrongly
        // are corrected in later steps.
        let whole = InitOptions { force: options.force, ..Default::default() };
        link.bear_shared_numbers(true);
        if let Outcome::Init(report) = init(link.clone(), whole).await? {
            numbered = Some(report);
        }
        link.bear_shared_numbers(false);
    }
    seen.broadcast = [Sequence::ZERO, Sequence::MAX].map(|_| 0);
    for (place, to) in [Sequence::ZERO, Sequence::MAX].into_iter().enumerate() {
        let answers = raw_infos(link, &[to], 0).await;
        if let Some(count) = seen.broadcast.get_mut(place) {
            *count = answers.keys().filter(|from| **from != to.number()).count();
        }
        seen.zero_answers |= to == Sequence::ZERO && answers.contains_key(&0);
    }
    let all: Vec<Sequence> = Sequence::all().filter(|n| n.number() > 0).collect();
    for _ in 0..ROUNDS {
        for (from, answer) in raw_infos(link, &all, 0).await {
            seen.infos.entry(from).or_default().push(answer);
        }
    }
    if let Some(board) = seen.first_board() {
        let padded = raw_infos(link, &[board], 8).await;
        seen.padded = Some(padded.contains_key(&board.number()));
    }
    for board in seen.started_boards() {
        seen.offsets.push(initial_offsets(link, board).await);
    }
    let mut report = ProbeReport { init: numbered, ..judge(&seen) };
    use_profile(link, report.profile);
    if options.alive
        && let Some(board) = seen.first_board()
    {
        no_loop_runs(link, options)?;
        link.become_master(options.force).await?;
        let found = info(link, board.number()).await?.info.status;
        if found.has(Status::MCARUN) && !options.force {
            return Err(RunningError::LoopRuns { boards: vec![board.number()] }.into());
        }
        let back = if found.has(Status::MSTART) { StopLevel::Loop } else { StopLevel::Application };
        *begun = Some((board.number(), back));
        let by = alive_form(link, board.number()).await?;
        alive(&mut report, by);
    }
    Ok(report)
}

fn use_profile(link: &Link, profile: Profile) {
    link.with(|core| {
        core.profile = profile;
        core.times = Times::of(&profile);
    });
}

/// Collects the raw reports of all boards. The function requests the reports several times, because a board can be
/// booting, and a frame can be lost.
async fn all_reports(link: &Link) -> Vec<ucom::Report> {
    let mut reports = Vec::new();
    for _ in 0..ROUNDS {
        link.listen(0, &REPORTS);
        link.ask(link.broadcast_number(), ToBoard::Report).await;
        let until = link.now() + link.times().report_ask;
        while let Some(received) = link.next(until).await {
            if let FromBoard::Report(report) = received.message {
                reports.push(report);
            }
            if link.now() >= until || reports.len() > 1000 {
                break;
            }
        }
    }
    reports
}

/// Sends PC_RESET, and then PC_INIT to the first board. The function returns `true` if the board's status already shows OPINIT after
/// PC_INIT; it returns `None` if no board took the number.
async fn pin_raised(link: &Link) -> Result<Option<bool>, Error> {
    link.listen(0, &REPORTS);
    link.ask(link.broadcast_number(), ToBoard::Reset).await;
    link.with(|core| {
        core.boards.clear();
        core.data.clear();
    });
    collect_reports(link, link.times().report_window, &mut Reports::default()).await;
    let Some(first) = link.profile().board_numbers().next() else { return Ok(None) };
    link.listen(u32::MAX, &[Function::InitAck]);
    link.ask(first, ToBoard::Init).await;
    link.next(link.now() + link.times().init_ack).await;
    let answers = raw_infos(link, &[first], 0).await;
    let status = answers.get(&first.number()).and_then(|frames| frames.first()).and_then(status_of);
    Ok(status.map(|status| status.has(Status::OPINIT)))
}

/// Sends PC_INFO with `padding` additional bytes to some numbers. The function returns the frames of each answer. The function considers an
/// answer complete after 100 ms of silence.
async fn raw_infos(link: &Link, to: &[Sequence], padding: usize) -> BTreeMap<u8, Vec<Payload>> {
    link.listen(u32::MAX, &[Function::DspInfo]);
    let mut answers: BTreeMap<u8, Vec<Payload>> = BTreeMap::new();
    for number in to {
        let zeros = [0; 8];
        let data = zeros.get(..padding).unwrap_or(&zeros);
        if let Some(frame) = Frame::new(Function::Info.id(*number), data) {
            link.send_frame(frame).await;
        }
        // Because of this pause, the answers of many boards do not arrive as one burst.
        link.sleep(2 * MS).await;
    }
    let (times, limit) = (link.times(), link.now() + 5_000 * MS);
    let gap = times.info.max(times.gap);
    while let Some(received) = link.next((link.now() + gap).min(limit)).await {
        if let FromBoard::Info(payload) = received.message {
            answers.entry(received.from).or_default().push(payload);
        }
        if link.now() >= limit {
            break;
        }
    }
    answers
}

/// Returns the offsets of the packages that answer MCA_DUMP_CI, interpreted with the profile in use.
async fn initial_offsets(link: &Link, board: Sequence) -> Vec<u16> {
    link.listen(1 << board.number(), &[Function::DspCi]);
    link.ask(board, ToBoard::DumpCi).await;
    let limit = link.now() + 1_000 * MS;
    let mut offsets = Vec::new();
    while let Some(received) = link.next((link.now() + link.times().gap).min(limit)).await {
        if let FromBoard::Ci(package) = received.message {
            offsets.push(package.offset);
        }
        if link.now() >= limit {
            break;
        }
    }
    offsets
}

/// Checks if a control loop continues with only broadcast heartbeats, and if it continues with only unicast heartbeats.
async fn alive_form(link: &Link, board: u8) -> Result<[bool; 2], Error> {
    start_application(link, board).await?;
    let mut held = [false; 2];
    let before = link.profile();
    for (place, alive_mode) in [AliveMode::Broadcast, AliveMode::Unicast].into_iter().enumerate() {
        use_profile(link, Profile { alive_mode, ..before });
        mca_start(link, board).await?;
        link.sleep(u64::from(before.alive_pc_lost) * MS + 1_000 * MS).await;
        let info = numbers(link, board).await?;
        if let Some(held) = held.get_mut(place) {
            *held = info.status.has(Status::MCARUN);
        }
        if info.status.has(Status::MCARUN) {
            admin(link, board, Admin::default()).await?;
        }
    }
    use_profile(link, before);
    Ok(held)
}
