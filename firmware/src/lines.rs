//! Statuses for the two serial lines of one controller. The controller sends a response record on the line on which the
//! answered frame arrived. The status on the other line does not contain the record (J-04).
use jtc_wire::{STATUS_LEN, crc16, field::status as field};

/// Number of serial lines.
pub const LINES: usize = jtc_core::HOST_LINES;
/// Index of the RS422 line.
pub const RS422: usize = 0;
/// Index of the USB line, which is the virtual serial port of the ST-LINK.
pub const USB: usize = 1;

/// Returns a copy of the status without its response record.
pub fn without_record(status: &[u8; STATUS_LEN]) -> [u8; STATUS_LEN] {
    let mut idle = *status;
    idle[field::RESPONSE_TYPE..field::RESPONSE_LENGTH.end].fill(0);
    let crc = crc16(&idle[..field::CRC.start]);
    idle[field::CRC].copy_from_slice(&crc.to_be_bytes());
    idle
}

#[cfg(test)]
mod tests {
    use super::*;
    use jtc_wire::{ControllerState, DataStatus, FrameType, Response, Status};

    #[test]
    fn j04_the_other_line_gets_the_same_status_without_a_record() {
        let response = Response::good(FrameType::PidParam, DataStatus::NotAllowed, 126);
        let mut status = Status {
            response,
            state: ControllerState::Operate.into(),
            point: 77,
            gripper: Some(Default::default()),
            ..Default::default()
        };
        let sent = status.emit();
        status.response = Response::default();
        let idle = without_record(&sent);
        assert_eq!(Status::parse(&idle), Some(status), "with a good CRC");
        assert_eq!(without_record(&idle), idle);
    }
}
