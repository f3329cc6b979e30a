//! Checks the worked bytes of docs/protocol-jtc.md: header, length and CRC of every line in a `hex` block.
use anyhow::{Context, Result, ensure};

use crate::shell::root;

/// Returns the bytes at the start of a line, up to the first word that is not a byte value.
fn bytes(line: &str) -> Vec<u8> {
    line.split_whitespace()
        .take_while(|word| word.len() == 2)
        .map_while(|word| u8::from_str_radix(word, 16).ok())
        .collect()
}

/// Returns the CRC-16/XMODEM of the bytes. This function calculates the CRC itself, so that the test does not check the
/// page with the code that the page describes.
fn crc(bytes: &[u8]) -> u16 {
    let mut crc = 0u16;
    for byte in bytes {
        crc ^= u16::from(*byte) << 8;
        for _ in 0..8 {
            crc = if crc & 0x8000 != 0 { crc << 1 ^ 0x1021 } else { crc << 1 };
        }
    }
    crc
}

/// Returns an error that contains the first wrong line of the page.
pub(crate) fn check() -> Result<()> {
    let page =
        std::fs::read_to_string(root().join("docs/protocol-jtc.md")).context("docs/protocol-jtc.md")?;
    let mut inside = false;
    let mut lines = 0;
    for line in page.lines() {
        if line.starts_with("```") {
            inside = line == "```hex";
            continue;
        }
        if !inside {
            continue;
        }
        let frame = bytes(line);
        ensure!(frame.len() >= 6, "no frame: {line}");
        let length = usize::from(u16::from_be_bytes([frame[2], frame[3]]));
        ensure!(frame[0] == 0x9B && length == frame.len(), "header or length is wrong: {line}");
        ensure!(crc(&frame) == 0, "the CRC should be {:04X}: {line}", crc(&frame[..frame.len() - 2]));
        lines += 1;
    }
    ensure!(lines > 0, "the page has no worked bytes");
    println!("{lines} worked frames, each with the right length and CRC");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_with_its_crc_leaves_no_remainder() {
        assert_eq!(crc(b"123456789"), 0x31C3);
        assert_eq!(crc(&bytes("9B 0C 00 06 CD 27   TeachingModeEnable")), 0);
    }
}
