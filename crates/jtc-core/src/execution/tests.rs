//! Tests of the execution of a trajectory, tick by tick (section 5).
use jtc_wire::Segment;

use super::*;
use crate::{Config, ControllerState};

mod hold_back;
mod starting;

fn braking(state: ControllerState, trajectory: TrajectoryState) -> Controller<[RawPoint; 4]> {
    let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
    (controller.state, controller.trajectory, controller.braking_ms) = (state, trajectory, Some(5));
    controller
}

/// Begins an approach from `position` (rad), at which the arm is held.
fn begin_approach(controller: &mut Controller<[RawPoint; 4]>, position: [f64; JOINTS]) {
    controller.motion.set.begin_at(&position);
    let point = controller.path_point();
    controller.phase = controller.approach_to(&point).expect("an approach");
}

/// Errors (J-43) are suppressed while a pause or stop brakes, but only as long as the arm still moves.
#[test]
fn j33_braking_ends_where_the_arm_stands() {
    let mut stands = braking(ControllerState::HoldPos, TrajectoryState::Pause);
    assert!(!stands.brake());
    assert_eq!(stands.braking_ms, None);
    let mut moves = braking(ControllerState::HoldPos, TrajectoryState::Pause);
    moves.motion.set.point.velocity[2] = -0.03;
    assert!(moves.brake());
    assert_eq!(moves.braking_ms, Some(6));
    let mut on_the_path = braking(ControllerState::Operate, TrajectoryState::Execute);
    assert!(on_the_path.brake(), "path time still runs");
}

#[test]
fn j33_braking_ends_with_the_states_that_hold_or_follow() {
    for (next, goes_on) in
        [(ControllerState::HoldPos, true), (ControllerState::Error, false), (ControllerState::Init, false)]
    {
        let mut controller = braking(ControllerState::Operate, TrajectoryState::Execute);
        controller.enter(next);
        assert_eq!(controller.braking_ms.is_some(), goes_on, "{next:?}");
    }
}

#[test]
fn j34_after_a_stop_the_path_begins_anew() {
    for (trajectory, time) in [
        (TrajectoryState::Stop, 0.0),
        (TrajectoryState::Null, 0.0),
        (TrajectoryState::Pause, 250.0),
        (TrajectoryState::Finish, 250.0),
    ] {
        let mut controller = braking(ControllerState::Operate, TrajectoryState::Execute);
        controller.clock.time = 250.0;
        controller.set_trajectory(trajectory);
        assert_eq!(controller.clock.time, time, "{trajectory:?}: this is the index that the status shows");
    }
}

/// Returns a controller on the path that accepted a Pause `ms` ago.
fn pausing(ms: u16) -> Controller<[RawPoint; 4]> {
    let mut controller = braking(ControllerState::Operate, TrajectoryState::Execute);
    controller.phase = Phase::Running { leave: Some(TrajectoryState::Pause) };
    controller.braking_ms = Some(ms);
    (controller.clock, controller.clock.time) = (PathClock::start(1.0), 250.0);
    controller
}

#[test]
fn j33_a_path_that_cannot_be_stopped_is_an_error_of_the_joints_that_move() {
    let most = Config::avena().braking_ms_max;
    for (trajectory, ms, goes_on, error) in [
        (TrajectoryState::Execute, most - 1, true, 0),
        (TrajectoryState::Execute, most, false, joint_error::TORQUE),
        // In the next cases the arm is already held, but an external force still moves it. This is not an error.
        (TrajectoryState::Pause, most - 1, true, 0),
        (TrajectoryState::Pause, most, false, 0),
    ] {
        let mut controller = pausing(ms);
        (controller.trajectory, controller.motion.set.point.velocity[2]) = (trajectory, -0.03);
        assert_eq!(controller.brake(), goes_on, "{trajectory:?} after {ms} ms");
        let found: [u16; JOINTS] = core::array::from_fn(|j| controller.errors.joint(j).0);
        assert_eq!(found, [0, 0, error, 0, 0, 0], "{trajectory:?} after {ms} ms");
    }
    let mut controller = pausing(most);
    controller.brake();
    assert!(!controller.errors.any(), "it stands");
}

/// At the end of `stop_ms`, an arm that moves only at 0.01 rad/s counts as stopped. At 0.03 rad/s the arm does not
/// count as stopped.
#[test]
fn j33_an_arm_that_stands_when_its_time_is_over_has_stopped() {
    let most = Config::avena().stop_ms;
    for (ms, velocity, trajectory) in [
        (most - 1, 0.01, TrajectoryState::Execute),
        (most, 0.01, TrajectoryState::Pause),
        (most, -0.03, TrajectoryState::Execute),
    ] {
        let mut controller = pausing(ms);
        controller.motion.set.point.velocity[4] = velocity;
        controller.brake();
        assert_eq!(
            (controller.trajectory, controller.clock.standing()),
            (trajectory, trajectory == TrajectoryState::Pause),
            "{ms} {velocity}"
        );
        assert_eq!(controller.clock.time, 250.0);
    }
}

#[test]
fn j33_a_second_stop_gives_no_more_time_to_brake() {
    let mut controller = pausing(700);
    controller.leave_path(ExecCommand::Stop);
    assert_eq!(controller.braking_ms, Some(700));
    assert_eq!(
        controller.phase,
        Phase::Running { leave: Some(TrajectoryState::Stop) },
        "the later command holds"
    );
}

#[test]
fn j34_an_arm_exactly_at_the_tolerance_is_at_the_point() {
    let mut controller = braking(ControllerState::HoldPos, TrajectoryState::Stop);
    controller.config.start_tolerance_rad = 0.25;
    assert!(controller.near(&[0.0, 0.25, -0.25, 0.0, 0.1, 0.0]));
    assert!(!controller.near(&[0.0, 0.25, -0.2501, 0.0, 0.1, 0.0]));
    controller.config.start_tolerance_rad = 0.0;
    assert!(controller.near(&[0.0; JOINTS]));
}

#[test]
fn j33_j66_what_a_pause_or_stop_on_its_way_leads_to() {
    let leave = Some(TrajectoryState::Stop);
    assert_eq!(Phase::Running { leave }.leave(), leave);
    assert_eq!(
        Phase::Approaching { from: [0.0; JOINTS], length_ms: 200.0, clock: PathClock::start(1.0), leave }
            .leave(),
        leave
    );
    assert_eq!((Phase::BEGIN.leave(), Phase::AtStart.leave()), (None, None));
}

/// Returns a controller that decelerates at this path time, on a path of four points that are 100 ms apart.
fn halting_at(time: f64) -> Controller<[RawPoint; 4]> {
    let mut controller = pausing(5);
    let mut body = [0; 8 + 4 * 36];
    (body[5], body[7]) = (1, 100);
    let segment = Segment::parse(&body).expect("four points");
    controller.store.begin(&segment, false, false);
    controller.store.copy(&segment, 0, 4);
    controller.store.commit(&segment, Default::default());
    controller.clock.time = time;
    controller.clock.halt();
    controller
}

#[test]
fn j33_a_stop_ends_at_the_last_point_whatever_the_ramp_says() {
    for (time, trajectory) in [(100.0, TrajectoryState::Execute), (299.5, TrajectoryState::Pause)] {
        let mut controller = halting_at(time);
        controller.walk();
        assert_eq!(controller.trajectory, trajectory, "{time}");
        assert_eq!(controller.clock.standing(), trajectory == TrajectoryState::Pause, "{time}");
    }
}

#[test]
fn j16_an_execute_waits_for_the_joints_as_long_as_enabling_may_take() {
    let most = Config::avena().enable_timeout_ms;
    for (elapsed_ms, trajectory) in
        [(0, TrajectoryState::Execute), (most - 1, TrajectoryState::Execute), (most, TrajectoryState::Stop)]
    {
        let mut controller = braking(ControllerState::Operate, TrajectoryState::Execute);
        controller.phase = Phase::Waiting { elapsed_ms };
        controller.walk();
        assert_eq!(controller.trajectory, trajectory, "after {elapsed_ms} ms");
    }
}

#[test]
fn j34_an_approach_takes_the_time_of_the_ramp() {
    let length = f64::from(Config::avena().ramp_ms);
    for (before, arrives) in [(0.0, false), (length - 2.0, false), (length - 1.0, true)] {
        let mut controller = braking(ControllerState::Operate, TrajectoryState::Execute);
        let mut clock = PathClock::start(1.0);
        clock.time = before;
        controller.phase = Phase::Approaching { from: [0.0; JOINTS], length_ms: length, clock, leave: None };
        controller.walk();
        assert_eq!(controller.phase == Phase::AtStart, arrives, "{before} ms");
    }
}

/// An approach begins at the distance `way` from point 0. A Stop or Pause arrives `after_ms` later. The arm brakes at
/// once and comes to rest on the way to point 0.
#[test]
fn j33_a_stop_in_the_approach_brakes_at_once_and_leaves_the_arm_beside_the_point() {
    for (way, after_ms) in [(0.02, 1), (0.02, 60), (0.02, 150), (-0.3, 60), (0.49, 60), (0.49, 250)] {
        for (command, trajectory) in
            [(ExecCommand::Stop, TrajectoryState::Stop), (ExecCommand::Pause, TrajectoryState::Pause)]
        {
            let mut controller = halting_at(0.0);
            (controller.clock, controller.braking_ms) = (PathClock::default(), None);
            begin_approach(&mut controller, [way, 0.0, 0.0, 0.0, 0.0, 0.0]);
            for _ in 0..after_ms {
                controller.walk();
            }
            let set = |controller: &Controller<[RawPoint; 4]>| {
                let point = &controller.motion.set.point;
                (point.position[0], point.velocity[0])
            };
            let (at, speed) = set(&controller);
            controller.leave_path(command);
            let mut ticks = 0;
            while controller.trajectory == TrajectoryState::Execute && ticks < 2_000 {
                controller.walk();
                ticks += 1;
            }
            let (rest, velocity) = set(&controller);
            assert_eq!((controller.trajectory, velocity), (trajectory, 0.0), "{way} {after_ms}");
            assert!(ticks <= 220, "{way} after {after_ms} ms: {ticks} ms");
            let moved = (at - rest) * way.signum();
            // After the command, the arm may move at most by `most`. This is the remaining distance, or the stopping
            // distance if that is smaller. The stopping distance assumes that the approach still accelerates during
            // half of the ramp.
            let most = (0.15 * (speed.abs() + 0.1 * 12.0)).min(at.abs() + 1e-12);
            assert!((0.0..=most).contains(&moved), "{way} after {after_ms} ms: {moved} of {most} rad");
            assert_eq!(controller.clock.time, 0.0, "the index stays");
            // Joints that are already at the target have not moved.
            assert_eq!(controller.motion.set.point.position[1..], [0.0; JOINTS - 1]);
        }
    }
}

#[test]
fn j33_a_stop_before_the_approach_moves_nothing() {
    let mut controller = halting_at(0.0);
    begin_approach(&mut controller, [0.01; JOINTS]);
    let before = controller.motion.set.point.position;
    controller.leave_path(ExecCommand::Stop);
    assert_eq!(
        (controller.trajectory, controller.motion.set.point.position),
        (TrajectoryState::Stop, before)
    );
}

/// An approach takes at least the time of a ramp. If a joint with a long distance needs more time within its limits,
/// the approach takes this time.
#[test]
fn j34_an_approach_keeps_to_velocity_and_acceleration_limits() {
    for (way, velocity_max, acceleration_max) in
        [(0.0, 1.5, 12.0), (0.02, 1.5, 12.0), (0.4, 1.5, 12.0), (0.02, 0.01, 12.0), (0.3, 9.0, 0.5)]
    {
        let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
        controller.config.joints[3].velocity_max = velocity_max;
        controller.config.joints[3].acceleration_max = acceleration_max;
        let Some(Phase::Approaching { length_ms, .. }) =
            controller.approach_to(&[0.0, 0.0, 0.0, way, 0.0, 0.0])
        else {
            assert_eq!(way, 0.0, "there is a way");
            continue;
        };
        let length = length_ms / 1_000.0;
        // The velocity and acceleration of the approach are sampled at a thousand times.
        let at = |u: f64| way * u * u * u * (10.0 + u * (6.0 * u - 15.0));
        let step = 1e-3;
        let (mut fastest, mut hardest) = (0.0f64, 0.0f64);
        for i in 1..1_000 {
            let u = f64::from(i) * step;
            let (before, now, after) = (at(u - step), at(u), at(u + step));
            fastest = fastest.max((after - before) / (2.0 * step * length));
            hardest = hardest.max((after - 2.0 * now + before).abs() / (step * step * length * length));
        }
        assert!(
            fastest <= 1.001 * velocity_max && hardest <= 1.001 * acceleration_max,
            "{way}: {fastest} {hardest}"
        );
        let needed = fastest > 0.99 * velocity_max || hardest > 0.99 * acceleration_max;
        assert!(needed || length == 0.2, "{way}: {length} s");
    }
}

/// Only a path or an approach that goes on can be slowed down. The controller cannot slow down a finished path, a
/// jog, or an approach that has not begun.
#[test]
fn j75_only_a_motion_that_goes_on_is_held_back() {
    let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
    controller.phase = Phase::Running { leave: None };
    (controller.state, controller.trajectory) = (ControllerState::HoldPos, TrajectoryState::Finish);
    assert!(!controller.hold_back());
    controller.state = ControllerState::Operate;
    assert!(controller.hold_back() && !controller.motion.hold_back.is_active(), "it has just arrived");
    controller.trajectory = TrajectoryState::Execute;
    assert!(controller.hold_back() && controller.motion.hold_back.is_active());
    controller.phase = Phase::approach([0.0; JOINTS], 500.0);
    assert!(!controller.hold_back(), "it has not begun");
    let Phase::Approaching { clock, .. } = &mut controller.phase else { panic!() };
    clock.time = 1.0;
    assert!(controller.hold_back());
}

/// Returns the current internal errors of the joints.
fn joint_errors(controller: &Controller<[RawPoint; 4]>) -> [u16; JOINTS] {
    core::array::from_fn(|j| controller.errors.joint(j).0)
}

/// Joint 3 still moves at the end of the braking time. The path or jog then ends, and joint 3 lowers its load. With
/// `torque_release`, the same overload is an error that switches the torque of the arm off.
#[test]
fn j33_j70_a_motion_that_cannot_be_stopped_ends_with_the_configured_reaction() {
    let most = Config::avena().braking_ms_max;
    for (jogs, releases) in [(false, false), (false, true), (true, false), (true, true)] {
        for (ms, over) in [(most - 1, false), (most, true)] {
            let mut controller = pausing(ms);
            controller.config.torque_release = releases;
            controller.phase = Phase::Running { leave: Some(TrajectoryState::Stop) };
            if jogs {
                (controller.state, controller.trajectory) =
                    (ControllerState::HoldPos, TrajectoryState::Finish);
                let config = Config::avena();
                controller.motion.set.jog(&[0.0, 0.0, 0.1, 0.0, 0.0, 0.0], &[1.0; JOINTS], &config);
                controller.motion.set.end_jog();
                assert!(controller.motion.set.jog_ends(), "the jog comes to rest");
            }
            controller.motion.set.point.velocity[2] = -0.03;
            let case = (jogs, releases, ms);
            assert_eq!(controller.brake(), !over, "{case:?}");
            let torque = if over { joint_error::TORQUE } else { 0 };
            assert_eq!(joint_errors(&controller), [0, 0, torque, 0, 0, 0], "{case:?}");
            let held = over && !releases;
            assert_eq!(controller.errors.any(), over && releases, "{case:?}");
            assert_eq!(controller.errors.held_stop(), held, "{case:?}");
            let yields: [bool; JOINTS] = core::array::from_fn(|j| controller.motion.law.yields(j));
            assert_eq!(yields, [false, false, held, false, false, false], "{case:?}");
            assert_eq!(controller.motion.set.jogging(), jogs && !held, "{case:?}");
            let trajectory = match (jogs, held) {
                (true, _) => TrajectoryState::Finish,
                (false, true) => TrajectoryState::Stop,
                (false, false) => TrajectoryState::Execute,
            };
            assert_eq!(controller.trajectory, trajectory, "{case:?}");
        }
    }
}
