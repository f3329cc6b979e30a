//! Functions of the fuzz targets. Each function accepts any bytes, and panics if a guarantee is violated.
mod reference;
mod script;
mod status;

use std::format;
use std::vec;
use std::vec::Vec;

use crate::{Command, FrameRef, FrameType, Lengths, RawPoint, crc16};

pub use reference::{Event, events};
pub use script::{stream_parser, stream_regions};
pub use status::status_stream;

/// Builds a frame of any type and body with a correct CRC. The length of the frame can be invalid for its type.
pub fn sealed(kind: u8, body: &[u8]) -> Vec<u8> {
    let mut bytes = vec![crate::HEADER, kind];
    bytes.extend((body.len() as u16 + 6).to_be_bytes());
    bytes.extend(body);
    bytes.extend(crc16(&bytes).to_be_bytes());
    bytes
}

/// Returns a permitted body length for frames of type `kind`; `pick` selects the length.
fn body_len(kind: FrameType, pick: u8) -> usize {
    match kind.lengths() {
        Lengths::OneOf(list) => usize::from(list[usize::from(pick) % list.len()]) - 6,
        Lengths::Steps { first, step, last } => {
            let count = (usize::from(last - first) / usize::from(step)).min(39) + 1;
            usize::from(first) - 6 + usize::from(step) * (usize::from(pick) % count)
        }
    }
}

/// Returns the frame for an input of [`frame_bodies`]. The input consists of the type, a byte that selects the length, and the body. The
/// body is repeated or cut to the selected length.
pub fn body_frame(data: &[u8]) -> Option<Vec<u8>> {
    let [kind, pick, rest @ ..] = data else { return None };
    // A number up to 0x11 selects the frame type with this number, as in older stored inputs. Other numbers select extension types.
    let kind = match usize::from(*kind % 0x20) {
        kind @ 0..0x12 => FrameType::from_byte(kind as u8)?,
        more => *FrameType::ALL.get(more - 1)?,
    };
    let body: Vec<u8> = rest.iter().chain(&[0]).copied().cycle().take(body_len(kind, *pick)).collect();
    Some(sealed(kind as u8, &body))
}

/// Parses, describes and encodes the frame of [`body_frame`], then parses the encoded frame again.
pub fn frame_bodies(data: &[u8]) {
    let Some(bytes) = body_frame(data) else { return };
    let frame = FrameRef::new_checked(&bytes).expect("a good frame");
    assert_eq!(frame.body(), &bytes[4..bytes.len() - 2]);

    // A body that the receiver never returns must not cause a panic either.
    let raw = FrameRef { frame_type: frame.frame_type, bytes: &data[2..] };
    if let Ok(command) = Command::parse(raw) {
        let mut out = vec![0; data.len() + 64];
        let _ = command.emit(&mut out);
        let _ = format!("{command} {command:#}");
    }

    let _ = format!("{frame}");
    if frame.body().len() < 200 || data[1].is_multiple_of(16) {
        let _ = format!("{frame:#}");
    }
    let Ok(command) = Command::parse(frame) else { return };
    let mut out = vec![0; bytes.len().max(10)];
    let n = command.emit(&mut out).expect("what was parsed can be encoded");
    let again = FrameRef::new_checked(&out[..n]).expect("what is sent is a good frame");
    assert_eq!(Command::parse(again), Ok(command));
    assert!(command.emit(&mut vec![0; n - 1]).is_err(), "never longer than the buffer");
    if let Command::Trajectory(segment) = command {
        assert_eq!(n, bytes.len());
        segment.points().for_each(scaled_and_back);
    }
}

fn scaled_and_back(point: RawPoint) {
    let again =
        RawPoint::from_si(&point.position_rad(), &point.velocity_rad_s(), &point.acceleration_rad_s2());
    let lowest = [point.position, point.velocity, point.acceleration].as_flattened().contains(&i16::MIN);
    match again {
        Ok(again) => assert_eq!(again, point),
        // -32768 is the only raw value outside the scale.
        Err(_) => assert!(lowest),
    }
}
