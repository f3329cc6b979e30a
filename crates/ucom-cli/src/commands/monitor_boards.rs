//! Table of boards in the live view of `ucom monitor`. The table shows as many columns as possible, and always the state, status bits and
//! heartbeat of a board.

use ratatui::layout::Constraint;
use ratatui::style::{Color, Modifier, Style, Stylize};
use ratatui::text::Span;
use ratatui::widgets::{Cell, Row, Table};
use ucom::Status;
use ucom_host::master::{Board, Boards, Life, Statistics};

/// Status bits of a board, beginning with the most significant bit. A narrow column shows one letter for each status bit; a wide column
/// shows a word.
pub(super) const BITS: [(Status, char, &str); 8] = [
    (Status::MSTART, 'M', ""),
    (Status::ASTART, 'A', "autostart"),
    (Status::MCARUN, 'R', ""),
    (Status::EXLRUN, 'X', ""),
    (Status::INIT, 'I', "init"),
    (Status::PROG, 'P', "prog"),
    (Status::OPINIT, 'o', "out-pin"),
    (Status::IPINIT, 'i', "in-pin"),
];

/// Minimum width of the view for status bits as words, and for the columns with flash numbers and programs.
pub(super) const WIDE: u16 = 130;
const MEDIUM: u16 = 72;
/// Age, in seconds, above which the view marks the last answer of a board as old.
const OLD_S: f64 = 5.0;

/// Column of the board table: its head, its width and its content.
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

/// Returns the table columns that fit into the width, the most important columns first.
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
    let description = |head, width| {
        Column::new(head, width, |_, b, _, _| Cell::from(b.description.clone().unwrap_or_else(|| "?".into())))
    };
    if width >= WIDE {
        let bits = Column::new("status", Constraint::Length(34), |_, b, _, _| words(b));
        let (text, last) = (description("description", Constraint::Min(18)), errors(Constraint::Min(14)));
        return vec![number, flash, program, text, state, bits, heartbeat, rate, last];
    }
    if width >= MEDIUM {
        let (text, last) = (description("text", Constraint::Min(8)), errors(Constraint::Length(6)));
        return vec![number, flash, program, state, letters, heartbeat, rate, last, text];
    }
    if width >= 48 {
        return vec![number, flash, state, letters, heartbeat];
    }
    vec![number, state, letters, heartbeat]
}

/// Returns the rows of the table from row `first`, with as many columns as the width of the view permits.
pub(super) fn table(
    boards: &Boards,
    statistics: &Statistics,
    now: u64,
    width: u16,
    first: usize,
) -> Table<'static> {
    let columns = columns(width);
    let row = |(number, b): (u8, &Board)| {
        Row::new(columns.iter().map(|c| (c.cell)(number, b, statistics, now)).collect::<Vec<_>>())
    };
    let rows: Vec<Row<'static>> = boards.iter().skip(first).map(row).collect();
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
    let colour = match board.state_name(now) {
        "lost" | "rebooted" => Color::Rgb(201, 70, 59),
        "running" => Color::Rgb(63, 111, 224),
        "started" => Color::Rgb(47, 131, 124),
        "programming" => Color::Rgb(201, 131, 59),
        _ => Color::Rgb(86, 97, 115),
    };
    let style = Style::new().bg(colour).fg(Color::White).add_modifier(Modifier::BOLD);
    Cell::from(Span::styled(format!(" {} ", board.state_name(now)), style))
}

/// Returns a text with a letter for each status bit that is set, at the position of the bit.
fn letters(board: &Board) -> Cell<'static> {
    let Some(status) = board.status().filter(|_| board.is_known()) else {
        return Cell::from("?").dark_gray();
    };
    let letter = |(bit, letter, _): &(Status, char, &str)| if status.has(*bit) { *letter } else { '·' };
    Cell::from(BITS.iter().map(letter).collect::<String>())
}

fn words(board: &Board) -> Cell<'static> {
    let Some(status) = board.status().filter(|_| board.is_known()) else {
        return Cell::from("?").dark_gray();
    };
    let set = BITS.iter().filter(|(bit, _, word)| status.has(*bit) && !word.is_empty());
    Cell::from(set.map(|(.., word)| *word).collect::<Vec<_>>().join(" "))
}

fn heartbeat(board: &Board, now: u64) -> Cell<'static> {
    match (board.life, board.alive_age_s(now)) {
        (Life::Unarmed, _) | (_, None) => match board.last {
            // The board sends frames only when a PC requests them, so the displayed values are as old as its last
            // answer.
            Some((at, _)) if now.saturating_sub(at) as f64 * 1e-6 >= OLD_S => {
                Cell::from(format!("{:.0} s old", now.saturating_sub(at) as f64 * 1e-6)).dark_gray()
            }
            _ => Cell::from("-").dark_gray(),
        },
        (Life::Alive, Some(age)) => Cell::from(format!("{age:.1} s ago")).green(),
        (_, Some(age)) => Cell::from(format!("{} {age:.1} s", board.life.name())).red().bold(),
    }
}

fn errors(board: &Board) -> Cell<'static> {
    match board.errors.last() {
        None => Cell::from("-").dark_gray(),
        Some((_, code)) => Cell::from(format!("{} × {}", board.error_count, code)).red(),
    }
}

#[cfg(test)]
mod tests {
    use ucom_host::explain::{find, words};

    use super::*;

    /// The command `ucom explain` accepts each letter and word of a status bit in the view, and gives the same
    /// explanation as for the name of this bit.
    #[test]
    fn every_letter_and_word_of_a_bit_is_explained() {
        let all = words();
        for ((name, bit), (its_bit, letter, word)) in Status::NAMES.into_iter().zip(BITS) {
            let is = |shown: &str| find(&all, shown).iter().any(|w| w.shown[0] == name);
            assert!(bit == its_bit && is(&letter.to_string()) && (word.is_empty() || is(word)), "{name}");
        }
    }

    #[test]
    fn every_bit_has_its_place() {
        let byte = BITS.iter().fold(0, |byte, (bit, ..)| byte << 1 | u8::from(Status(0xFF).has(*bit)));
        assert_eq!(byte, 0xFF);
        assert!(BITS.windows(2).all(|pair| pair[0].0.0 >> 1 == pair[1].0.0), "from bit 7 to bit 0");
    }
}
