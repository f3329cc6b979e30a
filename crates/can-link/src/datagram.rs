//! A frame as one datagram in the format of python-can's `udp_multicast`: a MessagePack map.

use std::time::{SystemTime, UNIX_EPOCH};

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use crate::{CanFrame, Id};

/// Longest datagram that python-can accepts, bytes.
pub(crate) const MAX_DATAGRAM: usize = 4096;

/// MessagePack map that is sent in a datagram. python-can refuses maps with other keys.
#[derive(Serialize)]
struct Sent<'a> {
    timestamp: f64,
    arbitration_id: u32,
    is_extended_id: bool,
    is_remote_frame: bool,
    is_error_frame: bool,
    channel: Option<&'a str>,
    dlc: usize,
    data: &'a serde_bytes::Bytes,
    is_fd: bool,
    bitrate_switch: bool,
    error_state_indicator: bool,
}

/// Keys that the decoder reads from a received map. The decoder ignores other keys.
#[derive(Deserialize)]
struct Received {
    arbitration_id: u32,
    #[serde(default)]
    is_extended_id: bool,
    #[serde(default)]
    is_remote_frame: bool,
    #[serde(default)]
    is_error_frame: bool,
    dlc: usize,
    #[serde(default)]
    data: Option<serde_bytes::ByteBuf>,
    #[serde(default)]
    is_fd: bool,
    #[serde(default)]
    bitrate_switch: bool,
    #[serde(default, rename = "timestamp")]
    _timestamp: Option<IgnoredAny>,
}

/// Returns the datagram of a frame, with the current time as its timestamp.
pub(crate) fn encode(frame: &CanFrame) -> Vec<u8> {
    #[expect(clippy::disallowed_methods, reason = "the form has the time of day")]
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let sent = Sent {
        timestamp: now.as_secs_f64(),
        arbitration_id: frame.id().value(),
        is_extended_id: frame.is_extended(),
        is_remote_frame: frame.is_remote(),
        is_error_frame: false,
        channel: None,
        dlc: frame.len(),
        data: serde_bytes::Bytes::new(frame.data()),
        is_fd: frame.is_fd(),
        bitrate_switch: frame.is_brs(),
        error_state_indicator: false,
    };
    rmp_serde::to_vec_named(&sent).expect("numbers, flags and bytes can always be written")
}

/// Returns the frame in a datagram; `None` for error frames and invalid frames.
pub(crate) fn decode(datagram: &[u8]) -> Option<CanFrame> {
    let mut rest = datagram;
    let map: Received = rmp_serde::from_read(&mut rest).ok()?;
    if map.is_error_frame || !rest.is_empty() {
        return None;
    }
    let make_id = if map.is_extended_id { Id::extended } else { Id::standard };
    let id = make_id(map.arbitration_id).ok()?;
    let data = map.data.as_deref().map_or(&[][..], |data| &data[..]);
    if map.is_remote_frame {
        let valid = !map.is_fd && data.is_empty();
        return CanFrame::remote(id, map.dlc).ok().filter(|_| valid);
    }
    if map.dlc != data.len() {
        return None;
    }
    if map.is_fd {
        // python-can sends payloads of any length up to 64 bytes. A real bus supports only the lengths of CAN FD,
        // so the length is rounded up.
        return Some(CanFrame::fd_padded(id, data).ok()?.with_brs(map.bitrate_switch));
    }
    CanFrame::classic(id, data).ok().filter(|_| !map.bitrate_switch)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    use crate::frame::any_frame;

    /// Datagram that python-can 4.6.1 writes for `Message(arbitration_id=0x205, is_extended_id=False, is_fd=True,
    /// bitrate_switch=True, data=range(12), timestamp=1.5)`.
    const BY_PYTHON_CAN: &[u8] = b"\x8b\xa9timestamp\xcb?\xf8\0\0\0\0\0\0\xaearbitration_id\xcd\x02\x05\
        \xaeis_extended_id\xc2\xafis_remote_frame\xc2\xaeis_error_frame\xc2\xa7channel\xc0\xa3dlc\x0c\
        \xa4data\xc4\x0c\0\x01\x02\x03\x04\x05\x06\x07\x08\x09\x0a\x0b\xa5is_fd\xc3\
        \xaebitrate_switch\xc3\xb5error_state_indicator\xc2";

    #[test]
    fn a_datagram_of_python_can_is_understood_and_written_alike() {
        let frame = decode(BY_PYTHON_CAN).unwrap();
        let bytes: Vec<u8> = (0..12).collect();
        assert_eq!(frame, CanFrame::fd(Id::standard(0x205).unwrap(), &bytes).unwrap());
        // openjtc and python-can must write the same bytes. Only the timestamp (8 bytes from byte 12) differs.
        let again = encode(&frame);
        assert_eq!(again[..12], BY_PYTHON_CAN[..12]);
        assert_eq!(again[20..], BY_PYTHON_CAN[20..]);
    }

    #[test]
    fn what_is_cut_or_changed_never_panics() {
        for len in 0..BY_PYTHON_CAN.len() {
            assert_eq!(decode(&BY_PYTHON_CAN[..len]), None);
        }
        assert_eq!(decode(&[BY_PYTHON_CAN, b"\xc0"].concat()), None);
        for at in 0..BY_PYTHON_CAN.len() {
            for value in 0..=255 {
                let mut bytes = BY_PYTHON_CAN.to_vec();
                bytes[at] = value;
                let _ = decode(&bytes);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn every_frame_survives(frame in any_frame()) {
            let datagram = encode(&frame);
            prop_assert!(datagram.len() < MAX_DATAGRAM);
            prop_assert_eq!(decode(&datagram), Some(frame));
        }

        #[test]
        fn noise_is_no_frame(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            prop_assert_eq!(decode(&bytes), None);
        }
    }
}
