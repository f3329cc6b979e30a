//! The program of the second core of the H745, which only sleeps. This core always starts at bank 2 of the flash.

/// Instructions of the program: `wfi`, and a branch back to `wfi`.
const SLEEP: u32 = 0xE7FD_BF30;
/// Address of the first instruction, with the bit that selects Thumb.
const PROGRAM: u32 = 0x0810_0000 + 16 * 4 + 1;
/// End of SRAM3. The stack of the second core would start at this address, but no exception uses the stack.
const STACK: u32 = 0x3004_8000;

/// Vector table (stack, reset, fourteen exceptions) and program.
#[unsafe(link_section = ".m4.park")]
#[used]
static PARK: [u32; 17] = {
    let mut words = [PROGRAM; 17];
    words[0] = STACK;
    words[16] = SLEEP;
    words
};
