//! Progress of a board's answers that consist of several frames.

use crate::frame::Payload;
use crate::profile::Profile;
use crate::string::string_package;

/// Position in an answer of several frames. The position is either before the first frame, or at a package of the
/// string with the index `string`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    First,
    String { string: u32, package: u16 },
}

/// Answers of the board that are in progress.
#[derive(Clone, Copy, Debug)]
pub(super) struct Jobs {
    pub info: Option<Place>,
    pub info_again: bool,
    pub dump_io: Option<Place>,
    /// Earliest time at which the next frame of the IO description may be sent.
    pub dump_io_at: u64,
    /// Earliest time of a second IO description, which the PC has requested during the current one; `None` without
    /// such a request.
    pub dump_io_again: Option<u64>,
    /// Offset of the next package of the initial controller inputs.
    pub dump_ci: Option<u16>,
    pub dump_ci_again: bool,
    /// Offset of the next package of the sensor outputs.
    pub so: Option<u16>,
    /// Index of the next package of the debug text that is being sent. The second value is `true` if the text comes
    /// from the node itself, and `false` if it comes from the application.
    pub text: Option<(u16, bool)>,
    /// Debug text that the node itself wrote.
    pub own_text: Option<&'static [u8]>,
}

impl Jobs {
    pub(super) const fn new() -> Self {
        Self {
            info: None,
            info_again: false,
            dump_io: None,
            dump_io_at: 0,
            dump_io_again: None,
            dump_ci: None,
            dump_ci_again: false,
            so: None,
            text: None,
            own_text: None,
        }
    }

    /// Records a request for DSP_INFO. A request that arrives during a DSP_INFO answer is served after that answer, so the strings of two
    /// answers are never mixed (D-14).
    pub(super) fn ask_info(&mut self) {
        self.info_again = self.info.is_some();
        self.info = self.info.or(Some(Place::First));
    }

    /// Records a request for the IO description, like `ask_info` for DSP_INFO. The board does not send a frame of the answer before
    /// `due_us`. At `due_us`, the request with the same identifier has left the bus (D-05).
    pub(super) fn ask_dump_io(&mut self, due_us: u64) {
        if let Some(Place::String { .. }) = self.dump_io {
            self.dump_io_again = Some(due_us);
        } else {
            self.dump_io = Some(Place::First);
            self.dump_io_at = due_us;
        }
    }

    pub(super) fn info_done(&mut self) {
        self.info = core::mem::take(&mut self.info_again).then_some(Place::First);
    }

    pub(super) fn dump_io_done(&mut self) {
        let again = self.dump_io_again.take();
        self.dump_io = again.map(|_| Place::First);
        self.dump_io_at = again.unwrap_or(0);
    }

    pub(super) fn ask_dump_ci(&mut self) {
        self.dump_ci_again = self.dump_ci.is_some();
        self.dump_ci = self.dump_ci.or(Some(0));
    }

    pub(super) fn forget_application(&mut self) {
        *self = Self { info: self.info, info_again: self.info_again, ..Self::new() };
    }

    pub(super) fn deadline(&self) -> u64 {
        if self.info.is_some() || self.so.is_some() || self.dump_ci.is_some() || self.text.is_some() {
            0
        } else if self.dump_io.is_some() {
            self.dump_io_at
        } else {
            u64::MAX
        }
    }
}

/// Returns a package of the `string`-th text and the position of the next package; `None` if the package does not exist.
pub(super) fn package(text: &[u8], string: u32, package: u16, profile: &Profile) -> Option<(Payload, Place)> {
    let payload = string_package(text, package, profile)?;
    let last = string_package(text, package + 1, profile).is_none();
    let next = if last {
        Place::String { string: string + 1, package: 0 }
    } else {
        Place::String { string, package: package + 1 }
    };
    Some((payload, next))
}
