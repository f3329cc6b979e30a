//! Poses of the arm's links as transforms for viewers. Each transform is the pose of a joint's frame in its parent frame. The frame names
//! are the names in the robot description.

use super::RecordingInfo;
use super::cdr::Encoder;
use crate::arm::frame_name;
use crate::sample::Sample;

/// Length of a time interval in which at most one message with transforms is written, ns. The interval of 20 ms corresponds to the display
/// rate of a viewer (50 Hz).
const EVERY_NS: u64 = 20_000_000;

/// Rotation as a unit quaternion in the order x, y, z, w.
type Quaternion = [f64; 4];

/// Returns the rotation that consists of rotation `b` followed by rotation `a`.
fn product(a: Quaternion, b: Quaternion) -> Quaternion {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

/// Returns the rotation by an angle (rad) about axis 0, 1 or 2.
fn about(axis: usize, angle: f64) -> Quaternion {
    let (sin, cos) = (0.5 * angle).sin_cos();
    let mut turned = [0.0, 0.0, 0.0, cos];
    turned[axis] = sin;
    turned
}

/// Returns the rotation for roll, pitch and yaw about fixed axes, as in a URDF.
fn from_rpy([roll, pitch, yaw]: [f64; 3]) -> Quaternion {
    product(about(2, yaw), product(about(1, pitch), about(0, roll)))
}

/// Frame with the pose in its parent frame.
struct Placed {
    xyz: [f64; 3],
    rotation: Quaternion,
    parent: String,
    child: String,
}

/// Writer of `tf2_msgs/msg/TFMessage`.
pub(super) struct Frames {
    /// Frames of the six joints, followed by the frame of the fixed flange.
    placed: [Placed; 7],
    last: Option<u64>,
}

impl Frames {
    /// Creates the frames of the arm.
    pub(super) fn of(info: &RecordingInfo) -> Self {
        let placed = |i: usize| {
            let [x, y, z, roll, pitch, yaw] = info.joints.get(i).map_or(info.flange, |joint| joint.origin);
            Placed {
                xyz: [x, y, z],
                rotation: from_rpy([roll, pitch, yaw]),
                parent: frame_name(i),
                child: frame_name(i + 1),
            }
        };
        Self { placed: std::array::from_fn(placed), last: None }
    }

    /// Writes the message with the transforms of a sample. A joint whose position is unknown is left out. Writes
    /// nothing if all positions are unknown, or if a message was already written in the same interval of
    /// [`EVERY_NS`].
    pub(super) fn write<'a>(
        &mut self,
        cdr: &'a mut Encoder,
        stamp_ns: u64,
        sample: &Sample,
    ) -> Option<&'a [u8]> {
        let turn = stamp_ns / EVERY_NS;
        let position = |i: usize| sample.joints.get(i).map_or(0.0, |joint| joint.position);
        let known = (0..6).filter(|i| position(*i).is_finite()).count();
        if self.last == Some(turn) || known == 0 {
            return None;
        }
        self.last = Some(turn);
        // The flange does not move relative to its parent frame, so its pose is always known.
        cdr.start().u32(known as u32 + 1);
        for (i, placed) in self.placed.iter().enumerate().filter(|(i, _)| position(*i).is_finite()) {
            cdr.header(stamp_ns, &placed.parent).string(&placed.child);
            let rotation = product(placed.rotation, about(2, position(i)));
            for value in placed.xyz.into_iter().chain(rotation) {
                cdr.f64(value);
            }
        }
        Some(cdr.bytes())
    }
}
