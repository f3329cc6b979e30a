//! The update as a whole: checks U-1 to U-3, attempts, read-back, the next board; cancelling at any moment.

use std::collections::BTreeSet;
use std::prelude::v1::*;

use super::plan::UpdatePlan;
use super::transfer::{Attempt, Broken, Transferred};
use super::{PlanError, UpdateFailure, UpdateMode, UpdateOptions, UpdateOutcome, UpdateReport, UpdateResult};
use crate::master::control::{enter_exloader, start_application};
use crate::master::link::Link;
use crate::master::request::{confirmed, info, set_status};
use crate::master::scan::board_states;
use crate::master::{Error, Outcome};
use crate::{BoardInfo, ErrorCode, Header, Status, ToBoard};

/// What must survive a cancel.
struct Run {
    options: UpdateOptions,
    results: Vec<UpdateResult>,
    /// Boards between XRESET and their end.
    active: Vec<u8>,
    erased: BTreeSet<u8>,
}

impl Run {
    fn result(&mut self, board: u8) -> Option<&mut UpdateResult> {
        self.results.iter_mut().find(|r| r.board == board)
    }

    fn end(&mut self, board: u8, outcome: UpdateOutcome, failure: Option<UpdateFailure>) {
        self.active.retain(|b| *b != board);
        if let Some(result) = self.result(board) {
            result.outcome = outcome;
            result.failure = failure;
        }
    }

    fn fail(&mut self, board: u8, failure: UpdateFailure) {
        let outcome = match failure {
            UpdateFailure::NotVerified { .. } => UpdateOutcome::Written,
            UpdateFailure::NotRunning(_) => UpdateOutcome::Verified,
            _ if self.erased.contains(&board) => UpdateOutcome::Incomplete,
            _ => UpdateOutcome::NotStarted,
        };
        self.end(board, outcome, Some(failure));
    }

    fn open(&self) -> Vec<u8> {
        let open = |r: &&UpdateResult| r.failure.is_none() && r.outcome == UpdateOutcome::NotStarted;
        self.results.iter().filter(open).map(|r| r.board).collect()
    }

    fn flash_number(&self, board: u8) -> Option<u16> {
        self.results.iter().find(|r| r.board == board).and_then(|r| r.flash_number)
    }

    fn plan(&self, link: &Link, board: Option<u8>) -> Result<UpdatePlan, Error> {
        let named = board.and_then(|b| self.flash_number(b)).filter(|_| self.options.name_target);
        Ok(UpdatePlan::new(&self.options, named.unwrap_or(Header::ANY_BOARD), &link.profile())?)
    }
}

/// Updates all boards that need it.
pub(crate) async fn update(link: Link, options: UpdateOptions) -> Result<Outcome, Error> {
    let mut seen = BTreeSet::new();
    if options.targets.is_empty() {
        return Err(PlanError::NoTarget.into());
    }
    for target in &options.targets {
        link.board(target.board)?;
        if !seen.insert(target.board) {
            return Err(PlanError::Twice { board: target.board }.into());
        }
    }
    let results = options.targets.iter().map(|t| UpdateResult::new(t.board)).collect();
    let mut run = Run { options, results, active: Vec::new(), erased: BTreeSet::new() };
    let plan = run.plan(&link, None)?;
    match link.or_cancel(all(&link, &mut run)).await {
        Ok(()) => {}
        Err(Error::Cancelled) => cancelled(&link, &mut run).await,
        Err(e) => return Err(e),
    }
    let report = UpdateReport {
        dry_run: run.options.dry_run,
        program_id: plan.expected.map(|(id, _)| id),
        date: run.options.date,
        bytes: plan.total_bytes(),
        boards: run.results,
    };
    Ok(Outcome::Update(report))
}

/// The boards at work are told to forget the transfer; nothing half written is ever valid.
async fn cancelled(link: &Link, run: &mut Run) {
    for board in core::mem::take(&mut run.active) {
        // Best effort: what the board does not take now, its own time limit and the next XRESET undo.
        if set_status(link, board, Status::PROG, Status(0)).await.is_err() {
            link.note(format!("board {board} did not confirm that it left programming"));
        }
        let erased = run.erased.contains(&board);
        run.fail(board, UpdateFailure::Cancelled { erased });
    }
    for board in run.open() {
        run.fail(board, UpdateFailure::Cancelled { erased: false });
    }
}

async fn all(link: &Link, run: &mut Run) -> Result<(), Error> {
    check(link, run).await;
    let failed = run.results.iter().find(|r| r.failure.is_some()).map(|r| r.board);
    if let Some(after) = failed.filter(|_| !run.options.keep_going) {
        skip_open(run, after);
    }
    if run.open().is_empty() {
        return Ok(());
    }
    // U-2: program data outrank the process data of a running board.
    let states = board_states(link).await;
    let running: Vec<u8> = states.iter().filter(|(_, s)| s.has(Status::MCARUN)).map(|(b, _)| *b).collect();
    if !running.is_empty() && !run.options.force {
        let error = Error::Running { boards: running };
        for board in run.open() {
            run.fail(board, UpdateFailure::Refused(Box::new(error.clone())));
        }
        return Ok(());
    }
    if run.options.dry_run {
        return Ok(());
    }
    if let Err(error) = link.become_master(run.options.force).await {
        for board in run.open() {
            run.fail(board, UpdateFailure::Refused(Box::new(error.clone())));
        }
        return Ok(());
    }
    if run.options.mode == UpdateMode::Group && run.open().len() > 1 && link.profile().everybody().is_some() {
        let selected = run.open();
        for (board, status) in states {
            if status.has(Status::PROG) && !selected.contains(&board) {
                set_status(link, board, Status::PROG, Status(0)).await?;
            }
        }
        group(link, run).await?;
    }
    for board in run.open() {
        one(link, run, board, 1).await?;
        let failed = run.results.iter().any(|r| r.board == board && r.failure.is_some());
        if failed && !run.options.keep_going {
            skip_open(run, board);
            break;
        }
    }
    Ok(())
}

fn skip_open(run: &mut Run, after: u8) {
    for board in run.open() {
        run.fail(board, UpdateFailure::Skipped { after });
    }
}

/// U-1 and U-3, by questions only.
async fn check(link: &Link, run: &mut Run) {
    for target in run.options.targets.clone() {
        let board = target.board;
        let known = match confirmed(link, board).await {
            Ok(seen) => seen.info,
            Err(e) => {
                run.fail(board, UpdateFailure::Refused(Box::new(e)));
                continue;
            }
        };
        let found = known.flash_number;
        if let Some(result) = run.result(board) {
            result.flash_number = Some(found);
        }
        if let Some(wanted) = target.flash_number.filter(|wanted| *wanted != found) {
            let error = Error::WrongBoard { board, wanted, found };
            run.fail(board, UpdateFailure::Refused(Box::new(error)));
            continue;
        }
        let there = run.plan(link, Some(board)).is_ok_and(|plan| has(&known, &plan));
        if there && !run.options.force {
            run.end(board, UpdateOutcome::UpToDate, None);
        }
    }
}

/// Whether the board shows what the plan shall bring about.
fn has(known: &BoardInfo, plan: &UpdatePlan) -> bool {
    known.has_application() && plan.expected == Some((known.program_id, known.date))
}

/// One board, from attempt number `first` on.
async fn one(link: &Link, run: &mut Run, board: u8, first: u32) -> Result<(), Error> {
    let plan = run.plan(link, Some(board))?;
    let profile = link.profile();
    let mut gap_us = u64::from(profile.prog_frame_gap_us);
    let since = link.now();
    for number in first..=profile.prog_attempts.max(first) {
        run.active = vec![board];
        if let Some(result) = run.result(board) {
            result.attempts = number;
        }
        let again = attempt(link, run, board, &plan, number, gap_us).await;
        if let Some(result) = run.result(board) {
            result.time_us = link.now().saturating_sub(since);
        }
        match again {
            None => break,
            // Overruns: the board needs more time between frames.
            Some(Broken::Device { code: ErrorCode::Overrun | ErrorCode::CanOverrun, .. }) => {
                gap_us = (gap_us * 2).max(500);
            }
            Some(_) => {}
        }
        if number < profile.prog_attempts {
            link.note(format!("board {board}: attempt {number} failed, once more"));
        }
    }
    run.active.clear();
    Ok(())
}

/// One attempt with one board; `Some`: it failed in a way that another attempt may heal (the result says how).
async fn attempt(
    link: &Link,
    run: &mut Run,
    board: u8,
    plan: &UpdatePlan,
    number: u32,
    gap_us: u64,
) -> Option<Broken> {
    if let Err(error) = enter_exloader(link, board, run.flash_number(board)).await {
        let error = Box::new(error);
        let lost = run.erased.contains(&board);
        run.fail(board, if lost { UpdateFailure::After(error) } else { UpdateFailure::NoAnswer(error) });
        return None;
    }
    let to = link.board(board).ok()?;
    let since = link.now();
    let boards = vec![board];
    let attempt = Attempt { link, plan, to, boards, number, gap_us, since };
    let erased = &mut run.erased;
    let Transferred { broken, .. } = attempt.run(|boards| erased.extend(boards)).await;
    judge(link, run, board, plan, number, broken.first().map(|(_, b)| *b)).await
}

/// Read-back, or what an early end means.
async fn judge(
    link: &Link,
    run: &mut Run,
    board: u8,
    plan: &UpdatePlan,
    attempts: u32,
    broken: Option<Broken>,
) -> Option<Broken> {
    let erased = run.erased.contains(&board);
    let failure = match broken {
        None => {
            verify(link, run, board, plan).await;
            return None;
        }
        Some(Broken::NoFinish { .. }) if shows(link, board, plan).await => {
            // U-9: only DSP_PROGFINISHED was lost.
            verify(link, run, board, plan).await;
            return None;
        }
        Some(Broken::NoFinish { waited_ms }) => {
            let block = plan.frames(1).saturating_sub(1) / 8;
            UpdateFailure::Timeout { cycle: 2, block, waited_ms, attempts, erased }
        }
        Some(Broken::Timeout { cycle, block, waited_ms }) => {
            UpdateFailure::Timeout { cycle, block, waited_ms, attempts, erased }
        }
        Some(Broken::Device { code, cycle, block }) => {
            UpdateFailure::Device { code, cycle, block, attempts, erased }
        }
    };
    run.fail(board, failure);
    // The board must not take what comes next for the rest of this transfer.
    if let Ok(to) = link.board(board) {
        link.send(to, ToBoard::SetStatus { mask: Status::PROG.0, value: 0 }).await;
    }
    // U-7: the image or the board is wrong, another attempt would end the same.
    let hopeless = |code| matches!(code, ErrorCode::MemProtected | ErrorCode::Data);
    broken.filter(|b| !matches!(b, Broken::Device { code, .. } if hopeless(*code)))
}

async fn shows(link: &Link, board: u8, plan: &UpdatePlan) -> bool {
    confirmed(link, board).await.is_ok_and(|seen| has(&seen.info, plan))
}

/// U-10: the board must show the new program; then, if wanted, it must run.
async fn verify(link: &Link, run: &mut Run, board: u8, plan: &UpdatePlan) {
    let known = match confirmed(link, board).await {
        Ok(seen) => seen.info,
        Err(e) => {
            run.fail(board, UpdateFailure::After(Box::new(e)));
            // The board said that it is done; only the read-back is missing.
            if let Some(result) = run.result(board) {
                result.outcome = UpdateOutcome::Written;
            }
            return;
        }
    };
    let Some((wanted_id, wanted_date)) = plan.expected else {
        // A raw image hides its numbers: what the board says must do.
        return run.end(board, UpdateOutcome::Written, None);
    };
    if !has(&known, plan) {
        let (program_id, date) = (known.program_id, known.date);
        let failure = UpdateFailure::NotVerified { program_id, date, wanted_id, wanted_date };
        return run.fail(board, failure);
    }
    run.end(board, UpdateOutcome::Verified, None);
    if !run.options.start {
        return;
    }
    run.active.push(board);
    let started = match start_application(link, board).await {
        Ok(_) => info(link, board).await,
        Err(e) => Err(e),
    };
    match started {
        Ok(seen) if has(&seen.info, plan) && seen.info.status.has(Status::MSTART) => {
            run.end(board, UpdateOutcome::Running, None);
        }
        Ok(seen) => {
            let what = "the application does not run";
            let error = Error::NotReached { board, what, waited_ms: 0, status: seen.info.status };
            run.fail(board, UpdateFailure::NotRunning(Box::new(error)));
        }
        Err(e) => run.fail(board, UpdateFailure::NotRunning(Box::new(e))),
    }
}

/// All open boards at once by broadcast; those that fall behind stay open for an attempt of their own.
async fn group(link: &Link, run: &mut Run) -> Result<(), Error> {
    let plan = run.plan(link, None)?;
    let since = link.now();
    let mut boards = Vec::new();
    for board in run.open() {
        run.active.push(board);
        match enter_exloader(link, board, run.flash_number(board)).await {
            Ok(_) => boards.push(board),
            Err(e) => run.fail(board, UpdateFailure::NoAnswer(Box::new(e))),
        }
    }
    for board in &boards {
        if let Some(result) = run.result(*board) {
            result.attempts = 1;
        }
    }
    let to = link.everybody();
    let gap_us = u64::from(link.profile().prog_frame_gap_us);
    let since_transfer = link.now();
    let attempt = Attempt { link, plan: &plan, to, boards, number: 1, gap_us, since: since_transfer };
    let erased = &mut run.erased;
    let Transferred { finished, broken } = attempt.run(|boards| erased.extend(boards)).await;
    for board in finished {
        judge(link, run, board, &plan, 1, None).await;
        if let Some(result) = run.result(board) {
            result.time_us = link.now().saturating_sub(since);
        }
    }
    for (board, why) in broken {
        // A board whose READY was lost may have gone on with the others and be done.
        if !matches!(why, Broken::Device { .. }) && shows(link, board, &plan).await {
            verify(link, run, board, &plan).await;
        } else if judge(link, run, board, &plan, 1, Some(why)).await.is_some()
            && link.profile().prog_attempts > 1
        {
            run.active.push(board);
            one(link, run, board, 2).await?;
        }
    }
    Ok(())
}
