//! Tests of `ucom monitor`: its view on a terminal from start to end, and its lines on other outputs.
#![cfg(unix)]

use crate::common;

use std::io::{BufRead, BufReader};
use std::process::Stdio;

use cli_kit::testing::Terminal;
use common::Sim;

fn monitor(sim: &Sim) -> std::process::Command {
    let mut command = sim.command();
    command.arg("monitor");
    command
}

/// At 80 columns, the view shows flash number, program and status bits; at 40 columns, it shows state, status bits and keys. In
/// the view, the key `s` stops all control loops.
#[test]
fn the_view_shows_boards_and_its_stop_key_stops() {
    let sim = Sim::numbered(&["--boards", "3"]);
    for (columns, rows) in [(80, 24), (40, 12)] {
        let mut terminal = Terminal::new(columns, rows);
        let mut child = terminal.start(&monitor(&sim));
        terminal.until("three boards", |p| p.text().matches("···XI·").count() == 3);
        let text = terminal.picture.text();
        assert!(columns == 40 || text.contains("0x0021") && text.contains("0x0023"), "{text}");
        assert!(text.contains("s stops  q ends"), "{text}");
        let mut peer = sim.peer();
        terminal.press("s");
        peer.wait("600#00000000");
        terminal.until_it_shows("Stop sent to all boards");
        terminal.press("q");
        assert_eq!(terminal.ends(&mut child), 0);
        assert!(terminal.is_as_before());
    }
    let mut terminal = Terminal::new(80, 24);
    let mut command = monitor(&sim);
    command.arg("--listen-only");
    let mut child = terminal.start(&command);
    terminal.until_it_shows("q ends");
    let mut peer = sim.peer();
    terminal.press("s");
    terminal.until_it_shows("nothing was sent");
    assert!(peer.all(300).iter().all(|frame| !frame.starts_with("600#")));
    terminal.press("\u{1B}");
    assert_eq!(terminal.ends(&mut child), 0);
}

/// The view lists a board first if the board stops sending while it runs.
#[test]
fn d51_a_board_that_falls_silent_leads_the_view() {
    let mut sim = Sim::numbered(&["--boards", "2"]);
    sim.ucom(&["start", "all"]).ends(0);
    let mut terminal = Terminal::new(60, 20);
    let mut child = terminal.start(&monitor(&sim));
    terminal.until("heartbeats", |p| p.text().matches(" started ").count() == 2);
    // A board that has not yet sent its first heartbeat never counts as lost (D-51), so the test waits for a
    // heartbeat of both boards.
    terminal.until("heartbeats of both", |p| p.text().matches("s ago").count() == 2);
    sim.fault("silent board=2");
    terminal.until_it_shows(" lost ");
    let rows = terminal.picture.rows();
    assert!(rows[0].contains("board 2 gives no heartbeat"), "{}", terminal.picture.text());
    assert!(terminal.picture.text().contains("next: ucom info 2"), "{}", terminal.picture.text());
    terminal.press("q");
    assert_eq!(terminal.ends(&mut child), 0);
}

/// The view ends when its terminal is closed, and the line output ends when its reader disconnects.
#[test]
fn it_ends_when_nobody_looks_any_more() {
    let sim = Sim::numbered(&["--boards", "1"]);
    for nohup in [false, true] {
        let mut terminal = Terminal::new(60, 20);
        let own = monitor(&sim);
        let mut command = std::process::Command::new("sh");
        command.args(["-c", if nohup { "trap '' HUP; exec \"$0\" \"$@\"" } else { "exec \"$0\" \"$@\"" }]);
        command.arg(own.get_program()).args(own.get_args());
        for (name, value) in own.get_envs() {
            if let Some(value) = value {
                command.env(name, value);
            }
        }
        let mut child = terminal.start(&command);
        terminal.until_it_shows("XI·");
        terminal.hang_up();
        assert_eq!(terminal.ends(&mut child), 0, "nohup: {nohup}");
    }
    let mut child = monitor(&sim);
    let mut child = child.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let (mut line, mut out) = (String::new(), BufReader::new(child.stdout.take().unwrap()));
    out.read_line(&mut line).unwrap();
    assert!(line.contains("load") && !line.contains('\u{1B}'), "{line}");
    drop(out);
    assert_eq!(child.wait().unwrap().code(), Some(0));
}
