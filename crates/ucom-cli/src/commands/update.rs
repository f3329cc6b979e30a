//! `ucom update`: firmware onto boards, checked, written, verified.

use cli_kit::{Output, ProgressBar, table};
use serde_json::{Value, json};
use ucom::Profile;
use ucom::files::{Image, ImageOptions, Inventory};
use ucom::master::update::{Progress, UpdateImage, UpdateOptions, UpdateReport, UpdateResult, UpdateTarget};
use ucom::master::{Event, Outcome, Request};

use crate::args::{Boards, LinkArgs, UpdateArgs};
use crate::driver::{Driver, unexpected};
use crate::failure::{Failure, REFUSED};
use crate::shape::date;

/// Programs the boards that are meant.
pub fn update(args: &UpdateArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let profile = link.profile()?;
    let image = Image::read(&args.image, &ImageOptions::default())
        .map_err(|e| Failure::usage(e).hint("formats are raw binary, Intel HEX and S-record"))?;
    for note in image.notes() {
        out.note(format!("note: {note}"));
    }
    let day = day(args.date.as_deref(), &profile)?;
    let mut driver = Driver::with_profile(link, profile, out)?;
    let numbers = driver.numbers(&args.boards)?;
    let targets = targets(args, &numbers)?;
    let bytes = UpdateImage { bytes: image.bytes().to_vec(), address_words: image.address_words() };
    let several = targets.len() > 1;
    let options = UpdateOptions {
        dry_run: args.dry_run,
        force: args.force.force,
        start: args.start,
        // The other boards of a campaign are none the worse for one that fails.
        keep_going: several,
        ..UpdateOptions::new(targets, bytes, day)
    };
    let mut bar = Bar { bar: None, out };
    let outcome = driver.run_with(Request::Update(options), &mut |event| bar.see(event));
    bar.end();
    let report = match outcome? {
        Outcome::Update(report) => report,
        other => return Err(unexpected(&other)),
    };
    print(&report, &profile, out);
    match report.exit_code() {
        0 => Ok(()),
        code => Err(Failure::printed(code)),
    }
}

/// Which flash number each board must have: named, else as the inventory has it.
fn targets(args: &UpdateArgs, numbers: &[u8]) -> Result<Vec<UpdateTarget>, Failure> {
    if let Some(flash) = args.flash_id {
        return match numbers {
            [board] => Ok(vec![UpdateTarget { board: *board, flash_number: Some(flash) }]),
            _ => Err(Failure::usage(format!("--flash-id names one board, but {} are meant", numbers.len()))
                .hint("a list takes the flash ids from the inventory that ucom init writes")),
        };
    }
    if !args.inventory.exists() {
        // One board by its number alone is what the user said; a list needs to know who is who.
        if let ([board], Boards::Some(_)) = (numbers, &args.boards) {
            return Ok(vec![UpdateTarget { board: *board, flash_number: None }]);
        }
        return Err(Failure::new(
            REFUSED,
            "no-inventory",
            format!("which boards stand where? there is no inventory {}", args.inventory.display()),
        )
        .hint("ucom init writes one; or name one board and its --flash-id"));
    }
    let inventory = Inventory::read(&args.inventory).map_err(Failure::usage)?;
    let target = |board: &u8| match inventory.get(*board) {
        Some(known) => Ok(UpdateTarget { board: *board, flash_number: Some(known.flash_number) }),
        None => Err(Failure::new(
            REFUSED,
            "not-in-inventory",
            format!("board {board} is not in the inventory {}", args.inventory.display()),
        )
        .hint("ucom init --renew writes it anew; or name the board's --flash-id")),
    };
    numbers.iter().map(target).collect()
}

/// The flash date: as asked, else today (UTC).
fn day(asked: Option<&str>, profile: &Profile) -> Result<u16, Failure> {
    let (year, month, day) = match asked {
        Some(text) => {
            parsed(text).ok_or_else(|| Failure::usage(format!("--date {text}: the form is YYYY-MM-DD")))?
        }
        None => {
            let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
            civil(now.as_secs() / 86_400)
        }
    };
    profile.prog_date.encode(year, month, day).ok_or_else(|| {
        let form = profile.prog_date;
        Failure::usage(format!("{year:04}-{month:02}-{day:02} is no date that prog.date = {form} can hold"))
    })
}

fn parsed(text: &str) -> Option<(u16, u8, u8)> {
    let mut parts = text.split('-');
    let date = (parts.next()?.parse().ok()?, parts.next()?.parse().ok()?, parts.next()?.parse().ok()?);
    parts.next().is_none().then_some(date)
}

/// Year, month and day of a day since 1970-01-01 (Hinnant, "chrono-compatible low-level date algorithms").
fn civil(days: u64) -> (u16, u8, u8) {
    let z = days + 719_468;
    let (era, day_of_era) = (z / 146_097, z % 146_097);
    let year = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year + era * 400 + u64::from(month <= 2);
    (year as u16, month as u8, day as u8)
}

/// The bar on stderr.
struct Bar<'a> {
    bar: Option<(Vec<u8>, ProgressBar)>,
    out: &'a Output,
}

impl Bar<'_> {
    fn see(&mut self, event: &Event) {
        let Event::Progress { progress, .. } = event else { return };
        if self.bar.as_ref().is_none_or(|(boards, _)| *boards != progress.boards) {
            self.end();
            let list: Vec<String> = progress.boards.iter().map(u8::to_string).collect();
            let bar = self.out.bytes_bar(progress.total, &format!("board {}", list.join(", ")));
            self.bar = Some((progress.boards.clone(), bar));
        }
        if let Some((_, bar)) = &self.bar {
            bar.set_position(progress.bytes);
            bar.set_message(said(progress));
        }
    }

    fn end(&mut self) {
        if let Some((_, bar)) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}

fn said(p: &Progress) -> String {
    let cycle = if p.cycle == 1 { "checking" } else { "writing" };
    let attempt = if p.attempt > 1 { format!(", attempt {}", p.attempt) } else { String::new() };
    let (rate, left) = (p.rate as f64 / 1000.0, p.remaining_us as f64 * 1e-6);
    format!("{cycle}{attempt}, {rate:.1} kB/s, {left:.0} s left")
}

fn print(report: &UpdateReport, profile: &Profile, out: &Output) {
    let value = json!({
        "dry_run": report.dry_run,
        "program_id": report.program_id,
        "flash_date": date(profile, report.date),
        "bytes": report.bytes,
        // The outcome of one board is what scripts ask for most.
        "outcome": match report.boards.as_slice() {
            [one] => json!(one.outcome.name()),
            _ => Value::Null,
        },
        "boards": report.boards.iter().map(result).collect::<Vec<_>>(),
        "exit": report.exit_code(),
    });
    out.result(&value, || {
        let row = |b: &UpdateResult| {
            let why = b.failure.as_ref().map_or_else(String::new, ToString::to_string);
            let flash = b.flash_number.map_or_else(|| "?".into(), |f| format!("0x{f:04X}"));
            let time = if b.time_us > 0 { format!("{:.1} s", b.time_us as f64 * 1e-6) } else { "-".into() };
            vec![b.board.to_string(), flash, b.outcome.name().into(), b.attempts.to_string(), time, why]
        };
        let rows: Vec<Vec<String>> = report.boards.iter().map(row).collect();
        let head = match (report.dry_run, report.program_id) {
            (true, _) => "dry run: nothing was changed\n".to_owned(),
            (false, Some(id)) => format!("program 0x{id:04X}, {}\n", date(profile, report.date)),
            (false, None) => String::new(),
        };
        let hint =
            |b: &UpdateResult| b.failure.as_ref().map(|f| format!("board {}: {}\n", b.board, f.hint()));
        let hints: String = report.boards.iter().filter_map(hint).collect();
        head + &table(&[">board", "flash id", "outcome", ">attempts", ">time", ""], &rows) + &hints
    });
}

fn result(b: &UpdateResult) -> Value {
    json!({
        "board": b.board,
        "flash_number": b.flash_number,
        "outcome": b.outcome.name(),
        "attempts": b.attempts,
        "time_s": b.time_us as f64 * 1e-6,
        "error": b.failure.as_ref().map(|f| json!({
            "code": f.code(), "message": f.to_string(), "hint": f.hint(), "exit": f.exit_code(),
        })),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_those_of_the_calendar() {
        assert_eq!(civil(0), (1970, 1, 1));
        assert_eq!(civil(11_016), (2000, 2, 29));
        assert_eq!(civil(20_088), (2024, 12, 31));
        assert_eq!(parsed("2009-06-01"), Some((2009, 6, 1)));
        assert_eq!(day(Some("2009-06-01"), &Profile::default()).ok(), Some(0x3AC1));
        for wrong in ["2009", "2009-06", "2009-06-01-1", "x-06-01", "1979-01-01", "2009-13-01"] {
            assert!(day(Some(wrong), &Profile::default()).is_err(), "{wrong}");
        }
    }
}
