//! The defmt log of the firmware as text, decoded by the program `defmt-print`.
use std::io::{self, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// Decoder process, which receives the bytes and prints lines.
pub struct DefmtLog(Child);

impl DefmtLog {
    /// Starts the decoder for the firmware with this ELF file.
    pub fn new(elf: &Path) -> Result<Self, String> {
        let child = Command::new("defmt-print")
            .arg("-e")
            .arg(elf)
            .stdin(Stdio::piped())
            // Standard output is reserved for the `ready:` line.
            .stdout(io::stderr())
            .spawn();
        child.map(Self).map_err(|e| format!("defmt-print: {e}; install it with `cargo install defmt-print`"))
    }

    /// Sends log bytes to the decoder.
    pub fn print(&mut self, bytes: &[u8]) -> io::Result<()> {
        match &mut self.0.stdin {
            Some(input) if !bytes.is_empty() => input.write_all(bytes),
            _ => Ok(()),
        }
    }
}

impl Drop for DefmtLog {
    fn drop(&mut self) {
        // The decoder exits when its input ends.
        drop(self.0.stdin.take());
        let _ = self.0.wait();
    }
}
