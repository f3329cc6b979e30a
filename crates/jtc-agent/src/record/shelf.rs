//! The directory with the recordings of an agent: their names, how much room they take, and which of them go first.
//!
//! A list beside them has the names of those that were made here, so that no other file is ever removed. It is locked: two agents do not
//! share a directory.
use std::collections::VecDeque;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Name of the list.
pub const LIST: &str = ".jtc-recordings";
/// Ending of a recording that is whole.
const WHOLE: &str = ".mcap";
/// Ending of one that is being made, or broke off: every command reads it, too.
const PART: &str = ".part.mcap";
/// Lines of the list of files that are gone, before it is written anew.
const GONE_MAX: usize = 10_000;

/// A recording that was made here.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Own {
    /// Without its ending.
    name: String,
    /// Bytes, where it is not being written; a file of another length is not ours any more.
    bytes: u64,
    /// It broke off, or is being written.
    part: bool,
}

impl Own {
    fn path(&self, dir: &Path) -> PathBuf {
        dir.join(format!("{}{}", self.name, if self.part { PART } else { WHOLE }))
    }
}

/// Makes a file that is not there.
type Make = fn(&Path) -> io::Result<File>;

/// The directory.
pub struct Shelf {
    dir: PathBuf,
    make: Make,
    limit: u64,
    list: File,
    /// Oldest first, without the one that is being written.
    own: VecDeque<Own>,
    number: u64,
    gone: usize,
}

/// A recording that is being made.
pub struct Begun {
    /// Where it is written.
    pub path: PathBuf,
    name: String,
}

impl Shelf {
    /// Goes on with a directory, or makes it. `limit`: bytes that all recordings take together.
    ///
    /// # Errors
    ///
    /// It cannot be made or written to, or another agent has it.
    pub fn open(dir: &Path, limit: u64) -> io::Result<Self> {
        std::fs::create_dir_all(dir)?;
        let path = dir.join(LIST);
        let mut list = OpenOptions::new().read(true).append(true).create(true).open(path)?;
        list.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => {
                io::Error::new(io::ErrorKind::WouldBlock, "another agent records into this directory")
            }
            TryLockError::Error(error) => error,
        })?;
        let mut text = Vec::new();
        list.read_to_end(&mut text)?;
        let mut shelf =
            Self { dir: dir.to_owned(), make, limit, list, own: VecDeque::new(), number: 0, gone: 0 };
        for line in String::from_utf8_lossy(&text).lines() {
            shelf.take_line(line);
        }
        shelf.look();
        shelf.rewrite()?;
        Ok(shelf)
    }

    /// Takes in a line of the list; what is no such line is passed over.
    fn take_line(&mut self, line: &str) {
        let mut words = line.split(' ');
        let (Some(what), Some(name), bytes) = (words.next(), words.next(), words.next()) else { return };
        let Some(number) = number_of(name) else { return };
        self.number = self.number.max(number);
        self.own.retain(|own| own.name != name);
        let name = name.to_owned();
        match (what, bytes.and_then(|bytes| bytes.parse().ok())) {
            ("begin", _) => self.own.push_back(Own { name, bytes: 0, part: true }),
            ("part", Some(bytes)) => self.own.push_back(Own { name, bytes, part: true }),
            ("end", Some(bytes)) => self.own.push_back(Own { name, bytes, part: false }),
            _ => {}
        }
    }

    /// Looks what is there of it: files that somebody removed or wrote to are not ours any more. Of one whose agent was killed nobody knows
    /// the length.
    fn look(&mut self) {
        let dir = self.dir.clone();
        self.own.retain_mut(|own| match length(&own.path(&dir)) {
            Some(bytes) if own.part && own.bytes == 0 => {
                own.bytes = bytes;
                true
            }
            found => found == Some(own.bytes),
        });
    }

    /// Writes the list anew, without what is gone.
    fn rewrite(&mut self) -> io::Result<()> {
        let mut text = String::new();
        let line =
            |own: &Own| format!("{} {} {}\n", if own.part { "part" } else { "end" }, own.name, own.bytes);
        // The number goes on behind recordings that are gone.
        if self.number > 0 {
            text += &format!("gone {}\n", name(Duration::ZERO, self.number));
        }
        text.extend(self.own.iter().map(line));
        self.list.set_len(0)?;
        self.list.write_all(text.as_bytes())?;
        self.gone = 0;
        Ok(())
    }

    /// Appends a line to the list, whole or not at all.
    fn note(&mut self, line: &str) -> io::Result<()> {
        let end = self.list.seek(SeekFrom::End(0))?;
        let written = self.list.write_all(format!("{line}\n").as_bytes());
        if written.is_err() {
            // It is no worse than before.
            let _ = self.list.set_len(end);
        }
        written
    }

    /// Begins a file with the next number, at this time since 1970. It is in the list before it is there.
    ///
    /// # Errors
    ///
    /// The disk takes nothing.
    pub fn begin(&mut self, now: Duration) -> io::Result<(File, Begun)> {
        loop {
            let name = name(now, self.number + 1);
            let (whole, path) =
                (self.dir.join(format!("{name}{WHOLE}")), self.dir.join(format!("{name}{PART}")));
            self.number += 1;
            if whole.symlink_metadata().is_ok() || path.symlink_metadata().is_ok() {
                // Somebody else's, by its name.
                continue;
            }
            self.note(&format!("begin {name}"))?;
            let file = (self.make)(&path)?;
            return Ok((file, Begun { path, name }));
        }
    }

    /// A recording is whole: it gets its name.
    ///
    /// # Errors
    ///
    /// It is there under its other name.
    pub fn end(&mut self, begun: Begun) -> io::Result<PathBuf> {
        let bytes = length(&begun.path).unwrap_or(0);
        let mut own = Own { name: begun.name, bytes, part: true };
        let whole = Own { part: false, ..own.clone() }.path(&self.dir);
        let renamed = std::fs::rename(&begun.path, &whole);
        own.part = renamed.is_err();
        let noted = self.note(&format!("{} {} {bytes}", if own.part { "part" } else { "end" }, own.name));
        self.own.push_back(own);
        renamed.and(noted).map(|()| whole)
    }

    /// A recording breaks off: what is there of it stays, if it is anything.
    pub fn break_off(&mut self, begun: Begun, samples: u64) {
        if samples == 0 && std::fs::remove_file(&begun.path).is_ok() {
            let _ = self.note(&format!("gone {}", begun.name));
            self.gone += 1;
            // The next one may have its number.
            self.number -= u64::from(number_of(&begun.name) == Some(self.number));
            return;
        }
        let bytes = length(&begun.path).unwrap_or(0);
        let _ = self.note(&format!("part {} {bytes}", begun.name));
        self.own.push_back(Own { name: begun.name, bytes, part: true });
    }

    /// Removes the oldest recordings until there is room for so many bytes within the limit; returns what was removed.
    pub fn make_room(&mut self, bytes: u64) -> Vec<PathBuf> {
        let mut removed = Vec::new();
        while self.bytes() + bytes > self.limit
            && let Some(oldest) = self.own.pop_front()
        {
            let path = oldest.path(&self.dir);
            // A file that somebody has put in its place stays.
            if length(&path) == Some(oldest.bytes) && std::fs::remove_file(&path).is_ok() {
                removed.push(path);
            }
            self.gone += 1;
            let _ = self.note(&format!("gone {}", oldest.name));
        }
        if self.gone > GONE_MAX {
            // It is as good as it was where that fails.
            let _ = self.rewrite();
        }
        removed
    }

    /// A recording that is longer than this is continued in another, so that old parts of it can go.
    pub fn longest(&self) -> u64 {
        self.limit / 4
    }

    /// With another way to make files.
    #[cfg(test)]
    pub fn making(self, make: Make) -> Self {
        Self { make, ..self }
    }

    fn bytes(&self) -> u64 {
        self.own.iter().map(|own| own.bytes).sum()
    }
}

fn make(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).open(path)
}

/// Of a file itself, not of what a link leads to.
fn length(path: &Path) -> Option<u64> {
    path.symlink_metadata().ok().filter(std::fs::Metadata::is_file).map(|found| found.len())
}

/// Time (UTC) and number, as `20261123T154412Z-000017`: names are in the order of time, as long as nobody sets the clock; numbers always.
fn name(now: Duration, number: u64) -> String {
    let since = now.as_secs();
    let (year, month, day) = date((since / 86_400) as i64);
    let (hour, minute, second) = (since / 3600 % 24, since / 60 % 60, since % 60);
    format!("{year:04}{month:02}{day:02}T{hour:02}{minute:02}{second:02}Z-{number:06}")
}

/// The number in a name; `None` for what is no name of ours.
fn number_of(name: &str) -> Option<u64> {
    let (time, number) = name.split_once('-')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let (date, time) = time.strip_suffix('Z')?.split_once('T')?;
    (digits(date) && digits(time) && digits(number)).then(|| number.parse().ok())?
}

/// The date of a day since 1970-01-01 (Hinnant, *chrono-Compatible Low-Level Date Algorithms*).
fn date(days: i64) -> (i64, i64, i64) {
    let days = days + 719_468;
    let (era, of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    (year + 400 * era + i64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2026-11-23 15:44:12 UTC.
    const NOW: Duration = Duration::from_secs(1_795_448_652);

    /// Makes a recording of so many bytes; not `whole`: its agent is killed.
    fn make(shelf: &mut Shelf, bytes: usize, whole: bool) -> PathBuf {
        make_at(shelf, NOW, bytes, whole)
    }

    fn make_at(shelf: &mut Shelf, now: Duration, bytes: usize, whole: bool) -> PathBuf {
        let (mut file, begun) = shelf.begin(now).unwrap();
        file.write_all(&vec![1; bytes]).unwrap();
        let part = begun.path.clone();
        if whole { shelf.end(begun).unwrap() } else { part }
    }

    #[test]
    fn names_have_time_and_number() {
        let at = Duration::from_secs;
        assert_eq!(name(NOW, 17), "20261123T154412Z-000017");
        assert_eq!(name(at(951_782_400), 1_234_567), "20000229T000000Z-1234567");
        assert_eq!(number_of("20261123T154412Z-000017"), Some(17));
        for other in ["", "../../etc/passwd", "20261123T154412Z", "20261123T154412Z-../1", "aTbZ-1"] {
            assert_eq!(number_of(other), None, "{other}");
        }
    }

    #[test]
    fn the_oldest_go_first_and_only_those_that_were_made_here() {
        let dir = tempfile::tempdir().unwrap();
        let others = dir.path().join("20200101T000000Z-000001.mcap");
        std::fs::write(&others, [0; 5000]).unwrap();
        let mut shelf = Shelf::open(dir.path(), 1000).unwrap();
        let files: Vec<PathBuf> = (0..4).map(|_| make(&mut shelf, 200, true)).collect();
        assert!(shelf.make_room(200).is_empty());
        // Somebody has put another file in the place of the first, and a link in that of the second.
        std::fs::write(&files[0], [0; 10]).unwrap();
        std::fs::remove_file(&files[1]).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(&others, &files[1]).unwrap();
        assert_eq!(shelf.make_room(700), [files[2].clone()]);
        assert!(files[0].exists() && others.exists() && files[3].exists());
        #[cfg(unix)]
        assert!(files[1].symlink_metadata().is_ok());
        // Without room for what is asked, all that are ours go.
        assert_eq!(shelf.make_room(5000), [files[3].clone()]);
        assert!(shelf.make_room(5000).is_empty() && others.exists());
    }

    /// However the computer's clock is set meanwhile, also between two agents: what was made first goes first, and no number is used twice.
    #[test]
    fn the_oldest_are_those_that_were_made_first_whatever_the_clock_shows() {
        let dir = tempfile::tempdir().unwrap();
        let day = Duration::from_secs(86_400);
        let clock = [NOW, NOW - 4000 * day, NOW + 4000 * day, Duration::ZERO, NOW - day, NOW];
        let mut files = Vec::new();
        for times in clock.chunks(2) {
            let mut shelf = Shelf::open(dir.path(), 600).unwrap();
            files.extend(times.iter().map(|now| make_at(&mut shelf, *now, 100, true)));
        }
        let numbers = files.iter().map(|file| number_of(file.file_stem()?.to_str()?));
        assert!(numbers.eq((1..=6).map(Some)), "{files:?}");
        let mut shelf = Shelf::open(dir.path(), 600).unwrap();
        for (room, file) in (1..).map(|n| 100 * n).zip(files) {
            assert_eq!(shelf.make_room(room), [file]);
        }
    }

    #[test]
    fn another_agent_goes_on_where_the_last_one_ended() {
        let dir = tempfile::tempdir().unwrap();
        let mut shelf = Shelf::open(dir.path(), 1000).unwrap();
        let first = make(&mut shelf, 300, true);
        let killed = make(&mut shelf, 300, false);
        assert!(killed.to_str().unwrap().ends_with("-000002.part.mcap"), "{killed:?}");
        let error = Shelf::open(dir.path(), 1000).err().unwrap();
        assert_eq!(error.kind(), io::ErrorKind::WouldBlock);
        drop(shelf);
        // A line that was cut off is passed over.
        let mut list = OpenOptions::new().append(true).open(dir.path().join(LIST)).unwrap();
        list.write_all(b"end 20261123T154412Z-0000").unwrap();
        drop(list);
        let mut shelf = Shelf::open(dir.path(), 1000).unwrap();
        let third = make(&mut shelf, 300, true);
        assert!(third.to_str().unwrap().ends_with("-000003.mcap"), "{third:?}");
        assert_eq!(shelf.make_room(300), [first]);
        assert_eq!(shelf.make_room(600), [killed]);
        assert_eq!(shelf.make_room(1000), [third]);
        drop(shelf);
        let mut shelf = Shelf::open(dir.path(), 1000).unwrap();
        assert!(make(&mut shelf, 1, true).to_str().unwrap().ends_with("-000004.mcap"));
    }
}
