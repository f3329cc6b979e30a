//! Tests of FDCAN: dedicated buffers, order of transmission, acknowledgement, bus-off and recovery.
use std::cell::RefCell;
use std::rc::Rc;

use can_link::{CanFrame, Id};
use openjtc_emulator::Machine;
use openjtc_emulator::clock::{MICROSECOND, MILLISECOND, Time};
use openjtc_emulator::fdcan::{CanPeers, Outcome, frame_time};

use crate::machine;
use crate::programs::SLEEP;

const FDCAN1: u32 = 0x4000_A000;
const RAM: u32 = 0x4000_AC00;
const CCCR: u32 = FDCAN1 + 0x18;
const ECR: u32 = FDCAN1 + 0x40;
const PSR: u32 = FDCAN1 + 0x44;
const NDAT1: u32 = FDCAN1 + 0x98;
const TXBRP: u32 = FDCAN1 + 0xCC;
const TXBAR: u32 = FDCAN1 + 0xD0;
const TXBCR: u32 = FDCAN1 + 0xD4;
const TXBTO: u32 = FDCAN1 + 0xD8;
const TXBCF: u32 = FDCAN1 + 0xDC;
const BUS_OFF: u32 = 0x80;
/// Offsets of filters, receive buffers and transmit buffers in the message RAM.
const FILTERS: u32 = 0;
const RX: u32 = 0x100;
const TX: u32 = 0x800;
/// Size of an element of the message RAM with 24 payload bytes.
const ELEMENT: u32 = 32;

/// Bus node that acknowledges frames and stores them.
#[derive(Clone, Default)]
struct Listener(Rc<RefCell<Vec<(Time, CanFrame)>>>);

impl CanPeers for Listener {
    fn receive(&mut self, end: Time, frame: &CanFrame, _: &mut Vec<(Time, CanFrame)>) {
        self.0.borrow_mut().push((end, *frame));
    }
    fn acknowledge(&self) -> bool {
        true
    }
}

/// Returns a machine whose FDCAN1 runs at 1 and 5 Mbit/s, with PLL2 at 85 MHz as its clock. FDCAN1 has two filters
/// for receive buffers 0 and 1, and two transmit buffers. `prescaler` is the prescaler of the nominal phase.
fn with_prescaler(prescaler: u32, peers: Option<Listener>) -> Machine {
    let mut machine = machine(SLEEP, &[]);
    let rcc = 0x5802_4400;
    machine.write_register(rcc + 0xEC, 1 << 8);
    machine.write_register(rcc + 0x28, 2 | 4 << 12); // HSE / 4
    machine.write_register(rcc + 0x38, 169 | 3 << 16); // * 170 / 4 = 85 MHz
    machine.write_register(rcc, 1 | 1 << 16 | 1 << 26);
    machine.write_register(rcc + 0x50, 2 << 28);
    machine.write_register(CCCR, 1);
    machine.write_register(CCCR, 3);
    for (offset, value) in [
        (0x1C, 1 << 25 | (prescaler - 1) << 16 | 11 << 8 | 3),
        (0x0C, 11 << 8 | 3 << 4 | 1),
        (0x84, FILTERS | 2 << 16),
        (0x80, 0x3F),
        (0xAC, RX),
        (0xBC, 4 << 8),
        (0xC0, TX | 2 << 16),
        (0xC8, 4),
        (0x18, 0x303),
    ] {
        machine.write_register(FDCAN1 + offset, value);
    }
    for n in 0..2 {
        machine.write_register(RAM + FILTERS + 4 * n, 7 << 27 | (0x200 + n) << 16 | n);
        machine.write_register(RAM + TX + ELEMENT * n, (0x100 - 0x80 * n) << 18);
        machine.write_register(RAM + TX + ELEMENT * n + 4, 1 << 21 | 1 << 20 | 9 << 16);
        for word in 0..3 {
            machine.write_register(RAM + TX + ELEMENT * n + 8 + 4 * word, 0x0403_0201);
        }
    }
    machine.write_register(CCCR, 0x300);
    if let Some(peers) = peers {
        machine.chip().fdcan.wire.peers = Some(Box::new(peers));
    }
    let now = machine.now();
    machine.run_until(now + 20 * MICROSECOND);
    machine
}

fn run(machine: &mut Machine, time: Time) {
    let end = machine.now() + time;
    machine.run_until(end);
}

fn frame(id: u32, byte: u8) -> CanFrame {
    CanFrame::fd(Id::standard(id).unwrap(), &[byte; 16]).unwrap().with_brs(true)
}

#[test]
fn a_dedicated_buffer_holds_a_frame_until_its_flag_is_cleared() {
    let mut machine = with_prescaler(5, Some(Listener::default()));
    let now = machine.now();
    for (id, byte) in [(0x200, 1), (0x200, 2), (0x201, 3), (0x300, 4)] {
        machine.chip().fdcan.wire.put(now, frame(id, byte));
    }
    run(&mut machine, MILLISECOND);
    assert_eq!(machine.read_register(NDAT1), 3);
    assert_eq!(machine.read_register(RAM + RX) >> 18, 0x200);
    assert_eq!(machine.read_register(RAM + RX + 4) >> 16 & 15, 10);
    assert_eq!(machine.read_register(RAM + RX + 8), 0x0101_0101, "the first frame stays");
    assert_eq!(machine.read_register(RAM + RX + ELEMENT + 8), 0x0303_0303);
    assert_eq!((machine.chip().fdcan.stored, machine.chip().fdcan.rejected), (2, 2));
    machine.write_register(NDAT1, 1);
    assert_eq!(machine.read_register(NDAT1), 2);
    let now = machine.now();
    machine.chip().fdcan.wire.put(now, frame(0x200, 5));
    run(&mut machine, MILLISECOND);
    assert_eq!(machine.read_register(RAM + RX + 8), 0x0505_0505);
}

#[test]
fn the_lowest_identifier_goes_first_and_takes_its_time() {
    let listener = Listener::default();
    let received = Rc::clone(&listener.0);
    let mut machine = with_prescaler(5, Some(listener));
    let start = machine.now();
    machine.write_register(TXBAR, 3);
    assert_eq!(machine.read_register(TXBRP), 3);
    run(&mut machine, MILLISECOND);
    let received = received.borrow();
    let ids: Vec<u32> = received.iter().map(|(_, f)| f.id().value()).collect();
    assert_eq!(ids, [0x080, 0x100]);
    assert_eq!(received[0].1.data(), [1, 2, 3, 4, 1, 2, 3, 4, 1, 2, 3, 4]);
    assert_eq!(received[0].0, start + frame_time(&received[0].1));
    assert_eq!(received[1].0, start + frame_time(&received[0].1) + frame_time(&received[1].1));
    assert_eq!((machine.read_register(TXBRP), machine.read_register(TXBTO)), (0, 3));
}

#[test]
fn without_acknowledge_it_becomes_passive_but_not_bus_off() {
    let mut machine = with_prescaler(5, None);
    machine.write_register(TXBAR, 1);
    run(&mut machine, 20 * MILLISECOND);
    assert_eq!(machine.read_register(ECR) & 0xFF, 128);
    let status = machine.read_register(PSR);
    assert_eq!((status & 7, status & BUS_OFF, status >> 5 & 1), (3, 0, 1));
    assert_eq!(machine.read_register(TXBRP), 1, "it goes on trying");
    assert!(machine.chip().fdcan.wire.log().iter().all(|e| e.outcome == Outcome::NoAcknowledge));
    machine.write_register(TXBCR, 1);
    run(&mut machine, MILLISECOND);
    assert_eq!((machine.read_register(TXBRP), machine.read_register(TXBCF)), (0, 1));
}

#[test]
fn bus_off_ends_129_times_11_bits_after_init_is_cleared() {
    let listener = Listener::default();
    let received = Rc::clone(&listener.0);
    let mut machine = with_prescaler(5, Some(listener));
    machine.chip().fdcan.wire.fault.destroy_all = true;
    machine.write_register(TXBAR, 1);
    run(&mut machine, 10 * MILLISECOND);
    assert_eq!(machine.read_register(CCCR) & 1, 1, "INIT is set by bus-off");
    assert_ne!(machine.read_register(PSR) & BUS_OFF, 0);
    // The bus-off limit is 256. Each of the 32 errors adds 8 to the transmit error counter.
    assert_eq!(machine.chip().fdcan.wire.log().len(), 32);
    machine.chip().fdcan.wire.fault.destroy_all = false;
    machine.write_register(TXBCR, 1);
    machine.write_register(CCCR, 0x300);
    let start = machine.now();
    machine.run_until(start + 1418 * MICROSECOND);
    assert_ne!(machine.read_register(PSR) & BUS_OFF, 0);
    machine.run_until(start + 1420 * MICROSECOND);
    assert_eq!(machine.read_register(PSR) & BUS_OFF, 0);
    assert_eq!(machine.read_register(ECR), 0);
    assert!(received.borrow().is_empty(), "a cancelled frame is not sent");
    machine.write_register(TXBAR, 2);
    run(&mut machine, MILLISECOND);
    assert_eq!(received.borrow().len(), 1);
}

#[test]
fn a_wrong_bit_rate_is_an_error_to_every_node() {
    let mut machine = with_prescaler(10, Some(Listener::default()));
    assert_eq!(machine.chip().fdcan.state().rates, (500_000, 5_000_000));
    machine.write_register(TXBAR, 1);
    run(&mut machine, 10 * MILLISECOND);
    assert!(machine.chip().fdcan.state().bus_off);
    let mut machine = with_prescaler(10, Some(Listener::default()));
    let now = machine.now();
    machine.chip().fdcan.wire.put(now, frame(0x200, 1));
    run(&mut machine, MILLISECOND);
    assert_eq!((machine.read_register(NDAT1), machine.chip().fdcan.state().rec), (0, 1));
}
