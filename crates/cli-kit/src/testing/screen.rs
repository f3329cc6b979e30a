//! Terminal emulation that shows the output of a program. The emulation supports the functions that live views and
//! progress bars use.

/// Contents of the terminal screen, as characters in cells.
pub struct Picture {
    cells: Vec<Vec<char>>,
    at: (usize, usize),
    /// First bytes of an escape sequence or of a character whose remaining bytes have not arrived yet.
    begun: Vec<u8>,
}

impl Picture {
    /// Creates an empty terminal screen.
    pub fn new(columns: u16, rows: u16) -> Self {
        let cells = vec![vec![' '; columns.into()]; rows.into()];
        Self { cells, at: (0, 0), begun: Vec::new() }
    }

    /// Returns the rows of the terminal screen, without trailing spaces.
    pub fn rows(&self) -> Vec<String> {
        self.cells.iter().map(|row| row.iter().collect::<String>().trim_end().to_owned()).collect()
    }

    /// Returns the rows of the terminal screen as one text.
    pub fn text(&self) -> String {
        self.rows().join("\n")
    }

    /// Processes the output bytes of a program.
    pub fn take(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.begun.push(*byte);
            if self.begun[0] == 0x1B {
                self.sequence();
            } else if let Ok(text) = std::str::from_utf8(&self.begun) {
                let letter = text.chars().next();
                self.begun.clear();
                letter.into_iter().for_each(|c| self.letter(c));
            } else if self.begun.len() >= 4 {
                self.begun.clear();
            }
        }
    }

    fn letter(&mut self, letter: char) {
        let (columns, rows) = (self.cells[0].len(), self.cells.len());
        match letter {
            '\r' => self.at.1 = 0,
            '\n' if self.at.0 + 1 < rows => self.at.0 += 1,
            '\n' => {
                self.cells.remove(0);
                self.cells.push(vec![' '; columns]);
            }
            c if c.is_control() => {}
            c => {
                if self.at.1 >= columns {
                    self.at.1 = 0;
                    self.letter('\n');
                }
                self.cells[self.at.0][self.at.1] = c;
                self.at.1 += 1;
            }
        }
    }

    fn sequence(&mut self) {
        let Some((last, code)) = self.begun.split_last() else { return };
        if code.len() < 2 || !(last.is_ascii_alphabetic() || *last == b'~') {
            if self.begun.len() == 2 && *last != b'[' {
                self.begun.clear();
            }
            return;
        }
        let (last, code) = (*last, String::from_utf8_lossy(&code[2..]).into_owned());
        self.begun.clear();
        let numbers: Vec<usize> = code.split(';').map(|n| n.parse().unwrap_or(0)).collect();
        let number = |i: usize| numbers.get(i).copied().unwrap_or(0);
        let (columns, rows) = (self.cells[0].len(), self.cells.len());
        match last {
            b'A' => self.at.0 = self.at.0.saturating_sub(number(0).max(1)),
            b'B' => self.at.0 = (self.at.0 + number(0).max(1)).min(rows - 1),
            b'C' => self.at.1 = (self.at.1 + number(0).max(1)).min(columns - 1),
            b'D' => self.at.1 = self.at.1.saturating_sub(number(0).max(1)),
            b'G' => self.at.1 = number(0).max(1) - 1,
            b'H' => self.at = (number(0).clamp(1, rows) - 1, number(1).clamp(1, columns) - 1),
            b'K' if number(0) == 2 => self.cells[self.at.0].fill(' '),
            b'K' => self.cells[self.at.0][self.at.1.min(columns)..].fill(' '),
            b'J' => {
                let all = number(0) == 2;
                let from = if all { 0 } else { self.at.0 + 1 };
                self.cells[from..].iter_mut().for_each(|row| row.fill(' '));
                if !all {
                    self.cells[self.at.0][self.at.1.min(columns)..].fill(' ');
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_what_a_terminal_shows() {
        let mut picture = Picture::new(6, 3);
        picture.take("one\r\ntwo\x1B[1A\r\x1B[2Kpast\x1B[3;2H\u{2501}\x1B[31mx".as_bytes());
        assert_eq!(picture.rows(), ["past", "two", " \u{2501}x"]);
        picture.take(b"\r\nnext\r\n");
        assert_eq!(picture.rows(), [" \u{2501}x", "next", ""]);
        picture.take(b"\x1B[2J12345678");
        assert_eq!(picture.rows(), ["", "123456", "78"]);
    }
}
