//! Observers that find functions by their symbol names, and access to the log of the firmware.
use crate::elf::ElfError;
use crate::machine::Machine;
use crate::observe::Count;

/// Handle of a counter that counts the instructions of a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counter(usize);

/// Offset of defmt's channel in the RTT control block, after the identifier and two counts.
const RTT_CHANNEL: u32 = 24;

impl Machine {
    /// Starts counting the instructions of a function. `name` is the full name of the function, or a part of the name
    /// that no other symbol contains. A function that the compiler has inlined has no symbol.
    pub fn count(&mut self, name: &str) -> Result<Counter, ElfError> {
        let entry = self.elf().symbol(name)?.address;
        let chip = self.chip();
        chip.code.watch(entry);
        Ok(Counter(chip.observers.add_probe(entry)))
    }

    /// Returns the instruction counts of a counter.
    pub fn counted(&self, counter: Counter) -> Count {
        self.uc.get_data().observers.probe(counter.0)
    }

    /// Returns the bytes that the firmware has written into the first RTT channel since the last call. The bytes are
    /// encoded by defmt. The function reads the log in the same way as a debug probe.
    pub fn defmt(&mut self) -> Vec<u8> {
        let Ok(block) = self.elf().symbol("_SEGGER_RTT") else { return Vec::new() };
        let at = block.address + RTT_CHANNEL;
        let fields = [4, 8, 12, 16].map(|offset| self.word(at + offset).unwrap_or(0));
        let [buffer, size, write, read] = fields;
        if size == 0 || size > 0x10_0000 || write >= size || read >= size {
            return Vec::new(); // the firmware has not initialised RTT yet
        }
        let part = |from: u32, to: u32| self.memory(buffer + from, (to - from) as usize).unwrap_or_default();
        let bytes =
            if write >= read { part(read, write) } else { [part(read, size), part(0, write)].concat() };
        self.poke(at + 16, &write.to_le_bytes());
        bytes
    }
}
