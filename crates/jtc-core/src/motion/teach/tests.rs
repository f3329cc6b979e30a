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

/// The load torque has no step when Teaching begins. While a hand moves a joint by 1 rad, the torque that no mass
/// explains falls to a thirtieth.
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
    // If the arm is stretched vertically, a mass at its flange loads no joint. Near this pose, only an enormous mass
    // would fit the loads, so hardly any mass is estimated.
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
    /// The estimated mass becomes smaller by the given mass, at most to zero. This mass never changes its sign.
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

    /// A load can be learned at rest, in motion, or while a joint lowers it. At a position limit, no such load pushes
    /// a joint outwards. The load torque never exceeds the highest torque that was learned or that can be learned.
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

    /// The acting share of a load falls with the speed of the joint in the direction of the load torque. At rest the
    /// whole load acts again.
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

/// If a mass is the only cause of a motion, it is removed within seconds, without a torque step. If the arm moves
/// faster or more slowly than the mass would drive it, a hand moves the arm, and the mass is kept.
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
    // The joint now sinks because the removed torque is missing. `sinking` is the removed torque divided by the
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
    // If the model has contained the mass since it was removed, the mass is not added again.
    driven.taught.give_way(1.5);
    assert!(driven.taught.mass > 0.0 && driven.taught.found <= 0.51, "{} kg", driven.taught.found);
}

/// In each round, Teaching computes the inertia and the friction of every joint once. Teaching compares the load with
/// the motion six times, and reserves one tick for the inertia of the whole arm.
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

/// Only a part of the load is attributed to the fitted mass. The part depends on the torque of 1 kg on all joints
/// together: it is 0 up to 2 N·m and 1 from 6 N·m on.
///
/// In between, it rises smoothly with the square of this torque, from 4 to 36: 5/32 at a quarter of this range, 1/2
/// at the half, and 27/32 at three quarters.
#[test]
fn j25_a_mass_that_hardly_loads_the_arm_explains_a_part_of_the_load() {
    let unit = dynamics().flange_torque(&Q).map(|u| u * u).iter().sum::<f64>().sqrt();
    for (square, part) in [
        (1.0, 0.0),
        (4.0, 0.0),
        (12.0, 5.0 / 32.0),
        (20.0, 0.5),
        (28.0, 27.0 / 32.0),
        (36.0, 1.0),
        (49.0, 1.0),
    ] {
        // The torque of 1 kg is proportional to gravity, so the test sets this torque through gravity.
        let gravity = Config::avena().gravity.map(|g| g * f64::sqrt(square) / unit);
        let dynamics = Dynamics::new(&Parameters::avena().model, gravity);
        let loads = dynamics.flange_torque(&Q).map(|u| 2.0 * u);
        let mut taught = Taught::begin(&Q, &loads, &Config::avena());
        taught.fit(&Q, &dynamics);
        assert!((f64::from(taught.mass) - 2.0 * part).abs() < 1e-4, "{} kg at {square}", taught.mass);
        assert_eq!(taught.found, taught.mass);
        for (carried, load) in taught.carried.iter().zip(loads) {
            let rest = f64::from(carried.rest);
            assert!((rest - (1.0 - part) * load).abs() < 1e-4, "{rest} N·m of {load} N·m at {square}");
        }
    }
    assert_eq!(begun([5.0; JOINTS], &[f64::NAN; JOINTS]).mass, 0.0, "an invalid pose gives no mass");
}

/// The ramp computes the inertia of the whole arm in tick 2, and in the last slow tick of each round. A round has 76
/// ticks and begins at tick 9, and every fourth tick is slow. This slow tick is therefore 9 + 76 - 4 = 81.
#[test]
fn j25_one_tick_before_the_first_round_and_one_tick_of_each_round_belong_to_the_ramp() {
    for turn in 0..FIRST + TURNS {
        let taught = Taught { turn, ..Taught::default() };
        assert_eq!(taught.is_turn_of_ramp(), [2, 81].contains(&turn), "tick {turn}");
    }
}

/// The excess of the flange speed is (speed − limit) / limit, on a smooth ramp. With a limit of 0.5 m/s, the excess
/// is 0 at 0.5 m/s and 1 at 1 m/s.
#[test]
fn j25_the_excess_of_the_tool_speed_is_a_share_of_its_limit() {
    let (dynamics, direction) = (dynamics(), [0.1, 0.2, -0.3, 0.1, 0.0, 0.2]);
    let unit = dynamics.flange_speed(&Q, &direction);
    let config = Config { tool_speed_max: 0.5, ..Config::avena() };
    for (speed, excess) in [
        (0.25, 0.0),
        (0.5, 0.0),
        (0.625, 5.0 / 32.0),
        (0.75, 0.5),
        (0.875, 27.0 / 32.0),
        (1.0, 1.0),
        (2.0, 1.0),
    ] {
        // In this tick of a round, Teaching compares the load with the motion.
        let mut taught = Taught { turn: FIRST + 8, ..Taught::default() };
        let computed =
            taught.look(&Q, &direction.map(|v| v * speed / unit), &dynamics, &config, |_, _| (0.0, 0.0));
        assert!(
            computed && (f64::from(taught.haste) - excess).abs() < 1e-5,
            "{} at {speed} m/s",
            taught.haste
        );
    }
}

/// At 0.5 rad/s, a joint moves 0.006 rad in 12 ms. This motion is 0.02 times the distance of 0.3 rad, so 0.98 times the load remains. At
/// 0.03 rad/s, 1 − 0.03 · 0.012 / 0.3 = 0.9988 times the load remains.
#[test]
fn j25_a_load_without_a_mass_fades_only_while_a_joint_is_faster_than_0_02_rad_s() {
    for (velocity, left) in [(0.0, 1.0), (-0.02, 1.0), (0.02, 1.0), (0.03, 0.9988), (0.5, 0.98), (-0.5, 0.98)]
    {
        let mut taught = Taught::begin(&Q, &[8.0; JOINTS], &Config::avena());
        taught.judge(&[0.0, 0.0, velocity, 0.0, 0.0, 0.0]);
        for carried in taught.carried {
            assert!((f64::from(carried.rest) - left * 8.0).abs() < 1e-5, "{} at {velocity}", carried.rest);
        }
    }
}

/// Returns the state of Teaching in which 1 kg causes 10 N·m on joint 2. Damping and friction of joint 2 are `against`, N·m.
fn with_mass(found: f32, mass: f32, against: f64) -> Taught {
    let mut taught = Taught::begin(&Q, &[0.0; JOINTS], &Config::avena());
    (taught.found, taught.mass, taught.unit[1]) = (found, mass, 10.0);
    taught.joints[1].set_against(against);
    taught
}

/// Each comparison adds 12 ms to the time of sinking. The mass returns only after 100 ms: the eighth comparison is at
/// 96 ms, and the ninth is at 108 ms.
#[test]
fn j25_a_missed_mass_returns_by_its_missing_part() {
    // The acting mass is 0.5 kg of 2 kg, so 1.5 kg with a torque of 15 N·m are missing. The joint sinks at 0.2 rad/s.
    let mut taught = with_mass(2.0, 0.5, 15.0);
    let sinks = [0.0, -0.2, 0.0, 0.0, 0.0, 0.0];
    (0..8).for_each(|_| taught.judge(&sinks));
    assert_eq!((taught.mass, taught.sinks_ms), (0.5, 96));
    // The ninth comparison adds a part of the missing mass. With a time constant of 0.5 s, 12 ms add 0.024 · 1.5 kg =
    // 0.036 kg.
    taught.judge(&sinks);
    assert!((taught.mass - 0.536).abs() < 1e-5 && taught.found == 2.0, "{} kg", taught.mass);
    // If the joint does not sink, the time of sinking begins again.
    taught.judge(&[0.0; JOINTS]);
    assert!((taught.mass - 0.536).abs() < 1e-5 && taught.sinks_ms == 0, "{} kg", taught.mass);
}

/// The mass is removed only after it has driven the arm for 1,000 ms. Comparison 83 is at 996 ms, and comparison 84
/// is at 1,008 ms.
#[test]
fn j25_a_mass_that_drives_the_arm_goes_by_a_part_of_itself() {
    // The mass of 2 kg causes 20 N·m. Damping and friction oppose the motion at 0.3 rad/s with the same torque, so
    // the mass alone explains the motion.
    let mut taught = with_mass(2.0, 2.0, 20.0);
    let driven = [0.0, 0.3, 0.0, 0.0, 0.0, 0.0];
    (0..83).for_each(|_| taught.judge(&driven));
    assert_eq!((taught.mass, taught.driven_ms), (2.0, 996));
    // Comparison 84 removes a part of the mass. With a time constant of 1.5 s, 12 ms remove 0.008 · 2 kg = 0.016 kg.
    taught.judge(&driven);
    assert!((taught.mass - 1.984).abs() < 1e-5 && taught.found == 2.0, "{} kg", taught.mass);
}

/// After Teaching, the integral must produce the torques of the load and of the dry friction. The load torque is 5
/// N·m from the mass of 0.5 kg, and 12 N·m that no mass explains. The dry friction is at most 3 % of 200 N·m, which
/// is 6 N·m, at an extension of 5 mrad.
#[test]
fn j25_the_holding_torque_is_the_sum_of_load_and_dry_friction() {
    let mut config = Config::avena();
    config.joints[1].torque_max = 200.0;
    let mut taught = Taught::begin(&[0.0; JOINTS], &[12.0; JOINTS], &config);
    (taught.mass, taught.unit[1]) = (0.5, 10.0);
    taught.each(1, |joint| joint.set_inertia(3.0));
    for (position, expected) in [(0.0, 17.0), (0.0025, 14.0), (-0.0025, 20.0), (0.01, 11.0), (-0.01, 23.0)] {
        let held = taught.held(1, position, &config.joints[1], &config);
        assert!((held - expected).abs() < 1e-5, "{held} N·m at {position} rad, expected {expected} N·m");
    }
}
