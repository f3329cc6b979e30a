//! `ucom update`: firmware onto boards, checked, written, verified.

use cli_kit::{Output, ProgressBar};
use ucom::files::Inventory;
use ucom::master::update::{Progress, UpdateMode, UpdateOptions, UpdateTarget};
use ucom::master::{Event, Outcome, Request};

use super::update_files::{Files, day};
use super::update_report::print;
use crate::args::{Boards, LinkArgs, UpdateArgs};
use crate::driver::{Driver, unexpected};
use crate::failure::{Failure, REFUSED};

/// Programs the boards that are meant.
pub fn update(args: &UpdateArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let profile = link.profile()?;
    let files = Files::read(args, &profile, out)?;
    let day = day(args.date.as_deref(), &profile)?;
    let mut driver = Driver::with_profile(link, profile, out)?;
    let numbers = driver.numbers(&args.boards)?;
    let targets = targets(args, &numbers)?;
    let several = targets.len() > 1;
    let options = UpdateOptions {
        dry_run: args.dry_run,
        force: args.force.force,
        start: args.start,
        mode: if args.group { UpdateMode::Group } else { UpdateMode::OneByOne },
        second: files.second,
        expect_program_id: args.expect_program_id,
        name_target: args.name_target,
        // The other boards of a campaign are none the worse for one that fails.
        keep_going: several,
        ..UpdateOptions::new(targets, files.image, day)
    };
    let mut bar = Bar { bar: None, out };
    let outcome = driver.run_with(Request::Update(options), &mut |event| bar.see(event));
    bar.end();
    let report = match outcome? {
        Outcome::Update(report) => report,
        other => return Err(unexpected(&other)),
    };
    print(&report, &files.names, &profile, out);
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
