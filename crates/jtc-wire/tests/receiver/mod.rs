//! Tests of the stream parser of the device.

mod bounds;
mod held;
mod stream;

use jtc_wire::{FRAME_MAX, RawPoint, Receiver, fixed, trajectory};

const INTER_BYTE_TIMEOUT_US: u32 = 5000;

const ON: [u8; 6] = fixed::TEACHING_MODE_ENABLE;

fn receiver() -> Receiver<Vec<u8>> {
    Receiver::new(vec![0; FRAME_MAX], INTER_BYTE_TIMEOUT_US)
}

fn segment(points: usize) -> Vec<u8> {
    let mut bytes = vec![0; FRAME_MAX];
    let point = |i| RawPoint { position: [i as i16; 6], ..RawPoint::default() };
    let n = trajectory(&mut bytes, (0, 0, 1), 10, (0..points).map(point)).expect("it fits");
    bytes.truncate(n);
    bytes
}
