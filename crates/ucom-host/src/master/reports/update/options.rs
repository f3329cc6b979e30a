//! Boards and images of an update, and its options.
use std::collections::BTreeMap;
use std::sync::Arc;

use crate::files::{FlashRecord, Image};

/// An image and its load address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UpdateImage {
    /// Bytes in wire order, shared by every plan and cycle.
    pub bytes: Arc<[u8]>,
    /// Load address, words.
    pub address_words: u32,
}

impl From<Image> for UpdateImage {
    fn from(image: Image) -> Self {
        Self { address_words: image.address_words(), bytes: image.into_bytes().into() }
    }
}

/// A board to be updated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UpdateTarget {
    /// Board number.
    pub board: u8,
    /// The flash number that the board must have (U-1); `None`: any.
    pub flash_number: Option<u16>,
}

/// Sequence in which several boards are updated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpdateMode {
    /// Boards are updated in sequence.
    #[default]
    OneByOne,
    /// All at once, by broadcast. Boards that drop out of the group are updated one by one afterwards.
    Group,
}

/// Boards and image of an update, and its options.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UpdateOptions {
    /// The boards.
    pub targets: Vec<UpdateTarget>,
    /// The image.
    pub image: UpdateImage,
    /// Image of the other cycle under the plans `exloader-app` (first), `pmem-xmem` and `raw` (second).
    pub second: Option<UpdateImage>,
    /// Program ID that the board must show at the end, if the image does not contain it (plan `raw`, `prog.header` or
    /// `prog.checksum` `none`); otherwise the image must have this Program ID.
    pub expect_program_id: Option<u16>,
    /// Flash date as 16 bits, see [`DateForm`](ucom::DateForm).
    pub date: u16,
    /// `true` if a board that shows the program with another date is up to date (U-3), because no date was requested.
    pub any_date: bool,
    /// Flash records of the boards, by flash number (D-62). Boards without a record are not known.
    pub records: BTreeMap<u16, FlashRecord>,
    /// `true` if the header names the board's flash number, so that another board refuses the image.
    pub name_target: bool,
    /// Order of the updates.
    pub mode: UpdateMode,
    /// `true` for the checks only, including the look for another PC. Only PC_INFO is sent.
    pub dry_run: bool,
    /// Permission to update although boards run (U-2), another PC is on the bus, or the board already shows the program (U-3).
    pub force: bool,
    /// Permission to update although the board already shows the program (U-3), and nothing else.
    pub rewrite: bool,
    /// `true` to start the application at the end.
    pub start: bool,
    /// `true` if an image that cannot be verified counts as verified, without a failure (plan `raw`, `prog.header` or `prog.checksum`
    /// `none`, without [`expect_program_id`](Self::expect_program_id)). This also applies to a board that shows the program but whose
    /// flash content is not known (D-62).
    pub accept_unverified: bool,
    /// `true` to go on with the next board after a failure.
    pub keep_going: bool,
}

impl UpdateOptions {
    /// Creates options for one image and some boards, one by one, with all checks.
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
