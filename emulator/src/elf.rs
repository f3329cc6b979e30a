//! The firmware's ELF file: what to load where, and its symbols.
use std::collections::BTreeMap;
use std::fmt;

use object::read::elf::{FileHeader, ProgramHeader};
use object::{Object, ObjectSymbol, SymbolKind};

/// Why an ELF file cannot be used.
#[derive(Debug)]
pub enum ElfError {
    /// It is none, or is damaged.
    Bad(object::Error),
    /// No symbol has this name.
    NoSymbol {
        /// The name asked for.
        name: String,
        /// Names that are near to it.
        near: Vec<String>,
    },
    /// More than one symbol has this part in its name.
    Ambiguous {
        /// The part asked for.
        name: String,
        /// The names that have it.
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

/// A symbol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Symbol {
    /// Address, for a function without the Thumb bit.
    pub address: u32,
    /// Bytes.
    pub size: u32,
    /// It is code.
    pub code: bool,
}

/// What is loaded from the file.
#[derive(Clone, Debug, Default)]
pub struct Elf {
    /// Load addresses and contents.
    pub segments: Vec<(u32, Vec<u8>)>,
    symbols: BTreeMap<String, Symbol>,
}

impl Elf {
    /// Parse a 32-bit little-endian ELF file.
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

    /// A firmware that is nothing but these bytes at an address.
    pub fn from_image(address: u32, bytes: Vec<u8>) -> Self {
        Self { segments: vec![(address, bytes)], symbols: BTreeMap::new() }
    }

    /// The same with one more symbol.
    pub fn with_symbol(mut self, name: &str, symbol: Symbol) -> Self {
        self.symbols.insert(name.to_owned(), symbol);
        self
    }

    /// A symbol by its full name, or by a part of it that no other symbol has. Rust names are written as in the source,
    /// without the hash.
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

    /// All symbols by name.
    pub fn symbols(&self) -> &BTreeMap<String, Symbol> {
        &self.symbols
    }

    /// Name of the function at an address.
    pub fn function_at(&self, address: u32) -> Option<&str> {
        let holds = |s: &Symbol| s.code && (s.address..s.address + s.size.max(2)).contains(&address);
        self.symbols.iter().find(|(_, s)| holds(s)).map(|(name, _)| name.as_str())
    }
}
