//! Tests of point-to-point motions. The tests use only samples of the positions.
use jtc_core::Config;
use jtc_plan::{Limits, PlanError, point_to_point};

#[test]
fn a_motion_passes_both_ends_at_rest() {
    let limits = Limits::of(&Config::avena());
    let (from, to) = ([0.0; 6], [1.0, -0.5, 0.3, 0.0, 0.2, -1.0]);
    for limits in [limits.clone(), limits.without_jerk()] {
        let motion = point_to_point(&from, &to, &limits, None).unwrap();
        let (start, end) = (motion.at(0.0), motion.at(motion.duration()));
        assert_eq!((start.position, start.velocity), (from, [0.0; 6]));
        assert_eq!((end.position, end.velocity, end.acceleration), (to, [0.0; 6], [0.0; 6]));
        assert!(motion.duration() > 0.7 && motion.duration() < 1.2, "{}", motion.duration());
    }
}

#[test]
fn a_target_outside_the_limits_is_named() {
    let limits = Limits::of(&Config::avena());
    let error = point_to_point(&[0.0; 6], &[0.0, 1.6, 0.0, 0.0, 0.0, 0.0], &limits, None).unwrap_err();
    assert_eq!(error.to_string(), "waypoint 2, joint 2: 1.6 rad is outside -1.57..1.57 rad");
    let error = point_to_point(&[f64::NAN; 6], &[0.0; 6], &limits, None).unwrap_err();
    assert!(matches!(error, PlanError::NotFinite { waypoint: 1, .. }), "{error}");
}
