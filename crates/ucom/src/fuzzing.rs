//! Functions that the fuzz targets call.

use crate::{Frame, FromBoard, Profile, ToBoard};

/// Decodes a frame as a message of the PC and as a message of a board. Each valid message is encoded again, and must
/// have the same identifier as the frame.
pub fn frame(data: &[u8]) {
    let Some((id, payload)) = data.split_first_chunk::<2>() else { return };
    let Some(frame) = Frame::new(u16::from_be_bytes(*id) & 0x7FF, payload) else { return };
    let profile = Profile::default();
    if let Ok((to, message)) = ToBoard::decode(&frame, &profile) {
        let again = message.encode(to, &profile);
        assert_eq!(again.id(), frame.id());
        assert!(ToBoard::decode(&again, &profile).is_ok());
    }
    if let Ok((from, message)) = FromBoard::decode(&frame, &profile) {
        let again = message.encode(from, &profile);
        assert_eq!(again.id(), frame.id());
        assert!(FromBoard::decode(&again, &profile).is_ok());
    }
}
