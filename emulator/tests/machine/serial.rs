//! USART and DMA: the transmission of every byte takes as long as on a real line, and DMA stores the byte at the right
//! address.
use openjtc_emulator::clock::{MICROSECOND, MILLISECOND, SECOND};
use openjtc_emulator::{FIRST_LINE, Machine};

use crate::machine;
use crate::programs::{CLOBBER, SLEEP};

const USART3: u32 = 0x4000_4800;
const CR1: u32 = USART3;
const CR3: u32 = USART3 + 0x08;
const BRR: u32 = USART3 + 0x0C;
const ISR: u32 = USART3 + 0x1C;
const ICR: u32 = USART3 + 0x20;
const RDR: u32 = USART3 + 0x24;
const TDR: u32 = USART3 + 0x28;
/// Value of CR1 with the bits UE, RE, TE and FIFOEN.
const ON: u32 = 1 | 4 | 8 | 1 << 29;
const IDLE: u32 = 0x10;
const ORE: u32 = 8;
const RXNE: u32 = 0x20;
/// Address of DMA1 stream 1.
const DMA: u32 = 0x4002_0000 + 0x10 + 0x18;
const RING: u32 = 0x3000_0000;

/// Returns a sleeping machine whose USART3 runs from the 64 MHz HSI. `brr` is the divider of the bit rate.
fn with_divider(brr: u32, over8: bool) -> Machine {
    let mut machine = machine(SLEEP, &[(FIRST_LINE + 39, CLOBBER), (FIRST_LINE + 12, CLOBBER)]);
    machine.write_register(0x5802_44E8, 1 << 18);
    machine.write_register(0x5802_44D8, 1); // DMA1
    machine.write_register(0x5802_44DC, 1 << 29); // SRAM1
    machine.write_register(0x5802_4454, 3); // USART234578SEL: HSI
    machine.write_register(BRR, brr);
    machine.write_register(CR1, ON | u32::from(over8) << 15);
    machine
}

#[test]
fn bytes_leave_at_the_rate_of_the_divider() {
    for (brr, over8, baud) in [(556, false, 115_200), (64, false, 1_000_000), (0x10, true, 8_000_000)] {
        let mut machine = with_divider(brr, over8);
        machine.chip().usarts[1].host_baud = baud;
        let start = machine.now();
        for byte in 0..10 {
            machine.write_register(TDR, byte);
        }
        machine.run_until(start + 2 * MILLISECOND);
        let bytes: Vec<_> = machine.chip().usarts[1].take_output().collect();
        let kernel = if over8 { 128_000_000 } else { 64_000_000 };
        for (i, byte) in bytes.iter().enumerate() {
            let expected = start + (i as u64 + 1) * 10 * u64::from(brr) * SECOND / kernel;
            assert_eq!((byte.byte, byte.end), (i as u8, expected), "{baud} Bd");
        }
        assert_eq!(bytes.len(), 10);
        assert_ne!(machine.read_register(ISR) & 0x40, 0, "TC");
    }
}

#[test]
fn idle_comes_one_frame_after_the_last_byte_and_once() {
    let mut machine = with_divider(64, false);
    let byte = 10 * MICROSECOND;
    machine.chip().usarts[1].host_baud = 1_000_000;
    let start = machine.now();
    machine.chip().usarts[1].host_write(start, b"ab");
    machine.run_until(start + 3 * byte - 1000);
    assert_eq!(machine.read_register(ISR) & (IDLE | RXNE), RXNE);
    machine.run_until(start + 3 * byte + 1000);
    assert_eq!(machine.read_register(ISR) & IDLE, IDLE);
    machine.write_register(ICR, IDLE);
    machine.run_until(start + MILLISECOND);
    assert_eq!(machine.read_register(ISR) & IDLE, 0);
    assert_eq!([machine.read_register(RDR), machine.read_register(RDR)], [u32::from(b'a'), u32::from(b'b')]);
    assert_eq!(machine.read_register(ISR) & RXNE, 0);
}

#[test]
fn a_full_fifo_overruns() {
    let mut machine = with_divider(64, false);
    machine.chip().usarts[1].host_baud = 1_000_000;
    let now = machine.now();
    machine.chip().usarts[1].host_write(now, &[7; 16]);
    machine.run_until(now + MILLISECOND);
    assert_eq!(machine.read_register(ISR) & ORE, 0);
    let now = machine.now();
    machine.chip().usarts[1].host_write(now, &[8]);
    machine.run_until(now + MILLISECOND);
    assert_eq!(machine.read_register(ISR) & ORE, ORE);
    assert_eq!(machine.chip().usarts[1].overruns, 1);
}

#[test]
fn another_rate_is_not_understood() {
    let mut machine = with_divider(64, false);
    machine.chip().usarts[1].host_baud = 921_600;
    let now = machine.now();
    machine.chip().usarts[1].host_write(now, &[0x55]);
    machine.run_until(now + MILLISECOND);
    assert_ne!(machine.read_register(ISR) & 2, 0, "FE");
    assert_ne!(machine.read_register(RDR), 0x55);
}

#[test]
fn a_dma_ring_takes_a_stream_and_wraps() {
    let mut machine = with_divider(64, false);
    machine.chip().usarts[1].host_baud = 1_000_000;
    machine.write_register(0x4002_0804, 45); // DMAMUX1 channel 1: USART3_RX
    machine.write_register(DMA + 4, 8);
    machine.write_register(DMA + 8, RDR);
    machine.write_register(DMA + 12, RING);
    machine.write_register(DMA, 1 | 1 << 3 | 1 << 4 | 1 << 8 | 1 << 10); // EN HTIE TCIE CIRC MINC
    machine.write_register(CR3, 0x40);
    machine.write_register(0xE000_E100, 1 << 12);
    let start = machine.now();
    machine.chip().usarts[1].host_write(start, &(1..=19).collect::<Vec<u8>>());
    machine.run_until(start + 4 * 10 * MICROSECOND + MICROSECOND);
    assert_eq!(machine.memory(RING, 4).unwrap(), [1, 2, 3, 4]);
    // Half of the DMA transfers are complete. The interrupt line remains high, because the handler never clears the
    // flag.
    assert!(machine.chip().observers.latencies[FIRST_LINE + 12].entries > 0);
    machine.run_until(start + MILLISECOND);
    assert_eq!(machine.memory(RING, 8).unwrap(), [17, 18, 19, 12, 13, 14, 15, 16]);
    assert_eq!(machine.read_register(DMA + 4), 5);
    assert_eq!(machine.read_register(0x4002_0000) >> 6 & 0x30, 0x30);
    assert_eq!(machine.chip().usarts[1].received, 19);
}

#[test]
fn a_peripheral_without_clock_is_told_of() {
    let mut machine = machine(SLEEP, &[]);
    machine.write_register(BRR, 64);
    assert_eq!(machine.read_register(BRR), 0);
    let chip = machine.chip();
    assert_eq!((chip.unclocked[&BRR].reads, chip.unclocked[&BRR].writes), (1, 1));
    machine.write_register(0x4001_0000, 5); // TIM1 has no model
    assert_eq!(machine.chip().unknown[&0x4001_0000].value, 5);
}
