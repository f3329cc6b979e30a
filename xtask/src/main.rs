//! Command `cargo xtask`, which runs all tasks of the workspace. `cargo xtask help` lists the tasks.
#![forbid(unsafe_code)]

mod bench;
mod book;
mod deny;
mod dependencies;
mod dist;
mod docs;
mod emulate;
mod firmware;
mod links;
mod package;
mod panics;
mod parallel;
mod paths;
mod plain_words;
mod prebuild;
mod prove;
mod python;
mod rules;
mod shell;
mod size;
mod soak;
mod suite;
mod tally;
mod test;
mod test_files;
mod web;
mod worked_bytes;

use std::process::ExitCode;

const HELP: &str = "\
Usage: cargo xtask COMMAND

  test [--quick] [--only TEXT] every check of the project; ends with `N passed, N failed, N skipped`
                               --quick: only formatting, lints, tests and the document checks
                               --only: the steps with TEXT in their heading
  bench [--json FILE] [--quick]
                               performance and tracking figures beside their anchors, all measured in this run
  bench tracking               write docs/tracking.md: our control law beside that of the existing firmware, on one arm
  soak [--hours H] [--seed N]  virtual time with random commands and faults (default: 24 hours, seed 1)
  prove mutants [--package NAME] [--left] [--longest SECONDS] [--report]
                               mutation testing of the crates that run on a board (an hour); fails when a survivor has
                               no sentence in docs/evidence.md or more than 3 % of a crate survive
                               --left: only mutants without an outcome, and survivors; --longest: duration of the
                               longest test that runs (default 0.2 s); --report: judge the results that are there
  prove fuzz [TARGET] [--runs N] [--keep]
                               run one fuzz target, or each of them, up to 20000000 executions each, counted by commit
                               in docs/evidence.md
                               --keep: afterwards add to fuzz/corpus what reaches code that no kept input does
  firmware [BOARD...]          build the boards' programs; sizes, and that the tick cannot panic
  emulate [--update]           boot those programs in an emulator of the chip: tests, and figures that must be those of
                               docs/board-figures.txt (--update: write them there)
  emulate --serial PATH        an emulated board with simulated drives behind a serial port, until interrupted
  docs                         write the generated parts of docs/ again, and make the book
  book [--out DIR]             docs/ as a book of HTML, in target/book
  dist [--out DIR] [--quick] [--made] [--twice] [--check]
                               the files of a release, in target/dist-files: static programs, Debian packages, the Python
                               wheel, images of the boards, licences, bill of materials, sums
                               --quick: only for computers like this one, and without cargo-deny
                               --made: nothing is made, the files that are there are compared or checked
                               --twice: made again by a copy of the checkout in another folder, and compared
                               --check: the packages installed, used and removed in a fresh Debian (needs root)
  size                         static memory of the controller against its limit, and of the boards' programs by region
  plain-words [PART] [--update]
                               count the marks of unclear sentences; with PART, a crate or a folder, list them
                               --update: keep the counts in xtask/plain-words.txt, which may only fall
  help                         this text
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match dispatch(&arguments) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn dispatch(arguments: &[String]) -> anyhow::Result<ExitCode> {
    let (command, rest) = match arguments.split_first() {
        Some((command, rest)) => (command.as_str(), rest),
        None => ("help", arguments),
    };
    match command {
        "test" => test::main(rest),
        "bench" => bench::main(rest),
        "soak" => soak::main(rest),
        "prove" => prove::main(rest),
        "firmware" => firmware::main(rest),
        "emulate" => emulate::main(rest),
        "docs" => docs::main(rest),
        "book" => book::main(rest),
        "dist" => dist::main(rest),
        "size" => size::main(rest),
        "plain-words" => plain_words::main(rest),
        "help" | "--help" | "-h" => {
            print!("{HELP}");
            Ok(ExitCode::SUCCESS)
        }
        other => {
            eprintln!("error: no command `{other}`\n\n{HELP}");
            Ok(ExitCode::from(2))
        }
    }
}
