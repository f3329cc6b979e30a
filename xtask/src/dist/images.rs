//! Flash images of the firmware for the boards, and the list of images that `jtc firmware flash` reads.
use anyhow::{Context, Result, ensure};
use object::{Object as _, ObjectSegment as _};
use serde_json::json;

use super::tree::{Tree, sha256};
use crate::firmware;

/// First address of the flash of a board.
const FLASH: u64 = 0x0800_0000;
/// Number of bytes from the start of flash to the stored arm, which an image must not overwrite. The stored arm is in the last two
/// sectors of bank 2. The program of the second core of an H745 is at the start of bank 2. Therefore, the images for H745 boards
/// contain a gap of erased flash.
const ROOM: u64 = (2048 - 2 * 128) * 1024;
/// Value of erased flash bytes.
const ERASED: u8 = 0xff;

/// Flash image of the firmware of a board.
pub(super) struct Image {
    /// Name of the board for which the image is built.
    pub board: &'static str,
    /// Contents of flash from address 0x0800_0000 on.
    pub bin: Vec<u8>,
}

/// Builds the firmware of all boards. The contents of flash do not depend on the build folder. The file names in the ELF files
/// depend on the build folder, so a release does not contain the ELF files.
pub(super) fn build() -> Result<Vec<Image>> {
    let image = |board| {
        let path = firmware::build(board)?;
        let elf = std::fs::read(&path).with_context(|| path.display().to_string())?;
        let bin = flash(&elf).with_context(|| path.display().to_string())?;
        Ok(Image { board, bin })
    };
    firmware::BOARDS.into_iter().map(image).collect()
}

/// Returns the contents of flash according to an ELF file.
fn flash(elf: &[u8]) -> Result<Vec<u8>> {
    let file = object::read::elf::ElfFile32::<object::Endianness>::parse(elf)?;
    let mut bin = Vec::new();
    for segment in file.segments() {
        let bytes = segment.data()?;
        if bytes.is_empty() {
            continue;
        }
        // The code uses the load address of the segment, which differs from its run address.
        let address = u64::from(segment.elf_program_header().p_paddr.get(file.endian()));
        let end = address + bytes.len() as u64;
        ensure!(
            (FLASH..=FLASH + ROOM).contains(&address) && end <= FLASH + ROOM,
            "a part of {} B for {address:#x} is outside of what an image may fill",
            bytes.len()
        );
        let (from, to) = ((address - FLASH) as usize, (end - FLASH) as usize);
        bin.resize(bin.len().max(to), ERASED);
        bin[from..to].copy_from_slice(bytes);
    }
    // The vector table begins with two addresses: the initial stack pointer in RAM and the first instruction. The address
    // of the first instruction is odd for Thumb code.
    let word = |at: usize| bin.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes);
    let (stack, start) = (word(0).context("the image is empty")?, word(4).context("the image is empty")?);
    ensure!(
        (0x2000_0000..0x4000_0000).contains(&stack),
        "the image begins its stack at {stack:#x}, not in RAM"
    );
    ensure!(
        start & 1 == 1 && (FLASH..FLASH + bin.len() as u64).contains(&u64::from(start)),
        "the image begins at {start:#x}, not in itself"
    );
    Ok(bin)
}

/// Adds the images and their list, `firmware.json`, to a folder.
pub(super) fn install(images: &[Image], version: &str, folder: &str, tree: &mut Tree) -> Result<()> {
    for image in images {
        tree.put(format!("{folder}/{}", name(image)), &*image.bin);
    }
    tree.put(format!("{folder}/firmware.json"), list(images, version)?);
    Ok(())
}

/// Returns the file name of the image, such as `nucleo-h745zi-q.bin`.
pub(super) fn name(image: &Image) -> String {
    format!("{}.bin", image.board)
}

/// Returns the list of images in JSON, with file, board, SHA-256, address and size of each image.
pub(super) fn list(images: &[Image], version: &str) -> Result<String> {
    let images: Vec<_> = images
        .iter()
        .map(|image| {
            json!({
                "board": image.board,
                "file": name(image),
                "sha256": sha256(&image.bin),
                "address": FLASH,
                "bytes": image.bin.len(),
            })
        })
        .collect();
    Ok(serde_json::to_string_pretty(&json!({ "version": version, "images": images }))? + "\n")
}
