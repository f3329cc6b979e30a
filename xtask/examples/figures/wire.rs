//! CRC and stream parser of the host link.
use std::hint::black_box;

use jtc_wire::{FRAME_MAX, Receiver, crc16};

use crate::{median_ns, path, print};

/// A result that the compiler must not leave out.
fn keep(crc: u16) {
    black_box(crc);
}

pub fn figures() {
    let bytes: Vec<u8> = (0..FRAME_MAX).map(|i| (i * 31 + i / 251) as u8).collect();
    let per_s = |ns: f64, len: usize| len as f64 / ns;
    print("crc_gb_s", per_s(median_ns(301, || keep(crc16(black_box(&bytes)))), bytes.len()));

    let one = crc::Crc::<u16, crc::Table<1>>::new(&crc::CRC_16_XMODEM);
    let sixteen = crc::Crc::<u16, crc::Table<16>>::new(&crc::CRC_16_XMODEM);
    assert_eq!((one.checksum(&bytes), sixteen.checksum(&bytes)), (crc16(&bytes), crc16(&bytes)));
    print("crc_table_1_gb_s", per_s(median_ns(51, || keep(one.checksum(black_box(&bytes)))), bytes.len()));
    print(
        "crc_table_16_gb_s",
        per_s(median_ns(301, || keep(sixteen.checksum(black_box(&bytes)))), bytes.len()),
    );

    // A whole upload: 12 000 points in segments of 120, handed over in pieces as a serial port would.
    let points = path::raw(&path::smooth(12_000)).expect("within the scales");
    let frames: Vec<u8> = points
        .chunks(120)
        .enumerate()
        .flat_map(|(i, part)| jtc_host::frame::segment(1, i as u16, 100, path::STEP_MS, part))
        .collect();
    let mut buffer = vec![0; FRAME_MAX];
    let mut found = 0;
    let mut parse = |piece: usize| {
        let mut receiver = Receiver::new(&mut buffer[..], 5000);
        found = 0;
        for (now, bytes) in (0u64..).zip(frames.chunks(piece)) {
            let mut rest = bytes;
            loop {
                let taken = receiver.push(now, rest);
                rest = &rest[taken..];
                while receiver.poll(now) {
                    black_box(receiver.event());
                    receiver.release();
                    found += 1;
                }
                if rest.is_empty() && !receiver.busy() {
                    break;
                }
            }
        }
        assert_eq!(found, 100, "every frame is found");
    };
    print("parser_gb_s", per_s(median_ns(51, || parse(4096)), frames.len()));
    print("parser_small_pieces_gb_s", per_s(median_ns(51, || parse(64)), frames.len()));
}

/// Sine and cosine of six angles by the system's mathematics library, an anchor of the dynamics.
pub fn libm() {
    let angles: Vec<f64> = (0..6144).map(|i| f64::from(i) * 0.001 - 3.0).collect();
    let ns = median_ns(101, || {
        for angle in &angles {
            black_box(black_box(angle).sin_cos());
        }
    });
    print("libm_sin_cos_6", ns / (angles.len() / 6) as f64);
}
