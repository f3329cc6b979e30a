//! Measurements of a board's program on the emulated chip: instruction counts, interrupt latencies and stack use.
//!
//! `cargo run --release --example figures -- ELF [--cycles]` prints identical lines on every computer. `--cycles` adds
//! an estimate of the clock cycles of one control step, computed by llvm-mca with its model of the Cortex-M7. The
//! estimate depends on the version of LLVM.
#[path = "figures/cycles.rs"]
mod cycles;
#[path = "../tests/rig/mod.rs"]
mod rig;
#[path = "figures/session.rs"]
mod session;

use std::error::Error;
use std::process::ExitCode;

use openjtc_emulator::clock::to_ns;
use openjtc_emulator::observe::Observers;
use openjtc_emulator::{BoardConfig, Elf, FIRST_LINE};
use rig::Rig;
use session::Session;

/// Interrupt handlers of the program, with their names and exception numbers.
const HANDLERS: [(&str, usize); 8] = [
    ("TIM7, the tick", FIRST_LINE + 55),
    ("TIM5, time of the links", FIRST_LINE + 50),
    ("USART2", FIRST_LINE + 38),
    ("USART3", FIRST_LINE + 39),
    ("DMA1 stream 0", FIRST_LINE + 11),
    ("DMA1 stream 1", FIRST_LINE + 12),
    ("DMA1 stream 2", FIRST_LINE + 13),
    ("DMA1 stream 3", FIRST_LINE + 14),
];

/// Largest number of instructions of a control step without a host event.
const STEP_MAX: u64 = 12_000;

/// Longest time from the tick's timer event to the first instruction of the tick, ns.
const LATENCY_MAX: u64 = 1_000;

/// Time during which the measurement checks after every instruction if interrupts are masked, ms.
const MASK_MS: u64 = 150;
/// Number of bytes of the stack memory that must remain unused.
const STACK_SPARE: u32 = 4_096;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("figures: {e}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let with_cycles = arguments.iter().any(|a| a == "--cycles");
    arguments.retain(|a| a != "--cycles");
    let [file] = &arguments[..] else { return Err("one ELF file is needed".into()) };
    let elf = Elf::parse(&std::fs::read(file).map_err(|e| format!("{file}: {e}"))?)?;
    let version = rig::version(&elf).ok_or("the file has no version record")?;
    let stack = stack(&elf)?;
    let rig = Rig::of(elf, &BoardConfig { baud: version.baud, ..Default::default() });
    let mut session = Session::new(rig)?;
    session.run();

    println!("  control step, instructions:");
    for (state, status, steps) in session.steps() {
        let and = if status { " and a status" } else { "" };
        println!("    {state}{and}: {} to {} in {} steps", steps.min, steps.max, steps.count);
        if steps.max > STEP_MAX {
            return Err(
                format!("a control step has {} instructions, {STEP_MAX} are allowed", steps.max).into()
            );
        }
    }
    let path = session.on_path();
    println!("    Operate, on the path at full speed: {} to {} in {} steps", path.min, path.max, path.count);
    println!("  control step that works at what a host sent, instructions:");
    for (name, state, steps) in session.serving() {
        println!("    {name} in {state}: {} to {} in {} steps", steps.min, steps.max, steps.count);
    }
    let recorded = session.recorded();
    println!(
        "  flight recorder, behind each control step, instructions: {} to {}, {} in the mean of {}",
        recorded.min,
        recorded.max,
        recorded.mean(),
        recorded.count
    );
    let mask = session.longest_mask(MASK_MS);
    let mut machine = session.into_machine();
    let observers = &machine.chip().observers;
    println!("  with a host at {} Bd on each line, the arm moving:", version.baud);
    handlers(observers)?;
    // Only code that masks interrupts can delay the tick. The emulator counts one clock cycle of the core for each
    // instruction.
    let late = mask * 1_000_000_000 / u64::from(version.core_hz);
    println!("    interrupts are masked for at most {mask} instructions = {late} ns");
    if late > LATENCY_MAX {
        return Err(format!("the tick may begin {late} ns late, {LATENCY_MAX} ns are allowed").into());
    }
    stacks(observers, stack)?;
    if with_cycles {
        cycles::print(file, &version)?;
    }
    Ok(())
}

/// Returns the first address above the stack, and the lowest address of the stack.
fn stack(elf: &Elf) -> Result<(u32, u32), Box<dyn Error>> {
    let word = elf.segments.iter().find(|(at, _)| *at == 0x0800_0000).ok_or("no vector table")?;
    let top = u32::from_le_bytes(word.1[..4].try_into()?);
    // The lowest address of the stack is the start of the tightly coupled memory.
    Ok((top, 0x2000_0000))
}

/// Prints the instruction count and the latency of each handler. The count does not include the instructions of other
/// handlers that interrupt the handler. Returns an error if the tick begins too late.
fn handlers(observers: &Observers) -> Result<(), Box<dyn Error>> {
    for (name, number) in HANDLERS {
        let (count, latency) = (observers.handlers[number], observers.latencies[number]);
        if count.calls > 0 {
            println!(
                "    {name}: {} to {} instructions, begins at most {} ns late",
                count.min,
                count.max,
                to_ns(latency.worst)
            );
        }
    }
    let tick = to_ns(observers.latencies[HANDLERS[0].1].worst);
    if tick > LATENCY_MAX {
        return Err(format!("the tick begins {tick} ns late, {LATENCY_MAX} ns are allowed").into());
    }
    Ok(())
}

/// Prints the stack use of each context (main program and handlers), including the exception frames, and the sum. The
/// sum is the worst case, because a handler of a higher priority can interrupt each context.
fn stacks(observers: &Observers, (top, bottom): (u32, u32)) -> Result<(), Box<dyn Error>> {
    let size = top - bottom;
    let mut sum = top - observers.lowest_sp[0];
    println!("  stack, bytes:");
    println!("    start and links: {sum}");
    for (name, number) in HANDLERS {
        if observers.handlers[number].calls > 0 {
            println!("    {name}: {}", observers.deepest[number]);
            sum += observers.deepest[number];
        }
    }
    println!("    all at once: {sum} of {size}");
    if sum + STACK_SPARE > size {
        return Err(format!("the stack has {size} bytes, {STACK_SPARE} of which should be spare").into());
    }
    Ok(())
}
