//! Tests of the loads that HoldPos has learned and that Teaching uses (J-25).
use proptest::prelude::*;

use super::*;
use crate::Parameters;

fn dynamics() -> Dynamics {
    Dynamics::new(&Parameters::avena().model, Config::avena().gravity)
}

fn begun(loads: [f64; JOINTS], q: &[f64; JOINTS]) -> Taught {
    let mut taught = Taught::begin(q, &loads, &Config::avena());
    taught.fit(q, &dynamics());
    taught
}

/// Returns the load torques in Teaching of an arm at rest at `q` (rad), N·m.
fn carried(taught: &mut Taught, q: &[f64; JOINTS]) -> [f64; JOINTS] {
    taught.unit = dynamics().flange_torque(q).map(|u| u as f32);
    core::array::from_fn(|j| taught.carried[j].torque(f64::from(taught.mass * taught.unit[j])))
}

const Q: [f64; JOINTS] = [0.3, 0.8, -0.9, 0.4, 0.7, 0.2];

#[test]
fn j25_a_mass_at_the_flange_is_found_and_carried_to_other_poses() {
    let elsewhere = [-1.0, 1.2, 0.4, -0.3, 1.0, 2.0];
    for mass in [-1.5, 0.4, 2.0, 2.5] {
        let mut taught = begun(dynamics().flange_torque(&Q).map(|u| mass * u), &Q);
        for (t, u) in carried(&mut taught, &elsewhere).iter().zip(dynamics().flange_torque(&elsewhere)) {
            assert!((t - mass * u).abs() < 1e-4, "{t} {}", mass * u);
        }
    }
}

/// The load torque has no step when Teaching begins. After a motion of 1 rad, the torque that no mass explains has fallen to a thirtieth.
#[test]
fn j25_what_no_mass_explains_is_carried_until_the_arm_is_led() {
    let missing = [7.0, 10.0, -3.0, 1.0, 0.0, 2.0];
    let mut taught = begun(missing, &Q);
    for (t, m) in carried(&mut taught, &Q).iter().zip(missing) {
        assert!((t - m).abs() < 1e-4, "{t} {m}");
    }
    (0..833).for_each(|_| taught.judge(&[0.01; JOINTS]));
    assert!((carried(&mut taught, &Q)[0] - 7.0).abs() < 1e-4, "at rest it stays");
    (0..84).for_each(|_| taught.judge(&[0.0, 0.0, -1.0, 0.0, 0.0, 0.0]));
    let left = carried(&mut taught, &Q)[0];
    assert!((left - 7.0 * f64::exp(-1.0 / WAY)).abs() < 0.05, "{left} N·m");
}

#[test]
fn j25_friction_never_becomes_a_great_mass() {
    // If the arm is stretched vertically, a mass at its flange does not load any joint. Near this pose, only an enormous mass could explain
    // the loads.
    assert!(begun([8.0; JOINTS], &[0.0; JOINTS]).mass.abs() < 0.2);
    for k in 0..200 {
        let q = [0.0, 0.01 * f64::from(k), 0.0, 0.0, 0.0, 0.0];
        let mass = begun([8.0, 8.0, -8.0, 3.0, 3.0, 3.0], &q).mass;
        assert!(mass.abs() < 2.0, "{mass} kg at {q:?}");
    }
    let nan = begun([f64::NAN; JOINTS], &[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!((nan.mass, nan.carried[1].rest), (0.0, 0.0));
}

proptest! {
    /// The estimated mass changes only towards zero, and never beyond zero.
    #[test]
    fn j60_a_mass_that_is_given_goes_from_the_one_that_was_found(found in -3.0..3.0f32, given in prop::collection::vec(-4.0..4.0f64, 1..8)) {
        let mut taught = Taught { found, mass: found, ..Taught::default() };
        for given in given {
            let before = taught.mass;
            taught.give_way(given);
            prop_assert!(taught.mass.abs() <= before.abs() && taught.mass * found >= 0.0);
            let expected = if given.signum() == f64::from(before).signum() { (before.abs() - given.abs() as f32).max(0.0) } else { before.abs() };
            prop_assert!((taught.mass.abs() - expected).abs() < 1e-5);
        }
    }

    /// The load may have been learned at rest, in motion, or while a joint lowered this load. At a position limit, the load does not push a
    /// joint outwards, and the spring of the soft end is stronger. The load torque never exceeds the highest torque that was learned or
    /// that may be learned.
    #[test]
    fn j25_at_a_position_limit_no_load_pushes_outwards(load in -180.0..180.0f64, by_mass in -180.0..180.0f64, velocity in -0.5..0.5f64) {
        let limits = Config::avena().joints[1];
        for (depth, sign) in [(0.1, 1.0), (-0.1, -1.0), (0.15, 1.0)] {
            let mut carried = Carried::begin(load, &limits);
            carried.explain(by_mass);
            let mut torque = 0.0;
            for _ in 0..1_000 {
                torque = carried.step(by_mass, velocity, 1.0, depth);
            }
            prop_assert!(torque * sign < 1e-3, "{torque} N·m at {depth} rad");
            prop_assert!(torque.abs() <= load.abs().max(54.0) + 1e-3);
        }
    }

    /// The acting share of a load falls with the speed of the joint in the direction of the load torque. At rest, the whole load acts, so
    /// the load is not lost.
    #[test]
    fn j25_a_load_acts_the_less_the_faster_it_drives(load in 1.0..54.0f64, balanced in 0.0..1.0f64, sign in prop_oneof![Just(-1.0), Just(1.0)]) {
        let limits = Config::avena().joints[1];
        let mut carried = Carried::begin(sign * load, &limits);
        let mut last = sign * load;
        for k in 0..60 {
            let velocity = 0.01 * f64::from(k) * sign;
            let mut torque = 0.0;
            (0..60).for_each(|_| torque = carried.step(0.0, velocity, balanced, 0.0));
            prop_assert!(torque * sign <= last * sign + 1e-4 && torque * sign >= -1e-4);
            last = torque;
        }
        prop_assert!(last.abs() < 0.01 * load, "{last} N·m at 0.6 rad/s");
        let mut steps = 0.0_f64;
        for _ in 0..3_000 {
            let torque = carried.step(0.0, 0.0, balanced, 0.0);
            steps = steps.max((torque - last).abs());
            last = torque;
        }
        prop_assert!((last - sign * load).abs() < 0.01 * load && steps < 0.01 * load, "{last} N·m, by {steps} N·m");
    }
}

/// Teaching of an arm with 2 kg at its flange, whose joint 2 moves in the direction of this load.
struct Driven {
    taught: Taught,
    q: [f64; JOINTS],
}

impl Driven {
    fn new() -> Self {
        let q = [0.0, 1.2, 0.0, 0.0, 0.0, 0.0];
        Self { taught: begun(dynamics().flange_torque(&q).map(|u| 2.0 * u), &q), q }
    }

    /// Moves joint 2 for `ms` at `velocity` (rad/s, in the direction of the load). `against` is the torque of damping and friction against
    /// this motion, as a share of the acting load torque. Returns the share of the mass that remains.
    fn moves(&mut self, against: f64, velocity: f64, ms: usize) -> f32 {
        let along = velocity * f64::from(self.taught.unit[1]).signum();
        for _ in 0..ms / usize::from(JUDGED_MS) {
            let torque = carried(&mut self.taught, &self.q)[1].abs();
            self.taught.joints.iter_mut().for_each(|joint| joint.set_against(against * torque));
            self.taught.judge(&[0.0, along, 0.0, 0.0, 0.0, 0.0]);
        }
        self.taught.mass / self.taught.found
    }
}

/// A mass that alone explains the motion is removed within seconds, without a torque step. If a hand moves the arm faster or more slowly
/// than the mass would, the mass stays.
#[test]
fn j25_a_mass_that_drives_the_arm_by_itself_goes() {
    let left = |against, velocity, ms| Driven::new().moves(against, velocity, ms);
    assert_eq!(left(1.0, 0.3, 990), 1.0, "after a second it may");
    for against in [0.85, 1.0, 1.25] {
        assert!((0.3..0.4).contains(&left(against, 0.3, 2_600)), "{against}");
    }
    for (against, velocity) in [(0.75, 0.3), (1.35, 0.3), (1.0, 0.05), (1.0, -0.3)] {
        assert_eq!(left(against, velocity, 2_600), 1.0, "{against} of it, {velocity} rad/s");
    }
}

/// A removed mass is added again if the joint sinks without this mass and no other torque explains this motion.
#[test]
fn j25_a_mass_that_is_missed_comes_back() {
    let mut driven = Driven::new();
    let gone = driven.moves(1.0, 0.3, 4_000);
    assert!(gone < 0.2, "{gone}");
    // The missing torque now drives the joint, as the acting torque drove the joint before. The missing torque is `sinking` times the
    // remaining load torque.
    let sinking = f64::from((1.0 - gone) / gone);
    for (against, velocity, ms) in
        [(sinking, -0.05, 1_000), (sinking, -0.2, 90), (sinking, 0.2, 1_000), (0.5 * sinking, -0.2, 1_000)]
    {
        assert_eq!(driven.moves(against, velocity, ms), gone, "{against}, {velocity} rad/s, {ms} ms");
    }
    let mut back = gone;
    for _ in 0..100 {
        let sinking = f64::from((1.0 - back) / back);
        back = driven.moves(sinking, -0.2, 12);
    }
    assert!((0.8..1.0).contains(&back), "{back}");
    // A mass that the model has contained since the removal is not added again.
    driven.taught.give_way(1.5);
    assert!(driven.taught.mass > 0.0 && driven.taught.found <= 0.51, "{} kg", driven.taught.found);
}

/// In each round, Teaching computes the inertia and the friction of every joint once. Teaching compares the load with the motion six times
/// in each round, and leaves one tick for the ramp.
#[test]
fn j25_each_round_computes_all_that_changes_slowly() {
    let of =
        |turns: core::ops::Range<u8>, turn: Turn| turns.filter(|number| Turn::of(*number) == turn).count();
    let round = || FIRST..FIRST + TURNS;
    for j in 0..JOINTS {
        assert_eq!(
            (of(0..FIRST, Turn::Inertia(j)), of(round(), Turn::Inertia(j)), of(round(), Turn::Friction(j))),
            (1, 1, 1)
        );
    }
    assert_eq!((of(round(), Turn::Judge), of(round(), Turn::Ramp), of(round(), Turn::Joints)), (6, 1, 57));
    assert_eq!([0, 1, 2].map(Turn::of), [Turn::Begin, Turn::Mass, Turn::Ramp]);
}
