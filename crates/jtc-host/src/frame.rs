//! Frames from the host to the controller.

use jtc_core::{Friction, PidGains};
use jtc_dynamics::{ArmModel, Origin};
use jtc_wire::{ExecCommand, FrameType, HEADER, RawPoint};

/// Bytes of a Trajectory frame around its points.
pub const TRAJECTORY_OVERHEAD: usize = 14;
/// Bytes of a point.
pub const POINT_LEN: usize = 36;

/// A whole frame with length and CRC. `body` has at most 59,994 bytes.
pub fn frame(kind: FrameType, body: &[u8]) -> Vec<u8> {
    let n = body.len() + 6;
    debug_assert!(n <= jtc_wire::FRAME_MAX);
    let mut bytes = Vec::with_capacity(n);
    bytes.extend([HEADER, kind as u8]);
    bytes.extend((n as u16).to_be_bytes());
    bytes.extend(body);
    bytes.extend(jtc_wire::crc16(&bytes).to_be_bytes());
    bytes
}

fn floats(kind: FrameType, values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    let body: Vec<u8> = values.into_iter().flat_map(|v| (v as f32).to_be_bytes()).collect();
    frame(kind, &body)
}

/// Clears errors: the controller's own, and those of the nodes in `nodes` (bits 0..6).
pub fn clear_current(jtc: bool, nodes: u8) -> Vec<u8> {
    frame(FrameType::ClearCurrentErrors, &[u8::from(jtc), nodes, 0, 0])
}

/// One segment of a trajectory.
pub fn segment(trajectory: u16, segment: u16, segments: u16, step_ms: u16, points: &[RawPoint]) -> Vec<u8> {
    let mut body = Vec::with_capacity(8 + points.len() * POINT_LEN);
    for v in [trajectory, segment, segments, step_ms] {
        body.extend(v.to_be_bytes());
    }
    for p in points {
        for v in p.position.iter().chain(&p.velocity).chain(&p.acceleration) {
            body.extend(v.to_be_bytes());
        }
    }
    frame(FrameType::Trajectory, &body)
}

/// Starts, pauses or stops the trajectory.
pub fn exec(command: ExecCommand) -> Vec<u8> {
    frame(FrameType::TrajSetExecStatus, &[command as u8])
}

/// Resets the nodes in `nodes` (bits 0..6).
pub fn reset(nodes: u8) -> Vec<u8> {
    frame(FrameType::ResetCanDevices, &[nodes, 0, 0, 0])
}

/// Switches the pump.
pub fn gripper(pump: bool) -> Vec<u8> {
    frame(FrameType::GripperControl, &[u8::from(pump), 0, 0, 0])
}

/// Gains of all joints.
pub fn pid(gains: &[PidGains; 6]) -> Vec<u8> {
    floats(FrameType::PidParam, gains.iter().flat_map(|g| [g.kp, g.ki, g.kd, g.int_min, g.int_max]))
}

/// Kinematics and masses.
pub fn arm_model(model: &ArmModel) -> Vec<u8> {
    let six = |o: &Origin| [o.xyz[0], o.xyz[1], o.xyz[2], o.rpy[0], o.rpy[1], o.rpy[2]];
    let joints = model.joints.iter().flat_map(six);
    let links = model
        .links
        .iter()
        .flat_map(move |l| six(&l.origin).into_iter().chain(l.inertia).chain([l.mass]).collect::<Vec<_>>());
    floats(FrameType::ArmModel, joints.chain(links))
}

/// Friction compensation: the polynomial (six coefficients, highest index first on the wire) or the tables.
pub fn friction(friction: &Friction) -> Vec<u8> {
    match friction {
        Friction::Polynomial(c) => floats(
            FrameType::FrictionPolynomial,
            c.iter().flat_map(|c| c.iter().rev().copied().collect::<Vec<_>>()),
        ),
        Friction::Table(tables) => {
            let mut body = Vec::with_capacity(10_560);
            for t in tables {
                for v in t.velocity.iter().chain(&t.temperature).chain(t.torque.iter().flatten()) {
                    body.extend(v.to_be_bytes());
                }
            }
            frame(FrameType::FrictionTable, &body)
        }
    }
}
