//! State of the controller in a snapshot. The state in a snapshot contains all values that affect the motion of the arm and the reports of
//! the controller. The state does not contain the arm and the points of the trajectory, because a log identifies both by their hashes.
//!
//! The snapshot does not contain the state of the host link: waiting response records, frames to send, and the progress of a long frame. A
//! replay reproduces the frames on the joint bus and the states, but not the bytes on the host lines.
use jtc_dynamics::Payload;
use jtc_wire::RawPoint;

use crate::bit_codec::{BitCodec, BitSink, bit_codec};
use crate::config::Config;
use crate::controller::Controller;
use crate::errors::Errors;
use crate::execution::phase::Phase;
use crate::host::line_upload::LineUpload;
use crate::host::priority::Priority;
use crate::host_parameters::HostParametersState;
use crate::last_stop::LastStop;
use crate::motion::Motion;
use crate::nodes::Nodes;
use crate::response_queue::HOST_LINES;
use crate::telemetry::Observed;
use crate::tick_overruns::TickOverruns;
use crate::trajectory::path::PathClock;
use crate::trajectory::store::StoreState;
use crate::{ControllerState, JOINTS, TrajectoryState};

/// Identity of the device, the arm and the trajectory of a snapshot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Number of starts of the device.
    pub boots: u32,
    /// Hash of the firmware's version and revision (FNV-1a, 64 bits).
    pub firmware: u64,
    /// Hash of the arm in use (J-52). `None` if this hash was not known yet.
    pub arm: Option<u64>,
    /// Flags that show whether gains, model and friction polynomial have their built-in values. The built-in values have more digits than
    /// an arm image can contain.
    pub built_in: [bool; 3],
    /// Hash of the points of the trajectory in memory.
    pub points_hash: u32,
    /// Number of points of the trajectory in memory.
    pub points: u32,
}

bit_codec!(Origin { boots, firmware, arm, built_in, points_hash, points });

/// Settings that are not part of the arm file.
#[derive(Clone, Copy, Debug)]
struct LiveSettings {
    speed: f64,
    payload: Payload,
    absent: [bool; JOINTS],
    absent_position: [f64; JOINTS],
}

bit_codec!(LiveSettings { speed, payload, absent, absent_position });
bit_codec!(Payload { mass, com, inertia });

impl LiveSettings {
    fn of(config: &Config) -> Self {
        let Config { speed, payload, absent, absent_position, .. } = *config;
        Self { speed, payload, absent, absent_position }
    }

    fn put_into(self, config: &mut Config) {
        let Self { speed, payload, absent, absent_position } = self;
        (config.speed, config.payload) = (speed, payload);
        (config.absent, config.absent_position) = (absent, absent_position);
    }
}

/// State of the controller that a snapshot contains.
#[derive(Clone, Debug)]
pub(crate) struct Dynamic {
    state: ControllerState,
    errors: Errors,
    nodes: Nodes,
    parameters: HostParametersState,
    live: LiveSettings,
    teaching: bool,
    teaching_waits_ms: u32,
    pump: bool,
    store: StoreState,
    trajectory: TrajectoryState,
    clock: PathClock,
    phase: Phase,
    braking_ms: Option<u16>,
    safety_stop_ms: Option<u16>,
    motion: Motion,
    last_stop: LastStop,
    priorities: [Priority; HOST_LINES],
    uploads: [LineUpload; HOST_LINES],
    tick_overruns: TickOverruns,
    observed: Observed,
    hosts_silent_ms: u32,
    jogs_refused_ms: u16,
}

bit_codec!(Dynamic {
    state,
    errors,
    nodes,
    parameters,
    live,
    teaching,
    teaching_waits_ms,
    pump,
    store,
    trajectory,
    clock,
    phase,
    braking_ms,
    safety_stop_ms,
    motion,
    last_stop,
    priorities,
    uploads,
    tick_overruns,
    observed,
    hosts_silent_ms,
    jogs_refused_ms,
});

/// Snapshot of the state of the controller after a tick, as recorded in a log.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Identity of the device, the arm and the trajectory.
    pub origin: Origin,
    pub(crate) dynamic: Dynamic,
}

bit_codec!(Snapshot { origin, dynamic });

impl Snapshot {
    /// Returns the ticks since the start of the device.
    pub fn tick(&self) -> u64 {
        self.dynamic.observed.tick
    }

    /// Returns the state of the controller.
    pub fn state(&self) -> ControllerState {
        self.dynamic.state
    }

    /// Returns the path time since the first point, ms, and the time between points, ms.
    pub fn path_ms(&self) -> (f64, u16) {
        (self.dynamic.clock.time, self.dynamic.store.step_ms())
    }

    /// Returns `true` if a trajectory is being executed, or is paused.
    pub fn needs_points(&self) -> bool {
        matches!(self.dynamic.trajectory, TrajectoryState::Execute | TrajectoryState::Pause)
    }
}

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Returns the identity of the device, the arm and the trajectory.
    pub(crate) fn origin(&self) -> Origin {
        let (points_hash, points) = self.store.points_hash();
        Origin {
            boots: self.extensions.identity.boots,
            firmware: self.extensions.firmware_hash,
            arm: self.extensions.hash,
            built_in: self.parameters.built_in(),
            points_hash,
            points,
        }
    }

    /// Appends the state of the controller, in the order of the fields of [`Dynamic`].
    pub(crate) fn write_state<S: BitSink>(&self, to: &mut S) {
        // The pattern lists every field, so each new field requires a decision about the snapshot.
        let Self {
            config,
            state,
            errors,
            nodes,
            parameters,
            teaching,
            teaching_waits_ms,
            pump,
            store,
            check: _,
            violation: _,
            trajectory,
            clock,
            phase,
            braking_ms,
            safety_stop_ms,
            motion,
            last_stop,
            slice_progress: _,
            priorities,
            uploads,
            records: _,
            since_status_ms: _,
            tick_overruns,
            status_frame: _,
            observed,
            extensions,
        } = self;
        state.write(to);
        errors.write(to);
        nodes.write(to);
        parameters.state().write(to);
        LiveSettings::of(config).write(to);
        teaching.write(to);
        teaching_waits_ms.write(to);
        pump.write(to);
        store.state().write(to);
        trajectory.write(to);
        clock.write(to);
        phase.write(to);
        braking_ms.write(to);
        safety_stop_ms.write(to);
        motion.write(to);
        last_stop.write(to);
        priorities.write(to);
        uploads.write(to);
        tick_overruns.write(to);
        observed.write(to);
        extensions.hosts_silent_ms.write(to);
        extensions.jogs_refused_ms.write(to);
    }

    /// Continues the controller from the state in a snapshot. The controller must have the recorded arm. If the snapshot was taken during a
    /// trajectory, the controller must also have this trajectory.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        let Dynamic {
            state,
            errors,
            nodes,
            parameters,
            live,
            teaching,
            teaching_waits_ms,
            pump,
            store,
            trajectory,
            clock,
            phase,
            braking_ms,
            safety_stop_ms,
            motion,
            last_stop,
            priorities,
            uploads,
            tick_overruns,
            observed,
            hosts_silent_ms,
            jogs_refused_ms,
        } = snapshot.dynamic.clone();
        (self.state, self.errors, self.nodes) = (state, errors, nodes);
        live.put_into(&mut self.config);
        self.parameters.use_built_in(snapshot.origin.built_in);
        self.parameters.restore(&parameters, &self.config);
        (self.teaching, self.teaching_waits_ms, self.pump) = (teaching, teaching_waits_ms, pump);
        self.store.restore(&store);
        (self.trajectory, self.clock, self.phase) = (trajectory, clock, phase);
        (self.braking_ms, self.safety_stop_ms) = (braking_ms, safety_stop_ms);
        (self.motion, self.last_stop) = (motion, last_stop);
        (self.priorities, self.uploads) = (priorities, uploads);
        (self.tick_overruns, self.observed) = (tick_overruns, observed);
        self.extensions.hosts_silent_ms = hosts_silent_ms;
        self.extensions.jogs_refused_ms = jogs_refused_ms;
    }

    /// Returns the hash of the trajectory points in memory.
    pub fn points_hash(&self) -> u32 {
        self.store.points_hash().0
    }

    /// Returns the trajectory points in memory.
    pub fn points(&self) -> &[RawPoint] {
        self.store.held_points(0)
    }

    /// Copies trajectory points into the memory of a controller that replays a log, starting with number `first`.
    pub fn put_points(&mut self, first: usize, points: &[RawPoint]) {
        self.store.put_points(first, points);
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::boxed::Box;

    use super::*;
    use crate::bit_codec::tests::Bits;
    use crate::settings::{self, TABLE};

    /// A snapshot contains each setting that the hash of the arm does not cover.
    #[test]
    fn j56_every_setting_that_is_no_part_of_the_arm_is_remembered() {
        let points = || [RawPoint::default(); 4];
        for row in TABLE.iter().filter(|row| !row.of_arm()) {
            for joint in if row.of_joint() { 1..=JOINTS as u8 } else { 0..=0 } {
                let mut controller = Box::new(Controller::new(Config::avena(), points()));
                let before = row.get(&controller.config, joint).expect("a value");
                let value = if before == row.high { row.low } else { row.high };
                let set = jtc_wire::SettingValue { setting: row.number, joint, value };
                settings::apply(&mut controller.config, set).expect("a value in its range");
                let mut bits = Bits::default();
                controller.origin().write(&mut bits);
                controller.write_state(&mut bits);
                let snapshot = Snapshot::read(&mut bits);
                let mut next = Box::new(Controller::new(Config::avena(), points()));
                next.restore(&snapshot);
                assert_eq!(row.get(&next.config, joint), Some(value), "{} {joint}", row.name);
            }
        }
    }

    /// Returns a Trajectory body with two points, 20 ms apart. Bytes 9 and 45 are the low bytes of the first position
    /// of point 0 and of point 1.
    fn body() -> [u8; 80] {
        let mut body = [0; 80];
        (body[5], body[7], body[9], body[45]) = (1, 20, 3, 4);
        body
    }

    /// The snapshot in a log shows the state of the controller and the path time.
    #[test]
    fn j56_a_snapshot_shows_the_state_and_the_time_on_the_path() {
        let body = body();
        let segment = jtc_wire::Segment::parse(&body).expect("a segment");
        let mut controller = Box::new(Controller::new(Config::avena(), [RawPoint::default(); 4]));
        controller.store.begin(&segment, false, false);
        controller.clock.time = 12.5;
        for state in ControllerState::ALL {
            for trajectory in TrajectoryState::ALL {
                (controller.state, controller.trajectory) = (state, trajectory);
                let mut bits = Bits::default();
                controller.origin().write(&mut bits);
                controller.write_state(&mut bits);
                let snapshot = Snapshot::read(&mut bits);
                assert_eq!((snapshot.state(), snapshot.path_ms()), (state, (12.5, 20)));
                // A replay needs the points only if the controller continues on the path.
                let needed = trajectory == TrajectoryState::Execute || trajectory == TrajectoryState::Pause;
                assert_eq!(snapshot.needs_points(), needed, "{trajectory:?}");
            }
        }
    }

    #[test]
    fn j56_the_points_in_memory_are_those_of_the_trajectory() {
        let body = body();
        let segment = jtc_wire::Segment::parse(&body).expect("a segment");
        let mut controller = Box::new(Controller::new(Config::avena(), [RawPoint::default(); 4]));
        controller.store.begin(&segment, false, false);
        assert_eq!(controller.points(), []);
        controller.store.copy(&segment, 0, 2);
        controller.store.commit(&segment, Default::default());
        let points: std::vec::Vec<i16> = controller.points().iter().map(|point| point.position[0]).collect();
        assert_eq!(points, [3, 4]);
    }
}
