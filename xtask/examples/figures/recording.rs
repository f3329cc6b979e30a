//! Time and memory for the report of a long recording. The program measures a recording of five minutes at 1 kHz, and
//! extrapolates the times to one hour.
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use jtc_host::Arm;
use jtc_host::recording::{Recorder, RecordingInfo, scan};
use jtc_host::report::{Digest, ReportInput, html, picture_svg};
use jtc_host::sample::{JointSample, Sample};
use jtc_wire::{ControllerState, NodeState, TrajectoryState};

use crate::print;
use crate::world::Result;

/// Duration of the measured recording, s. The next constant is the ratio of an hour to this duration.
const SECONDS: u32 = 300;
const IN_AN_HOUR: f64 = 3600.0 / SECONDS as f64;

/// Prints three figures for each file format: the time to make a report, the time to read the file, and the memory
/// that a report needs.
pub(crate) fn figures() -> Result<()> {
    let dir = tempfile::tempdir()?;
    for format in ["mcap", "csv"] {
        let path = dir.path().join(format!("recording.{format}"));
        write(&path, SECONDS)?;
        let began = Instant::now();
        if format == "mcap" {
            decompress(&path)?;
        } else {
            lines(&path)?;
        }
        print(&format!("recording.read_{format}_hour_s"), IN_AN_HOUR * began.elapsed().as_secs_f64());
        let began = Instant::now();
        report(&path)?;
        print(&format!("recording.report_{format}_hour_s"), IN_AN_HOUR * began.elapsed().as_secs_f64());
        let alone = Command::new(std::env::current_exe()?).arg("recording-memory").arg(&path).output()?;
        if let Ok(mb) = String::from_utf8_lossy(&alone.stdout).trim().parse() {
            print(&format!("recording.report_{format}_mb"), mb);
        }
    }
    Ok(())
}

/// Prints the largest memory use of a report, MB, if the operating system reports this value.
pub(crate) fn memory(path: &Path) -> Result<()> {
    report(path)?;
    let status = std::fs::read_to_string("/proc/self/status")?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let peak =
        peak.and_then(|line| line.trim().strip_suffix("kB")).and_then(|kb| kb.trim().parse::<f64>().ok());
    println!("{}", peak.ok_or("no VmHWM in /proc/self/status")? / 1000.0);
    Ok(())
}

/// Makes a report in the same way as `jtc report`.
fn report(path: &Path) -> Result<()> {
    let mut digest = Digest::new();
    let found = scan(path, |sample| digest.push(sample))?;
    let info = found.info.unwrap_or_default();
    let failure = digest.failure(&info, &found.ending);
    let input =
        ReportInput { info: &info, digest: &digest, facts: &[], failure: failure.as_ref(), plan: None };
    std::fs::write(path.with_extension("html"), html(&input))?;
    std::fs::write(path.with_extension("svg"), picture_svg(&input))?;
    Ok(())
}

/// Reads and decompresses each record of the recording.
fn decompress(path: &Path) -> Result<()> {
    let file = BufReader::with_capacity(1 << 18, File::open(path)?);
    let mut records = 0_u64;
    host_kit::mcap::each_record(file, |_| {
        records += 1;
        Ok::<(), mcap::McapError>(())
    })?;
    if records == 0 { Err("no record".into()) } else { Ok(()) }
}

/// Reads each byte of the recording and counts its lines.
fn lines(path: &Path) -> Result<()> {
    let (mut file, mut piece, mut lines) = (File::open(path)?, vec![0; 1 << 18], 0);
    loop {
        let read = file.read(&mut piece)?;
        if read == 0 {
            return if lines == 0 { Err("no line".into()) } else { Ok(()) };
        }
        lines += piece[..read].iter().filter(|byte| **byte == b'\n').count();
    }
}

/// Writes a recording of `seconds` seconds at 1 kHz with a value in every field.
pub(crate) fn write(path: &Path, seconds: u32) -> Result<()> {
    let arm = Arm::avena();
    let info = RecordingInfo { trajectory: "long".into(), ..RecordingInfo::of(&arm) };
    let mut recorder = Recorder::create(path, &info)?;
    for i in 0..seconds * 1000 {
        recorder.write(&sample(i))?;
        // Writes the buffered samples to the file every 200 ms, like the recorder of a running motion.
        if i % 200 == 199 {
            recorder.flush()?;
        }
    }
    recorder.finish()?;
    Ok(())
}

/// Returns the sample of one millisecond, with noise in the measured values.
fn sample(i: u32) -> Sample {
    let time_s = f64::from(i) * 1e-3;
    let noise = |n: u32| {
        f64::from((i ^ n.wrapping_mul(0x9E37_79B9)).wrapping_mul(0x85EB_CA6B) >> 8) / 16_777_216.0 - 0.5
    };
    let joint = |j: usize| {
        let (n, phase) = (j as u32, time_s * (0.5 + 0.1 * j as f64));
        let (sin, cos) = phase.sin_cos();
        let error = 1e-3 * noise(8 * n);
        JointSample {
            set_position: sin,
            set_velocity: 0.5 * cos,
            set_acceleration: -0.25 * sin,
            position: sin - error,
            error,
            velocity: 0.5 * cos + 1e-3 * noise(8 * n + 1),
            torque_model: 20.0 * cos,
            torque_p: 300.0 * error,
            torque_i: 0.5 * sin,
            torque_d: noise(8 * n + 2),
            torque_friction: 4.0 * cos,
            torque: 24.5 * cos + noise(8 * n + 3),
            temperature: 31.0,
            state: NodeState::ENABLED,
            internal: 0,
        }
    };
    Sample {
        time_s,
        state: ControllerState::Operate.into(),
        trajectory: TrajectoryState::Execute.into(),
        point: i,
        errors: 0,
        can_current: 0,
        joints: std::array::from_fn(joint),
    }
}
