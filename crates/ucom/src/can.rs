//! Conversion of CAN frames between this crate and the CAN driver of a HAL. The driver's frame type must implement the trait of
//! `embedded-can`.

use embedded_can::{Id, StandardId};

use crate::foreign::Foreign;
use crate::frame::{Format, Frame};

impl Frame {
    /// Creates a frame of this protocol from a driver's frame.
    ///
    /// # Errors
    /// Returns the reason why the frame is not of this protocol (D-02).
    pub fn from_can(frame: &impl embedded_can::Frame) -> Result<Self, Foreign> {
        let (id, extended) = match frame.id() {
            Id::Standard(id) => (u32::from(id.as_raw()), false),
            Id::Extended(id) => (id.as_raw(), true),
        };
        Self::received(id, Format { extended, remote: frame.is_remote_frame(), ..Format::BUS }, frame.data())
    }

    /// Returns the frame for a driver to send; returns `None` if the driver's type refuses the frame.
    pub fn to_can<F: embedded_can::Frame>(&self) -> Option<F> {
        F::new(StandardId::new(self.id())?, self.data())
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use embedded_can::{ExtendedId, Frame as _};
    use socketcan::CanFrame;

    use super::*;

    #[test]
    fn d01_d02_frames_of_a_driver_are_told_apart_like_those_of_a_bus() {
        let id = StandardId::new(0x281).unwrap();
        let data = [0, 1, 2, 3, 4, 5, 6, 7];
        for len in 0..=8 {
            let driver = CanFrame::new(id, &data[..len]).unwrap();
            let frame = Frame::from_can(&driver).unwrap();
            assert_eq!((frame.id(), frame.data()), (0x281, &data[..len]));
            let sent: CanFrame = frame.to_can().unwrap();
            assert!(sent.id() == Id::Standard(id) && sent.data() == &data[..len] && sent.is_data_frame());
        }
        let remote = CanFrame::new_remote(id, 0).unwrap();
        assert_eq!(Frame::from_can(&remote), Err(Foreign::Remote));
        // A frame with a 29-bit identifier does not belong to this protocol, even if the value of the identifier fits
        // into 11 bits.
        let extended = CanFrame::new(ExtendedId::new(0x281).unwrap(), &data).unwrap();
        assert_eq!(Frame::from_can(&extended), Err(Foreign::Extended));
        let bit5 = CanFrame::new(StandardId::new(0x2A1).unwrap(), &data).unwrap();
        assert_eq!(Frame::from_can(&bit5), Err(Foreign::Bit5));
    }
}
