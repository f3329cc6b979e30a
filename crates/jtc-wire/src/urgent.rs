//! Detection of Stop and Pause, which take effect before all other frames. The watch finds these commands in the bytes of a line as
//! soon as they arrive, independently of the frame parser (J-04).
//!
//! Other frames may wait for earlier frames, for bytes that a false header announces, or for space in a full buffer. A Stop must not wait.
//! The watch therefore recognises the seven bytes of a Stop or a Pause at any position, and the command takes effect in the next tick. The
//! frame of the command still passes through the [`Receiver`](crate::Receiver) and gets its response record in the normal order. From the
//! position of the frame in the stream, the controller detects that the command has already taken effect. The controller must not execute
//! an Execute that it received before the command.
//!
//! A disadvantage is that these seven bytes in the body of another frame also stop the arm. The error is on the safe side, because the arm
//! only stops. In a body of random bytes, the probability of this error is 2⁻⁵⁶ per position.
use crate::command::ExecCommand;
use crate::fixed;

/// Command that takes effect before all other frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum UrgentCommand {
    Stop,
    Pause,
}

impl From<UrgentCommand> for ExecCommand {
    fn from(command: UrgentCommand) -> Self {
        match command {
            UrgentCommand::Stop => Self::Stop,
            UrgentCommand::Pause => Self::Pause,
        }
    }
}

impl UrgentCommand {
    /// Returns the urgent command for Stop or Pause; `None` for Execute.
    pub const fn from_exec(command: ExecCommand) -> Option<Self> {
        match command {
            ExecCommand::Stop => Some(Self::Stop),
            ExecCommand::Pause => Some(Self::Pause),
            ExecCommand::Execute => None,
        }
    }
}

/// Urgent commands that arrived on a line in one tick: the number of Stops and Pauses, and the last command.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UrgentCommands {
    stops: u8,
    pauses: u8,
    pause_is_last: bool,
}

impl UrgentCommands {
    /// An empty list.
    pub const NONE: Self = Self { stops: 0, pauses: 0, pause_is_last: false };

    /// Appends a command.
    pub fn push(&mut self, command: UrgentCommand) {
        self.add(command, 1);
    }

    /// Appends a command `count` times.
    pub fn add(&mut self, command: UrgentCommand, count: u8) {
        if count == 0 {
            return;
        }
        self.pause_is_last = command == UrgentCommand::Pause;
        let counter = if self.pause_is_last { &mut self.pauses } else { &mut self.stops };
        *counter = counter.saturating_add(count);
    }

    /// Returns true if the list is empty.
    pub const fn is_empty(&self) -> bool {
        self.stops == 0 && self.pauses == 0
    }

    /// Returns each received command with its count. The command that was received last is the last item.
    pub fn iter(&self) -> impl Iterator<Item = (UrgentCommand, u8)> {
        let (stops, pauses) = ((UrgentCommand::Stop, self.stops), (UrgentCommand::Pause, self.pauses));
        let order = if self.pause_is_last { [stops, pauses] } else { [pauses, stops] };
        order.into_iter().filter(|(_, count)| *count > 0)
    }
}

/// Length of a Stop frame or a Pause frame.
const LENGTH: usize = 7;
/// Mask of the last seven bytes. The oldest byte is the most significant byte.
const WINDOW: u64 = (1 << (8 * LENGTH)) - 1;
const STOP: u64 = window(&fixed::STOP);
const PAUSE: u64 = window(&fixed::PAUSE);

const fn window(bytes: &[u8; LENGTH]) -> u64 {
    let [a, b, c, d, e, f, g] = *bytes;
    u64::from_be_bytes([0, a, b, c, d, e, f, g])
}

/// State of the watch for one line.
#[derive(Clone, Copy, Debug)]
struct Tail {
    /// The last bytes of the line.
    window: u64,
    /// Number of received bytes.
    received: u64,
    /// Time of the last byte, µs.
    last_us: u64,
    /// Commands that arrived since the last call of [`UrgentWatch::take`].
    commands: UrgentCommands,
    /// Stream position at which the last urgent command of the line ended.
    hit: u64,
    /// Number of bytes that this line had received when the last urgent command of any line arrived. A frame that began before this
    /// position counts as older than the urgent command.
    overtaken: u64,
}

/// Watches for Stop and Pause in the bytes of all lines to a controller.
///
/// In each tick, call [`scan`](Self::scan) with the bytes that have arrived on each line, and then call [`take`](Self::take). The
/// controller must not execute an Execute at a position that is [`overtaken`](Self::overtaken).
///
/// ```
/// use jtc_wire::{UrgentCommand, UrgentWatch, fixed};
/// let mut watch = UrgentWatch::<1>::new(6000);
/// // A false header, then a Stop in two pieces.
/// watch.scan(0, 0, &[0x9B, 0x04, 0xEA, 0x56, 0x9B, 0x0B]);
/// assert!(watch.take()[0].is_empty());
/// watch.scan(0, 1000, &fixed::STOP[2..]);
/// assert!(watch.take()[0].iter().eq([(UrgentCommand::Stop, 1)]));
/// assert!(watch.overtaken(0, 4) && !watch.overtaken(0, 11));
/// ```
#[derive(Clone, Debug)]
pub struct UrgentWatch<const LINES: usize> {
    inter_byte_timeout_us: u64,
    lines: [Tail; LINES],
}

impl<const LINES: usize> UrgentWatch<LINES> {
    /// Creates a watch. `inter_byte_timeout_us` is the silence, in µs, after which later bytes do not belong to the same frame. The
    /// interval between calls of `scan` limits the precision of this silence. If the timeout of the watch exceeds the timeout of the
    /// receiver by at least one tick, the watch finds every Stop that the receiver finds.
    pub const fn new(inter_byte_timeout_us: u32) -> Self {
        let tail =
            Tail { window: 0, received: 0, last_us: 0, commands: UrgentCommands::NONE, hit: 0, overtaken: 0 };
        Self { inter_byte_timeout_us: inter_byte_timeout_us as u64, lines: [tail; LINES] }
    }

    /// Scans the bytes that have arrived on a line until `now_us`. The caller must pass every byte once, in order. The scan takes a few
    /// instructions per byte.
    pub fn scan(&mut self, line: usize, now_us: u64, bytes: &[u8]) {
        let Some(tail) = self.lines.get_mut(line) else { return };
        if bytes.is_empty() {
            return;
        }
        if now_us.saturating_sub(tail.last_us) >= self.inter_byte_timeout_us {
            tail.window = 0;
        }
        tail.last_us = now_us;
        for &byte in bytes {
            tail.received += 1;
            tail.window = (tail.window << 8 | u64::from(byte)) & WINDOW;
            let command = match tail.window {
                STOP => UrgentCommand::Stop,
                PAUSE => UrgentCommand::Pause,
                _ => continue,
            };
            tail.commands.push(command);
            tail.hit = tail.received;
        }
    }

    /// Returns the commands that arrived on each line since the last call of `take`.
    pub fn take(&mut self) -> [UrgentCommands; LINES] {
        let commands = self.lines.map(|tail| tail.commands);
        let lines_with = commands.iter().filter(|commands| !commands.is_empty()).count();
        for tail in &mut self.lines {
            let own = !core::mem::take(&mut tail.commands).is_empty();
            // The order in which different lines received bytes within a tick is unknown. On the other lines, all
            // bytes received so far therefore count as older than the urgent command. If only one line received a
            // command, only the bytes up to this command count as older on this line.
            match lines_with {
                0 => {}
                1 if own => tail.overtaken = tail.hit,
                _ => tail.overtaken = tail.received,
            }
        }
        commands
    }

    /// Returns true if a frame that began at byte `position` of a line is older than the last urgent command of any line.
    pub fn overtaken(&self, line: usize, position: u64) -> bool {
        self.lines.get(line).is_some_and(|tail| position < tail.overtaken)
    }

    /// Returns the number of bytes received on a line.
    pub fn received(&self, line: usize) -> u64 {
        self.lines.get(line).map_or(0, |tail| tail.received)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use UrgentCommand::{Pause, Stop};

    fn commands(watch: &mut UrgentWatch<2>) -> [std::vec::Vec<(UrgentCommand, u8)>; 2] {
        watch.take().map(|commands| commands.iter().collect())
    }

    #[test]
    fn j04_a_stop_is_seen_at_its_last_byte_wherever_it_stands() {
        let mut watch = UrgentWatch::<2>::new(6000);
        for (n, noise) in
            [&[][..], &[0x9B], &[0x9B, 0x0B, 0, 7], &[7; 300], &fixed::STOP[..6]].iter().enumerate()
        {
            let now = n as u64 * 100_000;
            watch.scan(1, now, noise);
            watch.scan(1, now + 1000, &fixed::STOP[..6]);
            assert_eq!(commands(&mut watch), [[], []]);
            watch.scan(1, now + 2000, &fixed::STOP[6..]);
            assert_eq!(commands(&mut watch), [[].to_vec(), [(Stop, 1)].to_vec()], "behind {noise:?}");
        }
    }

    #[test]
    fn j05_a_stop_with_a_gap_in_it_is_none() {
        let mut watch = UrgentWatch::<2>::new(6000);
        for cut in 1..7 {
            let now = cut as u64 * 100_000;
            watch.scan(0, now, &fixed::PAUSE[..cut]);
            watch.scan(0, now + 6000, &fixed::PAUSE[cut..]);
            assert_eq!(commands(&mut watch), [[], []], "cut at {cut}");
            watch.scan(0, now + 20_000, &fixed::PAUSE[..cut]);
            watch.scan(0, now + 25_999, &fixed::PAUSE[cut..]);
            assert_eq!(commands(&mut watch)[0], [(Pause, 1)], "joined at {cut}");
        }
    }

    /// A call without bytes does not count as reception. The watch must measure the gap from the last received byte (J-03).
    #[test]
    fn j05_an_empty_scan_does_not_join_across_a_gap() {
        let mut watch = UrgentWatch::<2>::new(6000);
        watch.scan(0, 100_000, &fixed::STOP[..3]);
        watch.scan(0, 103_000, &[]);
        watch.scan(0, 106_000, &fixed::STOP[3..]);
        assert_eq!(commands(&mut watch), [[], []]);
    }

    #[test]
    fn j04_none_of_a_command_is_not_the_last_one() {
        let mut commands = UrgentCommands::NONE;
        assert!(commands.is_empty());
        commands.add(Pause, 2);
        commands.add(Stop, 1);
        commands.add(Pause, 0);
        assert!(commands.iter().eq([(Pause, 2), (Stop, 1)]) && !commands.is_empty());
    }

    #[test]
    fn j04_the_last_of_several_commands_acts_last() {
        let mut watch = UrgentWatch::<2>::new(6000);
        watch.scan(0, 0, &[fixed::STOP, fixed::PAUSE, fixed::STOP].concat());
        assert_eq!(commands(&mut watch)[0], [(Pause, 1), (Stop, 2)]);
        watch.scan(0, 0, &[fixed::STOP, fixed::EXECUTE, fixed::PAUSE].concat());
        assert_eq!(commands(&mut watch)[0], [(Stop, 1), (Pause, 1)]);
    }

    #[test]
    fn j04_only_what_was_received_before_is_overtaken() {
        let mut watch = UrgentWatch::<2>::new(6000);
        watch.scan(1, 0, &fixed::EXECUTE);
        watch.scan(0, 0, &[fixed::EXECUTE, fixed::STOP, fixed::EXECUTE].concat());
        assert!(!watch.overtaken(0, 0), "not before the command was taken");
        watch.take();
        assert!(watch.overtaken(0, 0) && watch.overtaken(0, 7), "the Stop itself has acted, too");
        assert!(!watch.overtaken(0, 14), "what follows the Stop is newer");
        assert!(watch.overtaken(1, 0), "an Execute of the other line is older");
        watch.scan(1, 1000, &fixed::EXECUTE);
        watch.take();
        assert!(!watch.overtaken(1, 7));
        assert_eq!((watch.received(0), watch.received(1)), (21, 14));
    }
}
