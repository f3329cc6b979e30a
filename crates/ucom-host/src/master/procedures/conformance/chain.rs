//! Conformance tests that renumber the chain, and tests of the status byte.
use crate::master::engine::MS;
use crate::master::error::Error;
use crate::master::procedures::conformance::ask::{expected_reports, only_reports};
use crate::master::procedures::conformance::bench::{Bench, list, verdict};
use crate::master::reports::Verdict;
use ucom::{Function, Status};

/// Sends PC_RESET to all boards, and waits until all boards are ready.
async fn reset_all(bench: &mut Bench<'_>) -> Vec<ucom::Frame> {
    bench.send(Function::Reset, bench.link.broadcast_number().number(), &[]).await;
    bench.link.with(|core| {
        core.boards.clear();
        core.data.clear();
    });
    bench.receive(bench.link.times().report_window).await
}

pub(super) async fn reset(bench: &mut Bench<'_>, _: u8) -> Result<Verdict, Error> {
    let came = reset_all(bench).await;
    let Some(expected) = expected_reports(bench) else {
        return Ok(Verdict::Skipped("report.mode of the profile is not flash7".into()));
    };
    let reports = only_reports(&came);
    let pass = expected.iter().all(|f| reports.iter().filter(|r| *r == f).count() == 1)
        && reports.len() == came.len();
    Ok(verdict(pass, &came))
}

pub(super) async fn unnumbered(bench: &mut Bench<'_>, _: u8) -> Result<Verdict, Error> {
    reset_all(bench).await;
    let Some(first) = bench.profile().board_numbers().next().map(|n| n.number()) else {
        return Ok(Verdict::Pass);
    };
    let requests: [(Function, &[u8]); 9] = [
        (Function::Info, &[]),
        (Function::SetStatus, &[0, 0]),
        (Function::Prog, &[0; 8]),
        (Function::Start, &[]),
        (Function::McaStart, &[]),
        (Function::DumpIo, &[]),
        (Function::DumpCi, &[]),
        (Function::Ci, &[0; 8]),
        (Function::Par, &[0; 8]),
    ];
    for (function, data) in requests {
        bench.send(function, first, data).await;
        let came = bench.receive(60 * MS).await;
        if !came.is_empty() {
            return Ok(Verdict::Fail(format!("the board answers {}: {}", function.name(), list(&came))));
        }
    }
    // Also sends the request by broadcast. A board without a number must ignore this request (D-04, D-06).
    bench.send(Function::Info, bench.link.broadcast_number().number(), &[]).await;
    let came = bench.receive(150 * MS).await;
    Ok(verdict(came.is_empty(), &came))
}

pub(super) async fn wire(bench: &mut Bench<'_>, _: u8) -> Result<Verdict, Error> {
    if bench.profile().chain_auto_opinit {
        return Ok(Verdict::Skipped("with this profile, boards raise their pin by themselves".into()));
    }
    reset_all(bench).await;
    let ack = bench.link.times().init_ack;
    let numbers: Vec<u8> = bench.profile().board_numbers().map(|n| n.number()).collect();
    for (i, n) in numbers.iter().take(bench.found.boards.len()).enumerate() {
        bench.send(Function::Init, *n, &[]).await;
        let came = bench.receive(ack).await;
        let pass = matches!(came.as_slice(), [f] if f.id() == 0x0C0 + u16::from(*n) && f.data() == [*n]);
        if !pass {
            return Ok(Verdict::Fail(format!("PC_INIT({n}): {}", list(&came))));
        }
        // The outgoing pin of the numbered board is still off. Therefore no board after it in the chain may take a
        // number.
        if let Some(next) = numbers.get(i + 1) {
            for function in [Function::Init, Function::Info] {
                bench.send(function, *next, &[]).await;
                let came = bench.receive(ack).await;
                if !came.is_empty() {
                    let name = function.name();
                    return Ok(Verdict::Fail(format!(
                        "{name}({next}) before the pin of board {n} is on: {}",
                        list(&came)
                    )));
                }
            }
        }
        bench.send(Function::SetStatus, *n, &[2, 2]).await;
        bench.receive(10 * MS).await;
        match bench.info(*n).await {
            Some(info) if info.status.has(Status::OPINIT) => {}
            other => return Ok(Verdict::Fail(format!("board {n}: OPINIT is not set: {other:?}"))),
        }
    }
    Ok(Verdict::Pass)
}

/// Sends one PC_SETSTATUS and returns the status of the board afterwards.
async fn set(bench: &mut Bench<'_>, board: u8, mask: u8, value: u8) -> Option<Status> {
    bench.send(Function::SetStatus, board, &[mask, value]).await;
    bench.receive(10 * MS).await;
    bench.info(board).await.map(|info| info.status)
}

pub(super) async fn formula(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    let Some(before) = bench.info(board).await else {
        return Ok(Verdict::Fail("the board does not answer PC_INFO".into()));
    };
    let on = set(bench, board, 0x00, 0x40).await;
    let off = set(bench, board, 0x40, 0x00).await;
    let (with, without) =
        (before.status.with(Status::ASTART, true), before.status.with(Status::ASTART, false));
    if before.status.has(Status::ASTART) {
        set(bench, board, 0x40, 0x40).await;
    }
    Ok(match (on, off) {
        (Some(on), Some(off)) if on == with && off == without => Verdict::Pass,
        other => Verdict::Fail(format!("after 0040 and 4000: {other:?}, before {}", before.status)),
    })
}

pub(super) async fn mirrors(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    let Some(before) = bench.info(board).await else {
        return Ok(Verdict::Fail("the board does not answer PC_INFO".into()));
    };
    for (mask, value) in [(0x01, 0x00), (0x10, 0x00), (0x20, 0x20)] {
        let after = set(bench, board, mask, value).await;
        if after != Some(before.status) {
            let text =
                format!("after {mask:02X}{value:02X} the status is {after:?}, before {}", before.status);
            return Ok(Verdict::Fail(text));
        }
    }
    Ok(Verdict::Pass)
}

/// Tests the automatic start of an application. The test resets all boards, and then sends PC_INIT with the number
/// `board`, which the first board of the chain takes. Therefore `board` must be the number of the first board, and
/// the chain must have been renumbered immediately before the test.
pub(super) async fn autostart(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    let Some(first) = bench.found.boards.iter().find(|b| b.number == board) else {
        return Ok(Verdict::Skipped("this board does not exist".into()));
    };
    if !first.info.has_application() {
        return Ok(Verdict::Skipped("the board has no application that could start".into()));
    }
    let flash = first.info.flash_number;
    let kept = first.info.status.has(Status::ASTART);
    match bench.info(board).await {
        Some(info) if info.flash_number == flash => {}
        other => {
            let text = format!("0x{flash:04X} does not have its number: {other:?}");
            return Ok(Verdict::Fail(text));
        }
    }
    set(bench, board, 0x40, 0x40).await;
    reset_all(bench).await;
    bench.send(Function::Init, board, &[]).await;
    let acknowledged = bench.wait(Function::InitAck, board, bench.link.times().init_ack).await.is_some();
    bench.link.sleep(100 * MS).await;
    bench.send(Function::XReset, board, &[]).await;
    // Waits for the hold-off of the automatic start and for the time that an application needs to start.
    let holdoff = u64::from(bench.profile().autostart_holdoff) * MS;
    let came = bench.receive(holdoff + bench.link.times().start).await;
    let now = bench.info(board).await;
    if now.is_some_and(|info| info.flash_number == flash) {
        set(bench, board, 0x44, if kept { 0x40 } else { 0 }).await;
    }
    Ok(match now {
        Some(i) if i.flash_number == flash && !i.status.has(Status::MSTART) && acknowledged => Verdict::Pass,
        other => {
            Verdict::Fail(format!("acknowledged: {acknowledged}, afterwards {other:?}, {}", list(&came)))
        }
    })
}
