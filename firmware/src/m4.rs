//! The second core of the H745 always starts at bank 2 of the flash. This is its program, which only sleeps.

/// Instructions: `wfi`, then a branch back to it.
const SLEEP: u32 = 0xE7FD_BF30;
/// Address of the instructions, with the bit that selects Thumb.
const PROGRAM: u32 = 0x0810_0000 + 16 * 4 + 1;
/// End of the small SRAM3. The stack would start here, but no exception uses it.
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
