//! Frames of a host, and the bodies of such frames.
use jtc_dynamics::ArmModel;
use jtc_wire::{FrameType, RawPoint, crc16};

/// Returns a frame with its length and CRC.
pub(crate) fn frame(frame_type: FrameType, body: &[u8]) -> Vec<u8> {
    let n = body.len() + 6;
    let mut bytes = vec![0x9B, frame_type as u8, (n >> 8) as u8, n as u8];
    bytes.extend_from_slice(body);
    bytes.extend_from_slice(&crc16(&bytes).to_be_bytes());
    bytes
}

pub(crate) fn floats(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_be_bytes).collect()
}

/// Returns the body of a Trajectory frame.
pub(crate) fn segment_body(
    number: u16,
    segment: u16,
    segments: u16,
    step: u16,
    points: &[RawPoint],
) -> Vec<u8> {
    let mut body: Vec<u8> = [number, segment, segments, step].iter().flat_map(|x| x.to_be_bytes()).collect();
    for p in points {
        for v in p.position.iter().chain(&p.velocity).chain(&p.acceleration) {
            body.extend_from_slice(&v.to_be_bytes());
        }
    }
    body
}

/// Returns the body of an ArmModel frame.
pub(crate) fn model_body(model: &ArmModel) -> Vec<u8> {
    let joints = model.joints.iter().flat_map(|j| j.xyz.into_iter().chain(j.rpy));
    let links = model.links.iter().flat_map(|l| {
        let origin = l.origin.xyz.into_iter().chain(l.origin.rpy);
        origin.chain(l.inertia).chain([l.mass])
    });
    floats(joints.chain(links).map(|x| x as f32))
}
