//! Runs each command of docs/from-two-poses-to-a-cycle.md with the real program against `jtc sim`. `UPDATE_DOCS=1` updates the outputs on
//! the page.
#![cfg(target_os = "linux")]

use test_kit::page::{Page, Printed, blurred};

use crate::common::Sim;
use crate::desk::Desk;

const PAGE: &str = "from-two-poses-to-a-cycle.md";

/// Runs a command that must succeed, and replaces the measured values in its output by placeholders.
fn done(desk: &Desk, command: &str) -> Printed {
    let seen = desk.run(command);
    assert_eq!(seen.code, 0, "{command}: {}", seen.text);
    // The comparison omits the table heading, because its width depends on the measured numbers.
    let lines = seen.text.lines().filter(|line| !line.contains("peak rad/s"));
    Printed { code: seen.code, text: lines.map(measured).collect() }
}

/// Like [`done`], for commands that print the same output in every run.
fn exact(desk: &Desk, command: &str) -> Printed {
    let seen = desk.run(command).0;
    assert_eq!(seen.code, 0, "{command}: {}", seen.text);
    seen
}

/// Replaces the measured numbers of an output line by placeholders, but not the words that the user types.
fn measured(line: &str) -> String {
    let (typed, rest) = match line.split_once(": ") {
        Some((typed, rest)) if typed.starts_with("move to ") => (format!("{typed}: "), rest),
        _ => (String::new(), line),
    };
    typed + &blurred(&without_signs(rest))
}

/// Removes the signs of numbers. A hyphen within a name is not a sign.
fn without_signs(text: &str) -> String {
    let mut before = ' ';
    let mut out = String::new();
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        let sign = c == '-' && " ,[".contains(before) && rest.peek().is_some_and(char::is_ascii_digit);
        if !sign {
            out.push(c);
        }
        before = c;
    }
    out
}

#[test]
fn the_page_shows_what_its_commands_print() {
    let desk = Desk::simulated(&["--speed", "max", "--no-throttle"]);
    done(&desk, "jtc recover --defaults");
    poses(&desk);
    plan(&desk);
    lines(&desk);
    runs(&desk);
    broken_off();
    taught();
}

fn poses(desk: &Desk) {
    let mut page = Page::new(PAGE, "poses");
    page.case("An arm file to begin with", "jtc example arm", &exact(desk, "jtc example arm"));
    for (title, command) in [
        ("Save the home pose", "jtc pose save home --arm my-arm.toml"),
        ("Move to another position", "jtc move --to 20,15,-30,0,25,0 --deg --speed 20"),
        ("Save the pick pose", "jtc pose save pick --arm my-arm.toml"),
        ("The poses in the file", "tail -n 3 my-arm.toml"),
        ("Move home", "jtc move --to home --arm my-arm.toml --speed 50"),
        ("List all poses", "jtc --json pose list --arm my-arm.toml"),
    ] {
        page.case(title, command, &done(desk, command));
    }
    let slip = "jtc move --to hoem --arm my-arm.toml";
    page.case("A mistyped name", slip, &desk.run(slip).blurred());
    page.finish();
}

fn plan(desk: &Desk) {
    let mut page = Page::new(PAGE, "plan");
    for (title, command) in [
        (
            "A motion between two poses",
            "printf 'pose\\nhome\\npick\\nhome\\n' > poses.csv; jtc plan poses.csv -o there-and-back.csv --arm my-arm.toml",
        ),
        ("An example with more waypoints", "jtc example cycle"),
        ("The waypoint file", "cat cycle-waypoints.csv"),
        (
            "The motion through the waypoints",
            "jtc plan cycle-waypoints.csv -o cycle.csv --blend 0.05 --report plan.html",
        ),
        ("The check that every run makes", "jtc traj check cycle.csv"),
    ] {
        // Only the output of the first plan depends on measured poses, so only its numbers may vary.
        let printed = if command.contains("poses.csv") { done(desk, command) } else { exact(desk, command) };
        page.case(title, command, &printed);
    }
    page.finish();
}

fn lines(desk: &Desk) {
    let mut page = Page::new(PAGE, "lines");
    for (title, command) in [
        (
            "Two poses of the flange",
            "printf 'x,y,z,roll,pitch,yaw\\n0.6,-0.3,0.4,0,0,0\\n0.6,0.3,0.4,0,0,0\\n' > poses-of-flange.csv; jtc plan poses-of-flange.csv -o across.csv",
        ),
        ("On a straight line", "jtc plan poses-of-flange.csv -o line.csv --line"),
    ] {
        page.case(title, command, &exact(desk, command));
    }
    let moves = [
        ("Move to the first pose", "jtc move --to-flange 0.6,-0.3,0.4,0,0,0"),
        ("A straight line without a file", "jtc move --to-flange 0.6,0.3,0.4,0,0,0 --line"),
        ("Move back to the home pose", "jtc move --to home --arm my-arm.toml"),
    ];
    for (title, command) in moves {
        page.case(title, command, &done(desk, command));
    }
    page.finish();
}

fn runs(desk: &Desk) {
    let mut page = Page::new(PAGE, "run");
    for (title, command) in [
        ("Run the cycle three times", "jtc traj run cycle.csv --repeat 3 --record run.mcap"),
        (
            "Run the motion between two poses twice",
            "jtc traj run there-and-back.csv --arm my-arm.toml --repeat 2 --approach",
        ),
        ("Run the motion of a recording", "jtc traj replay run.mcap"),
    ] {
        page.case(title, command, &done(desk, command));
    }
    page.finish();
}

/// Tests the section about an interrupted run. The simulator runs in real time, so that the test can stop a motion.
fn broken_off() {
    let mut page = Page::new(PAGE, "continue");
    let desk = Desk::simulated(&["--no-throttle"]);
    for command in [
        "jtc recover --defaults",
        "jtc example cycle",
        "jtc plan cycle-waypoints.csv -o cycle.csv --blend 0.05",
    ] {
        done(&desk, command);
    }
    let run = "jtc traj run cycle.csv --speed 40 --record broken.mcap";
    page.case_of_a_moment("Ctrl-C during a run", run, || {
        let run = format!("{run} --overwrite");
        done(&desk, "jtc move --to 0,0,0,0,0,0 --speed 100");
        let in_motion = |jtc: &std::process::Child, _: &Sim| {
            std::thread::sleep(std::time::Duration::from_millis(1500));
            cli_kit::testing::signal(jtc, "-INT");
        };
        desk.moving(&run, in_motion).blurred()
    });
    let on = "jtc traj continue broken.mcap";
    page.case("Continue the run", on, &done(&desk, on));
    page.finish();
}

/// Tests the section of the page in which a hand guides the simulated arm.
fn taught() {
    let mut page = Page::new(PAGE, "teach");
    let mut desk = Desk::simulated(&["--no-throttle"]);
    for command in ["jtc recover --defaults", "jtc example lead"] {
        done(&desk, command);
    }
    let lead = desk.dir().join("lead.csv");
    desk.write_line(&format!("hand {}", lead.display()));
    for (title, command) in [
        (
            "Lead the arm for some seconds",
            "jtc teach record taught.csv --waypoints --tolerance 0.02 --duration 8",
        ),
        ("Plan the taught motion", "jtc plan taught.csv -o taught-motion.csv --blend 0.02 --speed 50"),
        ("Run the taught motion", "jtc traj run taught-motion.csv --approach"),
    ] {
        page.case(title, command, &done(&desk, command));
    }
    page.finish();
}
