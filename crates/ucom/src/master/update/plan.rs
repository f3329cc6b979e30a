//! What goes over the wire: the blocks of both cycles (D-40, D-41).

use std::prelude::v1::*;

use super::UpdateOptions;
use crate::profile::{HeaderForm, Plan};
use crate::{BLOCK_LEN, Checksum, Header, Memory, Profile, block_count, checksum, data_block};

/// An image with its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UpdateImage {
    /// Bytes in wire order.
    pub bytes: Vec<u8>,
    /// Load address, words.
    pub address_words: u32,
}

/// Why an update cannot be planned.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// No board.
    #[error("no board is named")]
    NoTarget,
    /// A board twice.
    #[error("board {board} is named twice")]
    Twice {
        /// Its number.
        board: u8,
    },
    /// An image without bytes.
    #[error("the image is empty")]
    Empty,
    /// The plan needs a second image.
    #[error("plan `{plan}` needs a second image")]
    SecondMissing {
        /// `prog.plan`.
        plan: Plan,
    },
    /// The plan has no place for a second image.
    #[error("plan `{plan}` sends one image twice: there is no place for a second one")]
    SecondUnused {
        /// `prog.plan`.
        plan: Plan,
    },
    /// Half a word.
    #[error("the image has {bytes} bytes: not whole words")]
    HalfWord {
        /// Its length.
        bytes: usize,
    },
    /// The number of a board that has no application.
    #[error("Program ID 0xFFFF with date 0xFFFF means `no application`: choose another date")]
    Void,
}

impl PlanError {
    /// What helps.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NoTarget | Self::Twice { .. } => "`ucom update N IMAGE` with a number, a list or `all`",
            Self::Empty | Self::HalfWord { .. } => {
                "is it the right file? `ucom update --dry-run` shows what it holds"
            }
            Self::SecondMissing { .. } | Self::SecondUnused { .. } => {
                "see `prog.plan` in `ucom help profile`"
            }
            Self::Void => "`--date YYYY-MM-DD`",
        }
    }
}

/// One cycle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Cycle {
    pub header: Option<[u8; BLOCK_LEN]>,
    pub bytes: Vec<u8>,
}

impl Cycle {
    /// Blocks with the header's.
    pub(crate) fn blocks(&self) -> usize {
        block_count(self.bytes.len()) + usize::from(self.header.is_some())
    }

    /// The `i`-th block.
    pub(crate) fn block(&self, i: usize) -> Option<[u8; BLOCK_LEN]> {
        match (self.header, i.checked_sub(1)) {
            (Some(header), None) => Some(header),
            (Some(_), Some(data)) => data_block(&self.bytes, data),
            (None, _) => data_block(&self.bytes, i),
        }
    }
}

/// What a board gets, and what it shall show afterwards.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UpdatePlan {
    pub(crate) cycles: [Cycle; 2],
    /// Program ID and date that the board shows at the end; `None`: the image hides them from us (plan `raw`).
    pub expected: Option<(u16, u16)>,
    /// The first cycle only checks: before the second nothing is lost.
    pub first_only_checks: bool,
}

impl UpdatePlan {
    /// For a board, `target` in the header.
    pub fn new(options: &UpdateOptions, target: u16, profile: &Profile) -> Result<Self, PlanError> {
        let plan = profile.prog_plan;
        let image = &options.image;
        for one in [Some(image), options.second.as_ref()].into_iter().flatten() {
            if one.bytes.is_empty() {
                return Err(PlanError::Empty);
            }
            if plan != Plan::Raw && one.bytes.len() % 2 == 1 {
                return Err(PlanError::HalfWord { bytes: one.bytes.len() });
            }
        }
        let second = || options.second.as_ref().ok_or(PlanError::SecondMissing { plan });
        let [first, last] = match plan {
            Plan::VerifyWrite if options.second.is_some() => return Err(PlanError::SecondUnused { plan }),
            Plan::VerifyWrite => [(image, Memory::Program); 2],
            Plan::ExloaderApp => [(second()?, Memory::Ram), (image, Memory::Program)],
            Plan::PmemXmem => [(image, Memory::Program), (second()?, Memory::Data)],
            Plan::Raw => {
                [(image, Memory::Program), (options.second.as_ref().unwrap_or(image), Memory::Program)]
            }
        };
        let id = |image: &UpdateImage| checksum(profile.prog_checksum, profile.prog_endian, &image.bytes);
        let header = |cycle, (image, memory): (&UpdateImage, Memory)| Header {
            cycle,
            memory: memory.number(),
            address: image.address_words,
            length: (image.bytes.len() / 2) as u32,
            program_id: id(image),
            date: options.date,
            target,
        };
        let with_header = plan != Plan::Raw && profile.prog_header == HeaderForm::V1;
        let cycle = |number, part: (&UpdateImage, Memory)| Cycle {
            header: with_header.then(|| header(number, part).build(profile.prog_endian)),
            bytes: part.0.bytes.clone(),
        };
        let program_id = id(image);
        if with_header && program_id == 0xFFFF && options.date == 0xFFFF {
            return Err(PlanError::Void);
        }
        let known = with_header && profile.prog_checksum != Checksum::None;
        Ok(Self {
            cycles: [cycle(1, first), cycle(2, last)],
            expected: known.then_some((program_id, options.date)),
            first_only_checks: plan == Plan::VerifyWrite,
        })
    }

    /// Bytes of both cycles on the wire.
    pub fn total_bytes(&self) -> u64 {
        self.cycles.iter().map(|c| (c.blocks() * BLOCK_LEN) as u64).sum()
    }

    /// PC_PROG frames of one cycle, 0 or 1.
    pub fn frames(&self, cycle: usize) -> usize {
        self.cycles.get(cycle).map_or(0, |c| c.blocks() * 8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::master::update::UpdateTarget;

    fn options(bytes: Vec<u8>) -> UpdateOptions {
        let image = UpdateImage { bytes, address_words: 0 };
        UpdateOptions::new(vec![UpdateTarget { board: 1, flash_number: None }], image, 0x3AC1)
    }

    /// The golden update: 1000 bytes, 17 blocks and 136 frames a cycle, Program ID 0x4B3F.
    #[test]
    fn d41_golden_plan() {
        let bytes: Vec<u8> = (0..1000).map(|i| (37 * i + 11) as u8).collect();
        let plan = UpdatePlan::new(&options(bytes), Header::ANY_BOARD, &Profile::default()).unwrap();
        assert_eq!((plan.frames(0), plan.frames(1), plan.total_bytes()), (136, 136, 2 * 17 * 64));
        assert_eq!(plan.expected, Some((0x4B3F, 0x3AC1)));
        let first = plan.cycles[0].block(0).unwrap();
        assert_eq!(first[..10], [0x43, 0x55, 1, 0, 1, 0, 0, 0, 0, 0]);
        assert_eq!(first[62..], [0xDC, 0x22]);
        assert_eq!(plan.cycles[0].block(1).unwrap()[..8], [0x0B, 0x30, 0x55, 0x7A, 0x9F, 0xC4, 0xE9, 0x0E]);
        assert_eq!(plan.cycles[1].block(16).unwrap()[40..], [0xFF; 24]);
        assert_eq!(plan.cycles[1].block(17), None);
    }

    #[test]
    fn d40_other_plans_need_their_images() {
        let two = UpdateOptions {
            second: Some(UpdateImage { bytes: vec![9; 64], address_words: 5 }),
            ..options(vec![1; 128])
        };
        let planned = |options: &UpdateOptions, prog_plan| {
            UpdatePlan::new(options, Header::ANY_BOARD, &Profile { prog_plan, ..Profile::default() })
        };
        assert!(matches!(planned(&two, Plan::VerifyWrite), Err(PlanError::SecondUnused { .. })));
        assert!(matches!(
            planned(&options(vec![1; 2]), Plan::ExloaderApp),
            Err(PlanError::SecondMissing { .. })
        ));
        let plan = planned(&two, Plan::ExloaderApp).unwrap();
        assert_eq!((plan.cycles[0].block(0).unwrap()[6], plan.cycles[1].block(0).unwrap()[6]), (0x10, 0));
        let plan = planned(&two, Plan::PmemXmem).unwrap();
        assert_eq!((plan.cycles[0].block(0).unwrap()[6], plan.cycles[1].block(0).unwrap()[6]), (0, 1));
        let raw = planned(&options(vec![7; 65]), Plan::Raw).unwrap();
        assert_eq!((raw.frames(0), raw.expected), (16, None));
        assert_eq!(raw.cycles[0].block(0), Some([7; 64]));
        assert!(matches!(planned(&options(vec![]), Plan::Raw), Err(PlanError::Empty)));
        assert!(matches!(
            planned(&options(vec![1]), Plan::VerifyWrite),
            Err(PlanError::HalfWord { bytes: 1 })
        ));
    }
}
