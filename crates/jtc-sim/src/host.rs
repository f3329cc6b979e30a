//! Small host for tests, soak runs and the fault matrix. The host creates frames, receives statuses, and plans simple
//! motions.
//!
//! The real client library is `jtc-host`. Because of this small host, tests of the simulation do not depend on
//! `jtc-host`.
use jtc_dynamics::{ArmModel, JOINTS, JointVec, Origin};
use jtc_wire::{
    ACCELERATION_SCALE, ExecCommand, FrameType, HEADER, POSITION_SCALE, RawPoint, STATUS_LEN, Status,
    VELOCITY_SCALE, crc16,
};

use crate::world::World;

/// Returns a frame that consists of header, length, `body` and CRC.
pub fn frame(frame_type: FrameType, body: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(body.len() + 6);
    bytes.extend([HEADER, frame_type as u8]);
    // Every body of this protocol fits into a frame.
    bytes.extend(u16::try_from(body.len() + 6).unwrap_or(u16::MAX).to_be_bytes());
    bytes.extend(body);
    bytes.extend(crc16(&bytes).to_be_bytes());
    bytes
}

/// Returns the three frames that command the controller to use its default friction polynomial, gains and arm model.
pub fn use_defaults() -> Vec<u8> {
    [FrameType::FrictionPolynomialUseDefault, FrameType::PidParamUseDefault, FrameType::ArmModelUseDefault]
        .into_iter()
        .flat_map(|t| frame(t, &[]))
        .collect()
}

/// Returns the frame with an arm model. The controller receives the numbers of the model as rounded 32-bit floats.
pub fn arm_model(model: &ArmModel) -> Vec<u8> {
    let origin = |o: &Origin| o.xyz.into_iter().chain(o.rpy);
    let joints = model.joints.iter().flat_map(origin);
    let links = model.links.iter().flat_map(|l| origin(&l.origin).chain(l.inertia).chain([l.mass]));
    let body: Vec<u8> = joints.chain(links).flat_map(|x| (x as f32).to_be_bytes()).collect();
    frame(FrameType::ArmModel, &body)
}

/// Returns the frame for Execute, Pause or Stop.
pub fn exec(command: ExecCommand) -> Vec<u8> {
    frame(FrameType::TrajSetExecStatus, &[command as u8])
}

/// Returns the frames that clear all current and occurred errors of the controller and of every node.
pub fn clear_all() -> Vec<u8> {
    frame(FrameType::ClearCurrentErrors, &[1, 0x7F, 0, 0])
}

/// Returns the trajectory in segments of `per_segment` points, with `step_ms` ms between two points.
pub fn trajectory(points: &[RawPoint], step_ms: u16, per_segment: usize) -> Vec<Vec<u8>> {
    let segments: Vec<_> = points.chunks(per_segment.max(1)).collect();
    let number = |n: usize| u16::try_from(n).unwrap_or(u16::MAX).to_be_bytes();
    let make = |(n, part): (usize, &&[RawPoint])| {
        let mut body = Vec::new();
        body.extend(1u16.to_be_bytes());
        body.extend(number(n));
        body.extend(number(segments.len()));
        body.extend(step_ms.to_be_bytes());
        part.iter().for_each(|point| body.extend(point.emit()));
        frame(FrameType::Trajectory, &body)
    };
    segments.iter().enumerate().map(make).collect()
}

/// Returns a motion that starts and ends at standstill, with a point every `step_ms`. The motion goes from `from` to
/// `to` (rad) in `seconds` and back, `times` times. The motion follows a quintic polynomial with zero acceleration at
/// both ends.
pub fn there_and_back(
    from: &JointVec,
    to: &JointVec,
    seconds: f64,
    times: usize,
    step_ms: u16,
) -> Vec<RawPoint> {
    let steps = ((seconds * 1000.0 / f64::from(step_ms.max(1))).round() as usize).max(1);
    let mut points = Vec::new();
    for leg in 0..2 * times {
        let (a, b) = if leg % 2 == 0 { (from, to) } else { (to, from) };
        let first = usize::from(leg > 0);
        points.extend((first..=steps).map(|k| quintic(a, b, k as f64 / steps as f64, seconds)));
    }
    points
}

fn quintic(a: &JointVec, b: &JointVec, u: f64, seconds: f64) -> RawPoint {
    let s = u * u * u * (10.0 + u * (-15.0 + 6.0 * u));
    let ds = 30.0 * u * u * (1.0 + u * (-2.0 + u)) / seconds;
    let dds = 60.0 * u * (1.0 + u * (-3.0 + 2.0 * u)) / (seconds * seconds);
    let raw = |value: f64, scale: f64| (value / scale * 32_767.0).round().clamp(-32_767.0, 32_767.0) as i16;
    let all = |f: &dyn Fn(usize) -> i16| -> [i16; JOINTS] { core::array::from_fn(f) };
    RawPoint {
        position: all(&|j| raw(a[j] + s * (b[j] - a[j]), POSITION_SCALE)),
        velocity: all(&|j| raw(ds * (b[j] - a[j]), VELOCITY_SCALE)),
        acceleration: all(&|j| raw(dds * (b[j] - a[j]), ACCELERATION_SCALE)),
    }
}

/// Collects the statuses that the device sends.
#[derive(Clone, Debug, Default)]
pub struct Listener {
    bytes: Vec<u8>,
    /// Latest received status.
    pub last: Option<Status>,
    /// Responses in the received statuses, oldest first. Each response remains in the list until the caller removes
    /// it.
    pub responses: Vec<jtc_wire::Response>,
    /// Number of received bytes.
    pub received: u64,
}

impl Listener {
    /// Reads the bytes that the simulation has sent to the host.
    pub fn listen(&mut self, world: &mut World) {
        let mut buffer = [0; 1024];
        loop {
            let count = world.host_read(&mut buffer);
            if count == 0 {
                break;
            }
            self.received += count as u64;
            self.bytes.extend_from_slice(&buffer[..count]);
        }
        while self.bytes.len() >= STATUS_LEN {
            let Some(status) = Status::parse(&self.bytes[..STATUS_LEN]) else {
                // After a reset of the controller, the bytes can begin with an incomplete status. The host skips one
                // byte and searches for the next status.
                self.bytes.remove(0);
                continue;
            };
            self.bytes.drain(..STATUS_LEN);
            if let Some(response) = status.response() {
                self.responses.push(response);
            }
            self.last = Some(status);
        }
    }
}
