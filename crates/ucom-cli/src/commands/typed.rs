//! Lines that the user types during `ucom run`. Typed lines set inputs and parameters, and switch outputs on and off.

use cli_kit::Failure;
use std::io::{BufRead, ErrorKind};
use std::sync::mpsc::{Receiver, channel};

use ucom_host::master::io::Kind;
use ucom_host::master::{AdminChange, Request, Setting};
use ucom_host::session::{Driver, History, Prepared, note_rounded, only, words};

use crate::args::{Assignment, RunArgs};

/// Reads lines from stdin in a separate thread, so that the bus session continues.
pub(super) fn typed() -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || each_line(std::io::stdin().lock(), |line| sender.send(line).is_ok()));
    receiver
}

/// Passes each line of the input to `take` until the input ends, or until `take` returns `false`. A line with bytes
/// that are not text is also passed, and is later reported as invalid. Therefore a `stop` in a later line still takes
/// effect.
fn each_line(mut from: impl BufRead, mut take: impl FnMut(String) -> bool) {
    let mut line = Vec::new();
    loop {
        line.clear();
        match from.read_until(b'\n', &mut line) {
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Ok(0) | Err(_) => return,
            Ok(_) => {
                if !take(String::from_utf8_lossy(&line).into_owned()) {
                    return;
                }
            }
        }
    }
}

/// Parses the assignments in a typed line. A word without `=` is the unit of the previous value, as in
/// `current_max=1500 mA`.
fn assignments<'a>(words: impl Iterator<Item = &'a str>) -> Result<Vec<Assignment>, Failure> {
    let mut values: Vec<String> = Vec::new();
    for word in words {
        match values.last_mut() {
            Some(last) if !word.contains('=') => *last += &format!(" {word}"),
            _ => values.push(word.to_owned()),
        }
    }
    values.iter().map(|word| word.parse().map_err(Failure::usage)).collect()
}

/// Executes a typed line: `ci 1 set_position=1500`, `par 1 kp=80`, `active on` or `active off`.
pub(super) fn obey(
    driver: &mut Driver,
    args: &RunArgs,
    line: &str,
    prepared: &Prepared,
) -> Result<(), Failure> {
    let form = || {
        Failure::usage(format!(
            "\"{line}\" is not a command, expected ci N NAME=VALUE, par N NAME=VALUE, active on|off, or stop"
        ))
    };
    let mut parts = line.split_whitespace();
    match parts.next() {
        None => Ok(()),
        Some("active") => {
            let on = match parts.next() {
                Some("on") => true,
                Some("off") => false,
                _ => return Err(form()),
            };
            let boards: Vec<u8> = prepared.known.keys().copied().collect();
            if !on {
                // The errors of all boards were already reported, so only the first error is returned.
                let failed = driver.outputs_safe(&boards, true).failed;
                return failed.into_iter().next().map_or(Ok(()), |(_, failure)| Err(failure.into()));
            }
            let mut done = Vec::new();
            for board in boards {
                let change = AdminChange { active: Some(true), ..Default::default() };
                let enabled = driver.run(Request::Admin { board, change, force: true });
                enabled.map_err(|failure| failure.after(done.iter().copied()))?;
                done.push(board);
            }
            Ok(())
        }
        Some(kind @ ("ci" | "par")) => {
            let board: u8 = parts.next().and_then(|n| n.parse().ok()).ok_or_else(form)?;
            let not_run = || Failure::usage(format!("board {board} is not one of the running boards"));
            let known = prepared.known.get(&board).ok_or_else(not_run)?;
            let values = assignments(parts)?;
            only(&[board], &values, "set")?;
            let kind = if kind == "ci" { Kind::Ci } else { Kind::Par };
            let words = words(known, kind, &values)?;
            note_rounded(driver, board, kind, &words);
            for word in &words {
                let (now, Setting { name, value }) = (driver.now_us(), known.setting(kind, word));
                match kind {
                    Kind::Ci => driver.master.set_input(now, board, &name, value)?,
                    _ => driver.master.set_parameter(now, board, &name, value)?,
                };
            }
            if kind == Kind::Par {
                let words = words.iter().map(|w| (w.index, w.word));
                History::of(&args.cache.cache(), &known.info).wrote(words);
            }
            Ok(())
        }
        Some(_) => Err(form()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_no_text_does_not_end_the_input() {
        let mut received = Vec::new();
        each_line(&b"ci 1 \xFF=3\nstop\nlast"[..], |line| {
            received.push(line.trim().to_owned());
            true
        });
        assert_eq!(received, ["ci 1 \u{FFFD}=3", "stop", "last"]);
    }

    #[test]
    fn units_may_stand_apart_from_their_values() {
        let typed = |line: &str| assignments(line.split_whitespace()).unwrap();
        assert_eq!(typed("current_max=1500 mA kp=3"), typed("current_max=1500mA kp=3"));
        assert!(assignments("mA".split_whitespace()).is_err());
    }
}
