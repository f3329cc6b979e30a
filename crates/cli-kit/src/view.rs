//! Parts of live views: the errors at the top, rows that scroll, and a line with the keys that is always visible.

use ratatui::Frame;
use ratatui::style::{Color, Style, Stylize};
use ratatui::text::Line;
use ratatui::widgets::{Block, BorderType, Padding, Paragraph};

use crate::keys::Key;

/// Smallest number of columns and rows of a live view.
pub const LEAST: (u16, u16) = (40, 12);
/// Smallest number of columns and rows of a live view that has frames around its parts.
pub const FRAMED: (u16, u16) = (80, 24);

/// Returns a frame that encloses a part of a live view.
pub fn panel(title: &str) -> Block<'static> {
    let title: String = if title.is_empty() { String::new() } else { format!(" {title} ") };
    Block::bordered()
        .border_type(BorderType::Rounded)
        .border_style(Style::new().dark_gray())
        .title(title)
        .padding(Padding::horizontal(1))
}

/// Wraps text between words into lines of at most `width` columns. A word that is longer than a line continues on the
/// next line.
pub fn wrapped(text: &str, width: u16) -> Vec<String> {
    let width = usize::from(width.max(1));
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        let letters: Vec<char> = word.chars().collect();
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + letters.len() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.extend(letters.chunks(width).map(|part| part.iter().collect::<String>())),
        }
    }
    lines
}

/// If the terminal is too small, draws one sentence with the required size and the key for Stop. The keys still work in
/// this case. Returns `true` if the terminal is too small.
pub fn too_small(frame: &mut Frame<'_>, keys: &str) -> bool {
    let area = frame.area();
    if area.width >= LEAST.0 && area.height >= LEAST.1 {
        return false;
    }
    let text = format!(
        "{keys}: this view needs {} columns and {} rows, but the terminal has {} and {}.",
        LEAST.0, LEAST.1, area.width, area.height
    );
    let lines: Vec<Line<'static>> = wrapped(&text, area.width).into_iter().map(Line::from).collect();
    frame.render_widget(Paragraph::new(lines), area);
    true
}

/// Errors that a live view shows, and the next command that is recommended.
#[derive(Clone, Debug, Default)]
pub struct Trouble {
    /// Texts of the causes. A cause that produces other causes comes first.
    pub causes: Vec<String>,
    /// Defects that do not stop the operation.
    pub warnings: Vec<String>,
    /// Recommended next command; empty if no command is recommended.
    pub next: String,
    /// Result of the last key press.
    pub message: String,
}

impl Trouble {
    /// Returns the lines for the head of a live view, if possible at most `most` lines. The lines contain the
    /// complete causes and warnings that fit, the next command, and the result of the last key press. The second list
    /// contains the causes that do not fit. The view shows them as the first rows of the scrolled part.
    pub fn lines(&self, width: u16, most: usize) -> (Vec<Line<'static>>, Vec<Line<'static>>) {
        let red = |text: String| Line::from(text).style(Style::new().fg(Color::Red).bold());
        let yellow = |text: String| Line::from(text).style(Style::new().fg(Color::Yellow));
        let mut foot: Vec<Line<'static>> = Vec::new();
        if !self.next.is_empty() {
            let next = format!("next: {}", self.next.replace('`', ""));
            foot.extend(wrapped(&next, width).into_iter().map(|line| Line::from(line).bold()));
        }
        foot.extend(wrapped(&self.message, width).into_iter().map(Line::from));
        let causes = self.causes.iter().map(|cause| (true, cause));
        let warnings = self.warnings.iter().map(|warning| (false, warning));
        let blocks: Vec<Vec<Line<'static>>> = causes
            .chain(warnings)
            .map(|(bad, text)| {
                let lines = wrapped(&text.replace('`', ""), width).into_iter();
                if bad { lines.map(red).collect() } else { lines.map(yellow).collect() }
            })
            .collect();
        let room = most.saturating_sub(foot.len());
        let all: usize = blocks.iter().map(Vec::len).sum();
        // If not all causes fit, a line is reserved for "and N more".
        let room = if all <= room { room } else { room.saturating_sub(1) };
        let mut taken = 0;
        let mut head: Vec<Line<'static>> = Vec::new();
        for block in &blocks {
            if taken > 0 && head.len() + block.len() > room {
                break;
            }
            head.extend(block.iter().cloned());
            taken += 1;
        }
        let rest: Vec<Line<'static>> = blocks[taken..].iter().flatten().cloned().collect();
        if taken < blocks.len() {
            head.push(red(format!("{} more below", blocks.len() - taken)));
        }
        head.extend(foot);
        (head, rest)
    }
}

/// Scroll position of the rows in a live view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scroll {
    at: usize,
    room: usize,
    rows: usize,
}

impl Scroll {
    /// Sets the number of visible rows and the number of all rows. The scroll position is limited so that no line below
    /// the last row stays empty.
    pub fn fit(&mut self, room: usize, rows: usize) {
        (self.room, self.rows) = (room, rows);
        self.at = self.at.min(rows.saturating_sub(room));
    }

    /// Returns the index of the first visible row.
    pub fn first(&self) -> usize {
        self.at
    }

    /// Scrolls the rows if the key requests scrolling.
    pub fn key(&mut self, key: Key) {
        let page = self.room.max(1) as isize;
        let by = match key {
            Key::Down | Key::Char('j') => 1,
            Key::Up | Key::Char('k') => -1,
            Key::PageDown | Key::Char(' ') => page,
            Key::PageUp => -page,
            Key::Home => isize::MIN,
            Key::End => isize::MAX,
            _ => 0,
        };
        self.at = self.at.saturating_add_signed(by);
        self.fit(self.room, self.rows);
    }

    /// Returns a text like `↑↓ 3-5 of 10` if not all rows are visible.
    pub fn place(&self) -> String {
        if self.rows <= self.room {
            return String::new();
        }
        format!("↑↓ {}-{} of {}", self.at + 1, (self.at + self.room).min(self.rows), self.rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_broken_between_words_and_nothing_of_a_long_word_is_lost() {
        assert_eq!(wrapped("one two three", 7), ["one two", "three"]);
        assert_eq!(wrapped("a 0123456789 b", 4), ["a", "0123", "4567", "89 b"]);
    }

    fn text(lines: &[Line<'static>]) -> Vec<String> {
        lines.iter().map(ToString::to_string).collect()
    }

    /// The live view never truncates the text of a cause. The view counts the causes that do not fit, and shows them as
    /// the first rows of the scrolled part.
    #[test]
    fn causes_are_shown_whole_or_scroll() {
        let trouble = Trouble {
            causes: vec![
                "joint 3 does not answer".into(),
                "joint 4: over-current".into(),
                "joint 5: x".into(),
            ],
            warnings: vec!["joint 6: y".into()],
            next: "`jtc recover`".into(),
            message: String::new(),
        };
        let all = ["joint 3 does not", "answer", "joint 4:", "over-current", "joint 5: x", "joint 6: y"];
        let (head, rest) = trouble.lines(20, 20);
        assert_eq!(text(&head), [&all[..], &["next: jtc recover"]].concat());
        assert!(rest.is_empty());
        let (head, rest) = trouble.lines(20, 5);
        assert_eq!(text(&head), [&all[..2], &["3 more below", "next: jtc recover"]].concat());
        assert_eq!(text(&rest), all[2..]);
        // The first cause is complete even if the view has no space for causes.
        assert_eq!(text(&trouble.lines(20, 0).0)[..2], all[..2]);
    }

    #[test]
    fn rows_scroll_to_the_last_one_and_back() {
        let mut scroll = Scroll::default();
        scroll.fit(3, 10);
        assert_eq!((scroll.first(), scroll.place().as_str()), (0, "↑↓ 1-3 of 10"));
        scroll.key(Key::PageDown);
        scroll.key(Key::Down);
        assert_eq!(scroll.place(), "↑↓ 5-7 of 10");
        scroll.key(Key::End);
        assert_eq!((scroll.first(), scroll.place().as_str()), (7, "↑↓ 8-10 of 10"));
        scroll.fit(6, 8);
        assert_eq!(scroll.first(), 2);
        scroll.key(Key::Home);
        assert_eq!(scroll.first(), 0);
        scroll.fit(8, 8);
        assert_eq!(scroll.place(), "");
    }
}
