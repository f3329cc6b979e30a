//! Methods of the simulation for its users.
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

/// Counters since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Counters of the joint bus.
    pub bus: BusStatistics,
    /// Number of bytes that reached the controller's end of the line.
    pub serial_to_device: u64,
    /// Number of bytes that reached the host.
    pub serial_to_host: u64,
    /// Number of valid host frames that the controller executed.
    pub good_frames: u64,
    /// Number of bad frames and of noise.
    pub bad_frames: u64,
    /// Number of bytes from the host that the board could not store.
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
    /// Returns the virtual time since the start, µs.
    pub fn now_us(&self) -> u64 {
        self.ticks * TICK_US
    }

    /// Puts bytes of the host on the line; the device receives them at the rate of the line.
    pub fn host_write(&mut self, bytes: &[u8]) {
        if !bytes.is_empty() {
            self.to_device.write(self.now_us(), bytes);
        }
    }

    /// Limits the host's silence to `us` µs of its own time, although virtual time may pass faster. A frame that another program sends in
    /// pieces is then not interrupted by a gap (J-03) that the host did not cause. Bytes that wait on the line still cause gaps. `None`,
    /// the default: only virtual time counts.
    pub fn limit_host_silence(&mut self, us: Option<u64>) {
        self.silence_us = us;
    }

    /// Returns the number of the host's bytes that have not reached the device.
    pub fn host_write_pending(&self) -> usize {
        self.to_device.pending()
    }

    /// Takes bytes that have reached the host by now; returns their number.
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

    /// Returns the controller, for a replay of a recording.
    pub fn controller(&self) -> &Controller<Vec<RawPoint>> {
        self.board.controller()
    }

    /// Returns the telemetry of the controller's last tick.
    pub fn telemetry(&self) -> &Telemetry {
        self.board.telemetry()
    }

    /// Returns the image of the arm that the controller's board has stored, and its number (J-54).
    pub fn stored_arm(&self) -> Option<(&[u8], u32)> {
        self.board.stored_arm()
    }

    /// Returns the true state of the arm.
    pub fn truth(&self) -> &Truth {
        self.plant.truth()
    }

    /// Returns the arm after model errors.
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

    /// Returns the inputs and outputs of the controller's board in the last millisecond; `None` unless it is
    /// [watched](Self::watch_board).
    pub fn exchange(&self) -> Option<&Exchange> {
        self.exchange.as_deref()
    }

    /// Returns true if the controller had its tick in the last millisecond.
    pub fn ticked(&self) -> bool {
        self.ticked
    }

    /// Returns the state of the bus in the last millisecond.
    pub fn bus_state(&self) -> BusState {
        self.bus_state
    }

    /// Returns all frames on the joint bus in the last millisecond.
    pub fn bus_frames(&self) -> &[TimedFrame] {
        self.bus.frames()
    }

    /// Queues a frame of a member of the joint bus outside this simulation: an answer for the controller, or a request for the nodes.
    /// Returns `false` if too many such frames wait already.
    pub fn put_bus_frame(&mut self, frame: Frame) -> bool {
        self.bus.put(frame)
    }

    /// Returns the state bytes of joints and gripper (255: no gripper).
    pub fn node_states(&self) -> [NodeState; NODES] {
        self.node_states
    }

    /// Returns the host frames that the last tick executed.
    pub fn worked(&self) -> &[Worked] {
        &self.board.worked
    }

    /// Returns the level of the controller's safety output: true = no error.
    pub fn safety_output(&self) -> bool {
        self.safety_output
    }

    /// Sets the level of the controller's safety input: true = no error.
    pub fn set_safety_input(&mut self, level: bool) {
        self.safety_input = level;
    }

    /// Places a part under the gripper, or removes it. A part is present from the start.
    pub fn set_part_present(&mut self, present: bool) {
        self.plant.set_part_present(present);
    }

    /// Adds a fault; `Trigger::At` counts from the start of the simulation.
    pub fn inject(&mut self, fault: Fault) {
        self.faults.add(fault);
    }

    /// Adds the faults of a fault file; `Trigger::At` counts from the start of the simulation.
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

    /// Pushes a joint with a torque (N·m) for `ms` milliseconds from now on.
    pub fn push(&mut self, joint: Joint, torque: f64, ms: u64) {
        let trigger = Trigger::At(self.now_us() / TICK_US);
        self.inject(Fault { kind: FaultKind::Push { joint, torque }, trigger, duration_ms: Some(ms) });
    }

    /// Leads the arm along a path by a hand as soon as it is taught. Replaces a hand that leads it already.
    pub fn lead(&mut self, path: HandPath) {
        let kind = FaultKind::Hand { path: self.hands.len() };
        self.hands.push(path);
        let trigger = Trigger::At(self.now_us() / TICK_US);
        self.inject(Fault { kind, trigger, duration_ms: None });
    }

    /// Returns the last millisecond, for the checker of invariants.
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

    /// Returns the counters since the start.
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
