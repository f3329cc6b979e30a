//! Converts CAN frames to and from the structures of the Linux kernel, and error frames of the kernel to a
//! controller state.

use socketcan::errors::ControllerProblems;
use socketcan::id::FdFlags;
use socketcan::{
    CanAnyFrame, CanDataFrame, CanErrorFrame, CanFdFrame, CanRemoteFrame, EmbeddedFrame, ExtendedId,
    StandardId,
};

use crate::{CanFrame, ControllerState, ErrorState, Id};

/// Data received from the kernel.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Received {
    Frame(CanFrame),
    State(ControllerState),
    Nothing,
}

pub(super) fn to_kernel(frame: &CanFrame) -> CanAnyFrame {
    let value = frame.id().value();
    let id = match frame.is_extended() {
        true => ExtendedId::new(value).map(socketcan::Id::Extended),
        false => u16::try_from(value).ok().and_then(StandardId::new).map(socketcan::Id::Standard),
    };
    let id = id.expect("a frame's identifier has 11 or 29 bits");
    let raw: Option<CanAnyFrame> = if frame.is_remote() {
        CanRemoteFrame::new_remote(id, frame.len()).map(Into::into)
    } else if frame.is_fd() {
        let flags = if frame.is_brs() { FdFlags::BRS } else { FdFlags::empty() };
        CanFdFrame::with_flags(id, frame.data(), flags).map(Into::into)
    } else {
        CanDataFrame::new(id, frame.data()).map(Into::into)
    };
    raw.expect("a frame's length is one of its kind")
}

pub(super) fn from_kernel(raw: &CanAnyFrame, before: ControllerState) -> Received {
    let frame = match raw {
        CanAnyFrame::Normal(raw) => id(raw).and_then(|id| CanFrame::classic(id, raw.data()).ok()),
        CanAnyFrame::Remote(raw) => id(raw).and_then(|id| CanFrame::remote(id, raw.dlc()).ok()),
        CanAnyFrame::Fd(raw) => {
            let frame = id(raw).and_then(|id| CanFrame::fd(id, raw.data()).ok());
            frame.map(|frame| frame.with_brs(raw.is_brs()))
        }
        CanAnyFrame::Error(raw) => return Received::State(state(*raw, before)),
    };
    frame.map_or(Received::Nothing, Received::Frame)
}

fn id(raw: &impl EmbeddedFrame) -> Option<Id> {
    match raw.id() {
        socketcan::Id::Standard(id) => Id::standard(u32::from(id.as_raw())).ok(),
        socketcan::Id::Extended(id) => Id::extended(id.as_raw()).ok(),
    }
}

/// Returns the controller state after an error frame. Some error frames lack the new state, the new counters, or
/// both.
fn state(raw: CanErrorFrame, before: ControllerState) -> ControllerState {
    const PASSIVE: ControllerProblems = ControllerProblems::RX_PASSIVE.union(ControllerProblems::TX_PASSIVE);
    const WARNING: ControllerProblems = ControllerProblems::RX_WARNING.union(ControllerProblems::TX_WARNING);
    let error = raw.into_error();
    let reported = error.controller().and_then(|problems| {
        if problems.intersects(PASSIVE) {
            Some(ErrorState::Passive)
        } else if problems.intersects(WARNING) {
            Some(ErrorState::Warning)
        } else {
            problems.contains(ControllerProblems::ACTIVE).then_some(ErrorState::Active)
        }
    });
    let errors = if error.is_bus_off() {
        Some(ErrorState::BusOff)
    } else if error.is_restarted() {
        Some(ErrorState::Active)
    } else {
        reported
    };
    let counters = error.counters();
    match (errors, counters) {
        (None, None) => before,
        // The counters of the previous state are not valid for the new state, so the new state has no counters.
        (Some(errors), None) => ControllerState::without_counters(errors),
        (errors, Some((tec, rec))) => {
            let (tec, rec) = (u16::from(tec), u16::from(rec));
            let of_counters = ErrorState::of_counters(tec, rec);
            // Eight-bit counters cannot show bus-off, which requires a count above 255. Without a reported state, a
            // controller that was bus-off is therefore still considered bus-off.
            let kept = if before.errors == ErrorState::BusOff { before.errors } else { of_counters };
            ControllerState { errors: errors.unwrap_or(kept), tec: Some(tec), rec: Some(rec) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Class bits defined in the kernel's `can/error.h`.
    const CONTROLLER: u32 = 0x4;
    const BUS_OFF: u32 = 0x40;
    const BUS_ERROR: u32 = 0x80;
    const RESTARTED: u32 = 0x100;
    const COUNTERS: u32 = 0x200;

    fn after(before: ControllerState, class: u32, problems: u8, tec: u8, rec: u8) -> ControllerState {
        let data = [0, problems, 0, 0, 0, 0, tec, rec];
        let raw = CanErrorFrame::new_error(class, &data).unwrap();
        match from_kernel(&raw.into(), before) {
            Received::State(state) => state,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn error_frames_move_the_state() {
        let unknown = ControllerState::default();
        let without = ControllerState::without_counters;
        for (class, problems, expected) in [
            (CONTROLLER, 0x04, without(ErrorState::Warning)),
            (CONTROLLER, 0x08, without(ErrorState::Warning)),
            (CONTROLLER, 0x10, without(ErrorState::Passive)),
            (CONTROLLER, 0x24, without(ErrorState::Passive)),
            (CONTROLLER, 0x40, without(ErrorState::Active)),
            (CONTROLLER, 0x01, unknown),
            (BUS_ERROR, 0, unknown),
            (BUS_OFF, 0, without(ErrorState::BusOff)),
            (RESTARTED, 0, without(ErrorState::Active)),
        ] {
            assert_eq!(after(unknown, class, problems, 0, 0), expected, "{class:X} {problems:X}");
        }
        let passive = after(unknown, CONTROLLER | COUNTERS, 0x20, 136, 7);
        assert_eq!(passive, ControllerState::of_counters(136, 7));
        // Counters without a state also determine the state. An error frame without state and counters changes
        // nothing.
        assert_eq!(after(passive, COUNTERS, 0, 100, 0), ControllerState::of_counters(100, 0));
        assert_eq!(after(passive, BUS_ERROR, 0, 0, 0), passive);
        let off = after(passive, BUS_OFF | COUNTERS, 0, 248, 0);
        assert_eq!(off.errors, ErrorState::BusOff);
        assert_eq!(after(off, COUNTERS, 0, 248, 0).errors, ErrorState::BusOff);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        /// Frames that are converted to the kernel's structures and back must be unchanged.
        #[test]
        fn every_frame_survives_the_kernels_form(
            value in any::<u32>(), extended in any::<bool>(), kind in 0..4, data in prop::collection::vec(any::<u8>(), 0..=64)
        ) {
            let id = if extended { Id::extended(value >> 3) } else { Id::standard(value >> 21) }.unwrap();
            let short = &data[..data.len().min(8)];
            let frame = match kind {
                0 => CanFrame::classic(id, short),
                1 => CanFrame::remote(id, short.len()),
                2 => CanFrame::fd_padded(id, &data),
                _ => CanFrame::fd_padded(id, &data).map(|frame| frame.with_brs(false)),
            }
            .unwrap();
            let raw = to_kernel(&frame);
            prop_assert_eq!(from_kernel(&raw, ControllerState::default()), Received::Frame(frame));
            // Bytes of `struct can_frame`: identifier with its flags, length, and data from byte 8 on.
            let word = frame.id().value() | u32::from(extended) << 31 | u32::from(frame.is_remote()) << 30;
            let (written, len, bytes) = match &raw {
                CanAnyFrame::Normal(raw) => { let raw = raw.as_ref(); (raw.can_id, raw.can_dlc, raw.data.to_vec()) }
                CanAnyFrame::Remote(raw) => { let raw = raw.as_ref(); (raw.can_id, raw.can_dlc, raw.data.to_vec()) }
                CanAnyFrame::Fd(raw) => { let raw = raw.as_ref(); (raw.can_id, raw.len, raw.data.to_vec()) }
                CanAnyFrame::Error(_) => unreachable!("none was made"),
            };
            prop_assert_eq!((written, usize::from(len)), (word, frame.len()));
            prop_assert_eq!(&bytes[..frame.data().len()], frame.data());
        }
    }
}
