//! Tests of the panic check with small programs in machine code. The tests put these programs into ELF files.
use object::write::{Object, SectionId, Symbol, SymbolSection};
use object::{Architecture, BinaryFormat, Endianness, SectionKind, SymbolFlags, SymbolKind, SymbolScope};

use super::*;

const NOP: u16 = 0xBF00;
const RETURN: u16 = 0x4770;
const PANIC: &str = "_ZN4core9panicking9panic_fmt17h0123456789abcdefE";

fn add(file: &mut Object<'_>, section: SectionId, name: &str, kind: SymbolKind, value: u64, size: u64) {
    file.add_symbol(Symbol {
        name: name.into(),
        value,
        size,
        kind,
        scope: SymbolScope::Compilation,
        weak: false,
        section: SymbolSection::Section(section),
        flags: SymbolFlags::None,
    });
}

/// Returns a program of consecutive functions, each at the next address that is a multiple of 4.
fn program(parts: &[(&str, &[u16])]) -> Vec<u8> {
    let mut file = Object::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little);
    let section = file.add_section(Vec::new(), b".text".to_vec(), SectionKind::Text);
    for (name, code) in parts {
        let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
        let offset = file.append_section_data(section, &bytes, 4);
        add(&mut file, section, "$t", SymbolKind::Label, offset, 0);
        add(&mut file, section, name, SymbolKind::Text, offset | 1, bytes.len() as u64);
    }
    file.write().unwrap()
}

fn check(parts: &[(&str, &[u16])]) -> Report {
    reachable_panics(&program(parts), &["tick"]).unwrap()
}

/// Returns the code of a BL instruction from `at` to `to`, for short distances forward.
fn call(at: u32, to: u32) -> [u16; 2] {
    [0xF000, 0xF800 | ((to - at - 4) >> 1) as u16]
}

#[test]
fn a_panic_behind_two_calls_is_found_with_its_way() {
    let [a, b] = call(0, 4);
    // The last instruction of `helper` is a conditional jump (BNE.W to 12).
    let report = check(&[("tick", &[a, b]), ("helper", &[0xF040, 0x8002, RETURN, NOP]), (PANIC, &[0xE7FE])]);
    assert_eq!(report.paths, ["tick (0x0) > helper (0x4) > core::panicking::panic_fmt"]);
    assert_eq!((report.functions, report.indirect.len()), (2, 0));
}

#[test]
fn a_short_branch_that_leaves_its_function_counts() {
    // The first instruction of `tick` is CBZ r0 from address 0 to address 4.
    let report = check(&[("tick", &[0xB100, RETURN]), (PANIC, &[0xE7FE])]);
    assert_eq!(report.paths, ["tick (0x0) > core::panicking::panic_fmt"]);
}

#[test]
fn what_is_not_called_does_not_count() {
    let [a, b] = call(0, 8);
    let parts: [(&str, &[u16]); 4] = [
        ("tick", &[a, b, RETURN, NOP]),
        ("helper", &[RETURN, NOP]),
        ("other", &call(12, 16)),
        (PANIC, &[0xE7FE]),
    ];
    let report = check(&parts);
    assert!(report.paths.is_empty(), "{report}");
    assert_eq!((report.functions, report.instructions), (2, 5));
}

/// Returns the report for a program with two functions. `tick` is at addresses 0 to 8, and contains a return followed
/// by two halfwords of data or code. The panicking function is at address 8.
fn behind_return(kind: &str, halves: [u16; 2]) -> Report {
    let mut file = Object::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little);
    let section = file.add_section(Vec::new(), b".text".to_vec(), SectionKind::Text);
    let code = [RETURN, NOP, halves[0], halves[1], 0xE7FE];
    let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
    file.append_section_data(section, &bytes, 4);
    let marks = [("$t", 0), (kind, 4), ("$t", 8)].map(|(name, at)| (name, SymbolKind::Label, at, 0));
    for (name, kind, value, size) in
        marks.into_iter().chain([("tick", SymbolKind::Text, 1, 8), (PANIC, SymbolKind::Text, 9, 2)])
    {
        add(&mut file, section, name, kind, value, size);
    }
    reachable_panics(&file.write().unwrap(), &["tick"]).unwrap()
}

#[test]
fn data_between_code_is_no_code() {
    assert_eq!(behind_return("$t", call(4, 8)).paths.len(), 1);
    assert!(behind_return("$d", call(4, 8)).paths.is_empty());
    // The check treats the address of a function in the data as a call of this function.
    assert_eq!(behind_return("$d", [9, 0]).paths, ["tick (0x4) > core::panicking::panic_fmt"]);
}

#[test]
fn a_function_whose_address_is_formed_counts_as_called() {
    // The instructions MOVW r0, #9 and MOVT r0, #0 load the Thumb address of the panicking function at 8.
    let report = check(&[("tick", &[0xF240, 0x0009, 0xF2C0, 0x0000]), (PANIC, &[0xE7FE])]);
    assert_eq!(report.paths, ["tick (0x4) > core::panicking::panic_fmt"]);
}

#[test]
fn calls_through_a_register_are_listed_and_bridges_are_crossed() {
    // The first instruction is BLX r3, whose target is unknown.
    let report = check(&[("tick", &[0x4798, RETURN]), (PANIC, &[0xE7FE])]);
    assert_eq!(report.indirect, ["tick at 0x0"]);
    // The instructions MOVW r12, #13, MOVT r12, #0 and BX r12 jump to the panicking function at 12.
    let report = check(&[("tick", &[0xF240, 0x0C0D, 0xF2C0, 0x0C00, 0x4760, NOP]), (PANIC, &[0xE7FE])]);
    assert!(report.indirect.is_empty() && !report.paths.is_empty(), "{report}");
}

#[test]
fn a_trap_counts_unless_it_stands_behind_a_call_that_does_not_return() {
    assert_eq!(check(&[("tick", &[0xDEFE, NOP])]).paths, ["tick (0x0) > trap"]);
    let [a, b] = call(0, 8);
    let report = check(&[("tick", &[a, b, 0xDEFE, NOP]), ("abort", &[0xE7FE, NOP])]);
    assert!(report.paths.is_empty(), "{report}");
}

#[test]
fn a_missing_root_is_an_error() {
    let error = reachable_panics(&program(&[("tick", &[RETURN])]), &["TIM7"]).unwrap_err();
    assert!(error.to_string().contains("`TIM7`"), "{error}");
}
