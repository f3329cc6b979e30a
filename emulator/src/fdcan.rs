//! FDCAN1 (RM0399 chapter 56, a Bosch M_CAN) with its message RAM: filters, dedicated buffers, FIFOs, transmission by
//! identifier, error counters and bus-off.
mod bus;
mod pending;
mod ram;
mod receive;
mod registers;
mod transmit;

pub use bus::{BusEntry, CanPeers, Outcome, Wire, WireFault, frame_time};
pub use ram::{MessageRam, Target};

use crate::clock::{NEVER, Time};
use bus::NOMINAL_BIT;
use pending::Pending;

/// Bits of register CCCR.
mod cccr {
    pub const INIT: u32 = 1;
    pub const CCE: u32 = 2;
    pub const CSR: u32 = 0x10;
    pub const MON: u32 = 0x20;
    pub const DAR: u32 = 0x40;
    pub const FDOE: u32 = 0x100;
    pub const BRSE: u32 = 0x200;
    /// Bits of CCCR that the program can change only with INIT and CCE set.
    pub const PROTECTED: u32 = 0xF3E0;
}

/// Bits of register IR.
mod ir {
    pub const RF0N: u32 = 1;
    pub const RF0F: u32 = 4;
    pub const RF0L: u32 = 8;
    pub const TC: u32 = 1 << 9;
    pub const TCF: u32 = 1 << 10;
    pub const TFE: u32 = 1 << 11;
    pub const DRX: u32 = 1 << 19;
    pub const EP: u32 = 1 << 23;
    pub const EW: u32 = 1 << 24;
    pub const BO: u32 = 1 << 25;
    pub const PEA: u32 = 1 << 27;
    pub const PED: u32 = 1 << 28;
}

/// Error codes of PSR.LEC.
mod lec {
    pub const NONE: u32 = 0;
    pub const ACK: u32 = 3;
    pub const BIT1: u32 = 4;
    pub const BIT0: u32 = 5;
    pub const CRC: u32 = 6;
    pub const UNCHANGED: u32 = 7;
}

/// Duration of the recovery sequence after bus-off: 129 times 11 recessive bits.
const RECOVERY: Time = 129 * 11 * NOMINAL_BIT;
/// Duration of the recessive bits that a node must detect after it leaves INIT, before it participates in bus traffic.
const INTEGRATION: Time = 11 * NOMINAL_BIT;

/// A receive FIFO of FDCAN1.
#[derive(Clone, Copy, Default)]
struct Fifo {
    config: u32,
    fill: u32,
    get: u32,
    put: u32,
    lost: bool,
}

/// State of the CAN controller, for observers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FdcanState {
    /// Value of register CCCR.
    pub cccr: u32,
    /// Value of register NBTP.
    pub nbtp: u32,
    /// Value of register DBTP.
    pub dbtp: u32,
    /// Value of register TDCR.
    pub tdcr: u32,
    /// Transmit error counter.
    pub tec: u32,
    /// Receive error counter.
    pub rec: u32,
    /// `true` if the CAN controller is bus-off.
    pub bus_off: bool,
    /// `true` if the CAN controller participates in bus traffic.
    pub online: bool,
    /// Nominal and data bit rate, bit/s.
    pub rates: (u32, u32),
    /// Pending transmit requests, one bit per transmit buffer.
    pub pending: u32,
    /// Number of received frames that were lost because a FIFO was full.
    pub lost: u32,
}

/// The CAN controller FDCAN1.
pub struct Fdcan {
    /// The message RAM, which the core accesses at address 0x4000_AC00.
    pub ram: MessageRam,
    /// The line of the joint bus.
    pub wire: Wire,
    kernel_hz: u64,
    cccr: u32,
    nbtp: u32,
    dbtp: u32,
    tdcr: u32,
    psr: u32,
    tec: u32,
    rec: u32,
    ir: u32,
    ie: u32,
    ils: u32,
    ile: u32,
    gfc: u32,
    sidfc: u32,
    xidfc: u32,
    xidam: u32,
    ndat: [u32; 2],
    fifos: [Fifo; 2],
    rxbc: u32,
    rxesc: u32,
    txbc: u32,
    txesc: u32,
    tx: Pending,
    txbtie: u32,
    txbcie: u32,
    plain: crate::plain::Plain,
    /// Time from which the CAN controller participates in bus traffic; `NEVER` in INIT.
    online: Time,
    /// End of the recovery sequence after bus-off.
    recovers: Time,
    lost: u32,
    /// Number of frames that the CAN controller received and stored.
    pub stored: u64,
    /// Number of received frames that the filters rejected.
    pub rejected: u64,
}

impl Default for Fdcan {
    fn default() -> Self {
        Self {
            ram: MessageRam::default(),
            wire: Wire::default(),
            kernel_hz: 0,
            cccr: cccr::INIT,
            nbtp: 0x0600_0A03,
            dbtp: 0x0000_0A33,
            tdcr: 0,
            psr: 0x0707,
            tec: 0,
            rec: 0,
            ir: 0,
            ie: 0,
            ils: 0,
            ile: 0,
            gfc: 0,
            sidfc: 0,
            xidfc: 0,
            xidam: 0x1FFF_FFFF,
            ndat: [0; 2],
            fifos: [Fifo::default(); 2],
            rxbc: 0,
            rxesc: 0,
            txbc: 0,
            txesc: 0,
            tx: Pending::default(),
            txbtie: 0,
            txbcie: 0,
            plain: crate::plain::Plain::default(),
            online: NEVER,
            recovers: NEVER,
            lost: 0,
            stored: 0,
            rejected: 0,
        }
    }
}

impl Fdcan {
    /// Sets the registers to their values after reset. The reset does not affect the bus or the contents of the
    /// message RAM.
    pub fn reset(&mut self) {
        let old = core::mem::take(self);
        self.ram = old.ram;
        self.wire = old.wire;
        self.wire.drop_controller();
        self.kernel_hz = old.kernel_hz;
        (self.lost, self.stored, self.rejected) = (old.lost, old.stored, old.rejected);
    }

    /// Sets the kernel clock of FDCAN1.
    pub fn set_clock(&mut self, hz: u64) {
        self.kernel_hz = hz;
    }

    /// Returns the nominal and data bit rates that the registers set, bit/s.
    pub fn rates(&self) -> (u32, u32) {
        let rate =
            |prescaler: u32, quanta: u32| (self.kernel_hz / u64::from((prescaler + 1) * quanta)) as u32;
        let nominal = rate(self.nbtp >> 16 & 0x1FF, (self.nbtp >> 8 & 0xFF) + (self.nbtp & 0x7F) + 3);
        let data = rate(self.dbtp >> 16 & 0x1F, (self.dbtp >> 8 & 0x1F) + (self.dbtp >> 4 & 15) + 3);
        (nominal, data)
    }

    /// Returns `true` if the bit rates of the CAN controller are within 1 % of the bit rates of the bus.
    fn readable(&self) -> bool {
        let near = |rate: u32, of: u32| u64::from(rate.abs_diff(of)) * 100 <= u64::from(of);
        let (nominal, data) = self.rates();
        near(nominal, 1_000_000) && (self.cccr & cccr::BRSE == 0 || near(data, 5_000_000))
    }

    /// Returns the state of the CAN controller for observers.
    pub fn state(&self) -> FdcanState {
        FdcanState {
            cccr: self.cccr,
            nbtp: self.nbtp,
            dbtp: self.dbtp,
            tdcr: self.tdcr,
            tec: self.tec,
            rec: self.rec,
            bus_off: self.bus_off(),
            online: self.online != NEVER && !self.bus_off(),
            rates: self.rates(),
            pending: self.tx.requests,
            lost: self.lost,
        }
    }

    fn bus_off(&self) -> bool {
        self.psr & 0x80 != 0
    }

    /// Returns the time from which the CAN controller sends and receives: `online`, or `NEVER` in INIT, clock stop or
    /// bus-off.
    fn takes_part(&self) -> Time {
        if self.bus_off() || self.cccr & (cccr::INIT | cccr::CSR) != 0 { NEVER } else { self.online }
    }

    /// Returns the time of the next event of the CAN controller.
    pub fn next_event(&self) -> Time {
        let own = if self.wire.busy() { NEVER } else { self.tx.since().max(self.takes_part()) };
        self.wire.next_change().min(own).min(self.recovers)
    }

    /// Executes all events of FDCAN1 and of the bus up to `now`.
    pub fn advance(&mut self, now: Time) {
        loop {
            if self.recovers <= now {
                self.recover();
            }
            if let Some(done) = self.wire.finished(now) {
                self.finish(done);
                continue;
            }
            let own = if self.tx.requests == 0 || self.cccr & cccr::MON != 0 {
                NEVER
            } else {
                self.tx.since().max(self.takes_part())
            };
            let Some(start) = self.wire.start_time(own, now) else { return };
            let buffer = if own <= start { self.next_buffer() } else { None };
            let frame = buffer.and_then(|b| Some((b, self.load(b)?)));
            let readable = self.readable();
            self.wire.arbitrate(start, frame, readable);
            if !self.wire.busy() {
                return;
            }
        }
    }

    fn finish(&mut self, done: bus::Transmission) {
        let end = done.entry.end;
        match (done.buffer, done.entry.outcome) {
            (Some(buffer), Outcome::Good) => {
                self.sent(buffer);
                self.wire.deliver(end, &done.entry.frame);
            }
            (Some(buffer), outcome) => self.failed(buffer, outcome, end),
            (None, Outcome::Good) if end >= self.takes_part() => {
                if self.wire.fault.cut {
                    return;
                }
                if self.readable() {
                    self.rec = self.rec.saturating_sub(1).min(127);
                    self.last_error(lec::NONE);
                    self.receive(&done.entry.frame);
                } else {
                    self.receive_error();
                }
            }
            (None, Outcome::Error) if end >= self.takes_part() => self.receive_error(),
            _ => {}
        }
        self.update_status();
    }

    fn receive_error(&mut self) {
        self.rec = (self.rec + 1).min(128);
        self.last_error(lec::CRC);
    }

    fn last_error(&mut self, code: u32) {
        self.psr = self.psr & !7 | code;
        if code != lec::NONE {
            self.ir |= ir::PEA;
        }
    }

    /// Derives the error warning, error passive and bus-off states from the error counters.
    fn update_status(&mut self) {
        let passive = self.tec >= 128 || self.rec >= 128;
        let warning = self.tec >= 96 || self.rec >= 96;
        let status = u32::from(passive) << 5 | u32::from(warning) << 6;
        let changed = (self.psr ^ status) & 0x60;
        self.psr = self.psr & !0x60 | status;
        if changed & 0x20 != 0 {
            self.ir |= ir::EP;
        }
        if changed & 0x40 != 0 {
            self.ir |= ir::EW;
        }
        if self.tec > 255 && !self.bus_off() {
            self.psr |= 0x80;
            self.ir |= ir::BO;
            self.cccr |= cccr::INIT;
            self.online = NEVER;
            self.recovers = NEVER;
        }
    }

    /// Ends the recovery sequence after bus-off.
    fn recover(&mut self) {
        self.online = self.recovers;
        self.recovers = NEVER;
        (self.tec, self.rec) = (0, 0);
        self.psr &= !0x80;
        self.ir |= ir::BO;
        self.update_status();
    }

    /// Returns the levels of interrupt lines 0 and 1 of FDCAN1.
    pub fn lines(&self) -> [bool; 2] {
        let active = self.ir & self.ie;
        [active & !self.ils != 0 && self.ile & 1 != 0, active & self.ils != 0 && self.ile & 2 != 0]
    }
}
