//! Prints the throughput of the CRC function and of the stream parser as one JSON object. The command is
//! `cargo run --profile dist -p jtc-wire --example throughput`.
use std::hint::black_box;

use crc::{CRC_16_XMODEM, Crc, Table};
use jtc_wire::{FRAME_MAX, RawPoint, Receiver, crc16, trajectory};
use test_kit::clock::CpuTime;

static ONE: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_XMODEM);
static SIXTEEN: Crc<u16, Table<16>> = Crc::<u16, Table<16>>::new(&CRC_16_XMODEM);

/// Returns the throughput in GB/s of the fastest of many short rounds of `bytes` bytes each. The fastest round counts, because
/// other programs can only make a round slower. The rounds of the measured functions alternate, so that a slow period of the
/// computer affects all functions.
fn measure(bytes: usize, contenders: &mut [&mut dyn FnMut()]) -> Vec<f64> {
    const ROUNDS: usize = 301;
    let mut best = vec![f64::INFINITY; contenders.len()];
    for _ in 0..ROUNDS {
        for (contender, best) in contenders.iter_mut().zip(&mut best) {
            let start = CpuTime::now();
            contender();
            *best = best.min(start.elapsed_ns());
        }
    }
    best.iter().map(|ns| bytes as f64 / ns).collect()
}

fn main() {
    // A round is so short that it can end before the scheduler of the computer switches to another program.
    const REPEATS: usize = 10;
    let mut frame = vec![0; FRAME_MAX];
    let point = |i: usize| RawPoint { position: [i as i16; 6], velocity: [-1; 6], acceleration: [77; 6] };
    let n = trajectory(&mut frame, (0, 0, 1), 10, (0..113).map(point)).expect("it fits");
    frame.truncate(n);
    let stream = frame.repeat(FRAME_MAX / n);

    let mut receiver = Receiver::new(vec![0; FRAME_MAX], 5000);
    let mut parse = || {
        let mut frames = 0;
        for _ in 0..REPEATS {
            for mut piece in stream.chunks(4096) {
                while !piece.is_empty() {
                    piece = &piece[receiver.push(0, piece)..];
                    while receiver.poll(0) {
                        frames += 1;
                        receiver.release();
                    }
                }
            }
        }
        assert_eq!(frames, REPEATS * (stream.len() / n), "every frame is found");
    };
    let over = |crc: fn(&[u8]) -> u16| {
        for _ in 0..REPEATS {
            black_box(crc(black_box(&stream)));
        }
    };
    let figures = measure(
        REPEATS * stream.len(),
        &mut [
            &mut || over(crc16),
            &mut || over(|bytes| ONE.checksum(bytes)),
            &mut || over(|bytes| SIXTEEN.checksum(bytes)),
            &mut parse,
        ],
    );
    println!(
        "{{\"frame_bytes\":{n},\"crc16_gb_s\":{:.3},\"crate_one_table_gb_s\":{:.3},\"crate_slice16_gb_s\":{:.3},\
         \"stream_parser_gb_s\":{:.3}}}",
        figures[0], figures[1], figures[2], figures[3]
    );
}
