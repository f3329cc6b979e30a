//! Test doubles: firmware images, a board on a serial line, and the drive of the board's ST-LINK.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use jtc_wire::{Answer, DataStatus, FrameType, Info, Name, Program, Response, Status, StoreState};

use super::image::{BANK1, ERASED};
use super::{Drive, Image};
use crate::port::test::ScriptedPort;
use crate::port::{Port, PortError};

/// Size of the program in an image, bytes.
const PROGRAM: usize = 0x1000;

/// Returns an image for a board. The content of the image depends on `seed`. If the board has a second core, the image contains a program
/// for this core.
pub(super) fn image_bytes(board: &str, seed: u8) -> Vec<u8> {
    let mut bytes = vec![0; PROGRAM];
    bytes[0..4].copy_from_slice(&0x2001_2000u32.to_le_bytes());
    bytes[4..8].copy_from_slice(&0x0800_0601u32.to_le_bytes());
    // The sixth vector is the address of an interrupt handler at the end of the program.
    bytes[20..24].copy_from_slice(&0x0800_0F05u32.to_le_bytes());
    let record = &mut bytes[0x400..0x460];
    record[..8].copy_from_slice(b"OPENJTC\0");
    record[8..12].copy_from_slice(&[1, 0, 96, 0]);
    for (at, text) in [(12, "0.2.0"), (24, board), (48, "0123456789abc")] {
        record[at..at + text.len()].copy_from_slice(text.as_bytes());
    }
    record[88..92].copy_from_slice(&115_200u32.to_le_bytes());
    for (n, byte) in bytes[0x500..].iter_mut().enumerate() {
        *byte = (n as u8).wrapping_mul(31).wrapping_add(seed) | 1;
    }
    if super::drive::has_second_core(board) {
        bytes.resize(BANK1, ERASED);
        for word in [0x3004_8000u32].into_iter().chain([0x0810_0041; 15]).chain([0xE7FD_BF30]) {
            bytes.extend(word.to_le_bytes());
        }
    }
    bytes
}

/// Returns the report about the flash that a device with this image sends. The function computes the CRC bit by bit from its definition.
pub(super) fn program_of(image: &[u8]) -> Program {
    let bytes = &image[..PROGRAM];
    let mut register = u32::MAX;
    for byte in bytes {
        register ^= u32::from(*byte);
        for _ in 0..8 {
            register = (register >> 1) ^ (0xEDB8_8320 * (register & 1));
        }
    }
    Program { bytes: bytes.len() as u32, crc32: !register }
}

/// Creates a folder with images of these boards and their catalogue.
pub(super) fn catalogue(folder: &Path, boards: &[&str]) {
    use sha2::{Digest, Sha256};
    let images: Vec<_> = boards
        .iter()
        .map(|board| {
            let (bytes, file) = (image_bytes(board, 7), format!("{board}.bin"));
            fs::write(folder.join(&file), &bytes).unwrap();
            let sha256: String = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02X}")).collect();
            serde_json::json!({
                "board": board, "file": file, "sha256": sha256, "address": 0x0800_0000, "bytes": bytes.len(),
            })
        })
        .collect();
    let text = serde_json::json!({ "version": "0.2.0", "images": images }).to_string();
    fs::write(folder.join("firmware.json"), text).unwrap();
}

/// Simulated processor of a board, with the content of its flash.
#[derive(Clone)]
pub(super) struct Board(Arc<Mutex<Flashed>>);

struct Flashed {
    /// `true` while the ST-LINK keeps the processor stopped.
    held: bool,
    program: Option<Program>,
    board: String,
    started: Instant,
    /// Uptime of the board when the test begins, ms.
    before_ms: u64,
    status: Status,
}

impl Board {
    /// Creates a board that has run the program for an hour. The arm is configured and its torque is off.
    pub(super) fn running(board: &str, program: Option<Program>) -> Self {
        let mut status = Status { state: jtc_wire::ControllerState::Init.into(), ..Status::default() };
        status.joints.iter_mut().for_each(|joint| joint.state = jtc_wire::NodeState::READY);
        Self(Arc::new(Mutex::new(Flashed {
            held: false,
            program,
            board: board.to_owned(),
            started: Instant::now(),
            before_ms: 3_600_000,
            status,
        })))
    }

    /// Changes the status that the board sends after this call.
    pub(super) fn set_status(&self, change: impl FnOnce(&mut Status)) {
        change(&mut self.0.lock().unwrap().status);
    }

    /// Stops the processor, or lets it run again. A stopped processor does not send data.
    pub(super) fn hold(&self, held: bool) {
        self.0.lock().unwrap().held = held;
    }

    /// Like [`Board::hold`]. Returns the program that was running, and the name of its board.
    fn hold_with(&self, held: bool) -> (Option<Program>, String) {
        self.hold(held);
        let flashed = self.0.lock().unwrap();
        (flashed.program, flashed.board.clone())
    }

    fn start_with(&self, board: &str, program: Option<Program>) {
        let mut flashed = self.0.lock().unwrap();
        (flashed.held, flashed.program, flashed.board) = (false, program, board.to_owned());
        (flashed.started, flashed.before_ms) = (Instant::now(), 0);
    }

    fn info(&self) -> Option<Info> {
        let flashed = self.0.lock().unwrap();
        let info = Info {
            uptime_ms: flashed.before_ms + flashed.started.elapsed().as_millis() as u64,
            board: Name::cut(&flashed.board),
            program: flashed.program,
            store: StoreState::Stored,
            ..Info::default()
        };
        (!flashed.held).then(|| info.with_firmware("0.2.0", "0123456789abc"))
    }

    fn status(&self) -> Option<Status> {
        let flashed = self.0.lock().unwrap();
        (!flashed.held).then_some(flashed.status)
    }

    /// Returns a serial line to the board.
    pub(super) fn port(&self) -> Box<dyn Port> {
        let board = self.clone();
        let mut next = Duration::ZERO;
        Box::new(ScriptedPort::new(None, move |now, bytes| {
            let mut out = Vec::new();
            let Some(status) = board.status() else { return out };
            if !bytes.is_empty() {
                let response = Response::good(FrameType::GetInfo, DataStatus::NoError, 6);
                out.extend(Status { response, ..status }.emit());
                let mut frame = [0; jtc_wire::ANSWER_MAX];
                let n = board.info().map_or(0, |info| Answer::Info(info).emit(&mut frame).unwrap());
                out.extend(&frame[..n]);
            } else if now >= next {
                next = now + Duration::from_millis(40);
                out.extend(status.emit());
            }
            out
        }))
    }

    /// Returns a function that opens a serial line to the board.
    pub(super) fn opener(&self) -> impl FnMut() -> Result<Box<dyn Port>, PortError> {
        let board = self.clone();
        move || Ok(board.port())
    }
}

/// Reaction of a simulated ST-LINK to a file on its drive.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Behaviour {
    /// The ST-LINK writes the file into the flash. The drive disappears and appears again.
    Takes,
    /// Like `Takes`, but a part of the flash stays empty. A real ST-LINK causes such a gap if the bytes arrive in an
    /// unexpected order.
    LeavesHole,
    /// Like `Takes`, but before the ST-LINK stops the processor, the previous program restarts once.
    StartsBeforeAnew,
    /// The ST-LINK creates `FAIL.TXT` with this text.
    Fails(&'static str),
    /// The ST-LINK ignores the file.
    Ignores,
}

/// Drive of a board, and a thread that acts as its ST-LINK.
pub(super) struct StLink {
    /// Temporary folder that contains the drive. The folder is removed together with the drive.
    _folder: tempfile::TempDir,
    pub path: PathBuf,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl StLink {
    /// Creates a drive with the label `label` for `board`.
    pub(super) fn new(label: &str, board: &Board, behaviour: Behaviour) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(label);
        appear(&path);
        let stop = Arc::new(AtomicBool::new(false));
        let (at, end, board) = (path.clone(), stop.clone(), board.clone());
        let thread = thread::spawn(move || {
            let mut length = 0;
            while !end.load(Ordering::Relaxed) {
                thread::sleep(Duration::from_millis(5));
                // The thread skips a path that is not a regular file. If the path is a link to a device such as
                // `/dev/full`, reading would never end and would need all memory.
                let file = at.join("openjtc.bin");
                if !file.symlink_metadata().is_ok_and(|data| data.is_file()) {
                    continue;
                }
                // While the size of the file increases, the file is incomplete.
                let Ok(bytes) = fs::read(&file) else { continue };
                if Image::parse(&file, bytes.clone()).is_err() || bytes.len() != length {
                    length = bytes.len();
                    continue;
                }
                fs::remove_file(&file).unwrap();
                length = 0;
                work(&at, &board, &behaviour, bytes);
            }
        });
        Self { _folder: folder, path, stop, thread: Some(thread) }
    }

    /// Returns the drive in the form in which a search for drives returns it.
    pub(super) fn drive(&self) -> Drive {
        Drive::at(&self.path).unwrap()
    }
}

impl Drop for StLink {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let ended = self.thread.take().map(JoinHandle::join);
        assert!(matches!(ended, Some(Ok(()))) || thread::panicking());
    }
}

fn appear(path: &Path) {
    fs::create_dir_all(path).unwrap();
    fs::write(path.join("DETAILS.TXT"), "Version: V3J13M4B5S1\nBuild: Jan 1 2024\n").unwrap();
}

fn work(path: &Path, board: &Board, behaviour: &Behaviour, mut bytes: Vec<u8>) {
    match behaviour {
        Behaviour::Ignores => {}
        Behaviour::Fails(text) => fs::write(path.join("FAIL.TXT"), text).unwrap(),
        Behaviour::Takes | Behaviour::LeavesHole | Behaviour::StartsBeforeAnew => {
            let (before, name) = board.hold_with(true);
            fs::remove_dir_all(path).unwrap();
            if *behaviour == Behaviour::LeavesHole {
                bytes[0x800..0xA00].fill(0);
            }
            // The program starts only after this delay. The delay is longer than the tolerance for clock differences,
            // so that the start is recognised as later than the copying.
            thread::sleep(Duration::from_millis(400));
            if *behaviour == Behaviour::StartsBeforeAnew {
                board.start_with(&name, before);
                thread::sleep(Duration::from_millis(600));
                board.hold(true);
            }
            let name = super::Record::parse(&bytes).unwrap().board;
            appear(path);
            board.start_with(&name, Some(program_of(&bytes)));
        }
    }
}
