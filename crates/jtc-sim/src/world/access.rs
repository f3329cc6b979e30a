//! Methods that the users of the simulation call.
use jtc_bus::{Frame, Joint, NODES, NodeState};
use jtc_core::{BusState, Controller, Telemetry};
use jtc_dynamics::ArmModel;
use jtc_wire::RawPoint;

use super::Moment;
use super::{Exchange, TICK_US, World};
use crate::board::{SimRecorder, Worked};
use crate::bus::{BusStatistics, TimedFrame};
use crate::config::SimConfig;
use crate::event::Log;
use crate::faults::{Fault, FaultKind, FaultPlan, Trigger};
use crate::hand::HandPath;
use crate::plant::Truth;

/// Counters since the start of the simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Counters of the joint bus.
    pub bus: BusStatistics,
    /// Number of bytes on the serial line that reached the controller.
    pub serial_to_device: u64,
    /// Number of bytes that reached the host.
    pub serial_to_host: u64,
    /// Number of valid host frames that the controller executed.
    pub good_frames: u64,
    /// Number of invalid frames and noise events on the serial line.
    pub bad_frames: u64,
    /// Number of bytes from the host that the board could not store in its buffer.
    pub lost_bytes: u64,
    /// Number of resets by the watchdog.
    pub watchdog_resets: u32,
    /// Number of simulated milliseconds.
    pub ticks: u64,
}

impl Statistics {
    /// Returns the share of the time in which the joint bus was busy, 0..1.
    pub fn bus_load(&self) -> f64 {
        if self.ticks == 0 { 0.0 } else { self.bus.busy_us as f64 / (self.ticks * TICK_US) as f64 }
    }
}

impl World {
    /// Returns the virtual time since the start of the simulation, µs.
    pub fn now_us(&self) -> u64 {
        self.ticks * TICK_US
    }

    /// Adds bytes of the host to the serial line. The device receives these bytes at the rate of the line.
    pub fn host_write(&mut self, bytes: &[u8]) {
        if !bytes.is_empty() {
            self.to_device.write(self.now_us(), bytes);
        }
    }

    /// Limits the silence that the board measures between bytes of the host to `us` µs, the real time for which the
    /// host was silent. With `None`, the default, the board measures the silence in virtual time.
    ///
    /// Virtual time can pass faster than real time. A frame that another program sends in pieces would then contain a
    /// gap (J-03). Bytes that wait on the line still cause gaps.
    pub fn limit_host_silence(&mut self, us: Option<u64>) {
        self.silence_us = us;
    }

    /// Returns the number of the host's bytes that have not reached the device.
    pub fn host_write_pending(&self) -> usize {
        self.to_device.pending()
    }

    /// Moves the bytes that have reached the host into `buffer`, and returns the number of these bytes.
    pub fn host_read(&mut self, buffer: &mut [u8]) -> usize {
        let count = buffer.len().min(self.host_inbox.len());
        buffer[..count].copy_from_slice(&self.host_inbox[..count]);
        self.host_inbox.drain(..count);
        count
    }

    /// Returns the flight recorder of the controller's board (J-56).
    pub fn recorder(&self) -> &SimRecorder {
        self.board.recorder()
    }

    /// Clears the log of the flight recorder.
    pub fn clear_log(&mut self) {
        self.board.clear_log();
    }

    /// Returns the controller. A replay of a recording needs this controller.
    pub fn controller(&self) -> &Controller<Vec<RawPoint>> {
        self.board.controller()
    }

    /// Returns the telemetry of the controller's last tick.
    pub fn telemetry(&self) -> &Telemetry {
        self.board.telemetry()
    }

    /// Returns the image of the arm that the controller's board has stored, and the sequence number of the image (J-54).
    pub fn stored_arm(&self) -> Option<(&[u8], u32)> {
        self.board.stored_arm()
    }

    /// Returns the true state of the arm.
    pub fn truth(&self) -> &Truth {
        self.plant.truth()
    }

    /// Returns the model of the true arm, which includes the model errors.
    pub fn true_model(&self) -> &ArmModel {
        self.plant.true_model()
    }

    /// Returns the settings of the simulation.
    pub fn config(&self) -> &SimConfig {
        &self.config
    }

    /// Returns the frame that the controller sent in the last tick.
    pub fn sent(&self) -> Option<&Frame> {
        self.sent.as_ref()
    }

    /// Starts to record the inputs and outputs of the controller's board in [`exchange`](Self::exchange).
    pub fn watch_board(&mut self) {
        self.exchange.get_or_insert_default();
    }

    /// Returns the inputs and outputs of the controller's board in the last millisecond. Returns `None` if the board is not
    /// [watched](Self::watch_board).
    pub fn exchange(&self) -> Option<&Exchange> {
        self.exchange.as_deref()
    }

    /// Returns `true` if the controller executed its tick in the last millisecond.
    pub fn ticked(&self) -> bool {
        self.ticked
    }

    /// Returns the state of the joint bus in the last millisecond.
    pub fn bus_state(&self) -> BusState {
        self.bus_state
    }

    /// Returns all frames on the joint bus in the last millisecond.
    pub fn bus_frames(&self) -> &[TimedFrame] {
        self.bus.frames()
    }

    /// Queues a frame of a node outside this simulation. The frame is an answer for the controller, or a request for the nodes.
    /// Returns `false` if too many such frames are already queued.
    pub fn put_bus_frame(&mut self, frame: Frame) -> bool {
        self.bus.put(frame)
    }

    /// Returns the state bytes of the joints and the gripper (255 without a gripper).
    pub fn node_states(&self) -> [NodeState; NODES] {
        self.node_states
    }

    /// Returns the host frames that the last tick processed, including invalid frames.
    pub fn worked(&self) -> &[Worked] {
        &self.board.worked
    }

    /// Returns the level of the controller's safety output; `true` means no error.
    pub fn safety_output(&self) -> bool {
        self.safety_output
    }

    /// Sets the level of the controller's safety input; `true` means no error.
    pub fn set_safety_input(&mut self, level: bool) {
        self.safety_input = level;
    }

    /// Places a part under the gripper, or removes the part. At the start, a part is under the gripper.
    pub fn set_part_present(&mut self, present: bool) {
        self.plant.set_part_present(present);
    }

    /// Adds a fault. `Trigger::At` is the time since the start of the simulation.
    pub fn inject(&mut self, fault: Fault) {
        self.faults.add(fault);
    }

    /// Adds the faults of a fault file. `Trigger::At` is the time since the start of the simulation.
    pub fn inject_all(&mut self, plan: FaultPlan) {
        let known = self.hands.len();
        self.hands.extend(plan.hands);
        for mut fault in plan.faults {
            if let FaultKind::Hand { path } = &mut fault.kind {
                *path += known;
            }
            self.inject(fault);
        }
    }

    /// Pushes a joint with a torque (N·m) for `ms` milliseconds, beginning now.
    pub fn push(&mut self, joint: Joint, torque: f64, ms: u64) {
        let trigger = Trigger::At(self.now_us() / TICK_US);
        self.inject(Fault { kind: FaultKind::Push { joint, torque }, trigger, duration_ms: Some(ms) });
    }

    /// Adds a hand that guides the arm along a path as soon as Teaching begins. Replaces a hand that already guides the
    /// arm.
    pub fn lead(&mut self, path: HandPath) {
        let kind = FaultKind::Hand { path: self.hands.len() };
        self.hands.push(path);
        let trigger = Trigger::At(self.now_us() / TICK_US);
        self.inject(Fault { kind, trigger, duration_ms: None });
    }

    /// Returns the data of the last millisecond, for the check of invariants.
    pub fn moment(&self) -> Moment<'_> {
        Moment {
            time_us: self.now_us(),
            ticked: self.ticked,
            telemetry: self.board.telemetry(),
            truth: self.plant.truth(),
            sent: self.sent.as_ref(),
            worked: &self.board.worked,
            safety_output: self.safety_output,
            config: self.board.controller_config(),
        }
    }

    /// Returns the event log.
    pub fn log(&self) -> &Log {
        &self.log
    }

    /// Returns the counters since the start of the simulation.
    pub fn statistics(&self) -> Statistics {
        Statistics {
            bus: self.bus.statistics,
            serial_to_device: self.to_device.carried,
            serial_to_host: self.to_host.carried,
            good_frames: self.good_frames,
            bad_frames: self.bad_frames,
            lost_bytes: self.board.lost_bytes,
            watchdog_resets: self.board.watchdog_resets,
            ticks: self.ticks,
        }
    }
}
