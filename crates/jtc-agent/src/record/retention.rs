//! Recording directory: file names, limit of the total size, and removal of the oldest recordings.
//!
//! A list file in the directory contains the names of the recordings that agents have made in this directory. Agents remove only files
//! whose names are in the list file. An agent locks the list file, so two agents cannot use the same directory.
use std::collections::VecDeque;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Name of the list file in the recording directory.
pub(super) const LIST: &str = ".jtc-recordings";
/// File name extension of a complete recording.
const WHOLE: &str = ".mcap";
/// File name extension of a recording that is incomplete or in progress. Every command can read an incomplete recording.
const PART: &str = ".part.mcap";
/// Number of lines about removed files after which the agent rewrites the list file.
const GONE_MAX: usize = 10_000;

/// Recording that an agent has made in the recording directory.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Own {
    /// File name of the recording without extension.
    name: String,
    /// Length of the file in bytes; 0 if the length is unknown. If a file has another length than the list file
    /// states, another program has changed the file. The agent never removes such a file.
    bytes: u64,
    /// `true` if the recording is incomplete or in progress.
    part: bool,
}

impl Own {
    fn path(&self, dir: &Path) -> PathBuf {
        dir.join(format!("{}{}", self.name, if self.part { PART } else { WHOLE }))
    }
}

/// Function that creates a new file.
type Make = fn(&Path) -> io::Result<File>;

/// Directory that contains recordings.
pub(super) struct Retention {
    dir: PathBuf,
    make: Make,
    limit: u64,
    list: File,
    /// Completed and interrupted recordings, oldest first. The recording in progress is not included.
    own: VecDeque<Own>,
    number: u64,
    gone: usize,
}

/// Recording that is in progress.
pub(super) struct Begun {
    /// Path of the recording file.
    pub path: PathBuf,
    name: String,
}

impl Retention {
    /// Opens or creates a recording directory. `limit` is the largest total size of all recordings, bytes.
    ///
    /// # Errors
    ///
    /// The recording directory cannot be created or written, or another agent uses it.
    pub(super) fn open(dir: &Path, limit: u64) -> io::Result<Self> {
        std::fs::create_dir_all(dir)?;
        let path = dir.join(LIST);
        let mut list = OpenOptions::new().read(true).append(true).create(true).open(path)?;
        list.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => io::Error::new(
                io::ErrorKind::WouldBlock,
                "another agent uses this directory for its recordings",
            ),
            TryLockError::Error(error) => error,
        })?;
        let mut text = Vec::new();
        list.read_to_end(&mut text)?;
        let mut retention =
            Self { dir: dir.to_owned(), make, limit, list, own: VecDeque::new(), number: 0, gone: 0 };
        for line in String::from_utf8_lossy(&text).lines() {
            retention.take_line(line);
        }
        retention.look();
        retention.rewrite()?;
        Ok(retention)
    }

    /// Processes a line of the list file; ignores an invalid line.
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

    /// Checks the files in the list. Removes from the list the files that another program has removed or changed. If an agent was killed
    /// during a recording, the length of this recording is unknown.
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

    /// Rewrites the list file without the names of removed files.
    fn rewrite(&mut self) -> io::Result<()> {
        let mut text = String::new();
        let line =
            |own: &Own| format!("{} {} {}\n", if own.part { "part" } else { "end" }, own.name, own.bytes);
        // The numbers of removed recordings must not be used again.
        if self.number > 0 {
            text += &format!("gone {}\n", name(Duration::ZERO, self.number));
        }
        text.extend(self.own.iter().map(line));
        self.list.set_len(0)?;
        self.list.write_all(text.as_bytes())?;
        self.gone = 0;
        Ok(())
    }

    /// Appends a line to the list file. After a failed write, removes the incomplete line from the list file.
    fn note(&mut self, line: &str) -> io::Result<()> {
        let end = self.list.seek(SeekFrom::End(0))?;
        let written = self.list.write_all(format!("{line}\n").as_bytes());
        if written.is_err() {
            // If truncating the list file also fails, the list file is still valid, because an incomplete line is
            // ignored when the file is read.
            let _ = self.list.set_len(end);
        }
        written
    }

    /// Creates a recording file with the next number. `now` is the time since 1970. The file name is added to the list file before the
    /// recording file is created.
    ///
    /// # Errors
    ///
    /// The recording directory cannot be written.
    pub(super) fn begin(&mut self, now: Duration) -> io::Result<(File, Begun)> {
        loop {
            let name = name(now, self.number + 1);
            let (whole, path) =
                (self.dir.join(format!("{name}{WHOLE}")), self.dir.join(format!("{name}{PART}")));
            self.number += 1;
            if whole.symlink_metadata().is_ok() || path.symlink_metadata().is_ok() {
                // A file with this name exists, but it is not a recording of an agent.
                continue;
            }
            self.note(&format!("begin {name}"))?;
            let file = (self.make)(&path)?;
            return Ok((file, Begun { path, name }));
        }
    }

    /// Completes a recording and gives its file the final name.
    ///
    /// # Errors
    ///
    /// The recording file could not be renamed, and keeps the name of an incomplete recording.
    pub(super) fn end(&mut self, begun: Begun) -> io::Result<PathBuf> {
        let bytes = length(&begun.path).unwrap_or(0);
        let mut own = Own { name: begun.name, bytes, part: true };
        let whole = Own { part: false, ..own.clone() }.path(&self.dir);
        let renamed = std::fs::rename(&begun.path, &whole);
        own.part = renamed.is_err();
        let noted = self.note(&format!("{} {} {bytes}", if own.part { "part" } else { "end" }, own.name));
        self.own.push_back(own);
        renamed.and(noted).map(|()| whole)
    }

    /// Closes a recording file without completing it. The recording file is deleted only if it contains no samples.
    pub(super) fn break_off(&mut self, begun: Begun, samples: u64) {
        if samples == 0 && std::fs::remove_file(&begun.path).is_ok() {
            let _ = self.note(&format!("gone {}", begun.name));
            self.gone += 1;
            // The next recording may use the number of the deleted recording.
            self.number -= u64::from(number_of(&begun.name) == Some(self.number));
            return;
        }
        let bytes = length(&begun.path).unwrap_or(0);
        let _ = self.note(&format!("part {} {bytes}", begun.name));
        self.own.push_back(Own { name: begun.name, bytes, part: true });
    }

    /// Removes the oldest recordings until `bytes` more bytes fit within the limit. Returns the paths of the removed recordings.
    pub(super) fn make_room(&mut self, bytes: u64) -> Vec<PathBuf> {
        let mut removed = Vec::new();
        while self.bytes() + bytes > self.limit
            && let Some(oldest) = self.own.pop_front()
        {
            let path = oldest.path(&self.dir);
            // If another program has replaced the recording by another file, the agent does not remove this file.
            if length(&path) == Some(oldest.bytes) && std::fs::remove_file(&path).is_ok() {
                removed.push(path);
            }
            self.gone += 1;
            let _ = self.note(&format!("gone {}", oldest.name));
        }
        if self.gone > GONE_MAX {
            // An error is ignored. If the name of a recording is then missing in the list file, no later agent
            // removes this recording.
            let _ = self.rewrite();
        }
        removed
    }

    /// Returns the file size in bytes above which a recording continues in a new file. The agent can then remove the old files of a
    /// long recording.
    pub(super) fn longest(&self) -> u64 {
        self.limit / 4
    }

    /// Replaces the function that creates recording files.
    #[cfg(test)]
    pub(super) fn making(self, make: Make) -> Self {
        Self { make, ..self }
    }

    fn bytes(&self) -> u64 {
        self.own.iter().map(|own| own.bytes).sum()
    }
}

fn make(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).open(path)
}

/// Returns the length of the file at this path. The length of a symbolic link is that of the link itself, not of its
/// target.
fn length(path: &Path) -> Option<u64> {
    path.symlink_metadata().ok().filter(std::fs::Metadata::is_file).map(|found| found.len())
}

/// Returns the name of a recording, which consists of time (UTC) and number, such as `20261123T154412Z-000017`. The
/// numbers always increase with time. The names also increase with time, unless the clock was set back.
fn name(now: Duration, number: u64) -> String {
    let since = now.as_secs();
    let (year, month, day) = date((since / 86_400) as i64);
    let (hour, minute, second) = (since / 3600 % 24, since / 60 % 60, since % 60);
    format!("{year:04}{month:02}{day:02}T{hour:02}{minute:02}{second:02}Z-{number:06}")
}

/// Returns the number in the name of a recording; `None` for names in another format.
fn number_of(name: &str) -> Option<u64> {
    let (time, number) = name.split_once('-')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let (date, time) = time.strip_suffix('Z')?.split_once('T')?;
    (digits(date) && digits(time) && digits(number)).then(|| number.parse().ok())?
}

/// Returns the date of a day since 1970-01-01 (Hinnant, *chrono-Compatible Low-Level Date Algorithms*).
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

    /// The time 2026-11-23 15:44:12 UTC.
    const NOW: Duration = Duration::from_secs(1_795_448_652);

    /// Creates a recording with a length of `bytes` bytes. If `whole` is false, the recording stays incomplete, as if its agent had been
    /// killed.
    fn make(retention: &mut Retention, bytes: usize, whole: bool) -> PathBuf {
        make_at(retention, NOW, bytes, whole)
    }

    fn make_at(retention: &mut Retention, now: Duration, bytes: usize, whole: bool) -> PathBuf {
        let (mut file, begun) = retention.begin(now).unwrap();
        file.write_all(&vec![1; bytes]).unwrap();
        let part = begun.path.clone();
        if whole { retention.end(begun).unwrap() } else { part }
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
        let mut retention = Retention::open(dir.path(), 1000).unwrap();
        let files: Vec<PathBuf> = (0..4).map(|_| make(&mut retention, 200, true)).collect();
        assert!(retention.make_room(200).is_empty());
        // Another program has replaced the first file by another file, and the second file by a link.
        std::fs::write(&files[0], [0; 10]).unwrap();
        std::fs::remove_file(&files[1]).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(&others, &files[1]).unwrap();
        assert_eq!(retention.make_room(700), [files[2].clone()]);
        assert!(files[0].exists() && others.exists() && files[3].exists());
        #[cfg(unix)]
        assert!(files[1].symlink_metadata().is_ok());
        // If the requested space exceeds the limit, all recordings of agents are removed.
        assert_eq!(retention.make_room(5000), [files[3].clone()]);
        assert!(retention.make_room(5000).is_empty() && others.exists());
    }

    /// Recordings are removed in the order of their creation, and no number is used twice, even if the clock of the computer is changed.
    #[test]
    fn the_oldest_are_those_that_were_made_first_whatever_the_clock_shows() {
        let dir = tempfile::tempdir().unwrap();
        let day = Duration::from_secs(86_400);
        let clock = [NOW, NOW - 4000 * day, NOW + 4000 * day, Duration::ZERO, NOW - day, NOW];
        let mut files = Vec::new();
        for times in clock.chunks(2) {
            let mut retention = Retention::open(dir.path(), 600).unwrap();
            files.extend(times.iter().map(|now| make_at(&mut retention, *now, 100, true)));
        }
        let numbers = files.iter().map(|file| number_of(file.file_stem()?.to_str()?));
        assert!(numbers.eq((1..=6).map(Some)), "{files:?}");
        let mut retention = Retention::open(dir.path(), 600).unwrap();
        for (room, file) in (1..).map(|n| 100 * n).zip(files) {
            assert_eq!(retention.make_room(room), [file]);
        }
    }

    #[test]
    fn another_agent_goes_on_where_the_last_one_ended() {
        let dir = tempfile::tempdir().unwrap();
        let mut retention = Retention::open(dir.path(), 1000).unwrap();
        let first = make(&mut retention, 300, true);
        let killed = make(&mut retention, 300, false);
        assert!(killed.to_str().unwrap().ends_with("-000002.part.mcap"), "{killed:?}");
        let error = Retention::open(dir.path(), 1000).err().unwrap();
        assert_eq!(error.kind(), io::ErrorKind::WouldBlock);
        drop(retention);
        // An incomplete line of the list file is ignored.
        let mut list = OpenOptions::new().append(true).open(dir.path().join(LIST)).unwrap();
        list.write_all(b"end 20261123T154412Z-0000").unwrap();
        drop(list);
        let mut retention = Retention::open(dir.path(), 1000).unwrap();
        let third = make(&mut retention, 300, true);
        assert!(third.to_str().unwrap().ends_with("-000003.mcap"), "{third:?}");
        assert_eq!(retention.make_room(300), [first]);
        assert_eq!(retention.make_room(600), [killed]);
        assert_eq!(retention.make_room(1000), [third]);
        drop(retention);
        let mut retention = Retention::open(dir.path(), 1000).unwrap();
        assert!(make(&mut retention, 1, true).to_str().unwrap().ends_with("-000004.mcap"));
    }
}
