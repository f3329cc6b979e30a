//! External access to the machine: registers, memory and faults. The module `cpu` executes the program of the machine.
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
    /// The core sleeps in WFI.
    Interrupt,
    /// The core sleeps in WFE.
    Event,
    /// The core is in lock-up until a reset.
    Lockup,
}

fn in_bank2(address: u32) -> bool {
    (BANK2..BANK2 + BANK2_SIZE).contains(&address)
}

impl Machine {
    /// Returns the chip around the core.
    pub fn chip(&mut self) -> &mut Chip {
        self.uc.get_data_mut()
    }

    /// Returns the ELF file of the firmware.
    pub fn elf(&self) -> &Elf {
        &self.elf
    }

    /// Returns the virtual time since power-on.
    pub fn now(&self) -> Time {
        self.uc.get_data().now()
    }

    /// Returns the number of instructions that the core has executed since power-on.
    pub fn instructions(&self) -> u64 {
        self.uc.get_data().core.instructions
    }

    /// Returns the value of a core register.
    pub fn register(&self, register: RegisterARM) -> u32 {
        self.uc.reg_read(register).unwrap_or(0) as u32
    }

    /// Returns the address of the next instruction.
    pub fn pc(&self) -> u32 {
        self.register(RegisterARM::PC)
    }

    /// Returns `true` if the core is in lock-up because a fault occurred in HardFault or while FAULTMASK was set.
    pub fn locked_up(&self) -> bool {
        self.sleep == Sleep::Lockup
    }

    /// Advances the peripherals to the current virtual time.
    pub(crate) fn catch_up(&mut self) {
        let mut ram = Ram(self.uc.clone());
        self.uc.get_data_mut().advance(&mut ram);
    }

    pub(crate) fn set(&mut self, register: RegisterARM, value: u32) {
        // Every register that this code writes exists on the core, so a write cannot fail.
        let _ = self.uc.reg_write(register, u64::from(value));
    }

    /// Returns the word of memory at an address. Returns `None` if the address is not mapped.
    pub fn word(&self, address: u32) -> Option<u32> {
        if in_bank2(address) {
            let bytes = self.memory(address, 4)?;
            return Some(u32::from_le_bytes(bytes.try_into().ok()?));
        }
        let mut bytes = [0; 4];
        self.uc.mem_read(u64::from(address), &mut bytes).ok()?;
        Some(u32::from_le_bytes(bytes))
    }

    /// Returns the bytes of memory at an address. Returns `None` if the address is not mapped.
    pub fn memory(&self, address: u32, length: usize) -> Option<Vec<u8>> {
        if in_bank2(address) {
            let fits = address as usize + length <= (BANK2 + BANK2_SIZE) as usize;
            return fits.then(|| self.uc.get_data().flash.bank.bytes(address, length));
        }
        self.uc.mem_read_as_vec(u64::from(address), length).ok()
    }

    /// Changes memory as a debugger does; the memory may contain code. Returns `false` at an unmapped address.
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
            // Unicorn would otherwise continue to execute its translation of the old code. `ctl_flush_tb` discards
            // this translation.
            self.chip().core.it_block = 0..0;
            let _ = self.uc.ctl_flush_tb();
        }
        written
    }

    /// Reads a register of a peripheral as a debugger does.
    pub fn read_register(&mut self, address: u32) -> u32 {
        let mut ram = Ram(self.uc.clone());
        self.uc.get_data_mut().load(address, 4, &mut ram)
    }

    /// Writes a register of a peripheral as a debugger does.
    pub fn write_register(&mut self, address: u32, value: u32) {
        let mut ram = Ram(self.uc.clone());
        self.uc.get_data_mut().store(address, 4, value, &mut ram);
        if self.uc.get_data().remap {
            self.remap();
        }
    }

    /// Returns the contents of flash bank 2 after a power failure at the current virtual time. Words that the flash is
    /// erasing or programming at that time contain random values generated from `seed`.
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

    /// Maps the SRAM blocks of domain D2 whose clocks are enabled.
    pub(crate) fn remap(&mut self) {
        self.chip().remap = false;
        memory::protect(&mut self.uc);
    }

    /// Handles a fault at an instruction. The core enters HardFault, or lock-up if it is already in HardFault.
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
