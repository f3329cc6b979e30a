//! Measurements of the running firmware: instruction counts of functions and handlers, interrupt latencies, stack
//! pointers, resets and faults.
use crate::clock::Time;
use crate::nvic::EXCEPTIONS;

/// Instruction counts of a function or a handler, without the instructions of exceptions that interrupted it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Number of calls that have returned.
    pub calls: u64,
    /// Smallest number of instructions in a call.
    pub min: u64,
    /// Largest number of instructions in a call.
    pub max: u64,
    /// Number of instructions in the last call.
    pub last: u64,
    /// Number of instructions in all calls.
    pub total: u64,
}

impl Count {
    fn add(&mut self, n: u64) {
        self.min = if self.calls == 0 { n } else { self.min.min(n) };
        self.max = self.max.max(n);
        self.last = n;
        self.total += n;
        self.calls += 1;
    }
}

/// Interrupt latency: time from the moment at which an exception becomes pending to the first instruction of its
/// handler.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Latency {
    /// Number of entries into the handler.
    pub entries: u64,
    /// Longest latency.
    pub worst: Time,
    /// Time at which the longest latency occurred.
    pub at: Time,
    /// Latency of the last entry.
    pub last: Time,
}

/// Cause of a reset of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// The power was switched on.
    PowerOn,
    /// The reset pin was pulled low.
    Pin,
    /// The program set AIRCR.SYSRESETREQ.
    Software,
    /// The independent watchdog reset the machine.
    Watchdog,
}

/// A reset of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reset {
    /// Time of the reset.
    pub time: Time,
    /// Cause of the reset.
    pub cause: ResetCause,
    /// Address of the last instruction before the reset.
    pub pc: u32,
}

/// Kind of a fault of the core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// Load or store at an unmapped or forbidden address.
    BadAccess,
    /// Jump to an unmapped address.
    BadJump,
    /// Instruction that does not exist.
    Undefined,
    /// BKPT instruction without a debugger.
    Breakpoint,
    /// Invalid exception return.
    BadReturn,
}

/// A fault of the core, after which the core enters HardFault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Time of the fault.
    pub time: Time,
    /// Kind of the fault.
    pub kind: FaultKind,
    /// Address of the instruction that caused the fault.
    pub pc: u32,
    /// Address of the access that failed.
    pub address: u32,
    /// `true` if the fault occurred in HardFault or NMI, so that the core is in lock-up until a reset.
    pub lockup: bool,
}

struct Call {
    probe: usize,
    depth: usize,
    sp: u32,
    back: u32,
    start: u64,
    excluded: u64,
}

struct Probe {
    entry: u32,
    count: Count,
}

struct Running {
    exception: usize,
    start: u64,
    excluded: u64,
    /// Stack pointer at the beginning of the exception.
    base: Option<u32>,
}

/// All observers of the machine.
pub struct Observers {
    probes: Vec<Probe>,
    calls: Vec<Call>,
    running: Vec<Running>,
    /// Instruction counts of the handlers, by exception number.
    pub handlers: Vec<Count>,
    /// Interrupt latencies, by exception number.
    pub latencies: Vec<Latency>,
    /// Lowest stack pointer during each exception, by exception number. Entry 0 is for code outside of exceptions.
    pub lowest_sp: Vec<u32>,
    /// Largest stack use of one execution of each exception, by exception number, bytes. The value includes the
    /// frames of exceptions that interrupted the handler. Entry 0 is not used.
    pub deepest: Vec<u32>,
    /// Resets of the machine, oldest first.
    pub resets: Vec<Reset>,
    /// Faults of the core, oldest first.
    pub faults: Vec<Fault>,
}

impl Default for Observers {
    fn default() -> Self {
        Self {
            probes: Vec::new(),
            calls: Vec::new(),
            running: Vec::new(),
            handlers: vec![Count::default(); EXCEPTIONS],
            latencies: vec![Latency::default(); EXCEPTIONS],
            lowest_sp: vec![u32::MAX; EXCEPTIONS],
            deepest: vec![0; EXCEPTIONS],
            resets: Vec::new(),
            faults: Vec::new(),
        }
    }
}

impl Observers {
    /// Starts counting the instructions of the function at this entry address. Returns the number of the counter.
    pub fn add_probe(&mut self, entry: u32) -> usize {
        self.probes.push(Probe { entry, count: Count::default() });
        self.probes.len() - 1
    }

    /// Returns the instruction counts of a counter.
    pub fn probe(&self, probe: usize) -> Count {
        self.probes[probe].count
    }

    /// Resets all instruction counts, latencies and lowest stack pointers.
    pub fn clear(&mut self) {
        for probe in &mut self.probes {
            probe.count = Count::default();
        }
        self.handlers.fill(Count::default());
        self.latencies.fill(Latency::default());
        self.lowest_sp.fill(u32::MAX);
        self.deepest.fill(0);
    }

    /// Handles the execution of a watched address. If a counted function begins at this address, returns the return
    /// address of the function, which must be watched next.
    pub fn at(&mut self, pc: u32, sp: u32, lr: u32, instructions: u64) -> Option<u32> {
        let depth = self.running.len();
        while let Some(i) = self.calls.iter().rposition(|c| c.back == pc && c.sp == sp && c.depth == depth) {
            self.finish(i, instructions);
        }
        let mut back = None;
        for probe in 0..self.probes.len() {
            if self.probes[probe].entry == pc {
                let call = Call { probe, depth, sp, back: lr & !1, start: instructions, excluded: 0 };
                back = Some(call.back);
                self.calls.push(call);
            }
        }
        back.filter(|&b| b < 0xFFFF_FF00)
    }

    fn finish(&mut self, i: usize, instructions: u64) {
        let call = self.calls.remove(i);
        self.probes[call.probe].count.add(instructions - call.start - call.excluded);
    }

    /// Records the entry into an exception.
    pub fn enter(&mut self, exception: usize, since: Time, now: Time, instructions: u64) {
        let latency = &mut self.latencies[exception];
        latency.entries += 1;
        latency.last = now.saturating_sub(since);
        if latency.last >= latency.worst {
            latency.worst = latency.last;
            latency.at = now;
        }
        self.running.push(Running { exception, start: instructions, excluded: 0, base: None });
    }

    /// Records the return from the innermost exception.
    pub fn leave(&mut self, instructions: u64) {
        let depth = self.running.len();
        // If a counted function is itself a handler, the call ends with the exception.
        while let Some(i) = self.calls.iter().rposition(|c| c.depth >= depth) {
            self.finish(i, instructions);
        }
        let Some(done) = self.running.pop() else { return };
        let elapsed = instructions - done.start;
        self.handlers[done.exception].add(elapsed - done.excluded);
        if let Some(outer) = self.running.last_mut() {
            outer.excluded += elapsed;
        }
        for call in self.calls.iter_mut().filter(|c| c.depth == depth - 1) {
            call.excluded += elapsed;
        }
    }

    /// Records the stack pointer of the current context.
    pub fn note_sp(&mut self, sp: u32) {
        let mut context = 0;
        if let Some(running) = self.running.last_mut() {
            context = running.exception;
            let base = *running.base.get_or_insert(sp);
            self.deepest[context] = self.deepest[context].max(base.saturating_sub(sp));
        }
        self.lowest_sp[context] = self.lowest_sp[context].min(sp);
    }

    /// Records a reset of the machine.
    pub fn note_reset(&mut self, reset: Reset) {
        self.resets.push(reset);
        self.calls.clear();
        self.running.clear();
    }
}
