//! Holding registers of the Modbus server, and the handshake that converts register writes to commands. The agent
//! executes each command once, even if writes are repeated or answers are lost.
use super::codes::{Command, Outcome};
use super::map::{HOLDINGS, WATCHDOG_MIN, holding};
use super::pdu::Exception;

/// Command of a PLC, with the parameter values at the time when the PLC wrote the sequence number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Order {
    /// Sequence number of the command.
    pub sequence: u16,
    /// Command of the PLC.
    pub command: Command,
    /// Number of the trajectory that the command starts.
    pub trajectory: u16,
    /// Speed, %.
    pub speed: u16,
    /// Number of runs of the trajectory.
    pub repeat: u16,
    /// `true` if the arm first moves to the first point of the trajectory, unless it is already there.
    pub approach: bool,
    /// Watchdog time of the PLC, ms.
    pub watchdog_ms: u16,
}

/// Holding registers of the PLC that sends commands, and the last command of this PLC.
///
/// The sequence number of a command must follow the sequence number of the last command. A command with any other
/// sequence number is not executed. If an answer is lost and the PLC repeats its write, the repeated write therefore
/// has no effect. A PLC may also repeat values that it wrote before the start of the agent. These values have no
/// effect, because each agent starts with a different sequence number.
#[derive(Clone, Debug)]
pub struct Handshake {
    values: [u16; holding::COUNT],
    /// Sequence number of the last accepted command.
    taken: u16,
    acknowledged: u16,
    outcome: Outcome,
    error: u16,
}

impl Handshake {
    /// Creates a handshake whose last command has the sequence number `sequence`.
    pub fn new(sequence: u16) -> Self {
        let mut new = Self {
            values: [0; holding::COUNT],
            taken: sequence,
            acknowledged: sequence,
            outcome: Outcome::None,
            error: 0,
        };
        new.forget();
        new
    }

    /// Resets the registers to their defaults, because they contain values of another PLC. The sequence number is not
    /// reset.
    pub fn forget(&mut self) {
        self.values = HOLDINGS.map(|row| row.default);
        self.values[holding::SEQUENCE] = self.taken;
    }

    /// Returns the values of all holding registers, from address 0.
    pub fn values(&self) -> &[u16; holding::COUNT] {
        &self.values
    }

    /// Returns the watchdog time, ms; 0 if the watchdog is off. After the watchdog time without a request, the policy
    /// applies.
    pub fn watchdog_ms(&self) -> u16 {
        self.values[holding::WATCHDOG]
    }

    /// Returns the last acknowledged sequence number, and the outcome and the error number of its command.
    pub fn last(&self) -> (u16, Outcome, u16) {
        (self.acknowledged, self.outcome, self.error)
    }

    /// Returns `true` while a command is being executed.
    pub fn is_pending(&self) -> bool {
        self.taken != self.acknowledged
    }

    /// Checks that a PLC may write these values. If `commands` is `true`, the PLC holds the lease and cannot switch its
    /// watchdog off.
    ///
    /// # Errors
    ///
    /// [`Exception::Address`] if a register does not exist, [`Exception::Value`] if a value is out of range.
    pub fn check(&self, at: u16, values: &[u16], commands: bool) -> Result<(), Exception> {
        let at = usize::from(at);
        let rows = HOLDINGS.get(at..at + values.len()).ok_or(Exception::Address)?;
        for (n, (row, value)) in rows.iter().zip(values).enumerate() {
            let watchdog = at + n == holding::WATCHDOG;
            let off = watchdog && *value == 0;
            let possible = (row.range.0..=row.range.1).contains(value)
                && !(off && commands)
                && !(watchdog && !off && *value < WATCHDOG_MIN);
            if !possible {
                return Err(Exception::Value);
            }
        }
        Ok(())
    }

    /// Writes values in one step; [`check`](Self::check) must have accepted the values. Returns a command if the
    /// written values complete a command.
    pub fn write(&mut self, at: u16, values: &[u16]) -> Option<Order> {
        let at = usize::from(at);
        for (register, value) in self.values.iter_mut().skip(at).zip(values) {
            *register = *value;
        }
        let wrote = (at..at + values.len()).contains(&holding::SEQUENCE);
        let sequence = self.values[holding::SEQUENCE];
        if !wrote || sequence == self.taken {
            return None;
        }
        if sequence != self.taken.wrapping_add(1) {
            (self.outcome, self.error) = (Outcome::Sequence, 0);
            return None;
        }
        self.taken = sequence;
        let value = |register: usize| self.values[register];
        Some(Order {
            sequence,
            // `check` has already validated the number of the command.
            command: Command::from_number(value(holding::COMMAND)).unwrap_or_default(),
            trajectory: value(holding::TRAJECTORY),
            speed: value(holding::SPEED),
            repeat: value(holding::REPEAT),
            approach: value(holding::APPROACH) == 1,
            watchdog_ms: value(holding::WATCHDOG),
        })
    }

    /// Reports the outcome of a command. Has no effect unless `sequence` is the sequence number of the last accepted
    /// command.
    pub fn acknowledge(&mut self, sequence: u16, outcome: Outcome, error: u16) {
        if sequence == self.taken {
            (self.acknowledged, self.outcome, self.error) = (sequence, outcome, error);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const START: u16 = Command::Start as u16;

    fn write(handshake: &mut Handshake, at: usize, values: &[u16]) -> Result<Option<Order>, Exception> {
        let at = at as u16;
        handshake.check(at, values, false)?;
        Ok(handshake.write(at, values))
    }

    #[test]
    fn a_command_is_what_was_written_when_its_number_came() {
        let mut handshake = Handshake::new(41);
        assert_eq!(handshake.values()[holding::SEQUENCE], 41);
        // While only some registers of a command are written, in any order, no command is executed.
        assert_eq!(write(&mut handshake, holding::COMMAND, &[START]), Ok(None));
        assert_eq!(write(&mut handshake, holding::TRAJECTORY, &[3]), Ok(None));
        let order = write(&mut handshake, holding::SEQUENCE, &[42]).expect("it may be").expect("a command");
        assert_eq!((order.command, order.trajectory, order.speed, order.repeat), (Command::Start, 3, 100, 1));
        assert!(handshake.is_pending());
        // A new trajectory number applies to the next command.
        assert_eq!(write(&mut handshake, holding::TRAJECTORY, &[4]), Ok(None));
        handshake.acknowledge(42, Outcome::Done, 0);
        assert_eq!((handshake.last(), handshake.is_pending()), ((42, Outcome::Done, 0), false));
        // A single write request sets all registers.
        let all = [500, 2, 5, 20, 7, 1, START, 43];
        let order = write(&mut handshake, 0, &all).expect("it may be").expect("a command");
        let whole = Order {
            sequence: 43,
            command: Command::Start,
            trajectory: 5,
            speed: 20,
            repeat: 7,
            approach: true,
            watchdog_ms: 500,
        };
        assert_eq!(order, whole);
        assert_eq!(write(&mut handshake, 0, &all), Ok(None), "the same again");
    }

    #[test]
    fn a_number_that_is_not_the_next_has_nothing_done() {
        let mut handshake = Handshake::new(u16::MAX);
        for wrong in [1, 41, 65_534] {
            assert_eq!(write(&mut handshake, holding::COMMAND, &[START, wrong]), Ok(None));
            assert_eq!(handshake.last(), (u16::MAX, Outcome::Sequence, 0));
        }
        assert!(
            write(&mut handshake, holding::SEQUENCE, &[0]).expect("it may be").is_some(),
            "behind 65535 comes 0"
        );
    }

    #[test]
    fn a_command_that_was_not_waited_for_is_reported_no_more() {
        let mut handshake = Handshake::new(0);
        write(&mut handshake, holding::COMMAND, &[Command::Clear as u16, 1]).expect("it may be");
        write(&mut handshake, holding::COMMAND, &[Command::Stop as u16, 2]).expect("it may be");
        handshake.acknowledge(2, Outcome::Done, 0);
        handshake.acknowledge(1, Outcome::Failed, 18);
        assert_eq!(handshake.last(), (2, Outcome::Done, 0));
    }

    #[test]
    fn values_that_are_not_possible_are_not_written_nor_are_those_beside_them() {
        let mut handshake = Handshake::new(0);
        let before = *handshake.values();
        for (at, values, exception) in [
            (holding::COUNT, &[0][..], Exception::Address),
            (usize::from(u16::MAX), &[0], Exception::Address),
            (holding::SEQUENCE, &[1, 1], Exception::Address),
            (holding::TRAJECTORY, &[100], Exception::Value),
            (holding::TRAJECTORY, &[3, 0], Exception::Value),
            (holding::COMMAND, &[99, 1], Exception::Value),
            (holding::WATCHDOG, &[99], Exception::Value),
            (holding::WATCHDOG, &[60_001], Exception::Value),
            (0, &[1000, 3, 3, 100, 1, 0, START, 1], Exception::Value),
        ] {
            assert_eq!(write(&mut handshake, at, values), Err(exception), "{at} {values:?}");
        }
        assert_eq!((*handshake.values(), handshake.is_pending()), (before, false));
        // A PLC that sends commands needs a watchdog.
        assert_eq!(handshake.check(holding::WATCHDOG as u16, &[0], true), Err(Exception::Value));
        assert_eq!(handshake.check(holding::WATCHDOG as u16, &[0], false), Ok(()));
    }

    #[test]
    fn another_plc_begins_with_the_defaults_and_goes_on_with_the_numbers() {
        let mut handshake = Handshake::new(7);
        write(&mut handshake, 0, &[500, 0, 5, 20, 7, 1, START, 8]).expect("it may be");
        handshake.acknowledge(8, Outcome::Done, 0);
        handshake.forget();
        assert_eq!(*handshake.values(), [1000, 1, 0, 100, 1, 0, 0, 8]);
        assert_eq!(write(&mut handshake, holding::COMMAND, &[START, 8]), Ok(None));
    }

    proptest! {
        /// For any writes in any order, only the next valid sequence number starts a command. The command uses the
        /// register values at the time when the sequence number was written.
        #[test]
        fn nothing_is_done_without_a_new_number(
            first in any::<u16>(),
            writes in prop::collection::vec((0..10_u16, prop::collection::vec(0..9_u16, 1..9), any::<bool>()), 1..200),
        ) {
            let mut handshake = Handshake::new(first);
            let mut last = first;
            for (at, mut values, near) in writes {
                // The test also writes sequence numbers near the last number. Otherwise, random values would almost
                // never contain the next valid sequence number.
                let place = holding::SEQUENCE.checked_sub(usize::from(at)).filter(|place| *place < values.len());
                if let Some(place) = place.filter(|_| near) {
                    values[place] = last.wrapping_add(values[place] % 3);
                }
                let before = *handshake.values();
                match write(&mut handshake, usize::from(at), &values) {
                    Err(_) => prop_assert_eq!(*handshake.values(), before),
                    Ok(order) => {
                        let next = place.map(|place| values[place]) == Some(last.wrapping_add(1));
                        prop_assert_eq!(order.is_some(), next);
                        if let Some(order) = order {
                            last = order.sequence;
                            let now = handshake.values();
                            prop_assert_eq!(order.sequence, now[holding::SEQUENCE]);
                            prop_assert_eq!(order.command as u16, now[holding::COMMAND]);
                            prop_assert_eq!(order.trajectory, now[holding::TRAJECTORY]);
                            prop_assert_eq!(order.repeat, now[holding::REPEAT]);
                        }
                    }
                }
            }
        }
    }
}
