//! The tick, which is the interrupt of TIM7. The interrupt has the highest priority and occurs a thousand times per
//! second. The tick owns the controller and all hardware that moves or stops the arm. The tick shares only the slot and
//! a summary for the log with the other parts of the program.
use core::cell::Cell;
use core::sync::atomic::Ordering;

use critical_section::Mutex;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::{IWDG1, TIM7};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{interrupt, pac, rcc};
use embassy_time::Instant;
use jtc_core::recorder::{Block, Recorder};
use jtc_core::{Config, Controller, HostEvent, Identity, Inputs, Outputs};
use jtc_wire::{
    BootCause, EVENTS_MAX, EventBatch, LinkEvent, RawPoint, ReceivedEvent, Response, STATUS_LEN, StoreState,
    UrgentWatch,
};
use openjtc_firmware::clock;
use openjtc_firmware::flight::Flight;
use openjtc_firmware::lines;
use static_cell::StaticCell;

use crate::arm_store;
use crate::board::Pins;
use crate::fault::Boot;
use crate::fdcan::{Fdcan, ReceivedFrames};
use crate::link::{self, SlotOut};
use crate::program;
use crate::summary::{self, Summary};
use crate::uart::{self, Lookahead, Transmitter};

/// The trajectory controller, whose trajectory is in separate memory.
type Jtc = Controller<&'static mut [RawPoint]>;

/// The flight recorder, whose blocks are in separate memory.
pub type FlightRecorder = Recorder<&'static mut [Block], 3>;

/// Largest number of received bytes of one line that a tick searches. At 15 MBd, fewer bytes arrive in two ticks.
const LOOK_MAX: usize = 4096;

/// Number of ticks without a pass of the links after which the tick stops the arm. Without the links, the tick receives
/// no frames of a host except Stop and Pause.
const LINKS_SILENT_ERROR: u32 = 100;
/// Number of ticks without a pass of the links after which the tick stops feeding the watchdog. The watchdog then
/// resets the processor.
const LINKS_SILENT_RESET: u32 = 200;

/// Parts of the firmware that the tick needs.
pub struct Parts {
    /// Memory for the trajectory.
    pub points: &'static mut [RawPoint],
    /// Driver of the joint bus.
    pub can: Fdcan,
    /// Safety pins and LEDs.
    pub pins: Pins,
    /// Readers that search the received bytes for Stop and Pause.
    pub ahead: [Lookahead; lines::LINES],
    /// Slot with the events of the hosts.
    pub slot: SlotOut,
    /// Transmitters of the serial lines RS422 and USB.
    pub lines: [Transmitter; lines::LINES],
    /// Watchdog that resets the processor if no tick completes in time.
    pub watchdog: IndependentWatchdog<'static, IWDG1>,
    /// Flight recorder, which contains the records from before this program start.
    pub recorder: FlightRecorder,
    /// Cause of this program start, and data of the previous program run.
    pub boot: Boot,
}

struct Tick {
    controller: &'static mut Jtc,
    can: Fdcan,
    received: ReceivedFrames,
    pins: Pins,
    ahead: [Lookahead; lines::LINES],
    watch: UrgentWatch<{ lines::LINES }>,
    slot: SlotOut,
    lines: [Transmitter; lines::LINES],
    watchdog: IndependentWatchdog<'static, IWDG1>,
    flight: &'static mut Flight,
    recorder: FlightRecorder,
    links: Links,
    left_out: u32,
    /// Result of the last attempt to store an arm, and the number of that attempt.
    stored: arm_store::Progress,
    stored_number: u32,
    /// Time at which the last tick began.
    began: Option<Instant>,
}

/// Monitor that detects if the links have stopped.
#[derive(Default)]
struct Links {
    rounds: u32,
    silent: u32,
}

impl Links {
    /// Returns the number of ticks since the last pass of the links.
    fn silent(&mut self) -> u32 {
        let rounds = link::ROUNDS_DONE.load(Ordering::Relaxed);
        self.silent = if rounds == self.rounds { self.silent.saturating_add(1) } else { 0 };
        self.rounds = rounds;
        self.silent
    }
}

/// Data that only the tick uses. The interrupt handler takes the data out while it runs.
static TICK: Mutex<Cell<Option<&'static mut Tick>>> = Mutex::new(Cell::new(None));

/// Creates the trajectory controller in its static memory. The function is not inlined, because the controller is large
/// and is created on the stack. After this function returns, that part of the stack is free again.
#[inline(never)]
fn controller(points: &'static mut [RawPoint]) -> &'static mut Jtc {
    static PLACE: StaticCell<Jtc> = StaticCell::new();
    PLACE.init_with(|| Controller::new(Config::default(), points))
}

/// Starts the timer of the ticks. The function is not inlined, so that its stack is free again after it returns.
#[inline(never)]
pub fn start(parts: Parts) {
    static PLACE: StaticCell<Tick> = StaticCell::new();
    let Parts { points, can, pins, ahead, slot, lines, watchdog, recorder, boot } = parts;
    let tick = PLACE.init_with(|| Tick {
        controller: controller(points),
        can,
        received: ReceivedFrames::new(),
        pins,
        ahead,
        watch: UrgentWatch::new(link::INTER_BYTE_TIMEOUT_US + clock::TICK_US),
        slot,
        lines,
        watchdog,
        flight: boot.flight,
        recorder,
        links: Links::default(),
        left_out: 0,
        stored: arm_store::Progress::Idle,
        stored_number: arm_store::loaded().map_or(0, |loaded| loaded.sequence),
        began: None,
    });
    tick.controller.set_identity(Identity {
        board: openjtc_firmware::BOARD,
        firmware: env!("CARGO_PKG_VERSION"),
        revision: env!("OPENJTC_BUILD"),
        boots: boot.boots,
        boot_cause: BootCause::from_byte(boot.cause as u8).unwrap_or_default(),
        program: None,
    });
    load_arm(tick.controller);
    if boot.cause.failed() {
        tick.controller.raise_internal();
    }
    critical_section::with(|cs| TICK.borrow(cs).set(Some(tick)));

    rcc::enable_and_reset::<TIM7>();
    pac::TIM7.psc().write_value((clock::TICK_PRESCALER - 1) as u16);
    pac::TIM7.arr().write(|w| w.set_arr((clock::TICK_US - 1) as u16));
    // Prescaler and period of the timer take effect at an update event. The flag of this event is then cleared, so
    // that the event does not cause a tick.
    pac::TIM7.egr().write(|w| w.set_ug(true));
    pac::TIM7.sr().write(|w| w.set_uif(false));
    pac::TIM7.dier().write(|w| w.set_uie(true));
    interrupt::TIM7.set_priority(Priority::P0);
    // By default, the interrupt of the HAL's time driver has the same priority as the tick, and could delay the tick.
    interrupt::TIM5.set_priority(crate::clocks::LOW);
    // SAFETY: everything that the interrupt handler uses is initialised.
    unsafe { interrupt::TIM7.enable() };
    pac::TIM7.cr1().write(|w| w.set_cen(true));
}

/// Passes the stored arm to the controller at program start (J-54).
#[inline(never)]
fn load_arm(controller: &mut Jtc) {
    match arm_store::loaded() {
        None => controller.set_store_state(StoreState::Empty, 0),
        Some(arm_store::Loaded { image, sequence }) if controller.load_arm(image) => {
            controller.set_store_state(StoreState::Stored, sequence);
        }
        Some(arm_store::Loaded { sequence, .. }) => {
            defmt::error!("the stored arm, number {=u32}, is none that this firmware takes", sequence);
            controller.set_store_state(StoreState::Failed, sequence);
        }
    }
}

#[interrupt]
fn TIM7() {
    if !pac::TIM7.sr().read().uif() {
        return;
    }
    pac::TIM7.sr().write(|w| w.set_uif(false));
    let Some(tick) = critical_section::with(|cs| TICK.borrow(cs).take()) else { return };
    let summary = tick.run();
    critical_section::with(|cs| {
        TICK.borrow(cs).set(Some(tick));
        summary::LAST.borrow(cs).set(summary);
    });
    uart::WORK.signal(());
}

impl Tick {
    fn run(&mut self) -> Summary {
        let missed_ticks = self.missed_ticks();
        let bus_state = self.can.poll(&mut self.received);
        let counters = self.can.counters();
        self.look_ahead();
        let urgent = self.watch.take();
        let mut host = [NO_EVENT; EVENTS_MAX];
        let count = self.slot.batch().map_or(0, |batch| collect(batch, &self.watch, &mut host));
        let inputs = Inputs {
            bus: self.received.frames(),
            bus_state,
            safety_input: self.pins.safety_input.is_safe(),
            missed_ticks,
            urgent,
            host: host.get(..count).unwrap_or(&[]),
            status_free: self.lines.iter().all(Transmitter::is_free),
        };
        self.flight.begin(&inputs, counters.wrong_format);
        let outputs = control_step(self.controller, &inputs);

        self.pins.safety_output.set_level(outputs.safety_output.into());
        if let Some(frame) = &outputs.bus {
            self.can.send(frame);
        }
        // The tick writes the record after all actions that affect the arm, and before it returns the executed frames
        // to the links.
        record_step(&mut self.recorder, self.controller, &inputs, &outputs);
        self.slot.done(outputs.host_done);
        if outputs.status {
            send(&mut self.lines, outputs.record_line, self.controller.status_frame());
        }
        if let Some(line) = outputs.answer_line.and_then(|line| self.lines.get_mut(line)) {
            line.send(self.controller.answer_frame());
        }
        self.store_arm(outputs.store);
        self.controller.set_program(program::read());
        let telemetry = self.controller.telemetry();
        let (state, errors) = (telemetry.state, telemetry.errors);
        self.flight.complete(&outputs, &telemetry);
        self.pins.show(state);
        let silent = self.links.silent();
        if silent == LINKS_SILENT_ERROR {
            self.controller.raise_internal();
        }
        // The tick is complete. Only this call of `pet` prevents the watchdog from resetting the processor.
        if silent < LINKS_SILENT_RESET {
            self.watchdog.pet();
        }
        self.leave_out_late_tick();
        Summary { state: state as u8, errors, bus: counters, left_out: self.left_out }
    }

    /// Starts storing an arm if requested, and reports the result to the controller (J-54).
    fn store_arm(&mut self, requested: bool) {
        let state = if requested && arm_store::begin(self.controller.stored_arm()).is_err() {
            Some(StoreState::Failed)
        } else {
            let progress = arm_store::progress();
            let changed = core::mem::replace(&mut self.stored, progress) != progress;
            match progress {
                arm_store::Progress::Done { sequence } if changed => {
                    self.stored_number = sequence;
                    Some(StoreState::Stored)
                }
                arm_store::Progress::Failed(_) if changed => Some(StoreState::Failed),
                _ => None,
            }
        };
        if let Some(state) = state {
            self.controller.set_store_state(state, self.stored_number);
        }
    }

    /// Searches the bytes that have arrived since the last tick for Stop and Pause (J-04).
    fn look_ahead(&mut self) {
        let now_us = self.flight.tick * u64::from(clock::TICK_US);
        for (line, ahead) in self.ahead.iter_mut().enumerate() {
            ahead.read(LOOK_MAX, |bytes| self.watch.scan(line, now_us, bytes));
            if let Some(received) = link::RECEIVED.get(line) {
                received.store(self.watch.received(line) as u32, Ordering::Relaxed);
            }
        }
    }

    /// Returns the number of ticks since the last call that were missed, or were late by at least half a tick. The
    /// function computes this number from the time between two ticks.
    fn missed_ticks(&mut self) -> u16 {
        let now = Instant::now();
        let before = self.began.replace(now).unwrap_or(now);
        let us = now.as_micros().saturating_sub(before.as_micros());
        let periods = (us + u64::from(clock::TICK_US) / 2) / u64::from(clock::TICK_US);
        u16::try_from(periods.saturating_sub(1)).unwrap_or(u16::MAX)
    }

    /// Skips a tick that is already due, because the drives must not receive two frames without a pause between the
    /// frames (J-12).
    fn leave_out_late_tick(&mut self) {
        if pac::TIM7.sr().read().uif() {
            pac::TIM7.sr().write(|w| w.set_uif(false));
            self.left_out = self.left_out.wrapping_add(1);
        }
    }
}

/// Runs one step of the controller. The function is separate, so that tools can count its instructions by its symbol.
#[unsafe(no_mangle)]
#[inline(never)]
fn control_step(controller: &mut Jtc, inputs: &Inputs<'_>) -> Outputs {
    controller.tick(inputs)
}

/// Runs the flight recorder after the step of the controller. The function is separate, so that tools can count its
/// instructions by its symbol.
#[unsafe(no_mangle)]
#[inline(never)]
fn record_step(recorder: &mut FlightRecorder, controller: &mut Jtc, inputs: &Inputs<'_>, outputs: &Outputs) {
    recorder.record(controller, inputs, outputs);
}

/// Initial value of array elements that contain no event.
const NO_EVENT: HostEvent<'_> = HostEvent {
    line: lines::RS422,
    overtaken: false,
    plain: false,
    event: LinkEvent::Noise(Response::NONE),
};

/// Converts the events of the batch to host events of the controller. Returns the number of these host events.
fn collect<'a>(
    batch: &'a EventBatch,
    watch: &UrgentWatch<{ lines::LINES }>,
    host: &mut [HostEvent<'a>; EVENTS_MAX],
) -> usize {
    let mut count = 0;
    while let (Some(slot), Some(received)) = (host.get_mut(count), batch.get(count)) {
        let overtaken = watch.overtaken(received.line, received.position);
        let ReceivedEvent { line, plain, event, .. } = received;
        *slot = HostEvent { line, overtaken, plain, event };
        count += 1;
    }
    count
}

/// Sends a status on both serial lines. Only the status on the line of the answered frame contains the response record
/// (J-04).
fn send(lines: &mut [Transmitter; lines::LINES], record_line: Option<usize>, status: &[u8; STATUS_LEN]) {
    let other = if record_line.is_some() { lines::without_record(status) } else { *status };
    for (n, line) in lines.iter_mut().enumerate() {
        line.send(if record_line == Some(n) { status } else { &other });
    }
}
