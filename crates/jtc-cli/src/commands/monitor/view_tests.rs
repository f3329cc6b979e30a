use cli_kit::Key;
use jtc_wire::{NodeState, TrajectoryState};
use ratatui::Terminal;
use ratatui::backend::TestBackend;

use super::*;

/// Terminal sizes, smallest first.
const SIZES: [(u16, u16); 6] = [(40, 12), (60, 20), (80, 24), (90, 28), (120, 40), (200, 60)];

/// Returns the status of an arm that the controller holds and whose joint 3 does not answer.
fn silent() -> Status {
    let mut s = Status {
        state: ControllerState::Error.into(),
        errors: 0x2A,
        can_current: 1 << 10,
        ..Status::default()
    };
    for (j, joint) in s.joints.iter_mut().enumerate() {
        joint.state = NodeState::ENABLED;
        joint.position = 0.1 + j as f32;
        joint.temperature = 30;
    }
    s.joints[2].position = 0.0;
    s
}

fn of(s: Status) -> View {
    let mut view = View::new("/tmp/jtc".into());
    view.push(s);
    view
}

fn drawn(view: &mut View, (width, height): (u16, u16)) -> Vec<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| view.draw(frame)).unwrap();
    let cells = terminal.backend().buffer().content().to_vec();
    cells.chunks(width.into()).map(|row| row.iter().map(|c| c.symbol()).collect()).collect()
}

/// Returns all rows that the view shows while the test scrolls the view to its end.
fn scrolled(view: &mut View, size: (u16, u16)) -> Vec<String> {
    let mut all = drawn(view, size);
    loop {
        let before = view.scroll;
        view.scroll.key(Key::Down);
        if view.scroll == before {
            return all;
        }
        all.extend(drawn(view, size));
    }
}

/// Joins the rows of the view without their borders, so that the test can find wrapped texts.
fn joined(rows: &[String]) -> String {
    let words: Vec<&str> = rows.iter().flat_map(|row| row.split_whitespace()).filter(|w| *w != "│").collect();
    words.join(" ")
}

#[test]
fn a_joint_without_measurement_has_no_number_and_is_named_first() {
    for size in SIZES {
        let mut view = of(silent());
        let rows = drawn(&mut view, size);
        let text = rows.join("\n");
        let place = |words: &str| rows.iter().position(|row| row.contains(words));
        // The view shows the failure first, then the next command, then the state and the joints.
        let named = place("joint 3 does not answer").unwrap_or_else(|| panic!("not named\n{text}"));
        let (next, state) = (place("next: jtc recover").unwrap(), place(" Error ").unwrap());
        assert!(named <= 1 && named < next && next < state, "{size:?}\n{text}");
        let all = scrolled(&mut view, size);
        let row = all.iter().find(|row| row.contains("joint 3 does not answer ") && row.contains(" - "));
        let row = row.unwrap_or_else(|| panic!("{size:?}: no row\n{text}"));
        assert!(!row.contains("0.0000") && !row.contains("0.00 "), "{row}");
        for joint in [1, 2, 4, 5, 6] {
            assert!(
                all.iter().any(|row| row.contains(&format!("joint {joint} OperationEnable"))),
                "{size:?} {joint}"
            );
        }
    }
}

/// For any number of errors, the view shows the first cause and the next command completely. The user can scroll to rows that do not
/// fit.
#[test]
fn no_cause_is_cut_and_none_vanishes() {
    let mut s = Status {
        state: ControllerState::Error.into(),
        errors: 0xFF,
        jtc_init: 7,
        can_current: 0x101,
        ..Status::default()
    };
    for joint in &mut s.joints {
        (joint.state, joint.internal, joint.mc_current, joint.warnings) = (NodeState::FAULT, 0x3F, 0x41, 7);
    }
    let causes = [labels::causes(&s), labels::warnings(&s)].concat();
    assert!(causes.len() > 60);
    for size in SIZES {
        let mut view = of(s);
        let first = joined(&drawn(&mut view, size));
        let next =
            "next: jtc recover --arm FILE, or --defaults for the arm that is built into the controller";
        assert!(first.contains(&causes[0]) && first.contains(next), "{size:?}\n{first}");
        assert!(first.contains("more below") && first.contains("↑↓ 1-"), "{size:?}\n{first}");
        let all = joined(&scrolled(&mut view, size));
        for cause in &causes {
            assert!(all.contains(cause), "{size:?}: {cause}");
        }
        for joint in 1..=6 {
            assert!(
                all.contains(&format!("joint {joint} Fault"))
                    || all.contains(&format!("joint {joint} does not answer"))
            );
        }
    }
}

/// A joint with a fault is the first row of the table. The table shows error texts that fit completely, and the number of omitted texts.
#[test]
fn a_joint_with_a_fault_leads_the_table() {
    let mut s = Status { state: ControllerState::Error.into(), errors: 0x98, ..Status::default() };
    (s.joints[3].state, s.joints[3].errors, s.joints[3].mc_current) = (NodeState::FAULT, 2, 0x40);
    for size in SIZES {
        let rows = drawn(&mut of(s), size);
        let text = rows.join("\n");
        let first = rows.iter().position(|row| row.contains(" state ")).unwrap_or_else(|| panic!("{text}"));
        assert!(rows[first + 1].contains("joint 4 Fault"), "{text}");
        assert!(rows.iter().position(|row| row.contains("joint 4: over-current")).unwrap() < first, "{text}");
        let cut =
            rows[first + 1].contains("motor-control fault,") && !rows[first + 1].contains("over-current");
        assert!(!cut, "{text}");
    }
    for (size, words) in [((80, 24), "2 above"), ((90, 28), "motor-control fault +1")] {
        let text = drawn(&mut of(s), size).join("\n");
        assert!(text.contains(words), "{text}");
    }
}

/// `jtc explain` has a page for each cause and each warning that the view shows.
#[test]
fn every_cause_is_explained() {
    let mut s = Status {
        state: ControllerState::Error.into(),
        errors: 0xFF,
        jtc_init: 7,
        can_current: 0x7F01,
        ..Status::default()
    };
    s.gripper = Some(jtc_wire::GripperStatus { errors: 0x0F, warnings: 0x0F, ..Default::default() });
    for (n, joint) in s.joints.iter_mut().enumerate() {
        (joint.state, joint.internal, joint.errors) = (NodeState::new(254 + (n as u8 & 1)), 0x3F, 0x0F);
        (joint.mc_current, joint.warnings) = (0xFF, 0x0F);
    }
    for words in [labels::causes(&s), labels::warnings(&s)].concat() {
        assert!(!jtc_host::explain::find(&words).is_empty(), "{words}");
    }
}

/// If statuses stop arriving, the view does not show the last values as present values.
#[test]
fn a_silent_controller_shows_no_old_value() {
    for size in SIZES {
        let mut s = silent();
        (s.state, s.trajectory, s.errors, s.can_current) =
            (ControllerState::Operate.into(), TrajectoryState::Execute.into(), 0, 0);
        let mut view = of(s);
        view.silent = Some(Duration::from_secs(3));
        let rows = drawn(&mut view, size);
        let text = joined(&rows);
        assert!(text.contains("no status for 3 s") && text.contains("THE ARM MAY BE MOVING"), "{text}");
        assert!(text.contains("next: jtc doctor"), "{text}");
        let all = scrolled(&mut view, size).join("\n");
        assert!(
            !all.contains("OperationEnable") && !all.contains("1.10") && all.contains("not known"),
            "{all}"
        );
    }
}

#[test]
fn the_keys_are_always_there() {
    for size in SIZES {
        for mut view in [View::new("/tmp/jtc".into()), of(silent())] {
            assert!(drawn(&mut view, size).last().unwrap().contains("s stops   q ends"), "{size:?}");
        }
    }
}

#[test]
fn a_terminal_that_is_too_small_says_the_size_that_is_needed() {
    for size in [(39, 12), (40, 11), (20, 6)] {
        let text = joined(&drawn(&mut of(silent()), size));
        assert!(text.contains("s stops q ends: this view needs 40 columns and 12 rows"), "{text}");
        assert!(text.contains(&format!("the terminal has {} and {}.", size.0, size.1)), "{text}");
    }
}

/// If the gripper does not answer, the view does not show a pump state.
#[test]
fn a_silent_gripper_looks_so() {
    let mut s =
        Status { state: ControllerState::Error.into(), errors: 0x20, can_current: 1 << 14, ..silent() };
    s.gripper = Some(jtc_wire::GripperStatus { state: NodeState::ENABLED, ..Default::default() });
    for size in SIZES {
        let all = scrolled(&mut of(s), size);
        let row = all.iter().find(|row| row.contains("gripper does not answer  ")).expect("a row");
        assert!(!row.contains("off"), "{row}");
    }
}

#[test]
fn a_gap_in_the_measurement_is_a_gap_in_the_curve() {
    let mut view = View::new(String::new());
    view.push(silent());
    assert!(view.position[2][0].is_nan() && view.torque[2][0].is_nan() && view.position[1][0] > 1.0);
}
