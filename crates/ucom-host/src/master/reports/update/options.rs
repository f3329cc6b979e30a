//! Options for an update, with the boards and the images.
use std::collections::BTreeMap;
use std::sync::Arc;

use crate::files::{FlashRecord, Image};

/// Image and the address to which it is loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UpdateImage {
    /// Bytes of the image in the order in which they are sent. All plans and cycles share the bytes of the image.
    pub bytes: Arc<[u8]>,
    /// Load address in words.
    pub address_words: u32,
}

impl From<Image> for UpdateImage {
    fn from(image: Image) -> Self {
        Self { address_words: image.address_words(), bytes: image.into_bytes().into() }
    }
}

/// Board to update.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UpdateTarget {
    /// Board number.
    pub board: u8,
    /// Flash number that the board must have (U-1); `None` if any flash number is accepted.
    pub flash_number: Option<u16>,
}

/// Order in which several boards are updated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpdateMode {
    /// Updates one board after the other.
    #[default]
    OneByOne,
    /// Updates all boards at once by broadcast. A board that leaves the group is then updated alone.
    Group,
}

/// Options for an update.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UpdateOptions {
    /// Boards to update.
    pub targets: Vec<UpdateTarget>,
    /// Image to write.
    pub image: UpdateImage,
    /// Second image. With the plan `exloader-app`, the second image is sent in the first cycle, and the main image in
    /// the second cycle. With the plans `pmem-xmem` and `raw`, the second image is sent in the second cycle.
    pub second: Option<UpdateImage>,
    /// Program ID that the user expects. If the Program ID of the image is known, it must be equal to the expected
    /// ID. If it is not known (plan `raw`, or `none` for `prog.header` or `prog.checksum`), the board must report the
    /// expected ID at the end.
    pub expect_program_id: Option<u16>,
    /// Flash date as a 16-bit word, see [`DateForm`](ucom::DateForm).
    pub date: u16,
    /// `true` if the user did not request a date. A board that reports the program with another date is then up to date (U-3).
    pub any_date: bool,
    /// Flash records of the boards, by flash number (D-62). The flash content of boards without a record is not known.
    pub records: BTreeMap<u16, FlashRecord>,
    /// `true` if the header contains the board's flash number, so that other boards refuse the image.
    pub name_target: bool,
    /// Order in which the boards are updated.
    pub mode: UpdateMode,
    /// `true` to perform only the checks, including the check for another PC. In a dry run, the PC sends only queries.
    pub dry_run: bool,
    /// Permission to update even if boards are running (U-2), another PC is on the bus, or the board already has the program (U-3).
    pub force: bool,
    /// Permission to update even if the board already has the program (U-3). The other checks of an update still apply.
    pub rewrite: bool,
    /// `true` to start the application at the end of the update.
    pub start: bool,
    /// `true` to report no failure if a written program cannot be verified. A program cannot be verified with the
    /// plan `raw`, or if `prog.header` or `prog.checksum` is `none`, unless
    /// [`expect_program_id`](Self::expect_program_id) is set. The option also applies to a board that already reports
    /// the program but whose flash content is not known (D-62).
    pub accept_unverified: bool,
    /// `true` to continue with the next board after a failure of one board.
    pub keep_going: bool,
}

impl UpdateOptions {
    /// Creates options for one image and some boards. With these options, the boards are updated one by one, with all checks.
    pub fn new(targets: Vec<UpdateTarget>, image: UpdateImage, date: u16) -> Self {
        Self {
            targets,
            image,
            second: None,
            expect_program_id: None,
            date,
            any_date: false,
            records: BTreeMap::new(),
            name_target: false,
            mode: UpdateMode::OneByOne,
            dry_run: false,
            force: false,
            rewrite: false,
            start: false,
            accept_unverified: false,
            keep_going: false,
        }
    }
}
