//! Model of the Cortex-M7 core. Unicorn executes the instructions; the loop in this module models time, exceptions and
//! sleep.
//!
//! Every instruction takes one cycle of the core clock. A hook runs before each instruction. The hook counts the
//! instruction and stops the execution exactly when the next event is due. At the beginning of an IT block, the hook
//! counts all instructions of the block, because the hardware also takes time for instructions whose condition is
//! false. The execution never stops within an IT block.
use unicorn_engine::unicorn_const::{Arch, HookType, Mode, uc_error};
use unicorn_engine::{ArmCpuModel, RegisterARM, Unicorn};

use crate::chip::Chip;
use crate::clock::Time;
use crate::code::{self, IT, LOWERS_SP, MEMBER, PLAIN, SEV, UNKNOWN, WATCHED};
use crate::elf::Elf;
use crate::exception;
use crate::flash::Bank2;
use crate::machine::{Machine, Sleep};
use crate::memory;
use crate::nvic::{self, Masks};
use crate::observe::{FaultKind, Reset, ResetCause};
use crate::rcc::flag;

/// Numbers that Unicorn uses for exceptions of the core.
mod raised {
    pub const SVC: u32 = 2;
    pub const PREFETCH_ABORT: u32 = 3;
    pub const BREAKPOINT: u32 = 7;
    pub const EXCEPTION_EXIT: u32 = 8;
}

/// Start of the address range of exception returns. A branch to such an address returns from an exception.
const EXC_RETURN: u32 = 0xFFFF_FFE0;

impl Machine {
    /// Creates a machine with this firmware in its flash, and switches the power on. `seed` determines the initial
    /// contents of RAM.
    ///
    /// # Panics
    /// Panics if Unicorn rejects its configuration, which no input can cause.
    pub fn new(elf: Elf, seed: u64) -> Self {
        Self::with_bank2(elf, seed, Bank2::default())
    }

    /// Like [`Machine::new`], with these initial contents of flash bank 2.
    ///
    /// # Panics
    /// Panics under the same conditions as [`Machine::new`].
    pub fn with_bank2(elf: Elf, seed: u64, bank: Bank2) -> Self {
        let mut uc = Unicorn::new_with_data(Arch::ARM, Mode::THUMB, Chip::default()).expect("Unicorn");
        uc.ctl_set_cpu_model(ArmCpuModel::CORTEX_M7 as i32).expect("the model of the core");
        uc.ctl_exits_enable().expect("no exit addresses");
        memory::map(&mut uc, seed);
        hook(&mut uc);
        uc.get_data_mut().flash.bank = bank;
        let mut machine = Self { uc, elf, sleep: Sleep::Awake };
        for (address, bytes) in machine.elf.segments.clone() {
            // The machine ignores segments outside the memory of this board, because the linker has already checked
            // for them.
            machine.poke(address, &bytes);
        }
        let reset = Reset { time: 0, cause: ResetCause::PowerOn, pc: 0 };
        machine.chip().observers.note_reset(reset);
        machine.boot();
        machine
    }

    /// Runs the machine until `end`, a point in virtual time.
    pub fn run_until(&mut self, end: Time) {
        while self.now() < end {
            self.slice(end);
        }
        self.catch_up();
    }

    /// Resets the machine as the reset pin or SYSRESETREQ does. RAM and the existing reset flags do not change.
    pub fn reset(&mut self, cause: ResetCause) {
        let flags = match cause {
            ResetCause::PowerOn => flag::POR | flag::PIN | flag::BOR | flag::D1 | flag::D2 | flag::CPU,
            ResetCause::Pin => flag::PIN | flag::CPU,
            ResetCause::Software => flag::SFT | flag::PIN | flag::CPU,
            ResetCause::Watchdog => flag::IWDG1 | flag::PIN | flag::CPU,
        };
        let chip = self.chip();
        let reset = Reset { time: chip.now(), cause, pc: chip.core.pc };
        chip.observers.note_reset(reset);
        chip.reset(flags & flag::ALL);
        self.boot();
    }

    /// Sets the registers to their values after a reset. Reads the stack pointer and the entry address from the
    /// vector table in flash.
    fn boot(&mut self) {
        use RegisterARM::*;
        for register in [R0, R1, R2, R3, R4, R5, R6, R7, R8, R9, R10, R11, R12] {
            self.set(register, 0);
        }
        for register in [PRIMASK, BASEPRI, FAULTMASK, CONTROL, FPSCR] {
            self.set(register, 0);
        }
        self.chip().scs.vtor = memory::FLASH;
        self.set(XPSR_NZCVQG, 1 << 24);
        let sp = self.word(memory::FLASH).unwrap_or(0);
        let entry = self.word(memory::FLASH + 4).unwrap_or(0);
        self.set(SP, sp);
        self.set(LR, 0xFFFF_FFFF);
        self.set(PC, entry | 1);
        self.sleep = Sleep::Awake;
        self.remap();
    }

    /// Runs the machine up to the next event, or up to `end` if `end` is earlier.
    fn slice(&mut self, end: Time) {
        self.catch_up();
        let chip = self.uc.get_data_mut();
        chip.core.attention = false;
        if chip.iwdg.bites() <= chip.now() {
            return self.reset(ResetCause::Watchdog);
        }
        if core::mem::take(&mut chip.scs.reset_request) {
            return self.reset(ResetCause::Software);
        }
        if chip.remap {
            self.remap();
        }
        if let Some(address) = self.uc.get_data_mut().core.refused.take() {
            let core = &mut self.uc.get_data_mut().core;
            core.fault_address = address;
            let pc = core.pc;
            return self.fault(FaultKind::BadAccess, pc);
        }
        let waiting = self.uc.get_data().nvic.any_waiting() && self.sleep != Sleep::Lockup;
        let mut masked = false;
        if waiting {
            let masks = self.masks();
            if let Some(next) = self.uc.get_data().nvic.next(masks) {
                self.sleep = Sleep::Awake;
                return exception::enter(self, next);
            }
            masked = self.uc.get_data().nvic.held_by_masks(masks);
            self.wake(masks);
        } else {
            self.wake(Masks::default());
        }
        let chip = self.uc.get_data_mut();
        let now = chip.now();
        let next = chip.next_event().min(end);
        if self.sleep != Sleep::Awake {
            let cycle = chip.cycle();
            return chip.sleep_until(next.max(now + cycle));
        }
        let budget = next.saturating_sub(now).div_ceil(chip.cycle()).max(1);
        chip.core.masked = masked;
        chip.core.stop_at = chip.core.instructions + budget;
        chip.core.look_at = if masked || chip.core.check_sp { 0 } else { chip.core.stop_at };
        self.execute();
    }

    /// Ends the sleep of the core if its wake-up condition is met.
    fn wake(&mut self, masks: Masks) {
        let chip = self.uc.get_data_mut();
        let pended = core::mem::take(&mut chip.nvic.pended);
        if pended && chip.scs.scr & 0x10 != 0 {
            chip.core.event = true;
        }
        match self.sleep {
            Sleep::Interrupt if chip.nvic.any_waiting() && chip.nvic.wakes(masks) => {
                self.sleep = Sleep::Awake;
            }
            Sleep::Event if chip.core.event || chip.nvic.any_waiting() && chip.nvic.wakes(masks) => {
                chip.core.event = false;
                self.sleep = Sleep::Awake;
            }
            _ => {}
        }
    }

    fn execute(&mut self) {
        let begin = u64::from(self.pc() | 1);
        let core = &mut self.uc.get_data_mut().core;
        core.stopping = false;
        core.raised = None;
        core.fault_address = 0;
        let result = self.uc.emu_start(begin, 0, 0, 0);
        let pc = self.pc();
        let core = &mut self.uc.get_data_mut().core;
        if core.stopping {
            return;
        }
        let last = core.pc;
        match core.raised.take() {
            Some(raised::EXCEPTION_EXIT | raised::PREFETCH_ABORT) if pc >= EXC_RETURN & !1 => {
                return exception::leave(self, pc);
            }
            Some(raised::SVC) => {
                let now = self.now();
                return self.chip().nvic.pend(nvic::exception::SV_CALL, now);
            }
            Some(raised::BREAKPOINT) => return self.fault(FaultKind::Breakpoint, last),
            Some(_) => return self.fault(FaultKind::BadJump, pc),
            None => {}
        }
        match result {
            // Unicorn stops without an error only after WFI.
            Ok(()) => self.sleep = Sleep::Interrupt,
            Err(uc_error::INSN_INVALID) => self.hint_or_undefined(last),
            Err(uc_error::FETCH_UNMAPPED | uc_error::FETCH_PROT) if pc >= EXC_RETURN & !1 => {
                exception::leave(self, pc);
            }
            Err(uc_error::FETCH_PROT) if memory::allow_code(&mut self.uc, pc) => {}
            Err(uc_error::FETCH_UNMAPPED | uc_error::FETCH_PROT) => self.fault(FaultKind::BadJump, pc),
            Err(uc_error::EXCEPTION) => self.fault(FaultKind::Undefined, last),
            Err(_) => self.fault(FaultKind::BadAccess, last),
        }
    }

    /// Handles WFE and YIELD, which Unicorn reports as invalid instructions. Any other invalid instruction causes a
    /// fault.
    fn hint_or_undefined(&mut self, pc: u32) {
        let word = self.word(pc & !1).unwrap_or(0);
        let (first, second) = (word as u16, (word >> 16) as u16);
        let (wfe, length) = match (first, second) {
            (0xBF20, _) => (true, 2),
            (0xBF10, _) => (false, 2),
            (0xF3AF, 0x8002) => (true, 4),
            (0xF3AF, 0x8001) => (false, 4),
            _ => return self.fault(FaultKind::Undefined, pc),
        };
        self.set(RegisterARM::PC, (pc + length) | 1);
        if wfe {
            let core = &mut self.chip().core;
            if !core::mem::take(&mut core.event) {
                self.sleep = Sleep::Event;
            }
        }
    }
}

/// Installs the hooks for instructions, raised exceptions and failed accesses.
fn hook(uc: &mut Unicorn<'static, Chip>) {
    let code = uc.add_code_hook(1, 0, |uc, address, _| {
        let chip = uc.get_data_mut();
        let address = address as u32;
        if chip.core.instructions < chip.core.look_at && chip.code.class(address) == PLAIN {
            chip.core.instructions += 1;
            chip.core.pc = address;
            return;
        }
        look(uc, address);
    });
    let raised = uc.add_intr_hook(|uc, number| {
        uc.get_data_mut().core.raised = Some(number);
        let _ = uc.emu_stop();
    });
    // The hooks cover only the forbidden addresses, because a hook on the complete memory would slow down every
    // store.
    let invalid = memory::FORBIDDEN.into_iter().all(|(first, last)| {
        let note = |uc: &mut Unicorn<'_, Chip>, _, address: u64, _, _| {
            uc.get_data_mut().core.fault_address = address as u32;
            false
        };
        uc.add_mem_hook(HookType::MEM_INVALID, first, last, note).is_ok()
    });
    assert!(code.is_ok() && raised.is_ok() && invalid, "Unicorn takes hooks");
}

/// Handles an instruction that needs special treatment, before the core executes the instruction.
fn look(uc: &mut Unicorn<'_, Chip>, address: u32) {
    let chip = uc.get_data_mut();
    if chip.core.it_block.contains(&address) {
        // This instruction was counted at the beginning of its IT block, and the execution must not stop within the
        // block.
        chip.core.pc = address;
        return;
    }
    if chip.core.check_sp {
        let sp = uc.reg_read(RegisterARM::SP).unwrap_or(0) as u32;
        let chip = uc.get_data_mut();
        chip.core.check_sp = false;
        chip.observers.note_sp(sp);
    }
    let core = &uc.get_data().core;
    if core.instructions >= core.stop_at || core.attention || core.masked && unmasked(uc) {
        let core = &mut uc.get_data_mut().core;
        core.stopping = true;
        core.look_at = 0;
        // The previous instruction is complete, so the execution may stop here.
        let _ = uc.emu_stop();
        return;
    }
    let class = class(uc, address);
    if class & WATCHED != 0 {
        let sp = uc.reg_read(RegisterARM::SP).unwrap_or(0) as u32;
        let lr = uc.reg_read(RegisterARM::LR).unwrap_or(0) as u32;
        let chip = uc.get_data_mut();
        let instructions = chip.core.instructions;
        if let Some(back) = chip.observers.at(address, sp, lr, instructions) {
            chip.code.watch(back);
        }
    }
    let core = &mut uc.get_data_mut().core;
    if class & IT != 0 {
        let (members, bytes) = code::block(class);
        core.it_block = address + 2..address + 2 + bytes;
        core.instructions += u64::from(members);
    }
    if class & SEV != 0 {
        core.event = true;
    }
    core.check_sp = class & LOWERS_SP != 0;
    core.look_at = if core.check_sp || core.masked { 0 } else { core.stop_at };
    core.instructions += 1;
    core.pc = address;
}

/// Finds, stores and returns the class of the instruction at an address.
fn class(uc: &mut Unicorn<'_, Chip>, address: u32) -> u16 {
    let known = uc.get_data().code.class(address);
    if known & !(WATCHED | MEMBER) != UNKNOWN {
        return known;
    }
    let (first, second) = (half_word(uc, address), half_word(uc, address + 2));
    let mut class = code::classify(first, second);
    if class == IT {
        let members = code::it_block(first);
        let mut end = address + 2;
        for _ in 0..members {
            uc.get_data_mut().code.learn(end, MEMBER);
            end += code::length(half_word(uc, end));
        }
        class = code::begins_block(members, end - address - 2);
    }
    uc.get_data_mut().code.learn(address, class);
    known | class
}

fn half_word(uc: &Unicorn<'_, Chip>, address: u32) -> u16 {
    let mut bytes = [0; 2];
    let _ = uc.mem_read(u64::from(address), &mut bytes);
    u16::from_le_bytes(bytes)
}

/// Returns `true` if the current mask registers permit a pending exception.
fn unmasked(uc: &Unicorn<'_, Chip>) -> bool {
    let read = |register: RegisterARM| uc.reg_read(register).unwrap_or(0);
    let masks = Masks {
        primask: read(RegisterARM::PRIMASK) & 1 == 1,
        faultmask: read(RegisterARM::FAULTMASK) & 1 == 1,
        basepri: read(RegisterARM::BASEPRI) as u8,
    };
    uc.get_data().nvic.next(masks).is_some()
}
