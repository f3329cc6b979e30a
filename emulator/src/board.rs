//! The board with its firmware and its environment. The environment consists of a simulated arm with drives and gripper
//! on the joint bus, and of a host on each serial line.
use std::cell::{Ref, RefCell};
use std::rc::Rc;

use can_link::{CanFrame, Id};
use jtc_sim::{FaultKind, Plant, SimConfig};

use crate::clock::{MICROSECOND, MILLISECOND, Time};
use crate::elf::Elf;
use crate::fdcan::{CanPeers, WireFault};
use crate::flash::Bank2;
use crate::gpio::Pin;
use crate::machine::Machine;
use crate::usart::WireByte;

/// Pins of the safety input and output on the Nucleo boards.
const SAFETY: (Pin, Pin) = (Pin('D', 3), Pin('D', 4));

/// A serial port of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Port {
    /// USART2, which is the serial port at the host connector.
    Usart2,
    /// USART3, which is the virtual serial port of the ST-LINK.
    Usart3,
}

/// Settings of a [`Board`].
#[derive(Clone, Debug)]
pub struct BoardConfig {
    /// Settings of the simulated arm, drives and gripper. The settings of the simulator's own controller and serial
    /// line are not used.
    pub sim: SimConfig,
    /// `true` if no other node is on the joint bus.
    pub no_bus: bool,
    /// Bit rate of the serial lines of both hosts, bit/s.
    pub baud: u32,
    /// Pins of the safety input and the safety output.
    pub safety_pins: (Pin, Pin),
    /// Seed of the initial contents of RAM.
    pub seed: u64,
    /// Initial contents of flash bank 2. If the firmware file contains data for bank 2, these data replace the
    /// initial contents.
    pub bank2: Bank2,
}

impl Default for BoardConfig {
    fn default() -> Self {
        Self {
            sim: SimConfig::default(),
            no_bus: false,
            baud: 115_200,
            safety_pins: SAFETY,
            seed: 1,
            bank2: Bank2::default(),
        }
    }
}

/// The plant (arm, drives and gripper) as nodes of the joint bus.
struct Nodes {
    plant: Rc<RefCell<Plant>>,
    answers: Vec<jtc_sim::ReadyAnswer>,
}

impl CanPeers for Nodes {
    fn receive(&mut self, end: Time, frame: &CanFrame, answers: &mut Vec<(Time, CanFrame)>) {
        let id = u16::try_from(frame.id().value()).ok().filter(|_| !frame.is_extended() && frame.is_fd());
        let Some(frame) = id.and_then(|id| jtc_bus::Frame::new(id, frame.data())) else { return };
        self.plant.borrow_mut().receive(end / MICROSECOND, &frame, &mut self.answers);
        for (delay, answer) in self.answers.drain(..) {
            let frame =
                Id::standard(u32::from(answer.id)).and_then(|id| CanFrame::fd_padded(id, answer.data()));
            // The conversion cannot fail, because every frame of the joint bus has a valid identifier and length.
            let Ok(frame) = frame else { continue };
            answers.push((end + u64::from(delay) * MICROSECOND, frame.with_brs(true)));
        }
    }

    fn acknowledge(&self) -> bool {
        self.plant.borrow().acknowledges()
    }
}

/// The machine and the plant, which advance one millisecond at a time.
pub struct Board {
    /// The emulated machine.
    pub machine: Machine,
    plant: Rc<RefCell<Plant>>,
    faults: Vec<FaultKind>,
    safety: (Pin, Pin),
    ms: u64,
}

impl Board {
    /// Creates the board and the plant, and switches on the power of both.
    pub fn new(elf: Elf, config: &BoardConfig) -> Self {
        let plant = Rc::new(RefCell::new(Plant::new(&config.sim)));
        let mut machine = Machine::with_bank2(elf, config.seed, config.bank2.clone());
        let chip = machine.chip();
        if !config.no_bus {
            let nodes = Nodes { plant: Rc::clone(&plant), answers: Vec::new() };
            chip.fdcan.wire.peers = Some(Box::new(nodes));
        }
        for usart in &mut chip.usarts {
            usart.host_baud = config.baud;
        }
        chip.gpio.drive(config.safety_pins.0, Some(true));
        Self { machine, plant, faults: Vec::new(), safety: config.safety_pins, ms: 0 }
    }

    /// Returns the virtual time since power-on, ms.
    pub fn now_ms(&self) -> u64 {
        self.ms
    }

    /// Advances the board and its environment by one millisecond. The machine and the joint bus advance first, and then
    /// the drives and the arm.
    pub fn step(&mut self) {
        self.ms += 1;
        self.machine.run_until(self.ms * MILLISECOND);
        let safety = self.safety_output() == Some(true);
        self.plant.borrow_mut().step(safety);
    }

    /// Runs the board and its environment for `ms` milliseconds.
    pub fn run_ms(&mut self, ms: u64) {
        for _ in 0..ms {
            self.step();
        }
    }

    /// Returns the arm and its drives.
    pub fn plant(&self) -> Ref<'_, Plant> {
        self.plant.borrow()
    }

    /// Starts a simulated fault of a node, the arm, the safety input or the joint bus. Faults (`FaultKind`) of the
    /// simulator's own serial line and tick have no effect on this board.
    pub fn inject(&mut self, kind: FaultKind) {
        self.plant.borrow_mut().begin(kind);
        self.faults.push(kind);
        self.apply_faults();
    }

    /// Ends a simulated fault.
    pub fn heal(&mut self, kind: FaultKind) {
        self.faults.retain(|&k| k != kind);
        self.apply_faults();
    }

    fn apply_faults(&mut self) {
        self.plant.borrow_mut().set_faults(self.faults.iter().copied());
        let has = |kind| self.faults.contains(&kind);
        let fault = WireFault {
            cut: has(FaultKind::NoAcknowledge),
            destroy_all: has(FaultKind::BusOff),
            ..self.machine.chip().fdcan.wire.fault
        };
        let input = !has(FaultKind::SafetyInput);
        let chip = self.machine.chip();
        chip.fdcan.wire.fault = fault;
        chip.drive_pin(self.safety.0, Some(input));
    }

    /// Drives the safety input; `None` means a broken wire.
    pub fn set_safety_input(&mut self, level: Option<bool>) {
        let pin = self.safety.0;
        self.machine.chip().drive_pin(pin, level);
    }

    /// Returns the level of the safety output; `None` if the pin is not driven.
    pub fn safety_output(&mut self) -> Option<bool> {
        let pin = self.safety.1;
        self.machine.chip().gpio.output(pin)
    }

    fn index(port: Port) -> usize {
        match port {
            Port::Usart2 => 0,
            Port::Usart3 => 1,
        }
    }

    /// Sets the bit rate of the host at a port, bit/s.
    pub fn set_baud(&mut self, port: Port, baud: u32) {
        self.machine.chip().usarts[Self::index(port)].host_baud = baud;
    }

    /// Returns the bit rate that the firmware has set at a port, bit/s; 0 if no rate is set.
    pub fn firmware_baud(&self, port: Port) -> u32 {
        self.machine.uc.get_data().usarts[Self::index(port)].baud()
    }

    /// Sends bytes from the host, after the host bytes that already wait for transmission.
    pub fn write(&mut self, port: Port, bytes: &[u8]) {
        let chip = self.machine.chip();
        let now = chip.now();
        chip.usarts[Self::index(port)].host_write(now, bytes);
    }

    /// Returns the number of host bytes that still wait for transmission on the serial line.
    pub fn pending(&self, port: Port) -> usize {
        self.machine.uc.get_data().usarts[Self::index(port)].host_pending()
    }

    /// Returns the bytes that the host has received since the last call, with their arrival times.
    pub fn read_timed(&mut self, port: Port) -> Vec<WireByte> {
        self.machine.chip().usarts[Self::index(port)].take_output().collect()
    }

    /// Returns the bytes that the host has received since the last call.
    pub fn read(&mut self, port: Port) -> Vec<u8> {
        self.read_timed(port).into_iter().map(|b| b.byte).collect()
    }
}
