//! Checks that the control tick cannot reach a panic. The check follows the calls of the linked program.
//!
//! The check reads the ELF and not the source, because only the compiled code runs on the board. From each root function, the check
//! follows every branch that leaves the function. If the code computes the address of a function, the check assumes that the code calls
//! this function. The check lists calls through a register, because it does not know the targets of these calls.

mod thumb;

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::fmt;
use std::ops::Range;

use anyhow::{Context, Result, ensure};
use object::{Object, ObjectSection, ObjectSymbol, SectionKind, SymbolKind};

use thumb::Flow;

/// Name parts that identify functions that panic.
const PANICS: [&str; 8] = [
    "panicking",
    "panic_",
    "rust_begin_unwind",
    "unwrap_failed",
    "expect_failed",
    "index_fail",
    "error_fail",
    "len_mismatch_fail",
];

/// Result of the search that starts at the root functions.
#[derive(Debug)]
pub(crate) struct Report {
    /// Number of functions that the search has reached, including the root functions.
    pub functions: usize,
    /// Number of instructions in the reached functions.
    pub instructions: usize,
    /// Calls and jumps through a register, each with the name of the function and the address.
    pub indirect: Vec<String>,
    /// Call path to each instruction that panics or traps. A call path lists the names of functions, each with the address of the
    /// branch that leaves the function. The instruction is the last element of the call path.
    pub paths: Vec<String>,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} functions of {} instructions can be reached; {} ways to a panic, {} indirect calls",
            self.functions,
            self.instructions,
            self.paths.len(),
            self.indirect.len()
        )?;
        for path in &self.paths {
            write!(f, "\n  panic: {path}")?;
        }
        for site in &self.indirect {
            write!(f, "\n  indirect call: {site}")?;
        }
        Ok(())
    }
}

/// Returns the call paths from `roots` to a panic in a program for ARMv7-M. `roots` contains names of functions, as linked
/// or as in the source.
///
/// The program must have its symbol table. `llvm-addr2line -i -e ELF ADDRESS` prints the source line of an address.
pub(crate) fn reachable_panics(elf: &[u8], roots: &[&str]) -> Result<Report> {
    let program = Program::read(elf)?;
    // Functions that the search has reached, each with the calling function and the address of the branch.
    let mut from: BTreeMap<u32, Option<(u32, u32)>> = BTreeMap::new();
    let mut queue = VecDeque::new();
    for root in roots {
        let start = program.find(root).with_context(|| format!("the program has no function `{root}`"))?;
        from.insert(start, None);
        queue.push_back(start);
    }
    let mut report = Report { functions: 0, instructions: 0, indirect: Vec::new(), paths: Vec::new() };
    while let Some(start) = queue.pop_front() {
        let function = &program.functions[&start];
        let here = |address: u32| format!("{} ({address:#x})", way(&program, &from, start));
        report.functions += 1;
        let mut edges = Vec::new();
        program.scan(start, function, &mut report.instructions, |address, end| match end {
            End::Indirect => report.indirect.push(format!("{} at {address:#x}", function.name)),
            End::Trap => report.paths.push(format!("{} > trap", here(address))),
            End::Function(to) if program.functions[&to].panics => {
                report.paths.push(format!("{} > {}", here(address), program.functions[&to].name));
            }
            End::Function(to) => edges.push((to, address)),
            End::Nowhere(to) => report
                .indirect
                .push(format!("{} at {address:#x}, to {to:#x} outside the code", function.name)),
        });
        for (to, address) in edges {
            from.entry(to).or_insert_with(|| {
                queue.push_back(to);
                Some((start, address))
            });
        }
    }
    Ok(report)
}

/// Returns the chain of calls that leads to a function, as text.
fn way(program: &Program<'_>, from: &BTreeMap<u32, Option<(u32, u32)>>, at: u32) -> String {
    let name = &program.functions[&at].name;
    match from.get(&at) {
        Some(Some((caller, address))) => format!("{} ({address:#x}) > {name}", way(program, from, *caller)),
        _ => name.clone(),
    }
}

/// Target of an instruction that leaves a function.
enum End {
    Function(u32),
    /// Address that is outside of all functions.
    Nowhere(u32),
    Indirect,
    Trap,
}

struct Function {
    name: String,
    panics: bool,
    end: u32,
    /// Index of the section that contains the function.
    section: usize,
}

struct Program<'a> {
    /// Functions of the program by first address.
    functions: BTreeMap<u32, Function>,
    /// Executable sections of the program, each with first address and bytes.
    sections: Vec<(u32, &'a [u8])>,
    /// Addresses at which data in the code begins (`true`) and at which code continues (`false`).
    data: BTreeMap<u32, bool>,
}

impl<'a> Program<'a> {
    fn read(elf: &'a [u8]) -> Result<Self> {
        let file = object::File::parse(elf)?;
        ensure!(file.architecture() == object::Architecture::Arm, "a program for ARMv7-M is expected");
        let mut program = Program { functions: BTreeMap::new(), sections: Vec::new(), data: BTreeMap::new() };
        let mut places = HashMap::new();
        for section in file.sections().filter(|section| section.kind() == SectionKind::Text) {
            places.insert(section.index(), program.sections.len());
            program.sections.push((section.address() as u32, section.data()?));
        }
        for symbol in file.symbols() {
            let Some(&section) = symbol.section_index().and_then(|index| places.get(&index)) else {
                continue;
            };
            let (name, address) = (symbol.name()?, symbol.address() as u32);
            if let Some(kind) = name.strip_prefix('$') {
                program.data.insert(address, kind.starts_with('d'));
            } else if symbol.kind() == SymbolKind::Text {
                // The lowest bit marks Thumb code and is not part of the address.
                let (start, end) = (address & !1, (address & !1) + symbol.size() as u32);
                let name = format!("{:#}", rustc_demangle::demangle(name));
                let panics = PANICS.iter().any(|part| name.contains(part));
                let function = program.functions.entry(start).or_insert(Function {
                    name: name.clone(),
                    panics,
                    end,
                    section,
                });
                function.end = function.end.max(end);
                // The linker merges equal functions into one function with several names. If one of the names belongs
                // to a function that panics, the code keeps this name.
                if panics && !function.panics {
                    (function.name, function.panics) = (name, true);
                }
            }
        }
        ensure!(!program.functions.is_empty(), "the program has no symbols of functions");
        // Functions in assembly have no size, so the check assumes that they extend to the next function.
        let starts: Vec<u32> = program.functions.keys().copied().collect();
        for (start, next) in starts.iter().zip(starts.iter().skip(1).map(Some).chain([None])) {
            let Some(function) = program.functions.get_mut(start) else { continue };
            if function.end == *start {
                let (base, bytes) = program.sections[function.section];
                let limit = base + bytes.len() as u32;
                function.end = next.map_or(limit, |next| (*next).min(limit));
            }
        }
        Ok(program)
    }

    fn find(&self, root: &str) -> Option<u32> {
        let suffix = format!("::{root}");
        let named = |function: &Function| function.name == root || function.name.ends_with(&suffix);
        self.functions.iter().find(|(_, function)| named(function)).map(|(start, _)| *start)
    }

    /// Returns the function that contains `address`, because a branch may lead into the middle of a function.
    fn function_at(&self, address: u32) -> Option<u32> {
        let (start, function) = self.functions.range(..=address).next_back()?;
        (address < function.end).then_some(*start)
    }

    fn halfword(&self, section: usize, address: u32) -> Option<u16> {
        let (base, bytes) = self.sections[section];
        let at = address.checked_sub(base)? as usize;
        bytes.get(at..at + 2).map(|b| u16::from_le_bytes([b[0], b[1]]))
    }

    /// Returns the pieces of a function. The flag of a piece is `true` if the piece contains data.
    fn pieces(&self, function: &Range<u32>) -> Vec<(Range<u32>, bool)> {
        let mut is_data = self.data.range(..=function.start).next_back().is_some_and(|(_, data)| *data);
        let mut at = function.start;
        let mut pieces = Vec::new();
        for (next, data) in self.data.range(function.start + 1..function.end) {
            pieces.push((at..*next, is_data));
            (at, is_data) = (*next, *data);
        }
        pieces.push((at..function.end, is_data));
        pieces
    }

    /// Calls `found` for each instruction through which the execution may leave the function, and for each address of
    /// a function that the code contains.
    fn scan(&self, start: u32, function: &Function, count: &mut usize, mut found: impl FnMut(u32, End)) {
        let whole = start..function.end;
        let mut halves = [None; 16];
        for (piece, is_data) in self.pieces(&whole) {
            let mut after_call = false;
            let mut address = piece.start;
            while address < piece.end {
                let Some(first) = self.halfword(function.section, address) else { break };
                let second = self.halfword(function.section, address + 2).unwrap_or(0);
                if is_data {
                    // Data in the code may contain the address of a function. In such an address, the lowest bit is
                    // set (Thumb).
                    let word = u32::from(second) << 16 | u32::from(first);
                    if address.is_multiple_of(4) && word & 1 == 1 && self.functions.contains_key(&(word & !1))
                    {
                        found(address, End::Function(word & !1));
                    }
                    address += 2;
                    continue;
                }
                *count += 1;
                let flow = thumb::flow(address, first, second);
                let mut call = false;
                match flow {
                    Flow::Direct(to) if whole.contains(&to) => {}
                    Flow::Direct(to) => {
                        call = true;
                        found(address, self.function_at(to).map_or(End::Nowhere(to), End::Function));
                    }
                    // For long distances, the linker loads a constant address into a register and jumps to it.
                    Flow::Indirect(register) => match halves[usize::from(register)] {
                        Some((at, to)) if at + 4 == address => {
                            found(address, self.function_at(to & !1).map_or(End::Nowhere(to), End::Function));
                        }
                        _ => found(address, End::Indirect),
                    },
                    Flow::Low(register, low) => {
                        halves[usize::from(register)] = Some((address, u32::from(low)))
                    }
                    Flow::High(register, high) => {
                        if let Some((at, value)) = &mut halves[usize::from(register)] {
                            *at = address;
                            *value = *value & 0xFFFF | u32::from(high) << 16;
                            if *value & 1 == 1 && self.functions.contains_key(&(*value & !1)) {
                                found(address, End::Function(*value & !1));
                            }
                        }
                    }
                    // The compiler puts a trap after a call that does not return. The processor never executes this
                    // trap.
                    Flow::Trap if !after_call => found(address, End::Trap),
                    Flow::Trap | Flow::Other => {}
                }
                after_call = call;
                address += thumb::len(first);
            }
        }
    }
}

#[cfg(test)]
mod tests;
