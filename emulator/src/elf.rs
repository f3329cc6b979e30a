//! The ELF file of the firmware, with its symbols and the load addresses of its segments.
use std::collections::BTreeMap;
use std::fmt;

use object::read::elf::{FileHeader, ProgramHeader};
use object::{Object, ObjectSymbol, SymbolKind};

/// Reason why the emulator cannot use an ELF file.
#[derive(Debug)]
pub enum ElfError {
    /// The file is not an ELF file, or is damaged.
    Bad(object::Error),
    /// No symbol has this name.
    NoSymbol {
        /// Name of the requested symbol.
        name: String,
        /// Names of symbols that are similar to the requested name.
        near: Vec<String>,
    },
    /// The names of several symbols contain the requested text.
    Ambiguous {
        /// Text that the caller searched for.
        name: String,
        /// Names of the symbols that contain the requested text.
        found: Vec<String>,
    },
}

impl fmt::Display for ElfError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bad(e) => write!(f, "no usable ELF file: {e}"),
            Self::NoSymbol { name, near } => {
                write!(f, "the firmware has no symbol `{name}`; near it: {}", near.join(", "))
            }
            Self::Ambiguous { name, found } => {
                write!(f, "`{name}` is part of several symbols: {}", found.join(", "))
            }
        }
    }
}

impl std::error::Error for ElfError {}

impl From<object::Error> for ElfError {
    fn from(e: object::Error) -> Self {
        Self::Bad(e)
    }
}

/// A symbol of the ELF file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Symbol {
    /// Address of the symbol; the address of a function is without the Thumb bit.
    pub address: u32,
    /// Size of the symbol in bytes.
    pub size: u32,
    /// `true` if the symbol is code.
    pub code: bool,
}

/// The parts of the ELF file that are loaded into memory.
#[derive(Clone, Debug, Default)]
pub struct Elf {
    /// Load address and contents of each segment.
    pub segments: Vec<(u32, Vec<u8>)>,
    symbols: BTreeMap<String, Symbol>,
}

impl Elf {
    /// Parses a 32-bit little-endian ELF file.
    pub fn parse(bytes: &[u8]) -> Result<Self, ElfError> {
        let header = object::elf::FileHeader32::<object::Endianness>::parse(bytes)?;
        let endian = header.endian()?;
        let mut elf = Self::default();
        for segment in header.program_headers(endian, bytes)? {
            let data = segment.data(endian, bytes).unwrap_or(&[]);
            if segment.p_type(endian) == object::elf::PT_LOAD && !data.is_empty() {
                elf.segments.push((segment.p_paddr(endian), data.to_vec()));
            }
        }
        let file = object::File::parse(bytes)?;
        for symbol in file.symbols().filter(|s| s.is_definition()) {
            let code = symbol.kind() == SymbolKind::Text;
            if !code && symbol.kind() != SymbolKind::Data && symbol.kind() != SymbolKind::Unknown {
                continue;
            }
            let Ok(name) = symbol.name() else { continue };
            let address = symbol.address() as u32;
            let address = if code { address & !1 } else { address };
            let size = symbol.size() as u32;
            let name = format!("{:#}", rustc_demangle::demangle(name));
            elf.symbols.insert(name, Symbol { address, size, code });
        }
        Ok(elf)
    }

    /// Creates a firmware that contains only these bytes at this address.
    pub fn from_image(address: u32, bytes: Vec<u8>) -> Self {
        Self { segments: vec![(address, bytes)], symbols: BTreeMap::new() }
    }

    /// Adds a symbol to the firmware.
    pub fn with_symbol(mut self, name: &str, symbol: Symbol) -> Self {
        self.symbols.insert(name.to_owned(), symbol);
        self
    }

    /// Finds a symbol by its full name, or by a part of the name that no other symbol contains. Rust names have the
    /// same spelling as in the source, without the hash.
    pub fn symbol(&self, name: &str) -> Result<Symbol, ElfError> {
        if let Some(symbol) = self.symbols.get(name) {
            return Ok(*symbol);
        }
        let found: Vec<_> = self.symbols.iter().filter(|(n, _)| n.contains(name)).collect();
        match found[..] {
            [(_, symbol)] => Ok(*symbol),
            [] => {
                let tail = name.rsplit("::").next().unwrap_or(name);
                let near = self.symbols.keys().filter(|n| n.contains(tail)).take(8).cloned().collect();
                Err(ElfError::NoSymbol { name: name.to_owned(), near })
            }
            _ => Err(ElfError::Ambiguous {
                name: name.to_owned(),
                found: found.into_iter().take(12).map(|(n, _)| n.clone()).collect(),
            }),
        }
    }

    /// Returns all symbols of the firmware by name.
    pub fn symbols(&self) -> &BTreeMap<String, Symbol> {
        &self.symbols
    }

    /// Returns the name of the function at an address.
    pub fn function_at(&self, address: u32) -> Option<&str> {
        let holds = |s: &Symbol| s.code && (s.address..s.address + s.size.max(2)).contains(&address);
        self.symbols.iter().find(|(_, s)| holds(s)).map(|(name, _)| name.as_str())
    }
}
