//! The picture of `ucom monitor`.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Cell, Padding, Paragraph, Row, Sparkline, Table};
use ucom::Status;
use ucom::master::{Board, Boards, Life, Statistics};

use super::monitor::{Watch, age_s, doing, life};
use crate::driver::Driver;

/// Bits worth a place of their own, as short words.
const BITS: [(Status, &str); 5] = [
    (Status::ASTART, "autostart"),
    (Status::PROG, "prog"),
    (Status::INIT, "init"),
    (Status::OPINIT, "out-pin"),
    (Status::IPINIT, "in-pin"),
];

/// Columns that a terminal needs for the status bits.
const WIDE: u16 = 112;

/// Draws everything.
pub fn draw(frame: &mut Frame<'_>, driver: &Driver, watch: &Watch) {
    let (boards, statistics, now) = (driver.master.boards(), driver.master.statistics(), driver.now_us());
    let rows = boards.iter().count().max(1) as u16;
    let wide = frame.area().width >= WIDE;
    let [head, middle, log] =
        Layout::vertical([Constraint::Length(5), Constraint::Length(rows + 3), Constraint::Min(4)])
            .areas(frame.area());
    let [facts, curve] =
        Layout::horizontal([Constraint::Fill(1), Constraint::Length(if wide { 44 } else { 24 })]).areas(head);
    frame.render_widget(summary(watch, &statistics, now), facts);
    frame.render_widget(load(watch, &statistics, now, usize::from(curve.width.saturating_sub(4))), curve);
    if boards.iter().next().is_some() {
        frame.render_widget(table(&boards, &statistics, now, wide), middle);
    } else {
        let text = match watch.listen_only {
            true => "nobody talks yet; without --listen-only the boards are asked who they are",
            false => "no board answers yet; ucom init numbers the chain, ucom doctor looks for reasons",
        };
        frame.render_widget(Paragraph::new(text).block(panel(" boards ")), middle);
    }
    frame.render_widget(events(watch, log), log);
}

fn summary(watch: &Watch, statistics: &Statistics, now: u64) -> Paragraph<'static> {
    let role = if watch.foreign_master {
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
    let counts =
        format!("{:.0} s, {} frames heard, {} sent", now as f64 * 1e-6, statistics.received, statistics.sent);
    let lines = vec![Line::from(role), Line::from(counts), Line::from(foreign)];
    Paragraph::new(lines).block(panel(&format!(" {} ", watch.url)))
}

fn load(watch: &Watch, statistics: &Statistics, now: u64, room: usize) -> Sparkline<'static> {
    let percent = statistics.load_percent(now);
    let heights: Vec<u64> = watch.load.iter().rev().take(room).rev().map(|p| (p * 10.0) as u64).collect();
    let colour = if percent > 70.0 { Color::Red } else { Color::Rgb(67, 211, 158) };
    Sparkline::default()
        .data(heights)
        .max(1000)
        .style(Style::new().fg(colour))
        .block(panel(&format!(" bus load {percent:.1} % ")))
}

fn table(boards: &Boards, statistics: &Statistics, now: u64, wide: bool) -> Table<'static> {
    let rows = boards.iter().map(|(number, b)| row(number, b, statistics, now, wide));
    let widths = [
        Constraint::Length(5),
        Constraint::Min(18),
        Constraint::Length(13),
        Constraint::Length(if wide { 34 } else { 0 }),
        Constraint::Length(15),
        Constraint::Length(8),
        Constraint::Min(14),
    ];
    let status = if wide { "status" } else { "" };
    let head = ["board", "description", "state", status, "life sign", "frames/s", "errors"];
    Table::new(rows, widths).header(Row::new(head).dark_gray()).block(panel(" boards "))
}

fn row(number: u8, b: &Board, statistics: &Statistics, now: u64, wide: bool) -> Row<'static> {
    let colour = match doing(b, now) {
        "running" => Color::Rgb(63, 111, 224),
        "started" => Color::Rgb(47, 131, 124),
        "programming" => Color::Rgb(201, 131, 59),
        _ => Color::Rgb(86, 97, 115),
    };
    let style = Style::new().bg(colour).fg(Color::White).add_modifier(Modifier::BOLD);
    let state = Cell::from(Span::styled(format!(" {} ", doing(b, now)), style));
    let status = b.status().unwrap_or_default();
    // On a narrow terminal the state in one word must do.
    let words: Vec<&str> =
        BITS.iter().filter(|_| wide).filter(|(bit, _)| status.has(*bit)).map(|(_, word)| *word).collect();
    let alive = match (b.life, age_s(b, now)) {
        (Life::Unarmed, _) | (_, None) => Cell::from("-").dark_gray(),
        (Life::Alive, Some(age)) => Cell::from(format!("{age:.1} s ago")).green(),
        (_, Some(age)) => Cell::from(format!("{} {age:.1} s", life(b))).red().bold(),
    };
    let error = match b.errors.last() {
        None => Cell::from("-").dark_gray(),
        Some((_, code)) => Cell::from(format!("{} × {}", b.error_count, code)).red(),
    };
    Row::new(vec![
        Cell::from(format!("{number:>5}")),
        Cell::from(b.description.clone().unwrap_or_else(|| "?".into())),
        state,
        Cell::from(words.join(" ")),
        alive,
        Cell::from(format!("{:>8}", statistics.frames_per_s(number, now))),
        error,
    ])
}

fn events(watch: &Watch, area: Rect) -> Paragraph<'static> {
    let room = usize::from(area.height.saturating_sub(2)).max(1);
    let lines: Vec<Line<'static>> = watch
        .log
        .iter()
        .rev()
        .take(room)
        .rev()
        .map(|(time_s, text)| Line::from(vec![format!("{time_s:8.1} s  ").dark_gray(), text.clone().into()]))
        .collect();
    Paragraph::new(lines).block(panel(" events    r asks again    q ends "))
}

fn panel(title: &str) -> Block<'static> {
    Block::bordered()
        .border_type(BorderType::Rounded)
        .border_style(Style::new().dark_gray())
        .title(title.to_owned())
        .padding(Padding::horizontal(1))
}
