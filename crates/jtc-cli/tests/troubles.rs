//! Runs each case about `jtc` in docs/troubles.md with the real program, mostly against `jtc sim`. `UPDATE_DOCS=1` updates the
//! page.
#![cfg(target_os = "linux")]

mod files;

use std::process::Command;

use test_kit::page::Page;

use crate::desk::{Desk, Line};

/// Adds the files that the cases need to the workplace.
fn with_files(desk: Desk) -> Desk {
    files::write(desk.dir());
    desk
}

#[test]
fn the_page_of_troubles_says_what_jtc_prints() {
    let mut page = Page::new("troubles.md", "jtc");
    let desk = with_files(Desk::new());
    trajectory_files(&mut page, &desk);
    arms(&mut page, &desk);
    link(&mut page, &desk);
    moving(&mut page);
    outputs(&mut page);
    page.finish();
}

fn trajectory_files(page: &mut Page, desk: &Desk) {
    page.group("jtc: files");
    for (title, command) in [
        ("A file that does not exist", "jtc traj check nothing.csv"),
        ("Degrees instead of radians", "jtc traj check degrees.csv"),
        ("Decimal commas", "jtc traj check commas.csv"),
        ("No header", "jtc traj check no-header.csv"),
        ("A missing column", "jtc traj check column.csv"),
        ("A trajectory that is too fast", "jtc traj check fast.csv"),
        ("A position outside the limits of a joint", "jtc traj check outside.csv"),
        ("Two points that are far apart", "jtc traj check step.csv"),
        ("A fault file that counts joints from 0", "jtc sim --serial /tmp/jtc --faults old-faults.toml"),
    ] {
        page.case(title, command, &desk.run(command));
    }
}

fn arms(page: &mut Page, desk: &Desk) {
    page.group("jtc: the arm");
    for (title, command) in [
        ("A URDF with seven axes", "jtc arm import seven.urdf -o arm.toml"),
        ("A URDF with continuous joints", "jtc arm import continuous.urdf -o arm.toml"),
        ("A URDF with a gripper that moves", "jtc arm import gripper.urdf -o arm.toml"),
        ("A URDF with a word instead of a number", "jtc arm import word.urdf -o arm.toml"),
        ("An arm file that every controller refuses", "jtc arm check wrong.toml"),
        ("An arm that its drives cannot hold", "jtc arm check weak.toml"),
        ("An arm file of an older format", "jtc params show old.toml"),
        ("A trajectory instead of an arm file", "jtc traj check motion.csv --arm motion.csv"),
    ] {
        page.case(title, command, &desk.run(command));
    }
}

fn link(page: &mut Page, desk: &Desk) {
    page.group("jtc: the link");
    page.case("A port that does not exist", "jtc status", &desk.run("jtc status"));
    page.case(
        "A file instead of a port",
        "jtc status --port motion.csv",
        &desk.run("jtc status --port motion.csv"),
    );
    let silent = with_files(Desk::at(Line::new("")));
    page.case("Nothing answers", "jtc status", &silent.run("jtc status").blurred());
    let noisy = with_files(Desk::at(Line::new("a rate that is not ours makes noise\n")));
    page.case("Another baud rate, or another device", "jtc status", &noisy.run("jtc status").blurred());
    let sim = with_files(Desk::simulated(&["--speed", "max", "--no-throttle"]));
    page.case(
        "A controller without parameters",
        "jtc traj run motion.csv",
        &sim.run("jtc traj run motion.csv"),
    );
    let push = "jtc params push slower.toml";
    page.case("An arm whose limits the controller does not have", push, &sim.run(push));
    assert_eq!(sim.run("jtc recover --defaults").code, 0, "it waits until all drives are enabled");
    let other = "jtc traj run motion.csv --arm slower.toml";
    page.case("A run for an arm that the controller does not have", other, &sim.run(other));
    page.case(
        "Settings while the arm is held",
        "jtc arm push slower.toml",
        &sim.run("jtc arm push slower.toml"),
    );
    page.case("A jog that is too fast", "jtc jog 1 5", &sim.run("jtc jog 1 5"));
    let second = "jtc sim --serial /tmp/jtc";
    page.case("A second simulator at the same path", second, &sim.run(second));
    page.case("A Stop when nothing moves", "jtc stop", &sim.run("jtc stop"));
    page.case("A resume when nothing is paused", "jtc traj resume", &sim.run("jtc traj resume"));
    let busy = sim.hold_port();
    page.case("Another program has opened the port", "jtc status", &sim.run("jtc status"));
    drop(busy);
}

fn moving(page: &mut Page) {
    page.group("jtc: while the arm moves");
    let ready = |options: &[&str]| {
        let desk = with_files(Desk::simulated(&[&["--no-throttle"], options].concat()));
        assert_eq!(desk.run("jtc recover --defaults").code, 0);
        desk
    };
    let run = "jtc traj run motion.csv";
    let elsewhere = "jtc traj run elsewhere.csv";
    page.case(
        "The arm is not at the start of the motion",
        elsewhere,
        &ready(&["--speed", "max"]).run(elsewhere),
    );
    page.case_of_a_moment("Ctrl-C", run, || {
        let desk = ready(&[]);
        desk.moving(run, |jtc, _| cli_kit::testing::signal(jtc, "-INT")).blurred()
    });
    page.case_of_a_moment("The cable is pulled", run, || {
        let desk = ready(&[]);
        desk.moving(run, |_, sim| drop(Command::new("kill").args(["-KILL", &sim.pid()]).status())).blurred()
    });
    for (title, fault) in [
        ("A drive reports a fault", "kind = \"motor-fault\"\njoint = 3\nbits = 2"),
        ("A drive falls silent", "kind = \"node-silent\"\njoint = 2\nfor_s = 0.05"),
        ("A person pushes the arm", "kind = \"push\"\njoint = 3\ntorque_nm = 110\nfor_s = 0.5"),
    ] {
        let desk = Desk::new();
        let file = desk.dir().join("fault.toml");
        std::fs::write(&file, format!("format = 2\n[[fault]]\n{fault}\nat_point = 1500\n")).unwrap();
        page.case_of_a_moment(title, run, || {
            ready(&["--speed", "max", "--faults", file.to_str().unwrap()]).run(run).blurred()
        });
    }
    let file = Desk::new();
    let fault = file.dir().join("fault.toml");
    let text =
        "format = 2\n[[fault]]\nkind = \"push\"\njoint = 3\ntorque_nm = 110\nfor_s = 0.5\nat_point = 1500\n";
    std::fs::write(&fault, text).unwrap();
    let pushed = ready(&["--speed", "max", "--faults", fault.to_str().unwrap()]);
    pushed.run(run);
    let mut doctor = pushed.run("jtc doctor").blurred();
    // The simulated time runs at full speed, so the age of the stop may be seconds or hours. The test replaces each
    // unit by `s`.
    for unit in ["s", "min", "h", "days"] {
        doctor.text = doctor.text.replace(&format!("… {unit} ago"), "… s ago");
    }
    page.case("The diagnosis after the push", "jtc doctor", &doctor);
    page.case("The recovery after the push", "jtc recover", &pushed.run("jtc recover"));
}

fn outputs(page: &mut Page) {
    page.group("jtc: terminal and outputs");
    let desk = with_files(Desk::simulated(&["--speed", "max", "--no-throttle"]));
    assert_eq!(desk.run("jtc recover --defaults").code, 0);
    desk.run("touch old.csv; ln -s /dev/full full.csv");
    for (title, command) in [
        ("The recording exists already", "jtc traj run motion.csv --record old.csv"),
        ("A recording of an unknown format", "jtc traj run motion.csv --record run.txt"),
        ("The disk is full", "jtc traj run motion.csv --record full.csv --overwrite"),
        ("The result cannot be written", "jtc status > /dev/full"),
        ("An unknown command", "jtc traj chek motion.csv"),
        ("An unknown command, as JSON", "jtc --json traj chek motion.csv 2> /dev/null"),
        ("A file that does not exist, as JSON", "jtc --json traj check nothing.csv 2> /dev/null"),
    ] {
        page.case(title, command, &desk.run(command));
    }
    let shown = "jtc help files | head -1";
    page.case("The reader of the output has ended", shown, &desk.run(shown));
}
