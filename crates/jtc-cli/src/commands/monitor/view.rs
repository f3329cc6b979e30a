//! The picture of `jtc monitor`, from a large terminal down to one of 40 columns and 12 rows: what is wrong comes first, the joints
//! that are not measured lead the table, and curves are drawn where there is room left.

use std::collections::VecDeque;

use cli_kit::figure;
use jtc_host::sample::is_measured;
use jtc_host::words;
use jtc_wire::Status;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Cell, Padding, Paragraph, Row, Sparkline, Table};

use super::super::status::joint_state;

/// Values that the curves show: 8 s of statuses.
const HISTORY: usize = 200;
/// From here on there are frames around the parts.
const FRAMED: (u16, u16) = (80, 24);
/// Rows from which on there is one for the state of a link that is well.
const LINK: u16 = 16;
/// Least height of the curves.
const CURVES: u16 = 6;
/// Colours of the joints, as in the report.
const COLOURS: [Color; 6] = [
    Color::Rgb(122, 165, 255),
    Color::Rgb(255, 157, 87),
    Color::Rgb(67, 211, 158),
    Color::Rgb(255, 119, 182),
    Color::Rgb(183, 155, 255),
    Color::Rgb(227, 200, 76),
];

/// What the view remembers.
pub struct View {
    port: String,
    last: Option<Status>,
    /// No status comes.
    pub silent: bool,
    /// Statuses a second.
    pub rate: f64,
    /// Bytes that were in no frame.
    pub bad_bytes: u64,
    /// What became of the last key, until the next one.
    pub said: String,
    /// NaN where a joint was not measured.
    position: [VecDeque<f64>; 6],
    torque: [VecDeque<f64>; 6],
}

impl View {
    /// Of a controller at this port, of which nothing is known yet.
    pub fn new(port: String) -> Self {
        Self {
            port,
            last: None,
            silent: false,
            rate: 0.0,
            bad_bytes: 0,
            said: String::new(),
            position: Default::default(),
            torque: Default::default(),
        }
    }

    /// Takes a status in.
    pub fn push(&mut self, s: Status) {
        for (j, joint) in s.joints.iter().enumerate() {
            let known = |value: f32| if is_measured(&s, j) { f64::from(value) } else { f64::NAN };
            for (history, value) in
                [(&mut self.position[j], known(joint.position)), (&mut self.torque[j], known(joint.torque))]
            {
                history.push_back(value);
                if history.len() > HISTORY {
                    history.pop_front();
                }
            }
        }
        self.last = Some(s);
    }

    /// Draws all that there is room for.
    pub fn draw(&self, frame: &mut Frame<'_>) {
        let area = frame.area();
        let framed = area.width >= FRAMED.0 && area.height >= FRAMED.1;
        let edge = if framed { 2 } else { 0 };
        let Some(s) = &self.last else {
            let text = if self.silent {
                "no status comes; `jtc doctor` looks for the reason. q ends"
            } else {
                "waiting for a status. q ends"
            };
            let lines = wrapped(&text.replace('`', ""), area.width.saturating_sub(2 * edge));
            frame.render_widget(self.part(lines, &self.port, framed), area);
            return;
        };
        let inner = area.width.saturating_sub(2 * edge);
        let mut head = self.head(s, inner);
        if area.height < LINK && !self.silent {
            head.truncate(1);
        }
        // The table is worth more than the last lines of a long list of errors.
        let most = area.height.saturating_sub(head.len() as u16 + 7 + 3 * edge).max(2);
        let trouble = self.trouble(s, inner, most.into());
        let [top, middle, joints, curves] = Layout::vertical([
            Constraint::Length(head.len() as u16 + edge),
            Constraint::Length(trouble.len() as u16 + edge),
            Constraint::Length(7 + edge),
            Constraint::Fill(1),
        ])
        .areas(area);
        frame.render_widget(self.part(head, &self.port, framed), top);
        let title = if s.errors == 0 { "next" } else { "errors" };
        frame.render_widget(self.part(trouble, title, framed), middle);
        frame.render_widget(joint_table(s, inner, framed), joints);
        if framed && curves.height >= CURVES {
            self.curves(frame, curves);
        }
    }

    fn part(&self, lines: Vec<Line<'static>>, title: &str, framed: bool) -> Paragraph<'static> {
        let paragraph = Paragraph::new(lines);
        if framed { paragraph.block(panel(&format!(" {title} "))) } else { paragraph }
    }

    /// State, place on the trajectory, and the link.
    fn head(&self, s: &Status, width: u16) -> Vec<Line<'static>> {
        let state = Span::styled(format!(" {} ", words::state(s.fsm)), state_style(s.fsm));
        let mut line = vec![state, Span::raw(" trajectory "), words::tes(s.tes).bold()];
        line.push(Span::raw(format!(" {:.2} s", f64::from(s.point) * 1e-3)));
        if let Some(g) = s.gripper.filter(|_| width >= 60) {
            line.push(Span::raw(format!("   pump {}", if g.pump != 0 { "runs" } else { "stands" })));
        }
        let link = if self.silent {
            "no status comes any more".red().bold()
        } else {
            format!("{:.1} statuses/s, {} bad bytes", self.rate, self.bad_bytes).dark_gray()
        };
        vec![Line::from(line), Line::from(link)]
    }

    /// What is wrong, and what to do, in at most so many lines: of a long list of errors the first ones.
    fn trouble(&self, s: &Status, width: u16, most: usize) -> Vec<Line<'static>> {
        let mut lines = if s.errors != 0 {
            wrapped(&words::errors_line(s), width).into_iter().map(|line| line.red().bold()).collect()
        } else if s.fsm <= 1 {
            wrapped(&words::waiting_for(s), width)
        } else {
            Vec::new()
        };
        let next = format!("next: {}", words::next_step(s).replace('`', ""));
        let next = wrapped(if self.said.is_empty() { &next } else { &self.said }, width);
        lines.truncate(most.saturating_sub(next.len()).max(1));
        lines.extend(next);
        let keys = wrapped("keys: q ends, s stops the motion", width);
        if lines.len() + keys.len() <= most {
            lines.extend(keys.into_iter().map(|line| line.dark_gray()));
        }
        lines
    }

    fn curves(&self, frame: &mut Frame<'_>, area: Rect) {
        let grid = Layout::horizontal([Constraint::Ratio(1, 6); 6]).split(area);
        for j in 0..6 {
            let [top, bottom] = Layout::vertical([Constraint::Fill(1); 2]).areas(grid[j]);
            frame.render_widget(curve(&self.position[j], j, "q", top.width), top);
            frame.render_widget(curve(&self.torque[j], j, "τ", bottom.width), bottom);
        }
    }
}

fn panel(title: &str) -> Block<'static> {
    Block::bordered()
        .border_type(BorderType::Rounded)
        .border_style(Style::new().dark_gray())
        .title(title.to_owned())
        .padding(Padding::horizontal(1))
}

/// Broken between words into lines of at most `width` columns; a longer word is cut.
fn wrapped(text: &str, width: u16) -> Vec<Line<'static>> {
    let width = usize::from(width.max(1));
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines.into_iter().map(Line::from).collect()
}

fn state_style(fsm: u8) -> Style {
    let colour = match fsm {
        2 => Color::Rgb(47, 131, 124),
        3 => Color::Rgb(63, 111, 224),
        4 => Color::Rgb(125, 87, 201),
        5 => Color::Rgb(201, 70, 59),
        _ => Color::Rgb(86, 97, 115),
    };
    Style::new().bg(colour).fg(Color::White).add_modifier(Modifier::BOLD)
}

/// A column: head, width, and the least width of the view that has it.
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

fn joint_table(s: &Status, width: u16, framed: bool) -> Table<'static> {
    // What a joint that does not answer had said last is no news of it; it is named before those that work.
    let mut order: Vec<usize> = (0..6).collect();
    order.sort_by_key(|j| is_measured(s, *j));
    let shown = |c: &&Column| width >= c.2;
    let count = COLUMNS.iter().filter(shown).count();
    let rows = order.into_iter().map(|j| {
        let joint = &s.joints[j];
        let measured = is_measured(s, j);
        let number = |value: f32, digits: usize, width: usize| {
            let text = if measured { figure(value.into(), digits) } else { "-".into() };
            Cell::from(format!("{text:>width$}"))
        };
        let mut trouble: Vec<&str> = words::joint_errors(joint.internal);
        trouble.extend(words::node_errors(joint.errors));
        trouble.extend(words::motor_faults(joint.mc_current));
        trouble.extend(words::node_warnings(joint.warnings));
        let cells = [
            Cell::from(format!("joint {}", j + 1)).style(Style::new().fg(COLOURS[j])),
            Cell::from(joint_state(s, j)),
            number(joint.position, 4, 8),
            number(joint.torque, 2, 7),
            number(joint.velocity, 4, 9),
            number(joint.temperature.into(), 0, 4),
            Cell::from(trouble.join(", ")).style(Style::new().red()),
        ];
        let style = if measured { Style::new() } else { Style::new().red().bold() };
        Row::new(cells.into_iter().take(count)).style(style)
    });
    let mut widths: Vec<Constraint> = COLUMNS.iter().filter(shown).map(|c| Constraint::Length(c.1)).collect();
    if let Some(last) = widths.get_mut(COLUMNS.len() - 1) {
        *last = Constraint::Fill(1);
    }
    let head = Row::new(COLUMNS.iter().filter(shown).map(|c| {
        let width = usize::from(c.1);
        // Heads of figures stand over their last digit.
        if c.0 == "state" { c.0.to_owned() } else { format!("{:>width$}", c.0) }
    }));
    let table = Table::new(rows, widths).header(head.dark_gray());
    if framed { table.block(panel(" joints ")) } else { table }
}

fn curve(history: &VecDeque<f64>, j: usize, name: &str, width: u16) -> Sparkline<'static> {
    let known = || history.iter().copied().filter(|v| v.is_finite());
    let (low, high) = (known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max));
    // A resting value is not blown up to full height.
    let span = (high - low).max(0.01);
    let height = |v: &f64| v.is_finite().then(|| ((v - low) / span * 100.0) as u64 + 1);
    // The newest that there is room for beside the frame.
    let old = history.len().saturating_sub(usize::from(width.saturating_sub(4)));
    let heights: Vec<Option<u64>> = history.iter().skip(old).map(height).collect();
    let last = history.back().filter(|v| v.is_finite());
    let last = last.map_or("-".into(), |v| figure(*v, 2));
    Sparkline::default()
        .data(heights)
        .max(101)
        .style(Style::new().fg(COLOURS[j]))
        .block(panel(&format!(" {name}{} {last} ", j + 1)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    /// Joint 3 fell silent while the arm was held.
    fn silent() -> Status {
        let mut s = Status { fsm: 5, errors: 0x2A, can_current: 1 << 10, ..Status::default() };
        for (j, joint) in s.joints.iter_mut().enumerate() {
            joint.fsm = 3;
            joint.position = 0.1 + j as f32;
            joint.temperature = 30;
        }
        s.joints[2].position = 0.0;
        s
    }

    fn drawn(s: Status, width: u16, height: u16) -> Vec<String> {
        let mut view = View::new("/tmp/jtc".into());
        view.push(s);
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| view.draw(frame)).unwrap();
        let cells = terminal.backend().buffer().content().to_vec();
        cells.chunks(width.into()).map(|row| row.iter().map(|c| c.symbol()).collect()).collect()
    }

    #[test]
    fn a_joint_without_measurement_has_no_number_and_is_named_first() {
        for (width, height) in [(40, 12), (60, 20), (80, 24), (90, 28), (200, 60)] {
            let rows = drawn(silent(), width, height);
            let text = rows.join("\n");
            let place = |words: &str| rows.iter().position(|row| row.contains(words));
            // What broke stands before anything else that is wrong, and before the table.
            let named = place("joint 3 does not answer").unwrap_or_else(|| panic!("not named\n{text}"));
            let row = place("joint 3 does not answer  ").unwrap_or_else(|| panic!("no row\n{text}"));
            assert!(named < row, "{text}");
            assert!(!rows[row].contains("0.0000") && rows[row].contains(" - "), "{text}");
            for joint in [1, 2, 4, 5, 6] {
                let other = place(&format!("joint {joint} OperationEnable"));
                assert!(other.is_some_and(|other| row < other), "{width}×{height}: joint {joint}\n{text}");
            }
            assert!(text.contains("recover"), "{width}×{height}\n{text}");
        }
    }

    #[test]
    fn a_gap_in_the_measurement_is_a_gap_in_the_curve() {
        let mut view = View::new(String::new());
        view.push(silent());
        assert!(view.position[2][0].is_nan() && view.torque[2][0].is_nan() && view.position[1][0] > 1.0);
    }

    #[test]
    fn lines_are_broken_between_words() {
        let lines: Vec<String> = wrapped("one two three", 7).iter().map(ToString::to_string).collect();
        assert_eq!(lines, ["one two", "three"]);
    }
}
