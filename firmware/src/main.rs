//! Firmware of the joint trajectory controller.
//!
//! Two parts share the processor. The *tick* ([`tick`]) is an interrupt with the highest priority that runs a thousand
//! times per second. The tick owns the controller, the joint bus, the safety wires and the LEDs. The start of a tick is
//! never delayed by more than a few instructions. The *links* ([`link`]) run in the remaining time, take bytes from
//! both serial lines and split the bytes into frames. The links pass frames to the tick in batches, through one slot.
//! The tick passes statuses directly to the DMA of the serial lines. Stop and Pause do not depend on the links or the
//! slot, because the tick searches the received bytes for these commands. The links also write the stored arm
//! ([`arm_store`]), one step per pass.
//!
//! All code that does not access hardware is in the library of this package and in `jtc-core`. This code is tested on a
//! PC.
#![no_std]
#![no_main]
#![deny(unsafe_op_in_unsafe_fn)]
#![deny(clippy::undocumented_unsafe_blocks)]

use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::wdg::IndependentWatchdog;
use jtc_core::recorder::Recorder;
use openjtc_firmware::{BAUD, lines, version::Version};

mod arm_store;
mod bank2;
mod board;
mod clocks;
mod fault;
mod fdcan;
mod link;
#[cfg(any(feature = "nucleo-h745zi-q", feature = "nucleo-h745zi-q-ldo"))]
mod m4;
mod memory;
mod program;
mod summary;
mod tick;
mod uart;

/// Version record of this firmware, at a fixed address.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".version")]
#[used]
pub static VERSION: Version = Version::this();

/// Time within which a tick must complete, µs. If a tick takes longer, the watchdog resets the processor. The
/// watchdog has its own oscillator, with an error of a few per cent.
const WATCHDOG_US: u32 = 4_500;

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    board::safety_output_low_at_start();
    let boot = fault::boot();
    let p = clocks::init();
    memory::init();
    let board = board::wire(p);
    fault::log(&boot);
    defmt::info!(
        "openjtc {=str} for {=str}, build {=str}: core {=u32} MHz, {=u32} Bd, {=u32} points",
        env!("CARGO_PKG_VERSION"),
        openjtc_firmware::BOARD,
        env!("OPENJTC_BUILD"),
        VERSION.core_hz / 1_000_000,
        VERSION.baud,
        VERSION.points,
    );

    let memory::Memory { points, rings, statuses, receive, batch, arms, recorder } =
        memory::take(boot.lost_power);
    let store = arm_store::load(arms);
    // `Recorder::new` reads the complete memory of the flight recorder. Reading this memory is slow, so it must be done
    // before the watchdog starts.
    let recorder = Recorder::new(recorder, boot.cause.failed());
    let [rs422, usb] = board.lines;
    let [ring_rs422, ring_usb] = rings;
    let [status_rs422, status_usb] = statuses;
    let (rs422_in, rs422_ahead, rs422_out) = uart::open(rs422, ring_rs422, status_rs422, BAUD);
    let (usb_in, usb_ahead, usb_out) = uart::open(usb, ring_usb, status_usb, BAUD);
    let (slot_in, slot_out) = link::slot(batch);

    let mut watchdog = IndependentWatchdog::new(board.watchdog, WATCHDOG_US);
    watchdog.unleash();
    tick::start(tick::Parts {
        points,
        can: fdcan::Fdcan::start(),
        pins: board.pins,
        ahead: [rs422_ahead, usb_ahead],
        slot: slot_out,
        lines: [rs422_out, usb_out],
        watchdog,
        recorder,
        boot,
    });

    let [receive_rs422, receive_usb] = receive;
    let links = [
        link::Link::new(lines::RS422, rs422_in, receive_rs422),
        link::Link::new(lines::USB, usb_in, receive_usb),
    ];
    link::run(links, slot_in, store).await
}
