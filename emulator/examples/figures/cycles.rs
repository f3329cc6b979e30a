//! Clock cycles of one control step, and of the flight recorder after the step. llvm-mca estimates the cycles from the
//! sequence of executed instructions, with its model of the core.
use std::collections::BTreeMap;
use std::error::Error;
use std::io::Write;
use std::process::{Command, Stdio};

use jtc_core::ControllerState;
use openjtc_emulator::{BoardConfig, Elf, Machine, RegisterARM};

use crate::rig::{Rig, Version};
use crate::session::Session;

/// Measured functions: name in the output, symbol, and maximum number of clock cycles.
const PARTS: [(&str, &str, u64); 2] = [
    ("control step in Operate", "control_step", 12_000),
    ("tick of the flight recorder", "record_step", 500),
];

/// Measures a control step in Operate and prints the result.
pub fn print(path: &str, version: &Version) -> Result<(), Box<dyn Error>> {
    let elf = Elf::parse(&std::fs::read(path)?)?;
    let rig = Rig::of(elf, &BoardConfig { baud: version.baud, ..Default::default() });
    let mut session = Session::new(rig)?;
    session.hold();
    session.execute();
    session.run_ms(700);
    assert_eq!(session.rig.state(), ControllerState::Operate);
    let text = disassembly(path)?;
    for (name, symbol, aim) in PARTS {
        let lines = straight(&trace(&mut session.rig, symbol)?, &text)?;
        let cycles = simulate(&lines.join("\n"))?;
        println!(
            "  one {name}: {} instructions, {cycles} cycles = {:.1} µs by llvm-mca; the aim is {aim}",
            lines.len(),
            cycles as f64 * 1e6 / f64::from(version.core_hz)
        );
    }
    Ok(())
}

/// Runs the machine until the tick calls the function, and returns the addresses of the instructions that this call
/// executes.
fn trace(rig: &mut Rig, symbol: &str) -> Result<Vec<u32>, Box<dyn Error>> {
    let entry = rig.board.machine.elf().symbol(symbol)?.address;
    let flight = rig.board.machine.elf().symbol("FLIGHT")?.address;
    let machine = &mut rig.board.machine;
    let cycle = machine.chip().cycle();
    let steps = |machine: &mut Machine, n: u64| {
        let until = machine.now() + n * cycle;
        machine.run_until(until);
    };
    // The tick sets the phase of the flight record to 1 (inputs recorded) shortly before it calls the measured
    // function.
    let phase = |machine: &Machine| machine.word(flight + 8);
    while phase(machine) != Some(1) {
        steps(machine, 10);
    }
    while machine.pc() & !1 != entry {
        steps(machine, 1);
        if phase(machine) != Some(1) {
            return Err(format!("{symbol} was missed").into());
        }
    }
    let back = machine.register(RegisterARM::LR) & !1;
    let mut addresses = Vec::new();
    while machine.pc() & !1 != back {
        addresses.push(machine.pc() & !1);
        steps(machine, 1);
        if addresses.len() > 100_000 {
            return Err(format!("{symbol} does not return").into());
        }
    }
    Ok(addresses)
}

/// Returns the text of each instruction, by address.
fn disassembly(path: &str) -> Result<BTreeMap<u32, String>, Box<dyn Error>> {
    let mut objdump = tool("llvm-objdump")?;
    let out = objdump.args(["-d", "--no-show-raw-insn", "--mcpu=cortex-m7", path]).output()?;
    let text = String::from_utf8(out.stdout)?;
    let mut lines = BTreeMap::new();
    for line in text.lines() {
        let Some((address, instruction)) = line.split_once(':') else { continue };
        let Ok(address) = u32::from_str_radix(address.trim(), 16) else { continue };
        let code = instruction.split(['@', '<']).next().unwrap_or_default();
        lines.insert(address, code.trim().replace('\t', " "));
    }
    Ok(lines)
}

/// Returns the executed instructions in order, as assembler input for llvm-mca. Each jump becomes a branch to a
/// nearby address. The machine executes an IT block in one step, but the result contains all instructions of the
/// block, because the hardware fetches all of them.
fn straight(trace: &[u32], text: &BTreeMap<u32, String>) -> Result<Vec<String>, String> {
    let mut lines = Vec::new();
    for at in trace {
        let mut following = text.range(at..).map(|(_, code)| code);
        let code = following.next().filter(|_| text.contains_key(at));
        let code = code.ok_or_else(|| format!("no instruction at {at:#010x}"))?;
        let name = code.split(' ').next().unwrap_or_default();
        if name.starts_with("it") {
            // The model of llvm-mca does not contain IT, so the code omits it. The core executes IT together with the
            // next instruction.
            lines.extend(following.take(name.len() - 1).map(|code| unconditional(code)));
        } else {
            lines.push(without_target(code));
        }
    }
    Ok(lines)
}

/// Replaces the target of a branch by a nearby address. A call becomes a branch, because llvm-mca does not model calls:
/// according to its documentation, llvm-mca assumes 100 cycles for each call.
fn without_target(code: &str) -> String {
    let (name, operands) = code.split_once(' ').unwrap_or((code, ""));
    let name = match name {
        "bl" => "b",
        "blx" => return format!("bx {operands}"),
        name => name,
    };
    if name.starts_with("cb") {
        let register = operands.split(',').next().unwrap_or_default();
        return format!("{name} {register}, #4");
    }
    // The model of llvm-mca does not contain the floating-point comparison with zero. The code replaces it by a
    // comparison of two registers, which takes equally long.
    if let Some(register) = operands.strip_suffix(", #0").filter(|_| name.starts_with("vcmp")) {
        return format!("{name} {register}, {}", register.trim());
    }
    if name.starts_with('b') && operands.trim().starts_with("0x") {
        format!("{name} #4")
    } else {
        code.to_owned()
    }
}

/// Removes the condition from an instruction of an IT block.
fn unconditional(code: &str) -> String {
    const CONDITIONS: [&str; 14] =
        ["eq", "ne", "hs", "lo", "mi", "pl", "vs", "vc", "hi", "ls", "ge", "lt", "gt", "le"];
    let (name, operands) = code.split_once(' ').unwrap_or((code, ""));
    let (name, width) = name.find('.').map_or((name, ""), |dot| name.split_at(dot));
    let plain = CONDITIONS.iter().find_map(|condition| name.strip_suffix(condition)).unwrap_or(name);
    without_target(&format!("{plain}{width} {operands}"))
}

/// Returns the number of clock cycles that llvm-mca estimates for executing these instructions once.
fn simulate(assembly: &str) -> Result<u64, Box<dyn Error>> {
    let mut mca = tool("llvm-mca")?;
    mca.args(["-mtriple=thumbv7em-none-eabihf", "-mcpu=cortex-m7", "-iterations=1"]);
    let mut child = mca.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
    let mut stdin = child.stdin.take().ok_or("stdin")?;
    let text = format!("{assembly}\n");
    let writer = std::thread::spawn(move || stdin.write_all(text.as_bytes()));
    let out = child.wait_with_output()?;
    writer.join().map_err(|_| "writing to llvm-mca")??;
    let text = String::from_utf8(out.stdout)?;
    let cycles = text.lines().find_map(|line| line.strip_prefix("Total Cycles:"));
    match cycles.and_then(|n| n.trim().parse().ok()) {
        Some(n) => Ok(n),
        None => Err(format!("llvm-mca: {}", String::from_utf8_lossy(&out.stderr)).into()),
    }
}

/// Finds an LLVM program whose name may end with a version number.
fn tool(name: &str) -> Result<Command, Box<dyn Error>> {
    let versions = (14..=22).rev().map(|version| format!("{name}-{version}"));
    for program in std::iter::once(name.to_owned()).chain(versions) {
        let works =
            Command::new(&program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        if works.is_ok_and(|status| status.success()) {
            return Ok(Command::new(program));
        }
    }
    Err(format!("{name} is not installed; in Debian it is in the package llvm").into())
}
