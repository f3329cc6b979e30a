//! Function of the fuzz target for bus frames.

use crate::{Answer, Decoded, Frame, POSITION_FULL_SCALE, Request, Scale, duration_ns};

/// Uses the first two bytes as the identifier and the remaining bytes as the payload. Parses the frame as a request and as an answer.
/// Encodes the request and the answer again, and compares the result with the frame.
pub fn bus_frame(data: &[u8]) {
    let Some((id, payload)) = data.split_first_chunk::<2>() else { return };
    let id = u16::from_be_bytes(*id);
    let Some(frame) = Frame::new(id & 0x7FF, payload) else { return };
    let duration = duration_ns(&frame);
    assert!((29_000..120_000).contains(&duration), "{duration} ns");
    let scale = Scale::default();

    let request = Request::parse(&frame);
    let answer = Answer::parse(&frame, scale);
    assert!(request.is_err() || answer.is_err(), "a frame is a request or an answer");
    if let Ok(request) = request {
        let again = request.emit();
        assert_eq!(again.id, frame.id);
        let once = Request::parse(&again).expect("what was sent is understood");
        assert_eq!(once.emit(), again);
        if let Request::Move { torque, .. } = request {
            assert!(torque.iter().all(|torque| torque.is_finite() && torque.abs() < 360.02));
        }
    }
    if let Ok(answer) = answer {
        let again = answer.emit(scale);
        assert_eq!(again.id, frame.id);
        let once = Answer::parse(&again, scale).expect("what was sent is understood");
        assert_eq!(once.emit(scale), again);
        assert_eq!(answer.node(), frame.node());
        if let Answer::Joint { report, .. } = answer {
            assert!(report.position.abs() < 1.001 * POSITION_FULL_SCALE && report.velocity.abs() < 2.001);
        }
    }
    write_nowhere(&Decoded { frame: &frame, scale });
}

fn write_nowhere(text: &impl core::fmt::Display) {
    struct Nowhere;
    impl core::fmt::Write for Nowhere {
        fn write_str(&mut self, _: &str) -> core::fmt::Result {
            Ok(())
        }
    }
    let _ = core::fmt::write(&mut Nowhere, format_args!("{text}"));
}
