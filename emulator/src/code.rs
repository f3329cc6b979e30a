//! Properties of instructions that the machine must know before it executes an instruction. The module stores these
//! properties for each address.
//!
//! Unicorn executes `SEV` without effect and does not report changes of the stack pointer. Unicorn also skips the
//! instructions of an IT block whose condition is false. Therefore, the machine recognises these instructions by
//! their code when it executes an address for the first time.

/// Class of an address that has not been checked yet.
pub const UNKNOWN: u16 = 0;
/// Class of an instruction without special handling.
pub const PLAIN: u16 = 1;
/// Class of an instruction that sets the event register (SEV).
pub const SEV: u16 = 2;
/// Class of an instruction that may lower the stack pointer.
pub const LOWERS_SP: u16 = 4;
/// Mark of an address that an observer watches.
pub const WATCHED: u16 = 8;
/// Class of an instruction that begins an IT block. The machine counts all instructions of the block together with
/// this instruction, because the core fetches and issues every instruction regardless of its condition.
pub const IT: u16 = 16;
/// Mark of an instruction inside an IT block.
pub const MEMBER: u16 = 32;
/// Positions of two numbers within the class of an IT instruction: the number of instructions in the block, and their
/// length in half-words.
const MEMBERS: u32 = 8;
const HALF_WORDS: u32 = 12;

const FLASH: u32 = 0x0800_0000;
const FLASH_SIZE: u32 = 0x20_0000;
const ITCM_SIZE: u32 = 0x1_0000;

/// Classes of the instructions in ITCM and flash. Classes of other memory are not stored, so the machine classifies
/// those instructions each time.
pub struct Code {
    flash: Vec<u16>,
    itcm: Vec<u16>,
}

impl Default for Code {
    fn default() -> Self {
        Self { flash: vec![UNKNOWN; FLASH_SIZE as usize / 2], itcm: vec![UNKNOWN; ITCM_SIZE as usize / 2] }
    }
}

impl Code {
    /// Returns the class of the instruction at an address.
    #[inline]
    pub fn class(&self, address: u32) -> u16 {
        let in_flash = address.wrapping_sub(FLASH);
        if in_flash < FLASH_SIZE {
            return self.flash[in_flash as usize / 2];
        }
        if address < ITCM_SIZE { self.itcm[address as usize / 2] } else { UNKNOWN }
    }

    fn place(&mut self, address: u32) -> Option<&mut u16> {
        let in_flash = address.wrapping_sub(FLASH);
        if in_flash < FLASH_SIZE {
            return self.flash.get_mut(in_flash as usize / 2);
        }
        self.itcm.get_mut(address as usize / 2)
    }

    /// Stores the class of an address. The marks for observers and for instructions inside an IT block do not change.
    pub fn learn(&mut self, address: u32, class: u16) {
        if let Some(place) = self.place(address) {
            *place = class | *place & (WATCHED | MEMBER);
        }
    }

    /// Marks an address, so that the observers are called before the core executes its instruction. Returns `false`
    /// if code at this address cannot be watched.
    pub fn watch(&mut self, address: u32) -> bool {
        match self.place(address) {
            Some(place) => {
                *place |= WATCHED;
                true
            }
            None => false,
        }
    }

    /// Removes the stored classes of a range of addresses whose contents have changed. Returns `true` if the range
    /// may contain code.
    pub fn forget(&mut self, address: u32, length: u32) -> bool {
        let mut code = false;
        for at in address..address.saturating_add(length) {
            let Some(place) = self.place(at) else { break };
            *place &= WATCHED;
            code = true;
        }
        code
    }

    /// Removes the stored classes of instructions in ITCM, because the contents of ITCM have changed or will change.
    pub fn forget_itcm(&mut self) {
        for place in &mut self.itcm {
            *place &= WATCHED;
        }
    }
}

/// Returns the class of an instruction from its first two half-words.
pub fn classify(first: u16, second: u16) -> u16 {
    let lowers = first & 0xFE00 == 0xB400 // PUSH
        || first & 0xFF80 == 0xB080 // SUB SP, #
        || first == 0xE92D // PUSH.W, STMDB SP!
        || first & 0xFFBF == 0xED2D // VPUSH
        || matches!(first, 0xF1AD | 0xF5AD | 0xF2AD | 0xF6AD | 0xEBAD) && second & 0x0F00 == 0x0D00 // SUB SP
        || first == 0xF84D && second & 0x0F00 == 0x0D00 // STR [SP, #-]!
        || first & 0xFF7F == 0xE96D // STRD [SP, #-]!
        || first & 0xFF87 == 0x4685 // MOV SP
        || first & 0xFFF0 == 0xF380 && matches!(second & 0xFF, 8 | 9); // MSR MSP, PSP
    let sev = first == 0xBF40 || first == 0xF3AF && second == 0x8004;
    if it_block(first) > 0 {
        IT
    } else if lowers {
        LOWERS_SP
    } else if sev {
        SEV
    } else {
        PLAIN
    }
}

/// Returns the number of instructions and the length in bytes of the IT block that an instruction of this class
/// begins.
pub fn block(class: u16) -> (u32, u32) {
    (u32::from(class >> MEMBERS) & 7, 2 * (u32::from(class >> HALF_WORDS) & 15))
}

/// Returns the class of an IT instruction whose block has this number of instructions and this number of bytes.
pub fn begins_block(members: u32, bytes: u32) -> u16 {
    IT | ((members << MEMBERS) | ((bytes / 2) << HALF_WORDS)) as u16
}

/// Returns the number of instructions in the IT block that an instruction with this first half-word begins. Returns 0
/// if the instruction does not begin an IT block.
pub fn it_block(first: u16) -> u32 {
    // Bits 3..0 are the mask, whose lowest set bit determines the length of the block. If the mask is 0, the
    // instruction is a hint such as NOP.
    if first & 0xFF00 == 0xBF00 && first & 0xF != 0 { 4 - (first & 0xF).trailing_zeros() } else { 0 }
}

/// Returns the length of the instruction with this first half-word, in bytes.
pub fn length(first: u16) -> u32 {
    if first >= 0xE800 { 4 } else { 2 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Encodings from the Arm v7-M Architecture Reference Manual, A7.7.38, for blocks of one to four instructions.
    #[test]
    fn an_it_block_ends_where_its_mask_does() {
        for (first, members) in
            [(0xBF08, 1), (0xBF04, 2), (0xBF0C, 2), (0xBF02, 3), (0xBF1E, 3), (0xBF01, 4), (0xBF0F, 4)]
        {
            assert_eq!(it_block(first), members, "{first:04x}");
            assert_eq!(classify(first, 0), IT);
        }
        for (members, bytes) in [(1, 2), (1, 4), (4, 8), (4, 16)] {
            assert_eq!(block(begins_block(members, bytes)), (members, bytes));
        }
        for hint in [0xBF00, 0xBF10, 0xBF20, 0xBF30, 0xBF40] {
            assert_eq!(it_block(hint), 0, "{hint:04x}");
        }
        assert_eq!([0xE7FE, 0xE800, 0xF000, 0xBD10].map(length), [2, 4, 4, 2]);
    }

    #[test]
    fn instructions_that_matter_are_found() {
        for (first, second) in
            [(0xB510, 0), (0xB082, 0), (0xE92D, 0x4FF0), (0xED2D, 0x8B04), (0xF5AD, 0x5D80), (0xF84D, 0x4D04)]
        {
            assert_eq!(classify(first, second), LOWERS_SP, "{first:04x} {second:04x}");
        }
        assert_eq!(classify(0xBF40, 0), SEV);
        assert_eq!(classify(0xBF00, 0), PLAIN);
        assert_eq!(classify(0xBD10, 0), PLAIN);
    }

    #[test]
    fn a_watched_address_stays_watched() {
        let mut code = Code::default();
        assert!(code.watch(FLASH + 2));
        code.learn(FLASH + 2, PLAIN);
        assert_eq!(code.class(FLASH + 2), PLAIN | WATCHED);
        assert!(!code.watch(0x2000_0000));
    }
}
