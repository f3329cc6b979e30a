//! The firmware's defmt log in plain words.
use std::error::Error;

use defmt_decoder::{DecodeError, StreamDecoder, Table};

/// Decodes and prints.
pub struct DefmtLog {
    decoder: Box<dyn StreamDecoder>,
}

impl DefmtLog {
    /// For the firmware with this ELF file.
    pub fn new(elf: &[u8]) -> Result<Self, Box<dyn Error>> {
        let table = Table::parse(elf)?.ok_or("the firmware has no defmt log")?;
        // It is needed to the end of the process.
        let table: &'static Table = Box::leak(Box::new(table));
        Ok(Self { decoder: table.new_stream_decoder() })
    }

    /// Print the lines that are complete.
    pub fn print(&mut self, ms: u64, bytes: &[u8]) -> Result<(), Box<dyn Error>> {
        if bytes.is_empty() {
            return Ok(());
        }
        self.decoder.received(bytes);
        loop {
            match self.decoder.decode() {
                Ok(frame) => eprintln!("{ms} ms: {}", frame.display(false)),
                Err(DecodeError::UnexpectedEof) => return Ok(()),
                Err(DecodeError::Malformed) => eprintln!("{ms} ms: (a piece of the log was lost)"),
            }
        }
    }
}
