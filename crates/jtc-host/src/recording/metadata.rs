//! Conversion of the header of a recording to and from the key-value pairs of an MCAP metadata record.

use std::collections::BTreeMap;

use jtc_core::{JOINTS, PidGains};

use super::{DeviceIdentity, Ending, JointInfo, RecordingInfo};

/// Keys of a joint's gains in N·m/rad, N·m/(rad·s) and N·m·s/rad, followed by the bounds of the integral of the error.
const GAINS: [&str; 5] = ["kp", "ki", "kd", "int_min_rad_s", "int_max_rad_s"];

fn listed(gains: &PidGains) -> [f64; 5] {
    [gains.kp, gains.ki, gains.kd, gains.int_min, gains.int_max]
}

/// Returns the gains of all joints, or `None` if one of the gains is missing.
fn gains(map: &BTreeMap<String, String>) -> Option<[PidGains; JOINTS]> {
    let mut all = [PidGains::default(); JOINTS];
    for (i, gains) in all.iter_mut().enumerate() {
        let value = |key: &str| map.get(&format!("joint{}_{key}", i + 1))?.parse().ok();
        let [kp, ki, kd, int_min, int_max] = GAINS.map(value);
        *gains = PidGains { kp: kp?, ki: ki?, kd: kd?, int_min: int_min?, int_max: int_max? };
    }
    Some(all)
}

impl RecordingInfo {
    /// Returns the header as key-value pairs.
    pub(super) fn to_map(&self) -> BTreeMap<String, String> {
        let mut map = BTreeMap::new();
        let mut put = |key: String, value: String| drop(map.insert(key, value));
        put("arm".into(), self.arm.clone());
        put("source".into(), self.source.clone());
        put("trajectory".into(), self.trajectory.clone());
        put("start_unix_ns".into(), self.start_unix_ns.to_string());
        put("flange_origin".into(), join(&self.flange));
        let optional = [
            ("commanded_by", &self.commanded_by),
            ("outcome", &self.ending.outcome),
            ("reason", &self.ending.reason),
        ];
        for (key, value) in optional {
            if !value.is_empty() {
                put(key.into(), value.clone());
            }
        }
        if self.ending.lost_samples > 0 {
            put("lost_samples".into(), self.ending.lost_samples.to_string());
        }
        if let Some(runs) = self.runs {
            put("runs".into(), runs.to_string());
        }
        if let Some(hash) = self.hash {
            put("arm_hash".into(), format!("{hash:016x}"));
        }
        if let Some(device) = &self.device {
            put("board".into(), device.board.clone());
            put("firmware".into(), device.firmware.clone());
            put("revision".into(), device.revision.clone());
        }
        for (i, gains) in self.gains.iter().flatten().enumerate() {
            for (key, value) in GAINS.into_iter().zip(listed(gains)) {
                put(format!("joint{}_{key}", i + 1), value.to_string());
            }
        }
        for (i, joint) in self.joints.iter().enumerate() {
            let n = i + 1;
            put(format!("joint{n}_name"), self.joint_name(i));
            put(format!("joint{n}_origin"), join(&joint.origin));
            for (key, value) in [
                ("position_min_rad", joint.position_min_rad),
                ("position_max_rad", joint.position_max_rad),
                ("velocity_max_rad_s", joint.velocity_max_rad_s),
                ("torque_max_nm", joint.torque_max_nm),
                ("position_error_max_rad", joint.position_error_max_rad),
            ] {
                put(format!("joint{n}_{key}"), value.to_string());
            }
        }
        map
    }

    /// Reads the header from key-value pairs. Missing or unreadable values keep their defaults.
    pub(super) fn from_map(map: &BTreeMap<String, String>) -> Self {
        let text = |key: &str| map.get(key).cloned().unwrap_or_default();
        let number = |key: String| map.get(&key).and_then(|v| v.parse().ok()).unwrap_or(f64::NAN);
        let joints = std::array::from_fn(|i| {
            let n = i + 1;
            JointInfo {
                name: text(&format!("joint{n}_name")),
                position_min_rad: number(format!("joint{n}_position_min_rad")),
                position_max_rad: number(format!("joint{n}_position_max_rad")),
                velocity_max_rad_s: number(format!("joint{n}_velocity_max_rad_s")),
                torque_max_nm: number(format!("joint{n}_torque_max_nm")),
                position_error_max_rad: number(format!("joint{n}_position_error_max_rad")),
                origin: split(&text(&format!("joint{n}_origin"))),
            }
        });
        Self {
            arm: text("arm"),
            source: text("source"),
            commanded_by: text("commanded_by"),
            trajectory: text("trajectory"),
            start_unix_ns: text("start_unix_ns").parse().unwrap_or(0),
            joints,
            flange: split(&text("flange_origin")),
            ending: Ending {
                outcome: text("outcome"),
                reason: text("reason"),
                lost_samples: text("lost_samples").parse().unwrap_or(0),
            },
            description: None,
            gains: gains(map),
            hash: u64::from_str_radix(&text("arm_hash"), 16).ok(),
            device: map.contains_key("firmware").then(|| DeviceIdentity {
                board: text("board"),
                firmware: text("firmware"),
                revision: text("revision"),
            }),
            commanded: None,
            runs: text("runs").parse().ok(),
            then: None,
        }
    }
}

fn join(values: &[f64; 6]) -> String {
    values.map(|v| v.to_string()).join(" ")
}

fn split(text: &str) -> [f64; 6] {
    let mut values = text.split_whitespace().map(|v| v.parse().unwrap_or(0.0));
    std::array::from_fn(|_| values.next().unwrap_or(0.0))
}
