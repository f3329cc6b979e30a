//! The table of settings: number on the wire, name, unit, range, meaning, and where each is (J-53). Docs, arm files and
//! `jtc arm show` are made from it. Numbers are never given anew.
use super::{Live, Place, Setting};

/// One of a joint.
macro_rules! joint {
    ($number:literal $name:literal [$unit:literal] $low:literal..=$high:literal, $field:ident, $meaning:literal) => {
        Setting {
            number: $number,
            name: $name,
            unit: $unit,
            low: $low,
            high: $high,
            whole: false,
            live: Live::No,
            meaning: $meaning,
            place: Place::Joint { get: |joint| joint.$field, set: |joint, value| joint.$field = value },
        }
    };
}

/// One of the arm: a number, a whole number, or a switch.
macro_rules! arm {
    ($number:literal $name:literal [$unit:literal] $low:literal..=$high:literal, $($field:ident).+ $([$i:literal])?, $meaning:literal) => {
        arm!(@ $number $name $unit $low $high false $meaning,
            |config| config.$($field).+$([$i])?, |config, value| config.$($field).+$([$i])? = value)
    };
    (whole $number:literal $name:literal [$unit:literal] $low:literal..=$high:literal, $field:ident: $type:ty, $meaning:literal) => {
        arm!(@ $number $name $unit $low $high true $meaning,
            |config| f64::from(config.$field), |config, value| config.$field = value as $type)
    };
    (switch $number:literal $name:literal, $field:ident, $meaning:literal) => {
        arm!(@ $number $name "" 0.0 1.0 true $meaning,
            |config| f64::from(u8::from(config.$field)), |config, value| config.$field = value != 0.0)
    };
    (@ $number:literal $name:literal $unit:literal $low:literal $high:literal $whole:literal $meaning:literal, $get:expr, $set:expr) => {
        Setting {
            number: $number,
            name: $name,
            unit: $unit,
            low: $low,
            high: $high,
            whole: $whole,
            live: Live::No,
            meaning: $meaning,
            place: Place::Arm { get: $get, set: $set },
        }
    };
}

/// Every setting, in the order of the numbers.
pub static TABLE: [Setting; 54] = [
    joint!(1 "position_min_rad" ["rad"] -6.2832..=6.2832, position_min, "lowest position"),
    joint!(2 "position_max_rad" ["rad"] -6.2832..=6.2832, position_max, "highest position"),
    joint!(3 "velocity_max_rad_s" ["rad/s"] 0.01..=20.0, velocity_max, "highest speed"),
    joint!(4 "acceleration_max_rad_s2" ["rad/s²"] 0.01..=1000.0, acceleration_max, "highest acceleration"),
    joint!(5 "torque_max_nm" ["N·m"] 0.01..=360.0, torque_max, "highest torque at the joint"),
    joint!(6 "position_error_max_rad" ["rad"] 0.0001..=1.0, position_error_max, "largest difference of commanded and measured position"),
    joint!(7 "rotor_inertia_kg_m2" ["kg·m²"] 0.0..=100.0, rotor_inertia, "inertia of the drive's rotor at the joint"),
    joint!(8 "torque_gain" [""] 0.1..=10.0, torque_gain, "what the drive is asked for, as a multiple of the joint's torque"),
    arm!(32 "gravity_x_m_s2" ["m/s²"] -30.0..=30.0, gravity[0], "gravity along x of the base frame"),
    arm!(33 "gravity_y_m_s2" ["m/s²"] -30.0..=30.0, gravity[1], "gravity along y of the base frame"),
    arm!(34 "gravity_z_m_s2" ["m/s²"] -30.0..=30.0, gravity[2], "gravity along z of the base frame"),
    arm!(switch 35 "gripper", gripper, "a gripper is on the bus"),
    arm!(switch 36 "pump_off_on_error", pump_off_on_error, "the pump is switched off when the arm loses its torque"),
    arm!(37 "velocity_full_scale_rad_s" ["rad/s"] 0.1..=50.0, velocity_full_scale, "full scale of the drives' velocity"),
    arm!(38 "drive_speed_trip_rad_s" ["rad/s"] 0.1..=50.0, drive_speed_trip, "speed at which the drives trip by themselves"),
    arm!(39 "encoder_step_rad" ["rad"] 0.0..=0.01, encoder_step, "step of the joints' encoders"),
    arm!(whole 40 "joint_config_bits" [""] 0.0..=255.0, joint_config_bits: u8, "configuration bits sent to the joints"),
    arm!(whole 41 "gripper_config_bits" [""] 0.0..=255.0, gripper_config_bits: u8, "configuration bits sent to the gripper"),
    arm!(whole 42 "status_period_ms" ["ms"] 10.0..=1000.0, status_period_ms: u16, "time between two statuses without a record"),
    arm!(whole 43 "missed_moves_max" [""] 1.0..=50.0, missed_moves_max: u8, "Moves without a usable answer until that is an error"),
    arm!(whole 44 "node_boot_ms" ["ms"] 0.0..=60000.0, node_boot_ms: u32, "silence of a node after its reset that is no error"),
    arm!(whole 45 "enable_timeout_ms" ["ms"] 100.0..=60000.0, enable_timeout_ms: u32, "longest time for enabling"),
    arm!(46 "enable_speed_max_rad_s" ["rad/s"] 0.001..=2.0, enable_speed_max, "joints are enabled only while every one is slower"),
    arm!(whole 47 "enable_still_ms" ["ms"] 0.0..=10000.0, enable_still_ms: u16, "how long they have to have been that slow"),
    arm!(whole 48 "enable_rest_ms" ["ms"] 0.0..=10000.0, enable_rest_ms: u16, "time without enabling after torque was taken away"),
    arm!(49 "start_tolerance_rad" ["rad"] 0.0001..=0.5, start_tolerance_rad, "largest distance from the first point at the start"),
    arm!(whole 50 "ramp_ms" ["ms"] 20.0..=5000.0, ramp_ms: u16, "length of the ramp of pause, stop, resume and speed"),
    arm!(51 "overspeed_factor" [""] 1.0..=5.0, overspeed_factor, "measured speed that is an error, in velocity limits"),
    arm!(whole 52 "overspeed_ms" ["ms"] 1.0..=1000.0, overspeed_ms: u16, "how long a joint may be that fast"),
    arm!(whole 53 "stop_ms" ["ms"] 20.0..=10000.0, stop_ms: u16, "longest pause or stop"),
    arm!(whole 54 "braking_ms_max" ["ms"] 20.0..=20000.0, braking_ms_max: u16, "longest braking with all the torque there is"),
    arm!(55 "yield_torque_share" [""] 0.0..=1.0, yield_torque_share, "torque added to the model's after a position error, as a share of the limit"),
    arm!(whole 56 "torque_over_ms" ["ms"] 0.0..=100.0, torque_over_ms: u16, "torque at its limit in any 100 ms that is no error"),
    arm!(whole 57 "catch_ms_max" ["ms"] 0.0..=10000.0, catch_ms_max: u16, "time for catching the load of a joint that was just enabled"),
    arm!(whole 58 "blend_ms" ["ms"] 1.0..=5000.0, blend_ms: u16, "time over which steps of torque are blended out"),
    arm!(59 "teach_velocity_max_rad_s" ["rad/s"] 0.01..=5.0, teach_velocity_max, "speed above which teaching brakes"),
    arm!(60 "teach_damping_nm_s_rad" ["N·m·s/rad"] 0.0..=1000.0, teach_damping, "brake of teaching per speed in excess"),
    arm!(61 "teach_payload_max_kg" ["kg"] 0.0..=50.0, teach_payload_max, "largest mass at the flange that teaching carries"),
    arm!(62 "teach_payload_velocity_rad_s" ["rad/s"] 0.001..=5.0, teach_payload_velocity, "speed from which on the torque for it fades"),
    arm!(whole 63 "teach_fade_ms" ["ms"] 1.0..=10000.0, teach_fade_ms: u16, "time over which the rest of the missing torque fades"),
    arm!(64 "friction_sign_width_rad_s" ["rad/s"] 0.0001..=1.0, friction_sign_width, "speed around zero in which the sign of friction is smoothed"),
    arm!(whole 65 "host_timeout_ms" ["ms"] 0.0..=60000.0, host_timeout_ms: u16, "silence of all hosts that ends the motion; 0: none does"),
    arm!(96 "kp_max" ["N·m/rad"] 0.0..=1e6, parameter_bounds.kp_max, "highest Kp that is taken"),
    arm!(97 "ki_max" ["N·m/(rad·s)"] 0.0..=1e6, parameter_bounds.ki_max, "highest Ki that is taken"),
    arm!(98 "kd_max" ["N·m·s/rad"] 0.0..=1e5, parameter_bounds.kd_max, "highest Kd that is taken"),
    arm!(99 "integral_max_rad_s" ["rad·s"] 0.0..=1e5, parameter_bounds.integral_max, "largest bound of an integral that is taken"),
    arm!(100 "integral_bias_max" [""] 0.0..=1.0, parameter_bounds.integral_bias_max, "largest torque that bounds of an integral may force at rest, as a share of the limit"),
    arm!(101 "link_mass_max_kg" ["kg"] 0.0..=1000.0, parameter_bounds.link_mass_max, "heaviest link that is taken"),
    arm!(102 "link_inertia_max_kg_m2" ["kg·m²"] 0.0..=1e5, parameter_bounds.link_inertia_max, "largest inertia of a link that is taken"),
    arm!(103 "friction_max" [""] 0.0..=10.0, parameter_bounds.friction_max, "largest friction that is taken, as a share of the torque limit"),
    arm!(104 "slow_friction_max" [""] 0.0..=10.0, parameter_bounds.slow_friction_max, "the same up to half of the velocity limit"),
    arm!(105 "friction_reversed_max" [""] 0.0..=1.0, parameter_bounds.friction_reversed_max, "largest friction along a motion that is taken"),
    arm!(106 "rest_friction_max" [""] 0.0..=1.0, parameter_bounds.rest_friction_max, "largest friction at standstill that is taken"),
    Setting {
        live: Live::Always,
        ..arm!(128 "speed" [""] 0.05..=1.0, speed, "speed override: path seconds per second")
    },
];
