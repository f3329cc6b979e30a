//! The machine from outside: registers, memory, faults. What makes it run is in `cpu`.
use unicorn_engine::{RegisterARM, Unicorn};

use crate::chip::Chip;
use crate::clock::Time;
use crate::elf::Elf;
use crate::flash::{BANK2, BANK2_SIZE, Bank2};
use crate::memory::{self, Ram};
use crate::nvic::{self, Masks};
use crate::observe::{Fault, FaultKind};

/// The machine: core, memory and peripherals of the controller board, with a firmware in its flash.
pub struct Machine {
    pub(crate) uc: Unicorn<'static, Chip>,
    pub(crate) elf: Elf,
    pub(crate) sleep: Sleep,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sleep {
    Awake,
    /// In WFI.
    Interrupt,
    /// In WFE.
    Event,
    /// Locked up: only a reset helps.
    Lockup,
}

fn in_bank2(address: u32) -> bool {
    (BANK2..BANK2 + BANK2_SIZE).contains(&address)
}

impl Machine {
    /// The chip around the core.
    pub fn chip(&mut self) -> &mut Chip {
        self.uc.get_data_mut()
    }

    /// The firmware's file.
    pub fn elf(&self) -> &Elf {
        &self.elf
    }

    /// Virtual time since power-on.
    pub fn now(&self) -> Time {
        self.uc.get_data().now()
    }

    /// Instructions executed since power-on.
    pub fn instructions(&self) -> u64 {
        self.uc.get_data().core.instructions
    }

    /// A core register.
    pub fn register(&self, register: RegisterARM) -> u32 {
        self.uc.reg_read(register).unwrap_or(0) as u32
    }

    /// The instruction that comes next.
    pub fn pc(&self) -> u32 {
        self.register(RegisterARM::PC)
    }

    /// The core stands still after a fault within a fault.
    pub fn locked_up(&self) -> bool {
        self.sleep == Sleep::Lockup
    }

    /// Let peripherals happen up to now.
    pub(crate) fn catch_up(&mut self) {
        let mut ram = Ram(self.uc.clone());
        self.uc.get_data_mut().advance(&mut ram);
    }

    pub(crate) fn set(&mut self, register: RegisterARM, value: u32) {
        // Every register named here exists on this core.
        let _ = self.uc.reg_write(register, u64::from(value));
    }

    /// A word of memory; `None` where nothing is.
    pub fn word(&self, address: u32) -> Option<u32> {
        if in_bank2(address) {
            let bytes = self.memory(address, 4)?;
            return Some(u32::from_le_bytes(bytes.try_into().ok()?));
        }
        let mut bytes = [0; 4];
        self.uc.mem_read(u64::from(address), &mut bytes).ok()?;
        Some(u32::from_le_bytes(bytes))
    }

    /// Bytes of memory; `None` where nothing is.
    pub fn memory(&self, address: u32, length: usize) -> Option<Vec<u8>> {
        if in_bank2(address) {
            let fits = address as usize + length <= (BANK2 + BANK2_SIZE) as usize;
            return fits.then(|| self.uc.get_data().flash.bank.bytes(address, length));
        }
        self.uc.mem_read_as_vec(u64::from(address), length).ok()
    }

    /// Change memory from outside, as a debugger does, code too; false where nothing is.
    pub fn poke(&mut self, address: u32, bytes: &[u8]) -> bool {
        if in_bank2(address) {
            let fits = address as usize + bytes.len() <= (BANK2 + BANK2_SIZE) as usize;
            if fits {
                self.chip().flash.bank.put(address, bytes);
            }
            return fits;
        }
        let written = self.uc.mem_write(u64::from(address), bytes).is_ok();
        if written && self.chip().code.forget(address, bytes.len() as u32) {
            // What was translated from the old code would go on running.
            self.chip().core.it_block = 0..0;
            let _ = self.uc.ctl_flush_tb();
        }
        written
    }

    /// Read a register of a peripheral from outside, as a debugger does.
    pub fn read_register(&mut self, address: u32) -> u32 {
        let mut ram = Ram(self.uc.clone());
        self.uc.get_data_mut().load(address, 4, &mut ram)
    }

    /// Write a register of a peripheral from outside, as a debugger does.
    pub fn write_register(&mut self, address: u32, value: u32) {
        let mut ram = Ram(self.uc.clone());
        self.uc.get_data_mut().store(address, 4, value, &mut ram);
        if self.uc.get_data().remap {
            self.remap();
        }
    }

    /// What bank 2 of the flash would hold if the power went now: chance, from `seed`, where an operation runs.
    pub fn cut_power(&self, seed: u64) -> Bank2 {
        self.uc.get_data().flash.cut(self.now(), seed)
    }

    pub(crate) fn masks(&self) -> Masks {
        Masks {
            primask: self.register(RegisterARM::PRIMASK) & 1 == 1,
            faultmask: self.register(RegisterARM::FAULTMASK) & 1 == 1,
            basepri: self.register(RegisterARM::BASEPRI) as u8,
        }
    }

    /// D2 SRAM can be used as far as its clocks are enabled.
    pub(crate) fn remap(&mut self) {
        self.chip().remap = false;
        memory::protect(&mut self.uc);
    }

    /// A fault at an instruction: HardFault, or lock-up within it.
    pub(crate) fn fault(&mut self, kind: FaultKind, pc: u32) {
        let masks = self.masks();
        let chip = self.chip();
        let address = chip.core.fault_address;
        let hard = nvic::exception::HARD_FAULT;
        let lockup = chip.nvic.is_active(hard) || masks.faultmask;
        chip.observers.faults.push(Fault { time: chip.now(), kind, pc, address, lockup });
        chip.scs.hfsr |= 1 << 30;
        match kind {
            FaultKind::BadAccess => {
                chip.scs.cfsr |= 1 << 9 | 1 << 15;
                chip.scs.bfar = address;
            }
            FaultKind::BadJump => chip.scs.cfsr |= 1 << 8,
            FaultKind::Undefined => chip.scs.cfsr |= 1 << 16,
            FaultKind::BadReturn => chip.scs.cfsr |= 1 << 18,
            FaultKind::Breakpoint => {}
        }
        self.set(RegisterARM::PC, pc | 1);
        if lockup {
            self.sleep = Sleep::Lockup;
            return;
        }
        let now = self.now();
        self.chip().nvic.pend(hard, now);
    }
}
