//! Tests of `jtc` at a terminal: the live view from start to end, and a run with its progress bar.
#![cfg(unix)]

use crate::common;

use std::io::{BufRead, BufReader};
use std::process::Stdio;

use cli_kit::testing::{Terminal, signal};
use common::{Sim, motion, slow_motion};

/// Starts a slow motion that continues after the end of its command.
fn moving(sim: &Sim) {
    let file = sim.file("slow.csv", &slow_motion(300));
    let mut run = sim.command(&["--json", "traj", "run", &file]);
    let mut run = run.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(run.stderr.take().unwrap()).lines().map_while(Result::ok);
    assert!(lines.any(|line| line.contains("\"sample\"")), "it does not move");
    run.kill().unwrap();
    run.wait().unwrap();
}

/// The live view can stop a motion that another, ended command has started. The view shows the Stop and restores the
/// terminal.
#[test]
fn j33_the_stop_key_of_the_view_stops() {
    let sim = Sim::start(&["--no-throttle"]).held();
    moving(&sim);
    let mut terminal = Terminal::new(40, 12);
    let mut child = terminal.start(&sim.command(&["monitor"]));
    terminal.until_it_shows(" Operate ");
    terminal.until_it_shows("s stops   q ends");
    terminal.press("s");
    terminal.until_it_shows("stopping on the path");
    terminal.until_it_shows("trajectory Stop");
    terminal.press("q");
    assert_eq!(terminal.ends(&mut child), 0);
    assert!(terminal.is_as_before());
}

/// For every cause of its end, the live view ends at once and restores the terminal.
#[test]
fn the_view_ends_with_its_terminal_its_reader_and_its_signals() {
    let sim = Sim::start(&["--no-throttle"]);
    for name in ["-INT", "-TERM"] {
        let mut terminal = Terminal::new(80, 24);
        let mut child = terminal.start(&sim.command(&["monitor"]));
        terminal.until_it_shows("joint 6");
        signal(&child, name);
        assert_eq!(terminal.ends(&mut child), 0, "{name}");
        assert!(terminal.is_as_before() && !terminal.picture.text().contains("thread"), "{name}");
        // The terminal has received the control sequence that shows its previous screen again.
        assert!(String::from_utf8_lossy(&terminal.bytes).contains("\u{1B}[?1049l"), "{name}");
    }
    // The terminal is closed twice: once while the command receives SIGHUP, and once while the command ignores SIGHUP
    // (`nohup`).
    for nohup in [false, true] {
        let mut terminal = Terminal::new(60, 20);
        let mut monitor = sim.command(&["monitor"]);
        if nohup {
            let mut shell = std::process::Command::new("sh");
            shell
                .args(["-c", "trap '' HUP; exec \"$0\" \"$@\""])
                .arg(monitor.get_program())
                .args(monitor.get_args());
            monitor = shell;
        }
        let mut child = terminal.start(&monitor);
        terminal.until_it_shows("joint 6");
        terminal.hang_up();
        assert_eq!(terminal.ends(&mut child), 0, "nohup: {nohup}");
    }
    // Without a terminal, the command prints one line per status. The output ends when the reader closes the pipe.
    let mut child = sim.command(&["monitor"]);
    let mut child = child.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut line = String::new();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    out.read_line(&mut line).unwrap();
    assert!(line.contains("Init") && !line.contains('\u{1B}'), "{line}");
    drop(out);
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

/// If a terminal has fewer than 40 columns, the keys still work, and the command prints the required size.
#[test]
fn a_small_terminal_says_so_and_its_keys_work() {
    let sim = Sim::start(&["--no-throttle"]);
    let mut terminal = Terminal::new(30, 8);
    let mut child = terminal.start(&sim.command(&["monitor"]));
    terminal.until_it_shows("needs 40 columns");
    assert!(terminal.picture.rows()[0].starts_with("s stops"), "{}", terminal.picture.text());
    terminal.press("s");
    terminal.press("q");
    assert_eq!(terminal.ends(&mut child), 0);
}

/// Text that the command prints during a progress bar appears above the bar, and no part of the bar remains. The command reports if a
/// key has no effect.
#[test]
fn j33_a_run_at_a_terminal_leaves_no_stray_bar() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let file = sim.file("motion.csv", &motion(0.2));
    let mut terminal = Terminal::new(40, 40);
    let mut child = terminal.start(&sim.command(&["traj", "run", &file, "--speed", "10"]));
    terminal.until("the bar", |p| p.text().contains("% of 12.0 s") && p.text().contains("space pauses"));
    // Ctrl-S does not block the output, so the space bar still pauses the motion.
    terminal.press("\u{13} ");
    terminal.until_it_shows("paused; press space to resume");
    terminal.press(" ");
    terminal.until("the motion goes on", |p| p.text().matches("moving").count() >= 3);
    terminal.press("-");
    terminal.until_it_shows("speed 85 %");
    terminal.press("s");
    assert_eq!(terminal.ends(&mut child), 5);
    let text = terminal.picture.text();
    assert!(!text.contains('━') && !text.contains('╸') && !text.contains("keys:"), "{text}");
    assert!(text.contains("stopping on the path") && text.contains("stopped"), "{text}");
    // The result is wrapped between words, so these words are complete.
    let words: Vec<&str> = text.split_whitespace().collect();
    for whole in ["statuses,", "frames", "damaged"] {
        assert!(words.contains(&whole), "{whole}: {text}");
    }
    assert!(terminal.is_as_before());

    let mut terminal = Terminal::new(30, 60);
    let mut child = terminal.start(&sim.command(&["traj", "run", &file, "--approach", "--speed", "10"]));
    terminal.until("the size that is needed", |p| {
        let words: Vec<_> = p.text().split_whitespace().map(str::to_owned).collect();
        words.join(" ").contains("needs 40 columns and 12 rows")
    });
    terminal.press("s");
    assert_eq!(terminal.ends(&mut child), 5);
}
