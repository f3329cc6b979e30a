//! Layout of the `ucom monitor` view, for terminals down to 40 columns and 12 rows. Errors and the next command are
//! at the top of the view. Rows that do not fit can be scrolled, and the keys are always visible.

use cli_kit::view::{FRAMED, Scroll, Trouble, panel, too_small, wrapped};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize};
use ratatui::text::Line;
use ratatui::widgets::{Paragraph, Sparkline};
use ucom_host::session::{Picture, Problems, Watch};

use super::monitor_boards::{self as rows, WIDE};

/// Keys of the view. If the terminal is too small for the view, only the first key is shown.
const KEYS: &str = "s stops  q ends";
/// Minimum number of rows in the board table, including the table head, for any number of errors.
const LEAST_ROWS: u16 = 4;
/// Smallest terminal height, in rows, at which the last event gets its own row.
const EVENT: u16 = 16;

/// Draws the view, and stores the visible rows in `scroll`.
pub(super) fn draw(frame: &mut Frame<'_>, picture: &Picture<'_>, scroll: &mut Scroll) {
    if too_small(frame, KEYS) {
        return;
    }
    let [area, foot] = Layout::vertical([Constraint::Fill(1), Constraint::Length(1)]).areas(frame.area());
    let framed = area.width >= FRAMED.0 && frame.area().height >= FRAMED.1;
    let (edge, inner) = if framed { (2, area.width - 4) } else { (0, area.width) };
    let (boards, log) = (picture.boards.iter().count() as u16, if framed { 4 } else { 0 });
    let most = area.height.saturating_sub(1 + LEAST_ROWS + 2 * edge + log);
    let (trouble, rest) = trouble(picture).lines(inner, most.into());
    let first = if trouble.is_empty() { 0 } else { trouble.len() as u16 + edge };
    // The box with the load curve is shown only if all other parts of the view have enough space.
    let wanted = rest.len() as u16 + boards.max(1) + 1 + edge;
    let head = if framed && area.height >= first + wanted + log + 5 { 5 } else { 1 };
    let left = area.height.saturating_sub(first + head);
    let least = if framed { log } else { u16::from(area.height + 1 >= EVENT) };
    let [top, second, middle, last] = Layout::vertical([
        Constraint::Length(first),
        Constraint::Length(head),
        Constraint::Length(wanted.min(left.saturating_sub(least))),
        Constraint::Fill(1),
    ])
    .areas(area);
    let paragraph = Paragraph::new(trouble);
    frame.render_widget(if framed { paragraph.block(panel("what is wrong")) } else { paragraph }, top);
    if head > 1 {
        let width = if area.width >= WIDE { 44 } else { 24 };
        let [facts, curve] =
            Layout::horizontal([Constraint::Fill(1), Constraint::Length(width)]).areas(second);
        frame.render_widget(summary(picture), facts);
        frame.render_widget(load(picture, usize::from(width - 4)), curve);
    } else {
        frame.render_widget(facts(picture, boards, second.width), second);
    }
    scroll.fit(usize::from(middle.height.saturating_sub(edge + 1)), rest.len() + usize::from(boards));
    let block = panel(&format!("boards {boards}"));
    let place = if framed { block.inner(middle) } else { middle };
    if framed {
        frame.render_widget(block, middle);
    }
    let above: Vec<Line<'static>> = rest.iter().skip(scroll.first()).cloned().collect();
    let skip = scroll.first().saturating_sub(rest.len());
    let [causes, table] =
        Layout::vertical([Constraint::Length(above.len() as u16), Constraint::Fill(1)]).areas(place);
    frame.render_widget(Paragraph::new(above), causes);
    // The head of the board table is drawn only if there is space for at least one row below it.
    if boards > 0 && table.height > 1 {
        frame.render_widget(rows::table(picture.boards, picture.statistics, picture.now, inner, skip), table);
    }
    events(frame, picture.watch, last, framed);
    let keys = format!("{KEYS}  r asks  {}", scroll.place());
    frame.render_widget(Line::from(keys).style(Style::new().fg(Color::Gray)), foot);
}

/// Returns the errors, the effect of a key press, and the next command.
fn trouble(picture: &Picture<'_>) -> Trouble {
    let Problems { causes, warnings, next } = picture.problems();
    Trouble { causes, warnings, next, message: picture.watch.message.clone() }
}

/// Returns the state of the bus as one line. The line contains the bus name if the complete name fits.
fn facts(picture: &Picture<'_>, boards: u16, width: u16) -> Line<'static> {
    let load = picture.statistics.load_percent(picture.now);
    let foreign = picture.statistics.foreign_count();
    let foreign = if foreign > 0 { format!("  {foreign} foreign frames") } else { String::new() };
    let facts = format!("{boards} boards  load {load:.1} %{foreign}");
    let whole = format!("{facts}  {}", picture.watch.url);
    Line::from(if whole.chars().count() <= usize::from(width) { whole } else { facts }).dark_gray()
}

fn summary(picture: &Picture<'_>) -> Paragraph<'static> {
    let Picture { watch, statistics, now, .. } = picture;
    let role = if watch.competing_master.is_some() {
        "another PC is master; only listens".yellow()
    } else if watch.listen_only {
        "only listens".dark_gray()
    } else {
        "asked once, only listens; r asks again".dark_gray()
    };
    let foreign: Vec<String> = statistics.foreign.iter().map(|(kind, n)| format!("{n} × {kind}")).collect();
    let foreign = match foreign.is_empty() {
        true => "no foreign frames".dark_gray(),
        false => format!("foreign: {}", foreign.join(", ")).yellow(),
    };
    let counts = format!(
        "{:.0} s, {} frames received, {} sent",
        *now as f64 * 1e-6,
        statistics.received,
        statistics.sent
    );
    let lines = vec![Line::from(role), Line::from(counts), Line::from(foreign)];
    Paragraph::new(lines).block(panel(&watch.url))
}

fn load(picture: &Picture<'_>, room: usize) -> Sparkline<'static> {
    let percent = picture.statistics.load_percent(picture.now);
    let heights: Vec<u64> =
        picture.watch.load.iter().rev().take(room).rev().map(|p| (p * 10.0) as u64).collect();
    let colour = if percent > 70.0 { Color::Red } else { Color::Rgb(67, 211, 158) };
    Sparkline::default()
        .data(heights)
        .max(1000)
        .style(Style::new().fg(colour))
        .block(panel(&format!("bus load {percent:.1} %")))
}

/// Draws the newest events of the bus; the last event is at the bottom. A long event text continues on the next
/// line.
fn events(frame: &mut Frame<'_>, watch: &Watch, area: Rect, framed: bool) {
    let (width, height) = if framed {
        (area.width.saturating_sub(4), area.height.saturating_sub(2))
    } else {
        (area.width, area.height)
    };
    let mut lines: Vec<Line<'static>> = Vec::new();
    for (time_s, text) in watch.log.iter().rev() {
        let time = format!("{time_s:8.1} s  ");
        let text = wrapped(&text.replace('`', ""), width.saturating_sub(time.len() as u16));
        if lines.len() + text.len() > usize::from(height) {
            break;
        }
        for (n, line) in text.into_iter().enumerate().rev() {
            let head = if n == 0 { time.clone() } else { " ".repeat(time.len()) };
            lines.push(Line::from(vec![head.dark_gray(), line.into()]));
        }
    }
    lines.reverse();
    let paragraph = Paragraph::new(lines);
    frame.render_widget(if framed { paragraph.block(panel("events")) } else { paragraph }, area);
}

#[cfg(test)]
#[path = "monitor_tests.rs"]
mod tests;
