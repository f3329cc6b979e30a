//! Rows of the live view for the joints and the gripper.

use cli_kit::figure;
use cli_kit::view::panel;
use jtc_host::labels;
use jtc_host::sample::is_measured;
use jtc_wire::Status;
use ratatui::layout::Constraint;
use ratatui::style::{Color, Style, Stylize};
use ratatui::widgets::{Cell, Row, Table};

use super::super::status::{gripper_answers, gripper_state, joint_state};

/// Colours of the joints, which are also the colours of the joints in the report.
pub(super) const COLOURS: [Color; 6] = [
    Color::Rgb(122, 165, 255),
    Color::Rgb(255, 157, 87),
    Color::Rgb(67, 211, 158),
    Color::Rgb(255, 119, 182),
    Color::Rgb(183, 155, 255),
    Color::Rgb(227, 200, 76),
];

/// Column of the table: its heading, its width, and the smallest width of the view at which the column is shown.
type Column = (&'static str, u16, u16);

const COLUMNS: [Column; 7] = [
    ("", 7, 0),
    ("state", 15, 0),
    ("  q, rad", 8, 0),
    ("τ, N·m", 7, 40),
    ("qd, rad/s", 9, 52),
    ("  °C", 4, 58),
    ("", 8, 76),
];
/// Number of characters before the error texts of a joint.
const WITH_WORDS: u16 = 56;

/// Returns the number of rows of the joint table.
pub(super) fn count(s: &Status) -> usize {
    s.joints.len() + usize::from(s.gripper.is_some())
}

/// Returns `true` if joint `j` reports an error or is in a fault state.
fn is_broken(s: &Status, j: usize) -> bool {
    let joint = &s.joints[j];
    joint.state.is_fault() || joint.errors != 0 || joint.internal != 0 || joint.mc_current != 0
}

/// Returns as many error texts as fit into the width, and the number of omitted texts. The head of the view shows all error
/// texts.
fn fitting(words: &[&str], width: usize) -> String {
    for count in (1..=words.len()).rev() {
        let more = words.len() - count;
        let text = words[..count].join(", ") + &if more > 0 { format!(" +{more}") } else { String::new() };
        if text.chars().count() <= width {
            return text;
        }
    }
    if words.is_empty() { String::new() } else { format!("{} above", words.len()) }
}

/// Returns all rows of the table. Joints with unknown values come first, then joints with an error. The values of a silent joint are
/// unknown, because the last received values are outdated. If no statuses arrive, the values of all joints are unknown.
fn rows(s: &Status, silent: bool, width: u16) -> Vec<Row<'static>> {
    let room = usize::from(width.saturating_sub(WITH_WORDS));
    let known = |j: usize| !silent && is_measured(s, j);
    let mut order: Vec<usize> = (0..s.joints.len()).collect();
    order.sort_by_key(|j| (known(*j), !is_broken(s, *j)));
    let joints = order.into_iter().map(|j| {
        let joint = &s.joints[j];
        let number = |value: f32, digits: usize, width: usize| {
            let text = if known(j) { figure(value.into(), digits) } else { "-".into() };
            Cell::from(format!("{text:>width$}"))
        };
        let mut trouble: Vec<&str> = labels::joint_errors(joint.internal);
        trouble.extend(labels::node_errors(joint.errors));
        trouble.extend(labels::motor_faults(joint.mc_current));
        trouble.extend(labels::node_warnings(joint.warnings));
        if silent {
            trouble.clear();
        }
        let cells = [
            Cell::from(format!("joint {}", j + 1)).style(Style::new().fg(COLOURS[j])),
            Cell::from(if silent { "not known" } else { joint_state(s, j) }),
            number(joint.position, 4, 8),
            number(joint.torque, 2, 7),
            number(joint.velocity, 4, 9),
            number(joint.temperature.into(), 0, 4),
            Cell::from(fitting(&trouble, room)).style(Style::new().red()),
        ];
        (cells, known(j))
    });
    let gripper = s.gripper.map(|g| {
        let state = if silent { "not known" } else { gripper_state(s) };
        let known = !silent && gripper_answers(s);
        let pump = match (known, g.pump != 0) {
            (false, _) => "-",
            (true, true) => "pumps",
            (true, false) => "off",
        };
        let mut trouble: Vec<&str> = labels::node_errors(g.errors);
        trouble.extend(labels::node_warnings(g.warnings));
        if g.pressure1 != 0 || g.pressure2 != 0 {
            trouble.push("vacuum");
        }
        let last = if known { fitting(&trouble, room) } else { String::new() };
        let empty = || Cell::from("");
        let cells = [
            Cell::from("gripper"),
            Cell::from(state),
            Cell::from(format!("{pump:>8}")),
            empty(),
            empty(),
            empty(),
            Cell::from(last),
        ];
        (cells, known)
    });
    let drawn = |(cells, known): ([Cell<'static>; 7], bool)| {
        let style = match (known, silent) {
            (true, _) => Style::new(),
            (false, true) => Style::new().dark_gray(),
            (false, false) => Style::new().red().bold(),
        };
        (cells, style)
    };
    joints.chain(gripper).map(drawn).map(|(cells, style)| Row::new(cells).style(style)).collect()
}

/// Returns the joint table for the width of the view, starting at row `first`.
pub(super) fn table(s: &Status, silent: bool, width: u16, framed: bool, first: usize) -> Table<'static> {
    let shown = |c: &&Column| width >= c.2;
    let mut widths: Vec<Constraint> = COLUMNS.iter().filter(shown).map(|c| Constraint::Length(c.1)).collect();
    if let Some(last) = widths.get_mut(COLUMNS.len() - 1) {
        *last = Constraint::Fill(1);
    }
    let head = Row::new(COLUMNS.iter().filter(shown).map(|c| {
        let width = usize::from(c.1);
        // The heading of a column with numbers is aligned to the right, like the numbers.
        if c.0 == "state" { c.0.to_owned() } else { format!("{:>width$}", c.0) }
    }));
    let table = Table::new(rows(s, silent, width).into_iter().skip(first), widths).header(head.dark_gray());
    if framed { table.block(panel("joints")) } else { table }
}
