//! Conformance tests that start the application and its control loop. These tests never enable the outputs of a board.
use crate::master::engine::MS;
use crate::master::error::Error;
use crate::master::procedures::conformance::ask::dimensions;
use crate::master::procedures::conformance::bench::{Bench, list, verdict};
use crate::master::reports::Verdict;
use ucom::{Frame, Function, Status};

/// Ends the test early if the previous step did not succeed.
macro_rules! need {
    ($result:expr) => {
        if let Err(verdict) = $result {
            return Ok(verdict);
        }
    };
}

fn is(frame: &Frame, function: Function, board: u8) -> bool {
    frame.address().is_ok_and(|(f, n)| f == function && n.number() == board)
}

/// Stops the control loop of a board. The function sends the stop command three times and discards the answers.
async fn halt(bench: &mut Bench<'_>, board: u8) {
    for _ in 0..3 {
        bench.send(Function::Admin, board, &[0; 4]).await;
        bench.receive(20 * MS).await;
    }
}

pub(super) async fn walk(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    let Some(before) = bench.info(board).await else {
        return Ok(Verdict::Fail("the board does not answer PC_INFO".into()));
    };
    if !before.has_application() {
        return Ok(Verdict::Skipped("the board has no application".into()));
    }
    let times = bench.link.times();
    bench.send(Function::XReset, board, &[]).await;
    bench.link.sleep(times.xreset_wait).await;
    need!(bench.status_is(board, 0x1F, "PC_XRESET").await);
    bench.send(Function::Start, board, &[]).await;
    bench.wait(Function::McaReady, board, times.start).await;
    need!(bench.status_is(board, 0x8B, "PC_START").await);
    bench.send(Function::McaStart, board, &[]).await;
    bench.receive(times.admin).await;
    let running = bench.status_is(board, 0xAB, "MCA_PC_START").await;
    halt(bench, board).await;
    need!(running);
    need!(bench.status_is(board, 0x8B, "flags with run = 0").await);
    bench.send(Function::SetStatus, board, &[0x80, 0]).await;
    bench.receive(100 * MS).await;
    need!(bench.status_is(board, 0x1B, "MSTART = 0").await);
    Ok(Verdict::Pass)
}

pub(super) async fn start(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    bench.send(Function::SetStatus, board, &[0x84, 0]).await;
    bench.receive(100 * MS).await;
    let Some(info) = bench.info(board).await else {
        return Ok(Verdict::Fail("the board does not answer PC_INFO".into()));
    };
    bench.send(Function::Start, board, &[]).await;
    let came = bench.receive(bench.link.times().start).await;
    if !info.has_application() {
        let pass = came.iter().any(|f| is(f, Function::Error, board) && f.data() == [11]);
        return Ok(verdict(pass, &came));
    }
    if !came.iter().any(|f| is(f, Function::McaReady, board)) {
        return Ok(Verdict::Fail(list(&came)));
    }
    need!(bench.status_is(board, 0x8B, "PC_START").await);
    Ok(Verdict::Pass)
}

pub(super) async fn inputs(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    need!(bench.started(board).await?);
    let Some(d) = dimensions(bench, board).await else {
        return Ok(Verdict::Fail("the board sent no dimensions".into()));
    };
    let endian = bench.profile().endian;
    let package = |offset: u16| {
        let [a, b] = endian.bytes(offset);
        [a, b, 0, 0, 0, 0, 0, 0]
    };
    bench.send(Function::Ci, board, &package(d.ci)).await;
    let came = bench.receive(100 * MS).await;
    if !matches!(came.as_slice(), [f] if is(f, Function::Error, board) && f.data() == [5]) {
        return Ok(Verdict::Fail(format!("at the dimension {}: {}", d.ci, list(&came))));
    }
    if let Some(last) = d.ci.checked_sub(1) {
        // Input words of 0 are harmless: the control loop does not run, and its next start uses the initial inputs.
        bench.send(Function::Ci, board, &package(last)).await;
        let came = bench.receive(100 * MS).await;
        if !came.is_empty() {
            return Ok(Verdict::Fail(format!(
                "frames after the last word with surplus words: {}",
                list(&came)
            )));
        }
    }
    need!(bench.status_is(board, 0x8B, "both").await);
    Ok(Verdict::Pass)
}

pub(super) async fn alone(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    need!(bench.started(board).await?);
    let outputs = dimensions(bench, board).await.map_or(0, |d| d.so);
    let lost = u64::from(bench.profile().alive_pc_lost) * MS;
    bench.heartbeats(false);
    bench.send(Function::McaStart, board, &[]).await;
    let start = bench.link.now();
    let came = bench.hear_all(lost + 500 * MS).await;
    let ended = came.iter().find(|(at, f)| *at > start + 200 * MS && is(f, Function::Admin, board));
    let result = judge_alone(bench, board, start, lost, outputs, &came, ended).await;
    bench.heartbeats(true);
    halt(bench, board).await;
    Ok(result)
}

async fn judge_alone(
    bench: &mut Bench<'_>,
    board: u8,
    start: u64,
    lost: u64,
    outputs: u16,
    came: &[(u64, Frame)],
    ended: Option<&(u64, Frame)>,
) -> Verdict {
    let Some((at, flags)) = ended else {
        return Verdict::Fail("the board sent no flags: it continues to run without a PC".into());
    };
    let after = (at - start) / MS;
    // For all times in the acceptance tests, the measured time may differ from the expected time by 20 %.
    if flags.data().get(..2) != Some(&[0, 0]) || after * MS < lost * 4 / 5 || after * MS > lost * 6 / 5 {
        return Verdict::Fail(format!("the board sent {flags} after {after} ms"));
    }
    let so = |f: &Frame| is(f, Function::So, board);
    if outputs > 0 && !came.iter().any(|(_, f)| so(f)) {
        return Verdict::Fail("the board sent no outputs while it ran".into());
    }
    if came.iter().any(|(t, f)| so(f) && *t > at + 50 * MS) {
        return Verdict::Fail("the board sent outputs after its control loop had ended".into());
    }
    bench.heartbeats(true);
    let again = bench.hear_all(1_000 * MS).await;
    if again.iter().any(|(_, f)| so(f)) {
        return Verdict::Fail("a heartbeat started the control loop again".into());
    }
    if let Err(v) = bench.status_is(board, 0x8B, "a heartbeat").await {
        return v;
    }
    bench.send(Function::McaStart, board, &[]).await;
    bench.receive(bench.link.times().admin).await;
    bench.status_is(board, 0xAB, "MCA_PC_START").await.err().unwrap_or(Verdict::Pass)
}

pub(super) async fn alive(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    bench.link.note(format!("board {board}: D-T14 takes more than 60 s"));
    need!(bench.started(board).await?);
    bench.send(Function::McaStart, board, &[]).await;
    bench.receive(bench.link.times().admin).await;
    let result = judge_alive(bench, board).await;
    bench.heartbeats(true);
    halt(bench, board).await;
    Ok(result)
}

/// Sends a last heartbeat and then sends no heartbeats for `us` µs.
async fn pause(bench: &mut Bench<'_>, us: u64) {
    bench.heartbeats(false);
    bench.heartbeats(true);
    // Waits until the last heartbeat has been sent.
    bench.link.sleep(5 * MS).await;
    bench.heartbeats(false);
    bench.link.sleep(us - 5 * MS).await;
}

async fn judge_alive(bench: &mut Bench<'_>, board: u8) -> Verdict {
    let period = u64::from(bench.profile().alive_pc_period) * MS;
    bench.link.sleep(60_000 * MS).await;
    if let Err(v) = bench.status_is(board, 0xAB, "60 s with heartbeats").await {
        return v;
    }
    pause(bench, 2 * period).await;
    bench.heartbeats(true);
    bench.link.sleep(5 * MS).await;
    if let Err(v) = bench.status_is(board, 0xAB, "one missing heartbeat").await {
        return v;
    }
    pause(bench, 4 * period).await;
    bench.heartbeats(true);
    bench.status_is(board, 0x8B, "three missing heartbeats").await.err().unwrap_or(Verdict::Pass)
}

pub(super) async fn flags(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    need!(bench.started(board).await?);
    bench.send(Function::Admin, board, &[2, 0, 0, 0]).await;
    let came = bench.receive(150 * MS).await;
    let answered = came.iter().any(|f| is(f, Function::Admin, board) || is(f, Function::Error, board));
    let ran = bench.info(board).await.is_some_and(|info| info.status.has(Status::MCARUN));
    if answered || ran {
        halt(bench, board).await;
        return Ok(Verdict::Fail(format!("02000000: {}", list(&came))));
    }
    bench.send(Function::Admin, board, &[0; 3]).await;
    let came = bench.receive(150 * MS).await;
    let pass = matches!(came.as_slice(), [f] if is(f, Function::Error, board) && f.data() == [7]);
    Ok(verdict(pass, &came))
}
