//! Table of settings (J-53), with the wire number, name, unit, range, meaning and field of each setting. Docs, arm files and the output of
//! `jtc arm show` are generated from this table. A number of a removed setting is never reused. For example, the numbers 59 to 63 belonged
//! to an earlier version of Teaching.
use super::{Kind, Live, Setting};
use crate::config::Config;

/// Declares the table of settings and the functions that read and write a value. Both functions use `match`, because a static analysis
/// cannot follow calls through a table of functions.
macro_rules! settings {
    ($($kind:ident $number:literal $name:literal [$unit:literal] $low:literal..=$high:literal $live:ident $meaning:literal ($($place:tt)+);)+) => {
        /// Table of all settings, in the order of their numbers.
        pub static TABLE: [Setting; [$($number),+].len()] = [$(Setting {
            number: $number,
            name: $name,
            unit: $unit,
            low: $low,
            high: $high,
            whole: matches!(Kind::$kind, Kind::Whole | Kind::Switch | Kind::EachSwitch),
            live: Live::$live,
            meaning: $meaning,
            kind: Kind::$kind,
        },)+];

        /// Returns the value of a setting. For a setting of the joints, this is the value of the joint with index `joint`.
        pub(super) fn get(config: &Config, number: u8, joint: usize) -> Option<f64> {
            match number {
                $($number => settings!(@get $kind config joint $($place)+),)+
                _ => None,
            }
        }

        /// Writes the value of a setting. Returns `false` if the joint does not exist.
        pub(super) fn set(config: &mut Config, number: u8, joint: usize, value: f64) -> bool {
            match number {
                $($number => settings!(@set $kind config joint value $($place)+),)+
                _ => false,
            }
        }
    };
    (@get Joint $config:ident $joint:ident $field:ident) => { $config.joints.get($joint).map(|joint| joint.$field) };
    (@get Each $config:ident $joint:ident $field:ident) => { $config.$field.get($joint).copied() };
    (@get EachSwitch $config:ident $joint:ident $field:ident) => {
        $config.$field.get($joint).map(|&switch| f64::from(u8::from(switch)))
    };
    (@get Number $config:ident $joint:ident $($field:tt)+) => { Some($config.$($field)+) };
    (@get Whole $config:ident $joint:ident $field:ident: $type:ty) => { Some(f64::from($config.$field)) };
    (@get Switch $config:ident $joint:ident $field:ident) => { Some(f64::from(u8::from($config.$field))) };
    (@set Joint $config:ident $joint:ident $value:ident $field:ident) => {
        $config.joints.get_mut($joint).map(|joint| joint.$field = $value).is_some()
    };
    (@set Each $config:ident $joint:ident $value:ident $field:ident) => {
        $config.$field.get_mut($joint).map(|each| *each = $value).is_some()
    };
    (@set EachSwitch $config:ident $joint:ident $value:ident $field:ident) => {
        $config.$field.get_mut($joint).map(|each| *each = $value != 0.0).is_some()
    };
    (@set Number $config:ident $joint:ident $value:ident $($field:tt)+) => {{ $config.$($field)+ = $value; true }};
    (@set Whole $config:ident $joint:ident $value:ident $field:ident: $type:ty) => {{ $config.$field = $value as $type; true }};
    (@set Switch $config:ident $joint:ident $value:ident $field:ident) => {{ $config.$field = $value != 0.0; true }};
}

settings! {
    Joint 1 "position_min_rad" ["rad"] -6.2832..=6.2832 No "lowest position" (position_min);
    Joint 2 "position_max_rad" ["rad"] -6.2832..=6.2832 No "highest position" (position_max);
    Joint 3 "velocity_max_rad_s" ["rad/s"] 0.01..=20.0 No "highest speed" (velocity_max);
    Joint 4 "acceleration_max_rad_s2" ["rad/s²"] 0.01..=1000.0 No "highest acceleration" (acceleration_max);
    Joint 5 "torque_max_nm" ["N·m"] 0.01..=360.0 No "highest torque at the joint" (torque_max);
    Joint 6 "position_error_max_rad" ["rad"] 0.0001..=1.0 No "largest difference of commanded and measured position" (position_error_max);
    Joint 7 "rotor_inertia_kg_m2" ["kg·m²"] 0.0..=100.0 No "inertia of the drive's rotor at the joint" (rotor_inertia);
    Joint 8 "torque_gain" [""] 0.1..=10.0 No "what the drive is asked for, as a multiple of the joint's torque" (torque_gain);
    Joint 9 "teach_damping_nm_s_rad" ["N·m·s/rad"] 0.0..=1000.0 No "damping in Teaching (J-25)" (teach_damping);
    EachSwitch 16 "absent" [""] 0.0..=1.0 Unpowered "the joint is not there, for work on a bench: no motion is executed" (absent);
    Each 17 "absent_position_rad" ["rad"] -6.2832..=6.2832 Unpowered "where the model has a joint that is not there" (absent_position);
    Number 32 "gravity_x_m_s2" ["m/s²"] -30.0..=30.0 No "gravity along x of the base frame" (gravity[0]);
    Number 33 "gravity_y_m_s2" ["m/s²"] -30.0..=30.0 No "gravity along y of the base frame" (gravity[1]);
    Number 34 "gravity_z_m_s2" ["m/s²"] -30.0..=30.0 No "gravity along z of the base frame" (gravity[2]);
    Switch 35 "gripper" [""] 0.0..=1.0 No "a gripper is on the bus" (gripper);
    Switch 36 "pump_off_on_error" [""] 0.0..=1.0 No "the pump is switched off when the arm loses its torque" (pump_off_on_error);
    Number 37 "velocity_full_scale_rad_s" ["rad/s"] 0.1..=50.0 No "full scale of the drives' velocity" (velocity_full_scale);
    Number 38 "drive_speed_trip_rad_s" ["rad/s"] 0.1..=50.0 No "speed at which the drives trip by themselves" (drive_speed_trip);
    Number 39 "encoder_step_rad" ["rad"] 0.0..=0.01 No "step of the joints' encoders" (encoder_step);
    Whole 40 "joint_config_bits" [""] 0.0..=255.0 No "configuration bits sent to the joints" (joint_config_bits: u8);
    Whole 41 "gripper_config_bits" [""] 0.0..=255.0 No "configuration bits sent to the gripper" (gripper_config_bits: u8);
    Whole 42 "status_period_ms" ["ms"] 10.0..=1000.0 No "time between two statuses without a record" (status_period_ms: u16);
    Whole 43 "missed_moves_max" [""] 1.0..=50.0 No "Moves without a usable answer until that is an error" (missed_moves_max: u8);
    Whole 44 "node_boot_ms" ["ms"] 0.0..=60000.0 No "silence of a node after its reset that is no error" (node_boot_ms: u32);
    Whole 45 "enable_timeout_ms" ["ms"] 100.0..=60000.0 No "longest time for enabling" (enable_timeout_ms: u32);
    Number 46 "enable_speed_max_rad_s" ["rad/s"] 0.001..=2.0 No "joints are enabled only while every one is slower" (enable_speed_max);
    Whole 47 "enable_still_ms" ["ms"] 0.0..=10000.0 No "how long they have to have been that slow" (enable_still_ms: u16);
    Whole 48 "enable_rest_ms" ["ms"] 0.0..=10000.0 No "time without enabling after torque was taken away" (enable_rest_ms: u16);
    Number 49 "start_tolerance_rad" ["rad"] 0.0001..=0.5 No "largest distance from the first point at the start" (start_tolerance_rad);
    Whole 50 "ramp_ms" ["ms"] 20.0..=5000.0 No "length of the ramp of pause, stop, resume and speed" (ramp_ms: u16);
    Number 51 "overspeed_factor" [""] 1.0..=5.0 No "measured speed that is an error, in velocity limits" (overspeed_factor);
    Whole 52 "overspeed_ms" ["ms"] 1.0..=1000.0 No "how long a joint may be that fast" (overspeed_ms: u16);
    Whole 53 "stop_ms" ["ms"] 20.0..=10000.0 No "longest pause or stop" (stop_ms: u16);
    Whole 54 "braking_ms_max" ["ms"] 20.0..=20000.0 No "longest braking with all the torque there is" (braking_ms_max: u16);
    Number 55 "yield_torque_share" [""] 0.0..=0.8 No "torque of a joint that yields to a slow push, as a share of the limit" (yield_torque_share);
    Whole 56 "torque_over_ms" ["ms"] 0.0..=100.0 No "time at the torque limit, within any 100 ms, that is not yet an overload" (torque_over_ms: u16);
    Whole 57 "catch_ms_max" ["ms"] 0.0..=10000.0 No "time for catching the load of a joint that was just enabled" (catch_ms_max: u16);
    Whole 58 "blend_ms" ["ms"] 1.0..=5000.0 No "time over which steps of torque are blended out" (blend_ms: u16);
    Number 64 "friction_sign_width_rad_s" ["rad/s"] 0.0001..=1.0 No "speed around zero in which the sign of friction is smoothed" (friction_sign_width);
    Whole 65 "host_timeout_ms" ["ms"] 0.0..=60000.0 No "silence of all hosts that pauses a motion and ends teaching (J-59); 0: none does" (host_timeout_ms: u16);
    Switch 66 "torque_reaction" [""] 0.0..=1.0 No "an overloaded joint releases the arm (1), or is held (0)" (torque_release);
    Switch 67 "protective_stop_latches" [""] 0.0..=1.0 No "a held stop is over only when the host has cleared it" (protective_stop_latches);
    Whole 68 "drive_speed_window_ms" ["ms"] 0.0..=15.0 No "time that the drives' speed is the mean over; 0: it is not compared with their position" (drive_speed_window_ms: u8);
    Number 69 "gear_stiffness_nm_rad" ["N·m/rad"] 10.0..=1e9 No "stiffness of a gear: how far a torque twists it" (gear_stiffness);
    Whole 72 "delay_ticks" [""] 0.0..=7.0 No "age of a measurement when what is commanded because of it acts, in ticks" (delay_ticks: u8);
    Number 77 "teach_stiction" [""] 0.0..=0.3 No "torque that holds a joint at standstill in Teaching, its own friction included, as a share of the limit" (teach_stiction);
    Number 78 "teach_friction" [""] 0.0..=0.7 No "share of the Coulomb friction that Teaching takes away" (teach_friction);
    Number 79 "tool_speed_max_m_s" ["m/s"] 0.0..=10.0 No "highest speed of the flange in a jog; Teaching brakes harder from it on, at twice that fully; 0: any" (tool_speed_max);
    Whole 80 "safety_input_ramp_ms" ["ms"] 0.0..=500.0 No "time for a stop when the safety input becomes 0, before the torque is taken away; 0: none" (safety_input_ramp_ms: u16);
    Number 96 "kp_max" ["N·m/rad"] 0.0..=1e6 No "highest Kp that is taken" (parameter_bounds.kp_max);
    Number 97 "ki_max" ["N·m/(rad·s)"] 0.0..=1e6 No "highest Ki that is taken" (parameter_bounds.ki_max);
    Number 98 "kd_max" ["N·m·s/rad"] 0.0..=1e5 No "highest Kd that is taken" (parameter_bounds.kd_max);
    Number 99 "integral_max_rad_s" ["rad·s"] 0.0..=1e5 No "largest bound of an integral that is taken" (parameter_bounds.integral_max);
    Number 100 "integral_bias_max" [""] 0.0..=1.0 No "largest torque that bounds of an integral may force at rest, as a share of the limit" (parameter_bounds.integral_bias_max);
    Number 101 "link_mass_max_kg" ["kg"] 0.0..=1000.0 No "heaviest link that is taken" (parameter_bounds.link_mass_max);
    Number 102 "link_inertia_max_kg_m2" ["kg·m²"] 0.0..=1e5 No "largest inertia of a link that is taken" (parameter_bounds.link_inertia_max);
    Number 103 "friction_max" [""] 0.0..=10.0 No "largest friction that is taken, as a share of the torque limit" (parameter_bounds.friction_max);
    Number 104 "slow_friction_max" [""] 0.0..=10.0 No "the same up to half of the velocity limit" (parameter_bounds.slow_friction_max);
    Number 105 "friction_reversed_max" [""] 0.0..=1.0 No "largest friction along a motion that is taken" (parameter_bounds.friction_reversed_max);
    Number 106 "rest_friction_max" [""] 0.0..=1.0 No "largest friction at standstill that is taken" (parameter_bounds.rest_friction_max);
    Number 128 "speed" [""] 0.05..=1.0 Always "speed override: path seconds per second" (speed);
    Number 144 "payload_mass_kg" ["kg"] 0.0..=100.0 Standing "mass at the flange; 0: none" (payload.mass);
    Number 145 "payload_x_m" ["m"] -5.0..=5.0 Standing "its centre of mass along x of the flange" (payload.com[0]);
    Number 146 "payload_y_m" ["m"] -5.0..=5.0 Standing "its centre of mass along y of the flange" (payload.com[1]);
    Number 147 "payload_z_m" ["m"] -5.0..=5.0 Standing "its centre of mass along z of the flange" (payload.com[2]);
    Number 148 "payload_ixx_kg_m2" ["kg·m²"] 0.0..=100.0 Standing "its inertia about its centre of mass, along the axes of the flange" (payload.inertia[0]);
    Number 149 "payload_ixy_kg_m2" ["kg·m²"] -100.0..=100.0 Standing "the same" (payload.inertia[1]);
    Number 150 "payload_ixz_kg_m2" ["kg·m²"] -100.0..=100.0 Standing "the same" (payload.inertia[2]);
    Number 151 "payload_iyy_kg_m2" ["kg·m²"] 0.0..=100.0 Standing "the same" (payload.inertia[3]);
    Number 152 "payload_iyz_kg_m2" ["kg·m²"] -100.0..=100.0 Standing "the same" (payload.inertia[4]);
    Number 153 "payload_izz_kg_m2" ["kg·m²"] 0.0..=100.0 Standing "the same" (payload.inertia[5]);
}
