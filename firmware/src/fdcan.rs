//! Driver of the joint bus, which uses FDCAN1 with dedicated buffers (J-10). Only the tick uses the joint bus, and the
//! CAN controller does not cause interrupts.
//!
//! At most one frame is sent per tick. The driver uses two transmit buffers alternately. If a frame is still unsent
//! when the next tick runs, the tick cancels the frame. A transmission that has already begun is completed; otherwise
//! the cancelled frame is never sent. The driver reports a cancelled frame as unacknowledged.
use core::sync::atomic::{Ordering, compiler_fence};

use embassy_stm32::pac::can::Fdcan as Registers;
use embassy_stm32::pac::can::regs::{Ndat1, Txbar, Txbcr};
use embassy_stm32::pac::{FDCAN1, FDCANRAM};
use embassy_stm32::peripherals;
use embassy_stm32::rcc;
use jtc_bus::timing::{self, BitTiming};
use jtc_bus::{Format, Frame, MAX_LEN, Request};
use jtc_core::{BusState, JOINTS};
use openjtc_firmware::message_ram as ram;

const CAN: Registers = FDCAN1;

/// Largest number of reads of a register while the driver waits for a change. The change should take a few clock
/// periods.
const PATIENCE: u32 = 10_000;
/// Largest number of reads of a register within a tick. Waits within a tick must be short. If the change has not
/// occurred by then, the next tick checks the register again.
const PATIENCE_IN_TICK: u32 = 100;

/// Frames that the joint bus received since the last tick.
pub struct ReceivedFrames {
    frames: [Frame; ram::RX],
    count: usize,
}

impl ReceivedFrames {
    /// Creates an empty list of frames.
    pub const fn new() -> Self {
        const NONE: Frame = Frame::new(0, &[]).expect("an empty frame is allowed");
        Self { frames: [NONE; ram::RX], count: 0 }
    }

    /// Returns the received frames, ordered by identifier.
    pub fn frames(&self) -> &[Frame] {
        self.frames.get(..self.count).unwrap_or(&[])
    }

    fn push(&mut self, frame: Frame) {
        if let Some(slot) = self.frames.get_mut(self.count) {
            *slot = frame;
            self.count += 1;
        }
    }
}

/// Error counters of the CAN controller, for the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counters {
    /// Transmit error counter.
    pub transmit: u8,
    /// Receive error counter.
    pub receive: u8,
    /// Number of frames that were cancelled because the next tick had begun, or not sent because the buffer was in use.
    pub cancelled: u32,
    /// Number of times that the CAN controller went bus-off.
    pub bus_off: u32,
    /// Number of received frames that were not CAN FD frames with an 11-bit identifier (J-15).
    pub wrong_format: u32,
}

impl Counters {
    /// Creates counters whose values are zero.
    pub const fn new() -> Self {
        Self { transmit: 0, receive: 0, cancelled: 0, bus_off: 0, wrong_format: 0 }
    }
}

/// Driver of the joint bus.
pub struct Fdcan {
    /// Number of the transmit buffer that contains the last frame.
    last: usize,
    /// `true` if the last tick wrote a frame into the transmit buffer.
    sent: bool,
    recovering: bool,
    counters: Counters,
}

impl Fdcan {
    /// Configures the CAN controller and connects it to the joint bus.
    pub fn start() -> Self {
        rcc::enable_and_reset::<peripherals::FDCAN1>();
        CAN.cccr().modify(|w| w.set_init(true));
        wait(PATIENCE, || CAN.cccr().read().init());
        CAN.cccr().modify(|w| w.set_cce(true));
        CAN.cccr().modify(|w| {
            w.set_fdoe(true);
            w.set_bse(true);
            w.set_txp(true);
            // The bus uses ISO CAN FD with automatic retransmission.
            w.set_niso(false);
            w.set_dar(false);
        });
        set_timing();

        // The contents of the message memory and its check bits are random after power-on, so the driver writes the
        // complete memory first.
        for word in 0..ram::BYTES / 4 {
            FDCANRAM.ram(word).write_value(0);
        }
        for n in 0..ram::RX {
            FDCANRAM.ram(ram::FILTERS + n).write_value(ram::filter(n));
        }
        CAN.gfc().write(|w| {
            // The CAN controller rejects frames that match no filter, and remote frames.
            w.set_anfs(3);
            w.set_anfe(3);
            w.set_rrfs(true);
            w.set_rrfe(true);
        });
        CAN.sidfc().write(|w| {
            w.set_flssa(ram::FILTERS as u16);
            w.set_lss(ram::RX as u8);
        });
        CAN.rxbc().write(|w| w.set_rbsa(ram::RX_BUFFERS as u16));
        CAN.rxesc().write(|w| w.set_rbds(ram::SIZE_CODE));
        CAN.txbc().write(|w| {
            w.set_tbsa(ram::TX_BUFFERS as u16);
            w.set_ndtb(ram::TX as u8);
        });
        CAN.txesc().write(|w| w.set_tbds(ram::SIZE_CODE));

        leave_init(PATIENCE);
        Self { last: 0, sent: false, recovering: false, counters: Counters::new() }
    }

    /// Takes the frames received since the last tick, and returns the state of the joint bus. This function must be
    /// called once per tick, before `send`.
    pub fn poll(&mut self, frames: &mut ReceivedFrames) -> BusState {
        let acknowledged = self.finish_last();
        let off = self.recover();
        frames.count = 0;
        let new = CAN.ndat1().read().nd();
        for n in 0..ram::RX {
            if new & 1 << n != 0 {
                match received(n) {
                    Some(frame) => frames.push(frame),
                    None => self.counters.wrong_format = self.counters.wrong_format.wrapping_add(1),
                }
            }
        }
        // Releases the receive buffers for new frames.
        CAN.ndat1().write_value(Ndat1(new));
        BusState { acknowledged, bus_off: off }
    }

    /// Requests transmission of the frame of this tick. Drops the frame while the CAN controller is bus-off.
    pub fn send(&mut self, frame: &Frame) {
        if self.recovering {
            return;
        }
        self.last = (self.last + 1) % ram::TX;
        self.sent = request(self.last, frame);
        if !self.sent {
            self.counters.cancelled = self.counters.cancelled.wrapping_add(1);
        }
    }

    /// Returns the error counters.
    pub fn counters(&mut self) -> Counters {
        let now = CAN.ecr().read();
        (self.counters.transmit, self.counters.receive) = (now.tec(), now.rec());
        self.counters
    }

    /// Returns `true` if the last frame was acknowledged. Cancels the last frame if it is still waiting for
    /// transmission.
    fn finish_last(&mut self) -> bool {
        let sent = core::mem::take(&mut self.sent);
        let bit = 1 << self.last;
        if sent && CAN.txbrp().read().0 & bit != 0 {
            CAN.txbcr().write_value(Txbcr(bit));
            self.counters.cancelled = self.counters.cancelled.wrapping_add(1);
            return false;
        }
        sent && CAN.txbto().read().0 & bit != 0
    }

    /// Restarts a CAN controller that is bus-off. According to ISO 11898-1, the CAN controller may send again after 129
    /// times 11 recessive bits, counted from the restart. Returns `true` while the CAN controller cannot send. During
    /// this time no frame is sent, and the drives apply their last commanded torque.
    fn recover(&mut self) -> bool {
        let control = CAN.cccr().read();
        // If INIT is set, the CAN controller has stopped itself. If ASM is set, the CAN controller could not access
        // its message memory, so it only listens.
        if control.init() || control.asm() {
            CAN.cccr().modify(|w| w.set_init(true));
            wait(PATIENCE_IN_TICK, || CAN.cccr().read().init());
            // The CAN controller clears all transmit requests when access to its configuration is enabled.
            CAN.cccr().modify(|w| {
                w.set_cce(true);
                w.set_asm(false);
            });
            leave_init(PATIENCE_IN_TICK);
            if !self.recovering {
                self.counters.bus_off = self.counters.bus_off.wrapping_add(1);
            }
        }
        let stopped = CAN.cccr().read().init();
        self.recovering = CAN.psr().read().bo() || stopped || control.asm();
        self.recovering
    }
}

fn set_timing() {
    // The timing registers contain these values minus one.
    let BitTiming { prescaler, segment1, segment2, jump_width } = timing::NOMINAL;
    CAN.nbtp().write(|w| {
        w.set_nbrp(prescaler - 1);
        w.set_ntseg1(segment1 - 1);
        w.set_ntseg2(segment2 - 1);
        w.set_nsjw(jump_width - 1);
    });
    let BitTiming { prescaler, segment1, segment2, jump_width } = timing::DATA;
    CAN.dbtp().write(|w| {
        w.set_dbrp((prescaler - 1) as u8);
        w.set_dtseg1(segment1 - 1);
        w.set_dtseg2(segment2 - 1);
        w.set_dsjw(jump_width - 1);
        w.set_tdc(true);
    });
    CAN.tdcr().write(|w| {
        w.set_tdco(timing::TDC_OFFSET);
        w.set_tdcf(timing::TDC_FILTER);
    });
}

/// Leaves the initialisation mode. The bit INIT is cleared in another clock domain and must read 0 before it may be set
/// again.
fn leave_init(patience: u32) {
    CAN.cccr().modify(|w| {
        w.set_cce(false);
        w.set_init(false);
    });
    wait(patience, || !CAN.cccr().read().init());
}

/// Calls `done` up to `patience` times until it returns `true`. Returns `false` if `done` never returned `true`.
fn wait(patience: u32, done: impl Fn() -> bool) -> bool {
    (0..patience).any(|_| done())
}

/// Returns the frame in receive buffer `n`. Returns `None` if the joint bus does not use the format of the frame.
fn received(n: usize) -> Option<Frame> {
    let word = |i: usize| FDCANRAM.ram(ram::rx(n) + i).read();
    let (head, about) = (word(0), word(1));
    let format =
        Format { extended: head & 1 << 30 != 0, remote: head & 1 << 29 != 0, fd: about & 1 << 21 != 0 };
    if format != Format::BUS {
        return None;
    }
    let mut data = [0; MAX_LEN];
    for (i, bytes) in data.chunks_exact_mut(4).enumerate() {
        bytes.copy_from_slice(&word(2 + i).to_le_bytes());
    }
    Frame::from_dlc((head >> 18 & 0x7FF) as u16, (about >> 16 & 0xF) as u8, &data)
}

/// Writes a frame into transmit buffer `n` and requests its transmission. Returns `false` if the transmit buffer is
/// still in use.
fn request(n: usize, frame: &Frame) -> bool {
    const FD: u32 = 1 << 21;
    const BIT_RATE_SWITCH: u32 = 1 << 20;
    if CAN.txbrp().read().0 & 1 << n != 0 {
        return false;
    }
    let put = |i: usize, value: u32| FDCANRAM.ram(ram::tx(n) + i).write_value(value);
    put(0, u32::from(frame.id) << 18);
    put(1, u32::from(frame.dlc()) << 16 | FD | BIT_RATE_SWITCH);
    for (i, bytes) in frame.data().chunks(4).take(MAX_LEN / 4).enumerate() {
        let mut word = [0; 4];
        for (to, from) in word.iter_mut().zip(bytes) {
            *to = *from;
        }
        put(2 + i, u32::from_le_bytes(word));
    }
    compiler_fence(Ordering::SeqCst);
    CAN.txbar().write_value(Txbar(1 << n));
    true
}

/// Sends zero torque to the drives after a program failure, if the joint bus still works. Stops trying after about one
/// millisecond. A fault handler calls this function when the state of all other parts of the program is unknown.
pub fn last_frame() {
    /// Largest number of reads while the function waits for the transmission. A frame takes 0.1 ms, and the drives
    /// may send up to seven answers before this frame.
    const LOOKS: u32 = 20_000;
    if !embassy_stm32::pac::RCC.apb1henr().read().fdcanen() || CAN.cccr().read().init() {
        return;
    }
    CAN.txbcr().write_value(Txbcr((1 << ram::TX) - 1));
    wait(PATIENCE, || CAN.txbrp().read().0 == 0);
    let zero = Request::Move { torque: [0.0; JOINTS], pump: false }.emit();
    for n in 0..ram::TX {
        if request(n, &zero) {
            let _ = (0..LOOKS).any(|_| CAN.txbto().read().0 & 1 << n != 0);
            return;
        }
    }
}
