//! Generates and checks the part of docs/troubles.md about `ucom`. The real `ucom` program runs each case with `ucom sim`. With
//! `UPDATE_DOCS=1`, the test rewrites the part of docs/troubles.md about `ucom`.
#![cfg(target_os = "linux")]

use crate::common;

use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use cli_kit::testing::signal;
use common::Sim;
use test_kit::page::{Page, Printed, blurred};

/// Name of the bus in docs/troubles.md.
const BUS: &str = "socketcand:localhost:29536/can0";

#[test]
fn the_page_of_troubles_has_what_ucom_prints() {
    let mut page = Page::new("troubles.md", "ucom");
    bus(&mut page);
    boards(&mut page);
    firmware(&mut page);
    running(&mut page);
    outputs(&mut page);
    page.finish();
}

/// Commands that a user runs with this chain; stdout and stderr are merged, as on a terminal.
trait Desk {
    fn shell(&self, shown: &str) -> Command;
    fn seen(&self, code: Option<i32>, text: &str) -> Printed;
    fn start(&self, shown: &str) -> Child;
    fn all_of(&self, child: Child) -> Printed;
    fn types(&self, shown: &str) -> Printed;
}

impl Desk for Sim {
    fn shell(&self, shown: &str) -> Command {
        let programs = Path::new(env!("CARGO_BIN_EXE_ucom")).parent().unwrap();
        let path = std::env::var("PATH").unwrap_or_default();
        let mut shell = Command::new("sh");
        for (name, value) in self.command().get_envs() {
            match value {
                Some(value) => shell.env(name, value),
                None => shell.env_remove(name),
            };
        }
        let address = self.url.split(['/']).next().unwrap().trim_start_matches("socketcand:").to_owned();
        let real = shown.replace("localhost:29536", &address);
        // The command replaces the shell process, so that it receives signals directly.
        shell
            .args(["-c", &format!("exec 2>&1\nexec {real}")])
            .current_dir(self.dir.path())
            .env("PATH", format!("{}:{path}", programs.display()))
            .env("COLUMNS", "100")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        shell
    }

    fn seen(&self, code: Option<i32>, text: &str) -> Printed {
        let address = self.url.split(['/']).next().unwrap().trim_start_matches("socketcand:").to_owned();
        let text = text
            .replace(&self.url, BUS)
            .replace(&address, "localhost:29536")
            .replace(&format!("{}/", self.dir.path().display()), "");
        Printed { code: code.unwrap_or(-1), text }
    }

    fn start(&self, shown: &str) -> Child {
        self.shell(shown).spawn().unwrap()
    }

    fn all_of(&self, mut child: Child) -> Printed {
        let mut text = String::new();
        child.stdout.take().unwrap().read_to_string(&mut text).unwrap();
        self.seen(child.wait().unwrap().code(), &text)
    }

    fn types(&self, shown: &str) -> Printed {
        self.all_of(self.start(shown))
    }
}

/// Removes the values that differ from run to run: numbers, and heartbeats that a busy computer receives late.
fn of_a_moment(printed: Printed) -> Printed {
    let text: String = printed
        .text
        .lines()
        .filter(|line| !line.contains("is late"))
        .map(|line| format!("{line}\n"))
        .collect();
    Printed { code: printed.code, text: blurred(&text) }
}

/// Starts a simulated chain with numbered boards.
fn numbered(options: &[&str]) -> Sim {
    let sim = Sim::numbered(options);
    sim.file("image.bin", &common::image(60_000, 7));
    sim.file("notes.bin", b"this is no firmware\n");
    sim
}

fn bus(page: &mut Page) {
    page.group("ucom: the bus");
    let empty = Sim::start(&["--boards", "0"]);
    let command = "env -u UCOM_BUS ucom scan";
    page.case("No bus is named", command, &empty.types(command));
    page.case("No board is on the bus", "ucom init", &empty.types("ucom init"));
    page.case("No board answers", "ucom scan", &empty.types("ucom scan"));
    let command = "ucom sim --listen localhost:29536";
    page.case("A second simulator at the same address", command, &empty.types(command));
    empty.signal("-KILL");
    std::thread::sleep(Duration::from_millis(300));
    page.case("The bus is not available", "ucom scan", &empty.types("ucom scan"));
}

fn boards(page: &mut Page) {
    page.group("ucom: boards");
    let fresh = Sim::start(&["--boards", "2"]);
    page.case("Boards without a number", "ucom info 1", &of_a_moment(fresh.types("ucom info 1")));
    let chain = fresh.file(
        "big.toml",
        b"[[board]]\nflash_id = 0x21\ndescription = \"UCoM2 neck yaw\"\n[board.profile]\nendian = \"big\"\n",
    );
    let other = Sim::start(&["--chain", &chain]);
    page.case("Boards with another byte order", "ucom init", &other.types("ucom init"));
    let mut sim = numbered(&["--boards", "2"]);
    page.case("The application is not started", "ucom ci 1 1=5", &sim.types("ucom ci 1 1=5"));
    page.case("A value without a name", "ucom ci 1 5", &sim.types("ucom ci 1 5"));
    sim.fault("same-number board=2");
    page.case("Two boards with the same number", "ucom scan", &of_a_moment(sim.types("ucom scan")));
    page.case(
        "The diagnosis of two boards with the same number",
        "ucom doctor",
        &of_a_moment(sim.types("ucom doctor")),
    );
}

fn firmware(page: &mut Page) {
    page.group("ucom: firmware");
    let sim = numbered(&["--boards", "2"]);
    for (title, command) in [
        ("A text instead of firmware", "ucom update 1 notes.bin"),
        ("An image for another board", "ucom update 1 image.bin --flash-id 0x42 --date 2026-01-02"),
        ("A board that is not in the inventory", "ucom update 7 image.bin"),
    ] {
        page.case(title, command, &sim.types(command));
    }
    let update = "ucom update 1 image.bin --date 2026-01-02";
    page.case_of_a_moment("Ctrl-C during an update", update, || {
        let sim = numbered(&["--boards", "2"]);
        let mut peer = sim.peer();
        let child = sim.start(update);
        peer.wait("2C1#");
        signal(&child, "-INT");
        of_a_moment(sim.all_of(child))
    });
}

/// Moves the result directly before the error, which always comes last. Two threads write the result and the notes to
/// the same pipe, so their order varies.
fn result_last(mut printed: Printed) -> Printed {
    let result = "not stopped for certain: 1\n";
    if let Some(before) = printed.text.find(&format!("\n{result}")) {
        printed.text.replace_range(before + 1..before + 1 + result.len(), "");
        let error = printed.text.find("ucom: not stopped").expect("the error follows");
        printed.text.insert_str(error, result);
    }
    printed
}

fn running(page: &mut Page) {
    page.group("ucom: while boards run");
    let run = "ucom run 1,2 --for 4";
    page.case_of_a_moment("A board loses its power", run, || {
        let mut sim = numbered(&["--boards", "2"]);
        let child = sim.start(run);
        sim.peer().wait("382#");
        // The wait is long enough for the start of all boards.
        std::thread::sleep(Duration::from_millis(1_000));
        sim.fault("power-loss board=1");
        result_last(of_a_moment(sim.all_of(child)))
    });
    page.case_of_a_moment("The adapter is pulled out", run, || {
        let sim = numbered(&["--boards", "2"]);
        let child = sim.start(run);
        sim.peer().wait("382#");
        std::thread::sleep(Duration::from_millis(1_000));
        sim.signal("-KILL");
        of_a_moment(sim.all_of(child))
    });
}

fn outputs(page: &mut Page) {
    page.group("ucom: terminal and outputs");
    let sim = numbered(&["--boards", "1"]);
    for (title, command) in [
        ("The result cannot be written", "ucom scan > /dev/full"),
        ("An unknown command", "ucom scann"),
        ("An unknown command, as JSON", "ucom --json scann 2> /dev/null"),
    ] {
        page.case(title, command, &sim.types(command));
    }
}
