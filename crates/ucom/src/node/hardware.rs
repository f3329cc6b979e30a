//! Traits for the hardware of a board (flash, init pins, a small non-volatile memory) and for its application.

use crate::header::Memory;
use crate::info::Dimensions;

/// A range of word addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// First word address of the area.
    pub start: u32,
    /// Number of words in the area.
    pub words: u32,
}

impl Area {
    /// Returns `true` if `other` is inside this area and contains at least one word.
    pub const fn holds(&self, other: Self) -> bool {
        let end = self.start as u64 + self.words as u64;
        other.words > 0 && other.start >= self.start && other.start as u64 + other.words as u64 <= end
    }
}

/// State of the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashState {
    /// The last flash operation succeeded, or no operation has been started yet.
    Ready,
    /// A flash operation is in progress.
    Busy,
    /// The last flash operation failed. The flash remains in this state until the next operation starts.
    Failed,
}

/// Error: the flash could not start or complete an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashError;

/// Number of bytes of the validity record.
pub const RECORD_LEN: usize = 16;

/// Flash of the board, and the RAM into which an exloader can be loaded.
///
/// The methods `erase…` and `write…` start an operation and return at once; [`Flash::state`] returns [`FlashState::Busy`] until the
/// operation is complete. The node does not start an operation while another operation is in progress. Implementations MUST keep the
/// validity record outside the application area. Erasing the application area must not change the record, and erasing the record must not
/// change the application area.
pub trait Flash {
    /// Returns the area for applications in a memory; `None` if the board has no such memory.
    fn area(&self, memory: Memory) -> Option<Area>;

    /// Returns the state of the last flash operation.
    fn state(&mut self, now_us: u64) -> FlashState;

    /// Starts to erase `area` in the memory. Implementations may erase whole sectors, but no data outside the application area.
    fn erase(&mut self, now_us: u64, memory: Memory, area: Area) -> Result<(), FlashError>;

    /// Starts to write up to 64 bytes in the order in which they were received, beginning at a word address. The number of bytes to write
    /// is always even.
    fn write(&mut self, now_us: u64, memory: Memory, address: u32, data: &[u8]) -> Result<(), FlashError>;

    /// Reads bytes, beginning at a word address, in the order in which they were written.
    fn read(&self, memory: Memory, address: u32, data: &mut [u8]) -> Result<(), FlashError>;

    /// Returns the stored validity record. If no validity record was written, the bytes are arbitrary.
    fn record(&self) -> [u8; RECORD_LEN];

    /// Starts to make the validity record invalid.
    fn erase_record(&mut self, now_us: u64) -> Result<(), FlashError>;

    /// Starts to write the validity record.
    fn write_record(&mut self, now_us: u64, record: &[u8; RECORD_LEN]) -> Result<(), FlashError>;
}

/// The init pins of a board in the chain (section 5 of the protocol).
pub trait Pins {
    /// Returns the level of the incoming pin, which is permanently active on the first board.
    fn init_in(&self) -> bool;

    /// Sets the level of the outgoing pin. After power-up, the outgoing pin MUST be inactive without a call of this method.
    fn set_init_out(&mut self, active: bool);
}

/// Data that survive a power loss, and data that never change.
pub trait Store {
    /// Returns the stored value of the status bit ASTART.
    fn autostart(&self) -> bool;

    /// Stores the value of the status bit ASTART. The node calls this method only if the value changes.
    fn set_autostart(&mut self, on: bool);

    /// Returns the description of the board for DSP_INFO, in Latin-1.
    fn description(&self) -> &[u8];
}

/// Text of an application in the IO description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Text {
    /// Description of the application, which may differ from the board's description (D-36).
    Application,
    /// Description of the controller input with this index.
    Ci(u16),
    /// Description of the sensor output with this index.
    So(u16),
    /// Description of the parameter with this index.
    Par(u16),
}

/// Application program in the application area. The node calls the methods of this trait only between [`Application::start`] and
/// [`Application::stop`]. Only [`Application::outputs`] with `false` may also be called at other times.
pub trait Application {
    /// Starts the application program.
    fn start(&mut self, now_us: u64);

    /// Ends the application program. The outputs of the program MUST be safe when this method returns.
    fn stop(&mut self);

    /// Returns `true` if the application program has started and can serve requests.
    fn is_up(&mut self, now_us: u64) -> bool;

    /// Returns the number of inputs, outputs and parameters of the application. These numbers MUST NOT change while the application runs.
    fn dimensions(&self) -> Dimensions;

    /// Returns a description of the application in Latin-1. The text is empty if the application has no such description.
    fn text(&self, text: Text) -> &[u8];

    /// Returns the initial value of a controller input. The initial value applies until the PC sets the input.
    fn initial_ci(&self, index: u16) -> u16;

    /// Returns the buffer for received controller inputs, one word for each input. The received inputs take effect at
    /// [`Application::latch_ci`].
    fn ci(&mut self) -> &mut [u16];

    /// Applies all inputs in [`Application::ci`] at the same time.
    fn latch_ci(&mut self);

    /// Returns the buffer for received parameters, one word for each parameter. The received parameters take effect in the next control
    /// cycle (D-35).
    fn par(&mut self) -> &mut [u16];

    /// Stores a snapshot of the sensor outputs for [`Application::so`].
    fn sample_so(&mut self);

    /// Returns the sensor outputs of the last snapshot, one word for each output.
    fn so(&self) -> &[u16];

    /// Informs the application that the control loop starts or ends.
    fn run(&mut self, now_us: u64, running: bool);

    /// Runs one control cycle. The node calls this method only while the control loop runs.
    fn step(&mut self, now_us: u64);

    /// Enables the outputs of the board (`true`), or makes the outputs safe (`false`).
    fn outputs(&mut self, active: bool);

    /// Returns the oldest waiting debug text in Latin-1. The text MUST NOT change until [`Application::debug_done`]
    /// is called.
    fn debug_text(&self) -> Option<&[u8]> {
        None
    }

    /// Removes the oldest debug text. The node calls this method after the text was sent, or if the text is dropped.
    fn debug_done(&mut self) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Minimal application for the tests.
    struct Mute;

    impl Application for Mute {
        fn start(&mut self, _: u64) {}
        fn stop(&mut self) {}
        fn is_up(&mut self, _: u64) -> bool {
            true
        }
        fn dimensions(&self) -> Dimensions {
            Dimensions::default()
        }
        fn text(&self, _: Text) -> &[u8] {
            &[]
        }
        fn initial_ci(&self, _: u16) -> u16 {
            0
        }
        fn ci(&mut self) -> &mut [u16] {
            &mut []
        }
        fn latch_ci(&mut self) {}
        fn par(&mut self) -> &mut [u16] {
            &mut []
        }
        fn sample_so(&mut self) {}
        fn so(&self) -> &[u16] {
            &[]
        }
        fn run(&mut self, _: u64, _: bool) {}
        fn step(&mut self, _: u64) {}
        fn outputs(&mut self, _: bool) {}
    }

    #[test]
    fn d38_a_program_need_not_have_texts() {
        assert_eq!(Mute.debug_text(), None);
    }
}
