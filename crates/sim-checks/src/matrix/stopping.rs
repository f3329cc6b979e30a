//! Rows that apply only to a motion: stop commands on a bad line, near the torque limit, and with a payload.
use jtc_core::{ControllerState, Parameters};

use super::MatrixError;
use super::standstill::{Motion, state_then, stood_in_time, stop_lines};
use crate::lowering::{LOADED, Lowering, holding_torque, with_payload};
use jtc_sim::Support;

/// Loads of the shoulder: holding torque as a share of the torque limit, speed (rad/s), and `true` if the torque
/// suffices to stop in time.
const LOADS: [(f64, f64, bool); 6] = [
    (0.90, 0.2, true),
    (0.95, 0.2, true),
    (0.97, 0.2, true),
    (0.99, 0.4, false),
    (1.02, 0.2, false),
    (1.02, 0.4, false),
];
/// Masses of the payloads, kg.
const PAYLOADS: [f64; 4] = [1.0, 2.0, 3.0, 4.0];
/// Shoulder angle (rad) and speed (rad/s) at which the host stops the arm with a payload.
const WITH_PAYLOAD: (f64, f64) = (-0.9, 0.3);

/// Returns the results of the stop commands as Markdown tables.
pub fn stopping_table() -> Result<String, MatrixError> {
    let mut out = format!(
        "The times count from the last byte of the command. In the rows *at … % of the torque limit*, the shoulder (joint {}) moves down. The\n\
         torque that holds it at the position of the Stop is that percentage of its limit, which is lower than the default in these rows. If\n\
         the remaining torque is not sufficient, the joint brakes with all of it for a second. A joint that still moves then lowers its load\n\
         (J-70). `jtc traj check` refuses such a path.\n\n\
         In the rows with a payload, the payload is at the centre of the last link of the default arm, which moves down at {} rad/s. The arm\n\
         model of the controller contains a *known* payload and lacks an *unknown* one. The sag is the distance that a joint moves in the half\n\
         second after the brakes have opened.\n\n\
         | in Operate | state then | with holding brakes | without brakes |\n|---|---|---|---|\n",
        LOADED + 1,
        WITH_PAYLOAD.1
    );
    out += &stop_lines()?;
    for (share, speed, suffices) in LOADS {
        let name = format!("Stop at {:.0} % of the torque limit, {speed} rad/s", 100.0 * share);
        out += &Line::of(&Lowering::at_share(share, speed), suffices)?.row(&name);
    }
    let (shoulder, speed) = WITH_PAYLOAD;
    for known in [true, false] {
        for mass in PAYLOADS {
            let mut lowering = Lowering::new(with_payload(mass), shoulder, speed);
            let load = 100.0 * holding_torque(&lowering.model, shoulder) / lowering.torque_max;
            if !known {
                lowering.known = Parameters::avena().model;
            }
            let line = Line::of(&lowering, true)?;
            let word = if known { "known" } else { "unknown" };
            let name = format!("Stop with {mass} kg, {word}, at {load:.0} %, sag {:.3} rad", line.sag);
            out += &line.row(&name);
        }
    }
    Ok(out)
}

/// Results of a lowering with and without holding brakes.
struct Line {
    then: [String; 2],
    motion: [Motion; 2],
    /// Maximum sag with and without brakes, rad.
    sag: f64,
}

impl Line {
    /// Runs a lowering. The controller must hold the arm after it comes to rest. If the torque `suffices`, the arm must
    /// come to rest in time.
    fn of(lowering: &Lowering, suffices: bool) -> Result<Self, MatrixError> {
        let mut sag = 0.0f64;
        let mut one = |support| -> Result<(String, Motion), MatrixError> {
            let o = Lowering { support, ..lowering.clone() }.run()?;
            sag = sag.max(o.sag);
            let motion = Motion::Stands { ms: o.standing_ms, distance: o.way, speed: o.peak };
            if suffices {
                stood_in_time(&motion)?;
            }
            if o.state != ControllerState::HoldPos {
                return Err(MatrixError::NoStop { ms: None });
            }
            Ok((state_then(o.state, o.trajectory, o.errors, o.joints), motion))
        };
        let (brakes, stand) = (one(Support::Brakes)?, one(Support::Stand)?);
        Ok(Self { then: [brakes.0, stand.0], motion: [brakes.1, stand.1], sag })
    }

    fn row(&self, name: &str) -> String {
        let [then, also] = &self.then;
        let also = if then == also { String::new() } else { format!("; without brakes {also}") };
        format!("| {name} | {then}{also} | {} | {} |\n", self.motion[0], self.motion[1])
    }
}
