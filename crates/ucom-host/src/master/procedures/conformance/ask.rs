//! Conformance tests that do not change any board.
use crate::master::engine::MS;
use crate::master::error::{Error, MasterError};
use crate::master::procedures::conformance::bench::{Bench, list, verdict};
use crate::master::reports::{BoardSeen, Verdict};
use ucom::profile::{Endian, ReportMode};
use ucom::{Dimensions, Frame, FromBoard, Function, Report, Status, package_count};

/// Returns the report frames among the given frames, sorted.
pub(super) fn only_reports(frames: &[Frame]) -> Vec<Frame> {
    let report = |f: &&Frame| f.address().is_ok_and(|(function, _)| (16..20).contains(&function.number()));
    let mut all: Vec<Frame> = frames.iter().filter(report).copied().collect();
    all.sort_by_key(|f| (f.id(), f.data().first().copied()));
    all
}

/// Returns the report frames that the boards must send (D-07).
pub(super) fn expected_reports(bench: &Bench<'_>) -> Option<Vec<Frame>> {
    if bench.profile().report_mode != ReportMode::Flash7 {
        return None;
    }
    let frame = |b: &BoardSeen| {
        let report = Report::flash7(b.info.flash_number);
        FromBoard::Report(report).encode(report.id_field, &bench.profile())
    };
    let mut frames: Vec<Frame> = bench.found.boards.iter().map(frame).collect();
    frames.sort_by_key(|f| (f.id(), f.data().first().copied()));
    Some(frames)
}

pub(super) async fn reports(bench: &mut Bench<'_>, _: u8) -> Result<Verdict, Error> {
    let boards = &bench.found.boards;
    let window = bench.link.times().report_ask;
    let broadcast = bench.link.broadcast_number().number();
    let mut seen = Vec::new();
    for _ in 0..2 {
        bench.send(Function::AskReport, broadcast, &[]).await;
        seen.push(only_reports(&bench.receive(window).await));
    }
    let [first, second] = seen.as_slice() else { return Ok(Verdict::Pass) };
    if first != second {
        return Ok(Verdict::Fail(format!("first {}; then {}", list(first), list(second))));
    }
    // Additional reports are not an error: a board of the chain that is excluded from the test also sends a report.
    if let Some(missing) = expected_reports(bench)
        .and_then(|all| all.into_iter().find(|f| first.iter().filter(|x| *x == f).count() != 1))
    {
        return Ok(Verdict::Fail(format!("{missing} was not received exactly once: {}", list(first))));
    }
    for board in boards {
        match bench.info(board.number).await {
            Some(now) if now == board.info => {}
            other => return Ok(Verdict::Fail(format!("afterwards board {} sends {other:?}", board.number))),
        }
    }
    Ok(Verdict::Pass)
}

pub(super) async fn init_again(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    if bench.found.strangers {
        let why = "a board that is not tested, or has no number, could take this number";
        return Ok(Verdict::Skipped(why.into()));
    }
    match bench.link.look_for_master(bench.options.force).await {
        Err(e @ Error::Master(MasterError::CompetingMaster { .. })) => {
            return Ok(Verdict::Skipped(e.to_string()));
        }
        other => other?,
    }
    // A board that has rebooted has no number and would accept any PC_INIT. Therefore the test first checks that the
    // board still has its number.
    if bench.info(board).await.is_none() {
        return Ok(Verdict::Fail(
            "the board does not answer PC_INFO; it may have rebooted: `ucom scan`".into(),
        ));
    }
    bench.send(Function::Init, board, &[]).await;
    let came = bench.receive(bench.link.times().init_ack).await;
    let pass = matches!(came.as_slice(), [f] if f.id() == 0x0C0 + u16::from(board) && f.data() == [board]);
    Ok(verdict(pass, &came))
}

/// Checks that the application of a board is started.
async fn up(bench: &mut Bench<'_>, board: u8) -> Option<Verdict> {
    match bench.info(board).await {
        Some(info) if info.status.has(Status::MSTART) => None,
        Some(_) => Some(Verdict::Skipped("the application is not started: ucom start".into())),
        None => Some(Verdict::Fail("the board does not answer PC_INFO".into())),
    }
}

pub(super) async fn description(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    if let Some(verdict) = up(bench, board).await {
        return Ok(verdict);
    }
    let id = Function::DumpIo.number();
    let answers = move |all: Vec<Frame>| -> Vec<Frame> {
        all.into_iter().filter(|f| f.id() == u16::from(id) << 6 | u16::from(board)).collect()
    };
    // An MCA_DUMP_IO_DESCRIPTION frame with data is always a board's answer, never a request (D-12), and only the
    // board itself may send such a frame with its number. Therefore the test sends its frame only when no answer of
    // the board is pending.
    bench.send(Function::DumpIo, board, &[0]).await;
    let came = answers(bench.receive(150 * MS).await);
    if !came.is_empty() {
        return Ok(Verdict::Fail(format!("with one byte of data: {}", list(&came))));
    }
    bench.send(Function::DumpIo, board, &[]).await;
    let mut came = Vec::new();
    loop {
        let more = answers(bench.receive(bench.link.times().gap.max(bench.link.times().info)).await);
        if more.is_empty() || came.len() > 10_000 {
            break;
        }
        came.extend(more);
    }
    Ok(match strings(bench, &came) {
        Ok(()) => Verdict::Pass,
        Err(what) => Verdict::Fail(what),
    })
}

/// Counts the strings of a description from the headers of the strings only.
fn strings(bench: &Bench<'_>, came: &[Frame]) -> Result<(), String> {
    let profile = bench.profile();
    let Some((head, rest)) = came.split_first() else { return Err("silence".into()) };
    if head.dlc() < 6 {
        return Err(format!("the first frame is {head}, not the dimensions"));
    }
    let dimensions = Dimensions::parse(&head.payload(), profile.endian).ok_or_else(|| head.to_string())?;
    let (mut found, mut left) = (0_u32, 0_u16);
    for frame in rest {
        match left {
            0 => {
                let &[a, b] = frame.data() else {
                    return Err(format!("{frame} is not a valid header of string {found}, expected 2 bytes"));
                };
                let count = profile.endian.word([a, b]);
                left = count.saturating_sub(u16::from(profile.string_count_includes_header));
                found += u32::from(left == 0);
            }
            1 => {
                left = 0;
                found += 1;
            }
            _ if frame.dlc() != 8 => {
                return Err(format!(
                    "{frame}: {left} packages of string {found} are missing, but only the last package may \
                     be short"
                ));
            }
            _ => left -= 1,
        }
    }
    match found == dimensions.strings() && left == 0 {
        true => Ok(()),
        false => Err(format!(
            "{found} complete strings, but the dimensions {head} announce {}",
            dimensions.strings()
        )),
    }
}

pub(super) async fn initial_inputs(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    if let Some(verdict) = up(bench, board).await {
        return Ok(verdict);
    }
    let (profile, times) = (bench.profile(), bench.link.times());
    let Some(dimensions) = dimensions(bench, board).await else {
        return Ok(Verdict::Fail("the IO description has no dimensions".into()));
    };
    bench.send(Function::DumpCi, board, &[]).await;
    let came = bench.receive(times.info.max(times.gap) + 2 * MS * u64::from(dimensions.ci)).await;
    let id = Function::DspCi;
    let packages: Vec<Frame> =
        came.into_iter().filter(|f| f.address().is_ok_and(|(f, n)| f == id && n.number() == board)).collect();
    let mut wrong = packages.len() != usize::from(package_count(dimensions.ci));
    for (i, frame) in packages.iter().enumerate() {
        let first = 3 * i;
        let [a, b, words @ ..] = frame.data() else {
            wrong = true;
            continue;
        };
        wrong |= usize::from(profile.endian.word([*a, *b])) != first;
        // Number of bytes in the package that contain words of the buffer. With `pd.short_last`, the last package can
        // end after these bytes. Any further bytes must be 0.
        let surplus = 2 * usize::from(dimensions.ci).saturating_sub(first).min(3);
        wrong |= words.len() < surplus || words.iter().skip(surplus).any(|byte| *byte != 0);
    }
    Ok(verdict(!wrong, &packages))
}

/// Returns the buffer dimensions of a board from the first frame of its description.
pub(super) async fn dimensions(bench: &mut Bench<'_>, board: u8) -> Option<Dimensions> {
    bench.send(Function::DumpIo, board, &[]).await;
    let first = bench.wait(Function::DumpIo, board, bench.link.times().info).await;
    // Waits for the remaining frames of the description, so that they are not mistaken for another answer.
    while !bench.receive(bench.link.times().gap).await.is_empty() {}
    let endian: Endian = bench.profile().endian;
    Dimensions::parse(&first?.payload(), endian)
}
