//! View of `jtc monitor`, for terminals down to 40 columns and 12 rows. The view shows errors and the next command first. The first rows of
//! the table are the joints without measured values. The user can scroll to text that does not fit, and the keys are always visible. The
//! position curves fill the remaining space of the view.

use std::collections::VecDeque;
use std::time::Duration;

use cli_kit::view::{FRAMED, Scroll, Trouble, panel, too_small};
use cli_kit::{Failure, figure};
use jtc_host::labels;
use jtc_host::sample::is_measured;
use jtc_wire::{Code, ControllerState, Status};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Sparkline};

use super::joints::{self, COLOURS};

/// Number of values that the position curves show, which is 8 s of statuses.
const HISTORY: usize = 200;
/// Smallest height of the view, in rows, at which the view has a row for a link without faults.
const LINK: u16 = 16;
/// Smallest height of the position curves, in rows.
const CURVES: u16 = 6;
/// Smallest number of rows of the joint table, including the heading, for any number of errors.
const LEAST_ROWS: u16 = 3;
/// Help text for the keys of the view. A terminal that is too small shows only the first key.
const KEYS: &str = "s stops   q ends";

/// State of the monitor view.
pub(super) struct View {
    port: String,
    last: Option<Status>,
    /// Time since the last status.
    pub silent: Option<Duration>,
    /// Number of received statuses per second.
    pub rate: f64,
    /// Number of received bytes that do not belong to a valid frame.
    pub bad_bytes: u64,
    /// Result of the last pressed key, which is shown until the next key is pressed.
    pub reply: String,
    /// Scroll position of the causes and the joints.
    pub scroll: Scroll,
    /// Last positions of each joint. The value is NaN if the joint was not measured.
    position: [VecDeque<f64>; 6],
    torque: [VecDeque<f64>; 6],
}

impl View {
    /// Creates the view for the controller at this port, before the first status.
    pub(super) fn new(port: String) -> Self {
        Self {
            port,
            last: None,
            silent: None,
            rate: 0.0,
            bad_bytes: 0,
            reply: String::new(),
            scroll: Scroll::default(),
            position: Default::default(),
            torque: Default::default(),
        }
    }

    /// Adds a status to the view.
    pub(super) fn push(&mut self, s: Status) {
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

    /// Returns the failure of a lost port, with the known state of the motion.
    pub(super) fn lost(&self, failure: Failure) -> Failure {
        let moving = self.last.is_some_and(|s| s.is_executing());
        let message = format!("{}{}", failure.message, if moving { "; THE ARM MAY BE MOVING" } else { "" });
        Failure { message, ..failure }
    }

    /// Draws all parts of the view for which the terminal has enough space.
    pub(super) fn draw(&mut self, frame: &mut Frame<'_>) {
        if too_small(frame, KEYS) {
            return;
        }
        let [area, foot] = Layout::vertical([Constraint::Fill(1), Constraint::Length(1)]).areas(frame.area());
        let framed = area.width >= FRAMED.0 && frame.area().height >= FRAMED.1;
        let edge = if framed { 2 } else { 0 };
        let inner = area.width.saturating_sub(2 * edge);
        let head = self.head(inner, frame.area().height >= LINK);
        // The joint table always has some rows. If enough space is available, the table shows all rows.
        let rows = if framed { 8 } else { LEAST_ROWS };
        let most = area.height.saturating_sub(head.len() as u16 + rows + 3 * edge);
        let (trouble, rest) = self.trouble().lines(inner, most.into());
        let count = self.last.as_ref().map_or(0, joints::count);
        let heights = [trouble.len() as u16 + edge, head.len() as u16 + edge];
        let left = area.height.saturating_sub(heights[0] + heights[1]);
        let table = if count == 0 { 0 } else { (rest.len() + 1 + count) as u16 + edge };
        let [first, second, third, curves] = Layout::vertical([
            Constraint::Length(heights[0]),
            Constraint::Length(heights[1]),
            Constraint::Length(table.min(left)),
            Constraint::Fill(1),
        ])
        .areas(area);
        let title =
            if self.silent.is_some() || self.last.is_some_and(|s| s.errors != 0) { "errors" } else { "next" };
        frame.render_widget(part(trouble, title, framed), first);
        frame.render_widget(part(head, &self.port, framed), second);
        self.rows(frame, third, rest, framed);
        if framed && curves.height >= CURVES {
            self.curves(frame, curves);
        }
        let keys = format!("{KEYS}   {}", self.scroll.place());
        frame.render_widget(Line::from(keys).style(Style::new().fg(Color::Gray)), foot);
    }

    /// Draws the joints, and the causes that do not fit into the head of the view. The user can scroll to rows that do
    /// not fit.
    fn rows(&mut self, frame: &mut Frame<'_>, area: Rect, rest: Vec<Line<'static>>, framed: bool) {
        let Some(s) = &self.last else { return };
        let (edge, heads) = (if framed { 2 } else { 0 }, 1);
        let all = rest.len() + joints::count(s);
        self.scroll.fit(usize::from(area.height.saturating_sub(edge + heads)), all);
        let first = self.scroll.first();
        let above: Vec<Line<'static>> = rest.iter().skip(first).cloned().collect();
        let [causes, table] =
            Layout::vertical([Constraint::Length(above.len() as u16), Constraint::Fill(1)]).areas(area);
        frame.render_widget(Paragraph::new(above), causes);
        let (inner, skip) = (area.width.saturating_sub(2 * edge), first.saturating_sub(rest.len()));
        // The table is drawn only if at least one row fits below its heading.
        if table.height > heads + edge {
            frame.render_widget(joints::table(s, self.silent.is_some(), inner, framed, skip), table);
        }
    }

    /// Returns the lines with the state of the controller, the position on the trajectory, and the link.
    fn head(&self, width: u16, link: bool) -> Vec<Line<'static>> {
        let Some(s) = &self.last else { return vec![Line::from(self.port.clone()).dark_gray()] };
        if self.silent.is_some() {
            let was = format!("last state {}, trajectory {}", s.state.name(), s.trajectory.name());
            return vec![Line::from(was).dark_gray()];
        }
        let state = Span::styled(format!(" {} ", s.state.name()), state_style(s.state));
        let mut line = vec![state, Span::raw(" trajectory "), s.trajectory.name().bold()];
        line.push(Span::raw(format!(" {:.2} s", f64::from(s.point) * 1e-3)));
        let mut lines = vec![Line::from(line)];
        if link {
            let words = format!("{:.1} statuses/s, {} bad bytes", self.rate, self.bad_bytes);
            let words =
                if width >= 60 { words } else { format!("{:.0}/s, {} bad bytes", self.rate, self.bad_bytes) };
            lines.push(Line::from(words.dark_gray()));
        }
        lines
    }

    /// Returns the errors and the next step of the user.
    fn trouble(&self) -> Trouble {
        let reply = self.reply.clone();
        let (causes, warnings, next) = match (&self.last, self.silent) {
            (None, None) => (Vec::new(), vec!["waiting for a status".into()], String::new()),
            (None, Some(time)) => (vec![silence(time)], Vec::new(), "jtc doctor".into()),
            (Some(s), Some(time)) => {
                let moving = if s.is_executing() { "; THE ARM MAY BE MOVING" } else { "" };
                let cause = format!("{}, older values are not shown{moving}", silence(time));
                (vec![cause], Vec::new(), "jtc doctor".into())
            }
            (Some(s), None) => {
                let causes = labels::causes(s);
                let mut warnings = labels::warnings(s);
                if causes.is_empty() && s.is_coming_up() {
                    warnings.insert(0, labels::waiting_for(s));
                }
                (causes, warnings, labels::next_step(s).to_string())
            }
        };
        Trouble { causes, warnings, next, message: reply }
    }

    fn curves(&self, frame: &mut Frame<'_>, area: Rect) {
        let grid = Layout::horizontal([Constraint::Ratio(1, 6); 6]).split(area);
        let silent = self.silent.is_some();
        for j in 0..6 {
            let [top, bottom] = Layout::vertical([Constraint::Fill(1); 2]).areas(grid[j]);
            frame.render_widget(curve(&self.position[j], j, "q", top.width, silent), top);
            frame.render_widget(curve(&self.torque[j], j, "τ", bottom.width, silent), bottom);
        }
    }
}

fn silence(time: Duration) -> String {
    format!("no status for {:.0} s", time.as_secs_f64())
}

fn part(lines: Vec<Line<'static>>, title: &str, framed: bool) -> Paragraph<'static> {
    let paragraph = Paragraph::new(lines);
    if framed { paragraph.block(panel(title)) } else { paragraph }
}

fn state_style(state: Code<ControllerState>) -> Style {
    let colour = match state.known() {
        Some(ControllerState::HoldPos) => Color::Rgb(47, 131, 124),
        Some(ControllerState::Operate) => Color::Rgb(63, 111, 224),
        Some(ControllerState::Teaching) => Color::Rgb(125, 87, 201),
        Some(ControllerState::Error) => Color::Rgb(201, 70, 59),
        Some(ControllerState::Start | ControllerState::Init) | None => Color::Rgb(86, 97, 115),
    };
    Style::new().bg(colour).fg(Color::White).add_modifier(Modifier::BOLD)
}

fn curve(history: &VecDeque<f64>, j: usize, name: &str, width: u16, silent: bool) -> Sparkline<'static> {
    let known = || history.iter().copied().filter(|v| v.is_finite());
    let (low, high) = (known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max));
    // The value range is at least 0.01, so that small changes of a joint at rest do not fill the full height of the
    // curve.
    let span = (high - low).max(0.01);
    let height = |v: &f64| v.is_finite().then(|| ((v - low) / span * 100.0) as u64 + 1);
    // The view draws only the newest values, as many as fit inside the frame.
    let old = history.len().saturating_sub(usize::from(width.saturating_sub(4)));
    let heights: Vec<Option<u64>> = history.iter().skip(old).map(height).collect();
    let last = history.back().filter(|v| v.is_finite() && !silent);
    let last = last.map_or("-".into(), |v| figure(*v, 2));
    let colour = if silent { Color::DarkGray } else { COLOURS[j] };
    Sparkline::default()
        .data(heights)
        .max(101)
        .style(Style::new().fg(colour))
        .block(panel(&format!("{name}{} {last}", j + 1)))
}

#[cfg(test)]
#[path = "view_tests.rs"]
mod tests;
