//! Data that an update sends: the blocks of both cycles (D-40, D-41).
use core::fmt;
use std::sync::Arc;

use crate::master::error::{PlanError, SecondImageError};
use crate::master::reports::update::options::{UpdateImage, UpdateOptions};
use ucom::profile::{HeaderForm, Plan};
use ucom::{BLOCK_LEN, BoardInfo, Checksum, Header, Memory, Profile, block_count, checksum, data_block};

/// Content of one cycle of an update.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Cycle {
    pub header: Option<[u8; BLOCK_LEN]>,
    pub bytes: Arc<[u8]>,
}

impl Cycle {
    /// Returns the number of blocks of the cycle, including the header block.
    pub(crate) fn blocks(&self) -> usize {
        block_count(self.bytes.len()) + usize::from(self.header.is_some())
    }

    /// Returns the `i`-th block of the cycle.
    pub(crate) fn block(&self, i: usize) -> Option<[u8; BLOCK_LEN]> {
        match (self.header, i.checked_sub(1)) {
            (Some(header), None) => Some(header),
            (Some(_), Some(data)) => data_block(&self.bytes, data),
            (None, _) => data_block(&self.bytes, i),
        }
    }
}

/// Program that a board must report at the end of an update.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Expected {
    /// Program ID that the board must report.
    pub program_id: u16,
    /// Flash date; `None` if the date is not known, because the update sends no header with a date.
    pub date: Option<u16>,
}

impl Expected {
    /// Returns `true` if the board reports this program.
    pub fn is(&self, known: &BoardInfo) -> bool {
        known.program_id == self.program_id && self.date.is_none_or(|date| date == known.date)
    }
}

/// Reasons why the program that a board must report after the update is not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unverifiable {
    /// With plan `raw`, the Program ID of the files is not known.
    RawPlan,
    /// With `prog.header = none`, the board itself determines the Program ID and the date.
    NoHeader,
    /// With `prog.checksum = none`, a Program ID is not the checksum of an image.
    NoChecksum,
}

impl fmt::Display for Unverifiable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::RawPlan => "with `prog.plan` raw the Program ID of the file is not known",
            Self::NoHeader => "with `prog.header` none the board itself sets its Program ID",
            Self::NoChecksum => "with `prog.checksum` none the Program ID cannot be computed",
        })
    }
}

impl Unverifiable {
    /// Returns the option that makes a verification possible.
    pub fn hint(&self) -> &'static str {
        "for a verification, give the Program ID that the board must show: `--expect-program-id 0x…`"
    }
}

/// Image in the form in which the update sends it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedImage {
    /// First and last cycle in which the image is sent: 1, 2 or both.
    pub cycles: (u32, u32),
    /// Memory to which the image is written; `None` with the plan `raw`, because only the content of the file determines the memory.
    pub memory: Option<Memory>,
    /// Load address in words; `None` if the update sends no address.
    pub address_words: Option<u32>,
    /// Length of the image in bytes.
    pub bytes: usize,
    /// Program ID of the image (D-44); `None` for one of the reasons in [`Unverifiable`].
    pub program_id: Option<u16>,
}

impl Unverifiable {
    /// Returns the reason why PC_INFO cannot verify an update with this profile; returns `None` if PC_INFO can verify the update.
    fn by_profile(profile: &Profile) -> Option<Self> {
        match (profile.prog_plan, profile.prog_header, profile.prog_checksum) {
            (Plan::Raw, ..) => Some(Self::RawPlan),
            (_, HeaderForm::None, _) => Some(Self::NoHeader),
            (.., Checksum::None) => Some(Self::NoChecksum),
            _ => None,
        }
    }
}

impl UpdateImage {
    /// Checks that the update can send the image. The image must consist of complete words, except with the plan `raw`.
    fn check(&self, plan: Plan) -> Result<(), PlanError> {
        match self.bytes.len() {
            0 => Err(PlanError::Empty),
            bytes if plan != Plan::Raw && bytes % 2 == 1 => Err(PlanError::HalfWord { bytes }),
            _ => Ok(()),
        }
    }
}

/// Returns `true` if updates with this profile send a header with Program ID and flash date (D-41).
pub fn has_header(profile: &Profile) -> bool {
    profile.prog_plan != Plan::Raw && profile.prog_header == HeaderForm::V1
}

/// Returns the image and the target memory of each cycle.
fn parts<'a>(
    plan: Plan,
    image: &'a UpdateImage,
    other: Option<&'a UpdateImage>,
) -> Result<[(&'a UpdateImage, Memory); 2], SecondImageError> {
    let second = || other.ok_or(SecondImageError::Missing { plan });
    Ok(match plan {
        Plan::VerifyWrite if other.is_some() => return Err(SecondImageError::Unused { plan }),
        Plan::VerifyWrite => [(image, Memory::Program); 2],
        Plan::ExloaderApp => [(second()?, Memory::Ram), (image, Memory::Program)],
        Plan::PmemXmem => [(image, Memory::Program), (second()?, Memory::Data)],
        Plan::Raw => [(image, Memory::Program), (other.unwrap_or(image), Memory::Program)],
    })
}

/// Data that an update sends to a board, and the program that the board must report afterwards.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UpdatePlan {
    pub(crate) cycles: [Cycle; 2],
    /// Images that the user gave, the main image first.
    pub images: Vec<PlannedImage>,
    /// Program that the board must report at the end; `None` if the program is not known.
    pub expected: Option<Expected>,
    /// Reason why the expected program is not known.
    pub unverifiable: Option<Unverifiable>,
    /// First cycle that may erase flash, 1 or 2. Earlier cycles do not erase any memory.
    pub erases_from: u32,
}

impl UpdatePlan {
    /// Creates the update plan for one board or for a group. The header contains `target`: the flash number of the board, or the value for
    /// any board.
    pub fn new(options: &UpdateOptions, target: u16, profile: &Profile) -> Result<Self, PlanError> {
        let plan = profile.prog_plan;
        let image = &options.image;
        for one in [Some(image), options.second.as_ref()].into_iter().flatten() {
            one.check(plan)?;
        }
        let other = options.second.as_ref();
        let [first, last] = parts(plan, image, other)?;
        let erases_from = match plan {
            // The first cycle of these plans only checks the image or fills RAM. The application in flash stays valid during this cycle.
            Plan::VerifyWrite | Plan::ExloaderApp => 2,
            // With `pmem-xmem`, the first cycle writes program flash. With `raw`, only the author of the files knows which cycle erases
            // memory.
            Plan::PmemXmem | Plan::Raw => 1,
        };
        let unverifiable = Unverifiable::by_profile(profile);
        let with_header = has_header(profile);
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
        let cycle = |number, part: (&UpdateImage, Memory)| Cycle {
            header: with_header.then(|| header(number, part).build(profile.prog_endian)),
            bytes: part.0.bytes.clone(),
        };
        let sent = |image: &UpdateImage, memory, cycles| PlannedImage {
            cycles,
            memory: (plan != Plan::Raw).then_some(memory),
            address_words: with_header.then_some(image.address_words),
            bytes: image.bytes.len(),
            program_id: unverifiable.is_none().then(|| id(image)),
        };
        let images = match (plan, other) {
            (_, None) => vec![sent(image, first.1, (1, 2))],
            (Plan::ExloaderApp, Some(other)) => {
                vec![sent(image, last.1, (2, 2)), sent(other, first.1, (1, 1))]
            }
            (_, Some(other)) => vec![sent(image, first.1, (1, 1)), sent(other, last.1, (2, 2))],
        };
        let program_id = id(image);
        if with_header && program_id == 0xFFFF && options.date == 0xFFFF {
            return Err(PlanError::Void);
        }
        let expected = match (unverifiable, options.expect_program_id) {
            (None, Some(expected)) if expected != program_id => {
                return Err(PlanError::OtherProgram { image: program_id, expected });
            }
            (None, _) => Some(Expected { program_id, date: Some(options.date) }),
            (Some(_), Some(program_id)) => {
                Some(Expected { program_id, date: with_header.then_some(options.date) })
            }
            (Some(_), None) => None,
        };
        let unverifiable = unverifiable.filter(|_| expected.is_none());
        Ok(Self { cycles: [cycle(1, first), cycle(2, last)], images, expected, unverifiable, erases_from })
    }

    /// Returns the Program ID that the board must report; returns `None` if the ID is not known.
    pub fn program_id(&self) -> Option<u16> {
        self.expected.map(|expected| expected.program_id)
    }

    /// Returns the number of bytes that the PC sends in both cycles.
    pub fn total_bytes(&self) -> u64 {
        self.cycles.iter().map(|c| (c.blocks() * BLOCK_LEN) as u64).sum()
    }

    /// Returns the number of PC_PROG frames of one cycle; the cycles have the indices 0 and 1.
    pub fn frames(&self, cycle: usize) -> usize {
        self.cycles.get(cycle).map_or(0, |c| c.blocks() * 8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::master::reports::update::options::UpdateTarget;

    fn options(bytes: Vec<u8>) -> UpdateOptions {
        let image = UpdateImage { bytes: bytes.into(), address_words: 0 };
        UpdateOptions::new(vec![UpdateTarget { board: 1, flash_number: None }], image, 0x3AC1)
    }

    /// The golden update has 1000 bytes, 17 blocks and 136 frames per cycle, and the Program ID 0x4B3F.
    #[test]
    fn d41_golden_plan() {
        let bytes: Vec<u8> = (0..1000).map(|i| (37 * i + 11) as u8).collect();
        let plan = UpdatePlan::new(&options(bytes), Header::ANY_BOARD, &Profile::default()).unwrap();
        assert_eq!((plan.frames(0), plan.frames(1), plan.total_bytes()), (136, 136, 2 * 17 * 64));
        assert_eq!(plan.expected, Some(Expected { program_id: 0x4B3F, date: Some(0x3AC1) }));
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
            second: Some(UpdateImage { bytes: vec![9; 64].into(), address_words: 5 }),
            ..options(vec![1; 128])
        };
        let planned = |options: &UpdateOptions, prog_plan| {
            UpdatePlan::new(options, Header::ANY_BOARD, &Profile { prog_plan, ..Profile::default() })
        };
        assert!(matches!(
            planned(&two, Plan::VerifyWrite),
            Err(PlanError::Second(SecondImageError::Unused { .. }))
        ));
        assert!(matches!(
            planned(&options(vec![1; 2]), Plan::ExloaderApp),
            Err(PlanError::Second(SecondImageError::Missing { .. }))
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
