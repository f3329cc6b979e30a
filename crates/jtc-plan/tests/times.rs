//! Tests of specified times. The planner keeps the specified times if the limits permit these times. If the limits do not permit a time,
//! the planner returns an error.
use jtc_core::Config;
use jtc_plan::{LimitKind, Limits, PlanError, Waypoint, through};
use proptest::prelude::*;

use crate::judge;

use judge::Case;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Some waypoints have later times than in the fastest motion. The planned motion must keep these times and all
    /// limits. Only with rounded corners may the planner report a time as too early, because slower adjacent legs
    /// then slow down the motion at the waypoint.
    #[test]
    fn given_times_are_kept(
        seed in any::<u64>(),
        later in prop::collection::vec(prop::option::of(1.0..4.0f64), 25),
        alike in prop::option::of(1.01..8.0f64),
    ) {
        let mut case = Case::random(seed);
        case.with_torque = false;
        let fastest = through(&case.given(), case.blend, &case.limits, None).unwrap();
        let mut waypoints = case.given();
        let mut time = 0.0;
        for (i, waypoint) in waypoints.iter_mut().enumerate().skip(1) {
            let step = fastest.waypoint_times()[i] - fastest.waypoint_times()[i - 1];
            time += step * alike.or(later[i - 1]).unwrap_or(1.0) + 1e-3;
            if later[i - 1].is_some() {
                waypoint.time = Some(time);
            }
        }
        match through(&waypoints, case.blend, &case.limits, None) {
            Ok(motion) => {
                for (waypoint, at) in waypoints.iter().zip(motion.waypoint_times()) {
                    if let Some(time) = waypoint.time {
                        prop_assert!((at - time).abs() <= 5e-4, "seed {}: {} instead of {}", seed, at, time);
                    }
                }
                let (wrong, _) = case.judge(&motion, true);
                prop_assert!(wrong.is_empty(), "seed {}: {}", seed, wrong);
            }
            Err(PlanError::TooEarly { given, shortest, .. }) => {
                let coupled = case.blend > 0.0 && shortest > given;
                prop_assert!(coupled, "seed {}: {} {} {:?}", seed, given, shortest, alike);
            }
            Err(error) => prop_assert!(false, "seed {}: {}", seed, error),
        }
    }
}

#[test]
fn a_time_that_is_too_early_is_refused_with_joint_limit_and_shortest_time() {
    let limits = Limits::of(&Config::avena());
    let mut waypoints =
        [[0.0; 6], [1.0, 0.2, 0.0, 0.0, 0.0, 0.0], [1.0, 0.2, 1.0, 0.0, 0.0, 0.0]].map(Waypoint::from);
    waypoints[1].time = Some(2.0);
    waypoints[2].time = Some(2.4);
    let error = through(&waypoints, 0.0, &limits, None).unwrap_err();
    let PlanError::TooEarly { from, waypoint, joint, given, shortest, .. } = error else { panic!("{error}") };
    assert_eq!((from, waypoint, joint.number()), (2, 3, 3));
    assert!((given - 0.4).abs() < 1e-9 && shortest > 0.7 && shortest < 1.0, "{given} {shortest}");
    // The planner must accept the shortest time that the error contains, plus 1 ms.
    waypoints[2].time = Some(2.0 + shortest + 0.001);
    let motion = through(&waypoints, 0.0, &limits, None).unwrap();
    assert!((motion.duration() - 2.0 - shortest - 0.001).abs() < 5e-4);
}

#[test]
fn times_rise_from_zero() {
    let limits = Limits::of(&Config::avena());
    let with = |times: [Option<f64>; 3]| {
        let mut waypoints = [[0.0; 6], [0.5; 6], [0.2; 6]].map(Waypoint::from);
        for (waypoint, time) in waypoints.iter_mut().zip(times) {
            waypoint.time = time;
        }
        through(&waypoints, 0.05, &limits, None)
    };
    for (times, wrong) in [
        ([Some(1.0), None, None], 1),
        ([None, Some(-1.0), None], 2),
        ([None, Some(f64::NAN), None], 2),
        ([Some(0.0), Some(3.0), Some(3.0)], 3),
        ([None, Some(3.0), Some(f64::INFINITY)], 3),
    ] {
        let error = with(times).unwrap_err();
        assert!(matches!(error, PlanError::Time { waypoint, .. } if waypoint == wrong), "{error}");
    }
    let motion = with([Some(0.0), None, Some(5.0)]).unwrap();
    assert_eq!(motion.duration(), 5.0);
    assert!(motion.binding().iter().any(|b| b.limit == LimitKind::GivenTime));
}
