//! The picture of `ucom monitor`: as much as the terminal has room for, and what has none can be scrolled to.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Cell, Padding, Paragraph, Row, Sparkline, Table};
use ucom::Status;
use ucom::master::{Board, Boards, Life, Statistics};

use super::monitor::{Watch, age_s, doing, life};

/// Status bits from the most significant one: a letter each where room is short, a word where there is more.
const BITS: [(Status, char, &str); 8] = [
    (Status::MSTART, 'M', ""),
    (Status::ASTART, 'A', "autostart"),
    (Status::MCARUN, 'R', ""),
    (Status::EXLRUN, 'X', ""),
    (Status::INIT, 'I', "init"),
    (Status::PROG, 'P', "prog"),
    (Status::OPINIT, 'o', "out-pin"),
    (Status::IPINIT, 'i', "in-pin"),
];

/// Columns that a terminal needs for status bits as words, and for flash numbers and programs.
const WIDE: u16 = 130;
const MEDIUM: u16 = 72;
/// Lines that it needs for load and events beside the boards.
const HIGH: u16 = 16;

/// What is shown.
pub struct Picture<'a> {
    /// The boards as last heard.
    pub boards: &'a Boards,
    /// What the bus carried.
    pub statistics: &'a Statistics,
    /// µs.
    pub now: u64,
    /// What is beside the boards.
    pub watch: &'a Watch,
}

/// Draws everything. Returns how many rows of boards have room, and how many there are.
pub fn draw(frame: &mut Frame<'_>, picture: &Picture<'_>) -> (usize, usize) {
    let (area, rows) = (frame.area(), picture.boards.iter().count());
    if area.height < HIGH || area.width < MEDIUM {
        return small(frame, picture, area, rows);
    }
    // Events have at least four lines, boards as many as are left for them.
    let table = (rows.max(1) as u16 + 3).min(area.height - 5 - 4);
    let [head, middle, log] =
        Layout::vertical([Constraint::Length(5), Constraint::Length(table), Constraint::Fill(1)]).areas(area);
    let curve = if area.width >= WIDE { 44 } else { 24 };
    let [facts, curve] = Layout::horizontal([Constraint::Fill(1), Constraint::Length(curve)]).areas(head);
    frame.render_widget(summary(picture), facts);
    frame.render_widget(load(picture, usize::from(curve.width.saturating_sub(4))), curve);
    let room = usize::from(middle.height.saturating_sub(3));
    if rows > 0 {
        let title = format!(" boards {}", place(picture.watch, room, rows));
        frame.render_widget(boards(picture, middle.width).block(panel(&title)), middle);
    } else {
        frame.render_widget(Paragraph::new(nobody(picture.watch)).block(panel(" boards ")), middle);
    }
    frame.render_widget(events(picture.watch, log), log);
    (room, rows)
}

/// A line of facts and the boards, without frames around them.
fn small(frame: &mut Frame<'_>, picture: &Picture<'_>, area: Rect, rows: usize) -> (usize, usize) {
    let [head, middle, foot] =
        Layout::vertical([Constraint::Length(1), Constraint::Fill(1), Constraint::Length(1)]).areas(area);
    let room = usize::from(middle.height.saturating_sub(1));
    let percent = picture.statistics.load_percent(picture.now);
    let facts = format!("load {percent:.1} %  boards {}", place(picture.watch, room, rows));
    frame.render_widget(Line::from(facts).dark_gray(), head);
    match rows {
        0 => frame.render_widget(Paragraph::new(nobody(picture.watch)), middle),
        _ => frame.render_widget(boards(picture, middle.width), middle),
    }
    let last = picture.watch.log.back().map(|(time_s, text)| format!("{time_s:.1} s  {text}"));
    frame.render_widget(Line::from(last.unwrap_or_else(|| "↑↓ scroll   r asks again   q ends".into())), foot);
    (room, rows)
}

/// `3-5 of 10 ↑↓ ` where not all have room.
fn place(watch: &Watch, room: usize, rows: usize) -> String {
    let first = watch.first(room, rows);
    if rows <= room {
        return if rows == 0 { String::new() } else { format!("{rows} ") };
    }
    format!("{}-{} of {rows} ↑↓ ", first + 1, (first + room).min(rows))
}

fn nobody(watch: &Watch) -> &'static str {
    match watch.listen_only {
        true => "nobody talks yet; without --listen-only the boards are asked who they are",
        false => "no board answers yet; ucom init numbers the chain, ucom doctor looks for reasons",
    }
}

fn summary(picture: &Picture<'_>) -> Paragraph<'static> {
    let Picture { watch, statistics, now, .. } = picture;
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
    let counts = format!(
        "{:.0} s, {} frames heard, {} sent",
        *now as f64 * 1e-6,
        statistics.received,
        statistics.sent
    );
    let lines = vec![Line::from(role), Line::from(counts), Line::from(foreign)];
    Paragraph::new(lines).block(panel(&format!(" {} ", watch.url)))
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
        .block(panel(&format!(" bus load {percent:.1} % ")))
}

/// A column: its head, its width, and what stands in it.
struct Column {
    head: &'static str,
    width: Constraint,
    cell: fn(u8, &Board, &Statistics, u64) -> Cell<'static>,
}

impl Column {
    const fn new(
        head: &'static str,
        width: Constraint,
        cell: fn(u8, &Board, &Statistics, u64) -> Cell<'static>,
    ) -> Self {
        Self { head, width, cell }
    }
}

/// The columns that have room, the most needed ones first in line.
fn columns(width: u16) -> Vec<Column> {
    let number =
        Column::new("#", Constraint::Length(2), |number, _, _, _| Cell::from(format!("{number:>2}")));
    let flash = Column::new("flash", Constraint::Length(6), |_, b, _, _| known(b, |i| i.flash_number));
    let program = Column::new("program", Constraint::Length(7), |_, b, _, _| match b.info {
        Some(info) if !info.has_application() => Cell::from("none").yellow(),
        _ => known(b, |i| i.program_id),
    });
    let state = Column::new("state", Constraint::Length(13), |_, b, _, now| state(b, now));
    let letters = Column::new("MARXIPoi", Constraint::Length(8), |_, b, _, _| letters(b));
    let heartbeat = Column::new("heartbeat", Constraint::Length(11), |_, b, _, now| heartbeat(b, now));
    let rate = Column::new("fr/s", Constraint::Length(5), |number, _, statistics, now| {
        Cell::from(format!("{:>5}", statistics.frames_per_s(number, now)))
    });
    let errors = |width| Column::new("errors", width, |_, b, _, _| errors(b));
    let description = |width| {
        Column::new("description", width, |_, b, _, _| {
            Cell::from(b.description.clone().unwrap_or_else(|| "?".into()))
        })
    };
    if width >= WIDE {
        let bits = Column::new("status", Constraint::Length(34), |_, b, _, _| words(b));
        let (text, last) = (description(Constraint::Min(18)), errors(Constraint::Min(14)));
        return vec![number, flash, program, text, state, bits, heartbeat, rate, last];
    }
    if width >= MEDIUM {
        let (text, last) = (description(Constraint::Min(8)), errors(Constraint::Length(6)));
        return vec![number, flash, program, state, letters, heartbeat, rate, last, text];
    }
    if width >= 48 {
        return vec![number, flash, state, letters, heartbeat];
    }
    vec![number, state, letters, heartbeat]
}

fn boards(picture: &Picture<'_>, width: u16) -> Table<'static> {
    let columns = columns(width);
    let Picture { boards, statistics, now, watch } = picture;
    let row = |(number, b): (u8, &Board)| {
        Row::new(columns.iter().map(|c| (c.cell)(number, b, statistics, *now)).collect::<Vec<_>>())
    };
    let rows: Vec<Row<'static>> = boards.iter().skip(watch.scrolled).map(row).collect();
    let head: Vec<&str> = columns.iter().map(|c| c.head).collect();
    Table::new(rows, columns.iter().map(|c| c.width)).header(Row::new(head).dark_gray())
}

fn known(board: &Board, number: fn(&ucom::BoardInfo) -> u16) -> Cell<'static> {
    match &board.info {
        Some(info) => Cell::from(format!("0x{:04X}", number(info))),
        None => Cell::from("?").dark_gray(),
    }
}

fn state(board: &Board, now: u64) -> Cell<'static> {
    let colour = match doing(board, now) {
        "running" => Color::Rgb(63, 111, 224),
        "started" => Color::Rgb(47, 131, 124),
        "programming" => Color::Rgb(201, 131, 59),
        _ => Color::Rgb(86, 97, 115),
    };
    let style = Style::new().bg(colour).fg(Color::White).add_modifier(Modifier::BOLD);
    Cell::from(Span::styled(format!(" {} ", doing(board, now)), style))
}

/// A letter for each bit that is set, in its place.
fn letters(board: &Board) -> Cell<'static> {
    let Some(status) = board.status() else { return Cell::from("?").dark_gray() };
    let letter = |(bit, letter, _): &(Status, char, &str)| if status.has(*bit) { *letter } else { '·' };
    Cell::from(BITS.iter().map(letter).collect::<String>())
}

fn words(board: &Board) -> Cell<'static> {
    let status = board.status().unwrap_or_default();
    let set = BITS.iter().filter(|(bit, _, word)| status.has(*bit) && !word.is_empty());
    Cell::from(set.map(|(.., word)| *word).collect::<Vec<_>>().join(" "))
}

fn heartbeat(board: &Board, now: u64) -> Cell<'static> {
    match (board.life, age_s(board, now)) {
        (Life::Unarmed, _) | (_, None) => Cell::from("-").dark_gray(),
        (Life::Alive, Some(age)) => Cell::from(format!("{age:.1} s ago")).green(),
        (_, Some(age)) => Cell::from(format!("{} {age:.1} s", life(board))).red().bold(),
    }
}

fn errors(board: &Board) -> Cell<'static> {
    match board.errors.last() {
        None => Cell::from("-").dark_gray(),
        Some((_, code)) => Cell::from(format!("{} × {}", board.error_count, code)).red(),
    }
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
    Paragraph::new(lines).block(panel(" events    ↑↓ scroll    r asks again    q ends "))
}

fn panel(title: &str) -> Block<'static> {
    Block::bordered()
        .border_type(BorderType::Rounded)
        .border_style(Style::new().dark_gray())
        .title(title.to_owned())
        .padding(Padding::horizontal(1))
}

#[cfg(test)]
mod tests {
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use ucom::master::{Event, Master, Request};
    use ucom::{Profile, Status};

    use super::*;

    /// Ten boards that were asked who they are, as they answer.
    fn ten() -> (Master, u64) {
        let (mut master, mut now) = (Master::new(Profile::default()), 0);
        for number in 1..=10_u8 {
            master.start(now, Request::Info { board: number }).unwrap();
            'asked: loop {
                while let Some(frame) = master.poll(now) {
                    if frame.to_string() == format!("{:03X}#", 0x200 + u16::from(number)) {
                        let id = 0x140 + u16::from(number);
                        let head =
                            format!("{id:03X}#{:02X}00{number:02X}1BCD{number:02X}6E38", 0x20 + number);
                        for text in [
                            head,
                            format!("{id:03X}#0100"),
                            format!("{id:03X}#6A6F696E74{:02X}", 0x40 + number),
                        ] {
                            now += 200;
                            master.handle(now, Ok(text.parse().unwrap()));
                        }
                    }
                }
                now += 1_000;
                while let Some(event) = master.take_event() {
                    if let Event::Done { result, .. } = event {
                        result.unwrap();
                        break 'asked;
                    }
                }
            }
        }
        (master, now)
    }

    /// The lines of a terminal of this size, scrolled so far.
    fn shown(width: u16, height: u16, scroll: isize) -> (Vec<String>, Watch) {
        let (master, now) = ten();
        let (boards, statistics) = (master.boards(), master.statistics());
        let mut watch = Watch::new("socketcand:127.0.0.1:29536/can0".into(), false);
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        let mut room = (0, 0);
        for turn in 0..2 {
            let picture = Picture { boards: &boards, statistics: &statistics, now, watch: &watch };
            terminal.draw(|frame| room = draw(frame, &picture)).unwrap();
            if turn == 0 {
                watch.scroll(scroll, room);
            }
        }
        let buffer = terminal.backend().buffer().clone();
        let cells = buffer.content().chunks(usize::from(width));
        (cells.map(|row| row.iter().map(|cell| cell.symbol()).collect()).collect(), watch)
    }

    fn line_of<'a>(lines: &'a [String], part: &str) -> &'a str {
        lines
            .iter()
            .find(|line| line.contains(part))
            .unwrap_or_else(|| panic!("no {part} in\n{}", lines.join("\n")))
    }

    #[test]
    fn eighty_columns_have_flash_number_program_and_status_bits() {
        let (lines, _) = shown(80, 24, 0);
        for number in 1..=10_u8 {
            let line = line_of(&lines, &format!("0x00{:02X}", 0x20 + number));
            assert!(line.contains(&format!("0x{number:02X}CD")), "{line}");
            assert!(
                line.contains("···XI·oi") && line.contains(" exloader ") && line.contains("joint"),
                "{line}"
            );
        }
        let wide = shown(160, 30, 0).0;
        assert!(line_of(&wide, "0x0021").contains("init out-pin in-pin"), "{}", wide.join("\n"));
    }

    /// Every board can be seen on the smallest terminals.
    #[test]
    fn small_terminals_scroll() {
        for (width, height) in [(40, 8), (50, 9), (80, 12), (100, 16)] {
            let (first, _) = shown(width, height, 0);
            let board = first.iter().any(|line| line.contains(" 1 ") && line.contains("···XI·oi"));
            assert!(board, "{width}x{height}:\n{}", first.join("\n"));
            let (last, watch) = shown(width, height, 1000);
            let text = last.join("\n");
            assert!(
                last.iter().any(|line| line.contains("10 ") && line.contains("···XI·oi")),
                "{width}x{height}:\n{text}"
            );
            assert!(text.contains("-10 of 10"), "{width}x{height}:\n{text}");
            // No further than to the last one, and all the way back.
            let mut watch = watch;
            assert!(watch.scrolled < 10);
            watch.scroll(-1000, (3, 10));
            assert_eq!(watch.scrolled, 0);
        }
    }

    #[test]
    fn without_frames_ten_boards_have_room_in_fifteen_lines() {
        let (lines, _) = shown(50, 15, 0);
        assert!(line_of(&lines, "10 0x002A").contains("···XI·oi"), "{}", lines.join("\n"));
    }

    #[test]
    fn every_bit_has_its_place() {
        let byte = BITS.iter().fold(0, |byte, (bit, ..)| byte << 1 | u8::from(Status(0xFF).has(*bit)));
        assert_eq!(byte, 0xFF);
        assert!(BITS.windows(2).all(|pair| pair[0].0.0 >> 1 == pair[1].0.0), "from bit 7 to bit 0");
    }
}
