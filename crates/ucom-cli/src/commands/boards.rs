//! Commands that send single requests to boards: `ucom info`, `status`, `reset`, `xreset`, `start`, `stop`.

use cli_kit::{Diagnose, ErrorKind, Failure, Output, error_object, exit};
use serde_json::json;
use ucom::{Profile, Status};
use ucom_host::master::{Outcome, RawStatus, Reports, Request, StopLevel, counted, state_name};
use ucom_host::session::{Numbered, SessionError, Stopped};

use crate::args::{ActArgs, Boards, BoardsArgs, LinkArgs, ResetArgs, StatusArgs, StopArgs};
use crate::session::shared_numbers;
use crate::shape::{bits, board_table, board_value, info_value};

/// Shows the information that boards report about themselves.
pub(super) fn info(args: &BoardsArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut driver = link.session()?;
    let profile = driver.master.profile();
    let mut boards = Vec::new();
    for board in driver.numbers(&args.boards)? {
        match driver.run(Request::Info { board })? {
            Outcome::Info(seen) => boards.push(seen),
            other => return Err(SessionError::from(other).into()),
        }
    }
    let value = json!({ "boards": boards.iter().map(|b| board_value(b, &profile)).collect::<Vec<_>>() });
    out.result(&value, || board_table(&boards, &profile));
    Ok(())
}

/// Sets and clears status bits of boards if the user requests this, then shows the status bits.
pub(super) fn status(args: &StatusArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let (set, clear) = (args.set.unwrap_or_default(), args.clear.unwrap_or_default());
    let (both, mirrors) = (set & clear, (set | clear) & Status::MIRRORS);
    if both != Status(0) {
        return Err(Failure::usage(format!("{both}: a bit cannot be set and cleared in one command")));
    }
    if mirrors != Status(0) {
        return Err(Failure::usage(format!(
            "{mirrors}: this bit mirrors the real state and cannot be written"
        ))
        .next("ucom start, ucom stop and ucom init change what these bits show"));
    }
    if let Some(bytes) = args.raw {
        return raw_status(args, bytes, link, out);
    }
    let mut driver = link.session()?;
    let profile = driver.master.profile();
    let boards = driver.numbers(&args.boards)?;
    let force = args.force.force;
    let all = match set | clear {
        Status(0) => driver.statuses(&boards)?,
        mask => driver.change_each(&boards, |board| Request::SetStatus { board, mask, value: set, force })?,
    };
    print(&all, &profile, out);
    Ok(())
}

/// Sends one PC_SETSTATUS with the two bytes of `--raw` to each board, or a single broadcast to all boards. Shows the actual status
/// of each board, and the status that the rules require.
fn raw_status(
    args: &StatusArgs,
    (mask, value): (u8, u8),
    link: &LinkArgs,
    out: &Output,
) -> Result<(), Failure> {
    let mut driver = link.session()?;
    let all = driver.set_raw_status(&args.boards, (mask, value), args.force.force)?;
    let row = |b: &RawStatus| {
        json!({
            "number": b.board,
            "before": b.before.status.0,
            "expected": b.expected.0,
            "after": b.after.map(|info| info.status.0),
            "as_expected": b.as_expected(),
        })
    };
    let result = json!({ "mask": mask, "value": value, "boards": all.iter().map(row).collect::<Vec<_>>() });
    out.result(&result, || {
        let outside = Status(value & !mask);
        let mut text = format!("sent: new = (old & ~0x{mask:02X}) | 0x{value:02X}\n");
        if outside != Status(0) {
            text +=
                &format!("these value bits are outside the mask, and the board sets them too: {outside}\n");
        }
        if Status(mask | value) & Status::MIRRORS != Status(0) {
            text += &format!(
                "{}: these bits mirror the real state, and a write does not change them\n",
                Status(mask | value) & Status::MIRRORS
            );
        }
        for b in &all {
            let after = match b.after {
                Some(info) => format!("0x{:02X} {}", info.status.0, info.status),
                None => "the board no longer answers to this number".into(),
            };
            let verdict = match b.as_expected() {
                true => String::new(),
                false => format!("; the rules require 0x{:02X} {}", b.expected.0, b.expected),
            };
            text += &format!("board {}: 0x{:02X} -> {after}{verdict}\n", b.board, b.before.status.0);
        }
        text
    });
    match all.iter().all(RawStatus::as_expected) {
        true => Ok(()),
        false => Err(Failure::shown(ErrorKind::Device)),
    }
}

fn print(all: &[Numbered], profile: &Profile, out: &Output) {
    let value =
        json!({ "boards": all.iter().map(|(n, info)| info_value(*n, info, profile)).collect::<Vec<_>>() });
    out.result(&value, || lines_of(all));
}

fn lines_of(all: &[Numbered]) -> String {
    let line = |(n, info): &Numbered| {
        let (status, words) = (info.status, bits(info.status).join(" "));
        if !status.has(Status::INIT) {
            return format!("board {n:<3} has lost its number; `ucom init` assigns a new number\n");
        }
        format!("board {n:<3} 0x{:02X}  {:12} {words}\n", status.0, state_name(status))
    };
    all.iter().map(line).collect()
}

/// Sends PC_RESET, either to all boards at once or to one board after the other.
pub(super) fn reset(args: &ResetArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut driver = link.session()?;
    let force = args.force.force;
    let boards: Vec<Option<u8>> = match &args.boards {
        Boards::All => vec![None],
        Boards::None => Vec::new(),
        Boards::Some(numbers) => numbers.iter().copied().map(Some).collect(),
    };
    let mut reports = Reports::default();
    for board in boards {
        match driver.run(Request::Reset { board, force })? {
            Outcome::Reset(some) => reports.ids.extend(some.ids),
            other => return Err(SessionError::from(other).into()),
        }
    }
    if reports.ids.is_empty() {
        return Err(Failure::new(ErrorKind::NoLink, "no-boards", "no board reported after the reset")
            .next("find the cause with ucom doctor"));
    }
    out.result(&json!({ "reports": reports.ids }), || {
        let ids: Vec<String> = reports.ids.iter().map(|id| format!("0x{id:02X}")).collect();
        let whose = if ids.len() == 1 { "its number is" } else { "their numbers are" };
        let boards = counted(ids.len(), "board");
        format!("{boards} reported: {}\n{whose} withdrawn; next: ucom init\n", ids.join(" "))
    });
    Ok(())
}

/// Sends PC_XRESET. After PC_XRESET, the board runs the exloader, and programming is enabled.
pub(super) fn xreset(args: &ActArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    act(args, link, out, |board, force| Request::XReset { board, force })
}

/// Sends PC_START, which starts the application of a board.
pub(super) fn start(args: &ActArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    act(args, link, out, |board, force| Request::Start { board, force })
}

fn act(
    args: &ActArgs,
    link: &LinkArgs,
    out: &Output,
    request: fn(u8, bool) -> Request,
) -> Result<(), Failure> {
    let mut driver = link.session()?;
    let profile = driver.master.profile();
    let boards = driver.numbers(&args.boards)?;
    let all = driver.change_each(&boards, |board| request(board, args.force.force))?;
    print(&all, &profile, out);
    Ok(())
}

/// Stops the outputs, the control loop and the application of boards, as the user requests. A stop is always allowed, even if another
/// PC is the master of the bus.
pub(super) fn stop(args: &StopArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut driver = link.session()?;
    let profile = driver.master.profile();
    let level = if args.control_only { StopLevel::Loop } else { StopLevel::Application };
    let Stopped { boards: all, failed } = driver.stop_each(&args.boards, level)?;
    // Two boards with the same number do not prevent a stop, because both boards receive the stop command. The
    // command reports these boards after the stop.
    let shared = shared_numbers(&driver.master);
    for error in driver.master.shared_numbers() {
        driver.note(format!("{error}; both boards received the Stop\n  {}", error.hint()));
    }
    let boards = all.iter().map(|(n, info)| info_value(*n, info, &profile)).collect::<Vec<_>>();
    let mut failures: Vec<(u8, Failure)> = failed.into_iter().map(|(board, e)| (board, e.into())).collect();
    let Some(worst) = failures.iter().map(|(_, f)| f).max_by_key(|f| exit::of(f.kind)).map(|f| f.kind) else {
        out.result(&json!({ "boards": boards, "shared_numbers": shared }), || lines_of(&all));
        return Ok(());
    };
    if all.is_empty()
        && let [_] = failures[..]
        && let Some((_, failure)) = failures.pop()
    {
        return Err(failure);
    }
    let error = |(board, f): &(u8, Failure)| {
        let mut value = error_object(f);
        value["board"] = json!(board);
        value
    };
    let failed = failures.iter().map(error).collect::<Vec<_>>();
    out.result(&json!({ "boards": boards, "failed": failed, "shared_numbers": shared }), || {
        let numbers: Vec<String> = failures.iter().map(|(board, _)| board.to_string()).collect();
        lines_of(&all) + &format!("not stopped for certain: {}\n", numbers.join(", "))
    });
    Err(Failure::shown(worst))
}
