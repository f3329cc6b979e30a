//! What the fuzz targets run: every file reader on any bytes. A panic, or a promise broken, is a finding.

use std::prelude::v1::*;

use super::image::{Format, Gaps, Image, ImageOptions};
use super::inventory::Inventory;
use super::recording::{CandumpWriter, FZI_HEADER, Recording, read_mcap};

/// Images in every form; the first byte chooses.
pub fn image(data: &[u8]) {
    let Some((&choice, data)) = data.split_first() else { return };
    let format = [None, Some(Format::Bin), Some(Format::IntelHex), Some(Format::SRecord)];
    let gaps = if choice & 4 == 0 { Gaps::Refuse } else { Gaps::Fill };
    let options = ImageOptions {
        format: format[usize::from(choice & 3)],
        gaps,
        swap_bytes: choice & 8 != 0,
        max_bytes: 1 << 16,
        ..Default::default()
    };
    if let Ok(image) = Image::parse(data, &options) {
        assert!(!image.bytes().is_empty() && image.bytes().len().is_multiple_of(2));
        assert!(image.bytes().len() <= (1 << 16) + 1);
    }
}

/// Recordings in every form; what candump lines give is written as lines that give the same.
pub fn recording(data: &[u8]) {
    if let Ok(recording) = Recording::read_candump(data) {
        let mut out = CandumpWriter::new(Vec::new());
        recording.records.iter().for_each(|r| out.write(r).expect("a vector takes all"));
        let again = Recording::read_candump(&out.into_inner()[..]).expect("our own form");
        assert_eq!(again.records, recording.records);
    }
    let mut stream = FZI_HEADER.as_bytes().to_vec();
    stream.push(b'\n');
    stream.extend_from_slice(data);
    let _ = Recording::read_fzi(&stream[..]);
    let _ = read_mcap(data);
}

/// Inventories; what is read is written as a text that gives the same.
pub fn inventory(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Ok(inventory) = Inventory::parse(text) {
        assert_eq!(Inventory::parse(&inventory.to_toml()).expect("our own form"), inventory);
    }
}
