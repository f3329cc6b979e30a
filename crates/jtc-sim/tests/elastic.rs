//! Tests of elastic gears, compared with the mechanics of two bodies that a spring connects.
use jtc_core::JOINTS;
use jtc_dynamics::Dynamics;
use jtc_sim::{Arm, FrictionModel, Gear, SimArm, SimFriction};

const TICK: f64 = 1e-3;
const POSE: [f64; JOINTS] = [0.3, 0.4, -0.7, 0.4, 0.6, -0.2];
/// Part of the rotor inertia that turns with the link, kg·m².
const OUTPUT: f64 = 0.01;

fn frictionless(gears: [Gear; JOINTS]) -> SimArm {
    SimArm {
        friction: std::array::from_fn(|_| SimFriction::Frictionless),
        stops: [(f64::NEG_INFINITY, f64::INFINITY); JOINTS],
        gears,
        ..SimArm::default()
    }
}

fn undamped(stiffness: f64) -> Gear {
    Gear { stiffness, damping: 0.0 }
}

/// Returns the kinetic energy of links and motors plus the potential energy of springs and links, J.
fn energy(arm: &Arm) -> f64 {
    let parts = arm.parts();
    let dynamics = Dynamics::new(&parts.model, parts.gravity);
    let m = dynamics.mass_matrix(&arm.q);
    let mut sum = 0.0;
    for j in 0..JOINTS {
        for k in 0..JOINTS {
            sum += 0.5 * arm.qd[j] * m[j][k] * arm.qd[k];
        }
        let (gear, rotor) = (&parts.gears[j], parts.rotor_inertia[j]);
        if gear.is_elastic() {
            sum += 0.5 * OUTPUT * arm.qd[j].powi(2) + 0.5 * (rotor - OUTPUT) * arm.motor_speed[j].powi(2);
            sum += 0.5 * gear.stiffness * (arm.motor[j] - arm.q[j]).powi(2);
        } else {
            sum += 0.5 * rotor * arm.qd[j].powi(2);
        }
    }
    // The frames of the joints are also the frames of the links, so the link masses can be located with the joint
    // poses.
    let poses = dynamics.forward_kinematics(&arm.q);
    for (link, pose) in parts.model.links[1..].iter().zip(&poses) {
        let com: f64 = (0..3).map(|i| pose.rotation[2][i] * link.origin.xyz[i]).sum();
        sum += 9.81 * link.mass * (pose.position[2] + com);
    }
    sum
}

#[test]
fn an_arm_on_undamped_gears_keeps_its_energy() {
    for stiffness in [500.0, 20_000.0, 1e6] {
        let mut arm = Arm::new(frictionless([undamped(stiffness); JOINTS]), [0.0; JOINTS], POSE);
        arm.motor_speed = [0.3, -0.2, 0.4, 0.5, -0.6, 1.0];
        let first = energy(&arm);
        let mut worst = 0.0f64;
        for _ in 0..1_000 {
            arm.step(&[0.0; JOINTS], TICK);
            worst = worst.max((energy(&arm) - first).abs());
        }
        println!("{stiffness} N·m/rad: {worst:.2e} J of {first:.1} J");
        assert!(worst < 1e-2, "{stiffness} N·m/rad: {worst} J");
        assert!((arm.q[1] - POSE[1]).abs() > 0.3, "it did fall");
    }
}

/// The change of energy must equal the work of the drives minus the dissipation in the damping.
#[test]
fn the_energy_changes_by_the_work_of_drives_pushes_and_damping() {
    let gear = Gear { stiffness: 8_000.0, damping: 15.0 };
    let gears = std::array::from_fn(|j| if j == 2 { Gear::RIGID } else { gear });
    let mut arm = Arm::new(frictionless(gears), [0.0; JOINTS], POSE);
    let first = energy(&arm);
    let (mut work, mut most) = (0.0, 0.0f64);
    let (tau, outside) = ([20.0, -15.0, 10.0, 8.0, -6.0, 5.0], [0.0, 9.0, 0.0, 0.0, 4.0, -3.0]);
    let power = |arm: &Arm| -> f64 {
        (0..JOINTS)
            .map(|j| {
                let damping = arm.parts().gears[j].damping * (arm.motor_speed[j] - arm.qd[j]).powi(2);
                tau[j] * arm.motor_speed[j] + outside[j] * arm.qd[j] - damping
            })
            .sum()
    };
    let dt = 1e-4;
    for _ in 0..6_000 {
        let before = power(&arm);
        arm.step_pushed(&tau, &outside, dt);
        work += 0.5 * dt * (before + power(&arm));
        most = most.max(work.abs());
    }
    let change = energy(&arm) - first;
    assert!(most > 5.0 && (change - work).abs() < 2e-3 * most, "{change} J, {work} J put in");
}

/// The test blocks the motor of one joint with an elastic gear, for each joint in turn. The link must oscillate at
/// √(K/J).
#[test]
fn a_link_swings_on_its_gear_at_its_natural_frequency() {
    for joint in 0..JOINTS {
        let stiffness = 10_000.0;
        let mut gears = [Gear::RIGID; JOINTS];
        gears[joint] = undamped(stiffness);
        let mut arm = Arm::new(SimArm { gravity: [0.0; 3], ..frictionless(gears) }, [0.0; JOINTS], POSE);
        arm.braked = [true; JOINTS];
        arm.q[joint] += 1e-4;
        let inertia = Dynamics::new(&arm.parts().model, [0.0; 3]).mass_matrix(&POSE)[joint][joint] + OUTPUT;
        let expected = (stiffness / inertia).sqrt();
        // The test measures the duration of ten periods, between upward crossings of the middle position.
        let (mut t, mut first, mut crossings) = (0.0, None, 0);
        let dt = 1e-4;
        while crossings <= 10 {
            let before = arm.q[joint] - POSE[joint];
            arm.step(&[0.0; JOINTS], dt);
            let after = arm.q[joint] - POSE[joint];
            t += dt;
            if before < 0.0 && after >= 0.0 {
                let crossed = t - dt * after / (after - before);
                first.get_or_insert(crossed);
                if crossings == 10 {
                    let frequency = 10.0 * std::f64::consts::TAU / (crossed - first.unwrap());
                    assert!(
                        (frequency / expected - 1.0).abs() < 1e-3,
                        "joint {}: {frequency} {expected}",
                        joint + 1
                    );
                }
                crossings += 1;
            }
            assert!(t < 20.0, "joint {}", joint + 1);
        }
    }
}

/// With a blocked motor, a loaded link must move down by the torque divided by the stiffness of the gear.
#[test]
fn a_loaded_link_rests_at_torque_over_stiffness() {
    let gear = Gear { stiffness: 20_000.0, damping: 200.0 };
    let mut arm = Arm::new(frictionless([gear; JOINTS]), [0.0; JOINTS], POSE);
    arm.braked = [true; JOINTS];
    arm.step(&[0.0; JOINTS], TICK);
    assert!(arm.qd.iter().all(|v| v.abs() < 1e-9), "it begins at rest: {:?}", arm.qd);
    let outside = [5.0, -4.0, 3.0, 2.0, -1.0, 1.0];
    (0..6_000).for_each(|_| arm.step_pushed(&[0.0; JOINTS], &outside, TICK));
    let load = Dynamics::new(&arm.parts().model, arm.parts().gravity).gravity_torque(&arm.q);
    for j in 0..JOINTS {
        let (twist, expected) = (arm.motor[j] - arm.q[j], (load[j] - outside[j]) / gear.stiffness);
        assert!((twist - expected).abs() < 1e-9, "joint {}: {twist} {expected}", j + 1);
    }
}

/// With increasing stiffness, the motion of the arm must approach the motion of an arm with rigid gears. The
/// test also includes friction.
#[test]
fn stiff_gears_move_the_arm_as_rigid_ones_do() {
    for model in [FrictionModel::default(), FrictionModel::Smooth { width: 0.01 }] {
        let run = |gear: Gear| {
            let parts = SimArm { gears: [gear; JOINTS], friction_model: model, ..SimArm::default() };
            let mut arm = Arm::new(parts, [1.0; JOINTS], POSE);
            for ms in 0..800 {
                let swing = f64::from(ms) * 0.008;
                arm.step(&[30.0, -60.0, 20.0, 10.0, -8.0, 6.0].map(|tau| tau * swing.sin()), TICK);
            }
            arm.q
        };
        let rigid = run(Gear::RIGID);
        let mut last = f64::INFINITY;
        for stiffness in [2e3, 2e4, 1e6] {
            let far =
                run(Gear::new(stiffness)).iter().zip(rigid).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            println!("{model:?}, {stiffness} N·m/rad: {far:.1e} rad");
            assert!(far < last, "{model:?}, {stiffness} N·m/rad: {far} rad after {last}");
            last = far;
        }
        assert!(last < 2e-3, "{model:?}: {last} rad");
    }
}
