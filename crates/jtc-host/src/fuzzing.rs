//! Functions that the fuzz targets call. Each function passes arbitrary bytes to the readers of one file type. The fuzz test fails if a
//! reader panics or a check of its result fails.

use jtc_core::recorder::{Log, sealed_block};

use crate::arm::{Arm, ParameterFile};
use crate::file::FileError;
use crate::log::FlightLog;
use crate::port::read_capture;
use crate::trajectory::{Loaded, Trajectory};
use crate::waypoints::WaypointFile;

fn text(data: &[u8]) -> Option<&str> {
    std::str::from_utf8(data).ok()
}

/// Checks a trajectory that was read from a file. All values must be finite, and the step time must not be 0. A trajectory that is written
/// as CSV or JSON and read again must be the same.
fn sound(read: Result<Loaded, FileError>) {
    let Ok(loaded) = read else { return };
    let t = &loaded.trajectory;
    assert!(t.step_ms > 0 && !t.points.is_empty());
    let finite = |v: &[f64; 6]| v.iter().all(|v| v.is_finite());
    // A spline through very large numbers may overflow. The conversion to frames must then reject the trajectory,
    // because its numbers are out of range.
    if !t.points.iter().all(|p| finite(&p.position) && finite(&p.velocity) && finite(&p.acceleration)) {
        assert!(t.raw().is_err());
        return;
    }
    if t.points.len() < 200 && t.step_ms <= 1000 && t.points.len() > 1 {
        let again = |text: &str| Loaded::parse(text, None).expect("our own form").trajectory;
        assert_eq!(&again(&t.to_csv()), t);
        assert_eq!(&again(&t.to_json()), t);
    }
    let _: Result<_, _> = Trajectory::raw(t);
}

/// Checks that waypoints are read and converted to positions, or rejected with an error.
fn waypoints(text: &str) {
    let Ok(file) = WaypointFile::parse(text) else { return };
    // Inverse kinematics of thousands of waypoints would take too long and would not find further errors.
    if file.waypoints.len() < 50 {
        let _ = file.positions(&Arm::avena());
    }
}

/// Reads the data as a trajectory file in CSV format with a header.
pub fn trajectory_csv(data: &[u8]) {
    let Some(text) = text(data) else { return };
    sound(Loaded::parse(&format!("t,q1,q2,q3,q4,q5,q6\n{text}"), None));
    sound(Loaded::parse(text, None));
    waypoints(&format!("t,pose,q1_deg,q2,q3,q4,q5,q6,x,y,z,roll,pitch,yaw\n{text}"));
    waypoints(text);
}

/// Reads the data as a trajectory file with 19 columns and without a header. Then builds a valid file of this format
/// from the data, with integers or with decimals, and reads this file too.
pub fn trajectory_table(data: &[u8]) {
    if let Some(text) = text(data) {
        sound(Loaded::parse(text, None));
    }
    let whole = data.len().is_multiple_of(2);
    let mut table = String::new();
    for (i, row) in data.chunks(36).take(50).enumerate() {
        let time = i * (1 + usize::from(row[0]));
        table += &if whole { time.to_string() } else { format!("{:.3}", time as f64 * 1e-3) };
        for c in 0..18 {
            let byte = |k: usize| row.get(k).copied().unwrap_or(0);
            let v = i16::from_be_bytes([byte(2 * c), byte(2 * c + 1)]);
            table += &if whole { format!(",{v}") } else { format!(",{:.6}", f64::from(v) / 1e4) };
        }
        table.push('\n');
    }
    sound(Loaded::parse(&table, None));
}

/// Reads the data as a trajectory file in each of the two JSON formats.
pub fn trajectory_json(data: &[u8]) {
    let Some(text) = text(data) else { return };
    sound(Loaded::parse(&format!("{{{text}"), None));
    waypoints(&format!("[{text}"));
    waypoints(&format!("{{{text}"));
}

/// Reads the data as a trajectory file in YAML format.
pub fn trajectory_yaml(data: &[u8]) {
    let Some(text) = text(data) else { return };
    sound(Loaded::parse(&format!("joint_names: [a1, a2, a3, a4, a5, a6]\n{text}"), None));
    sound(Loaded::parse(&format!("{text}\njoint_names: [a1, a2, a3, a4, a5, a6]\n"), None));
}

/// Checks an arm that was read from a file. The arm model must be physically possible. The parameters must fit into
/// their serial frames, or the parameter check must reject them.
fn sound_arm(read: Result<Arm, FileError>) {
    let Ok(arm) = read else { return };
    assert!(arm.model.check().is_ok());
    let set = arm.parameter_set();
    if set.check().is_ok() {
        let friction = set.friction.iter().map(crate::frame::friction);
        for frame in friction.chain(set.pid.iter().map(crate::frame::pid)).flatten() {
            assert!(jtc_wire::FrameRef::new_checked(&frame).is_some());
        }
    }
}

/// Reads the data as an arm file.
pub fn arm_toml(data: &[u8]) {
    let Some(text) = text(data) else { return };
    sound_arm(Arm::from_toml(text).and_then(|_| Arm::parse(text)));
}

/// Reads the data as a robot description.
pub fn arm_urdf(data: &[u8]) {
    let Some(text) = text(data) else { return };
    sound_arm(Arm::parse(text));
    let _ = Arm::from_urdf(text);
}

/// Reads the data as a table of friction, gains or an arm model.
pub fn parameter_table(data: &[u8]) {
    let Some(text) = text(data) else { return };
    if let Ok(file) = ParameterFile::parse_table(text) {
        let _ = file.parameter_set(Default::default()).check();
    }
}

/// Reads the data as a raw capture of the serial line.
pub fn capture(data: &[u8]) {
    let _ = read_capture(data);
}

/// Reads the data as the log of a flight recorder. The data is used twice: as a log file, and as arbitrary bits in valid blocks.
pub fn flight_log(data: &[u8]) {
    if let Some(log) = FlightLog::from_bytes(data) {
        assert_eq!(FlightLog::from_bytes(&log.to_bytes()).as_ref(), Some(&log));
    }
    let Some((head, bits)) = data.split_first_chunk::<3>() else { return };
    let words: Vec<u32> = bits
        .chunks(4)
        .map(|bytes| bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte)))
        .collect();
    // The first two bytes select the bit at which the snapshot begins. The length of the data determines the number of blocks.
    let snapshot = u16::from_be_bytes([head[0], head[1]]);
    let blocks: Vec<_> = words
        .chunks(251)
        .enumerate()
        .map(|(n, words)| {
            sealed_block(u32::from(head[2]) + n as u32, if n == 0 { snapshot } else { u16::MAX }, words)
        })
        .collect();
    let records = Log::new(&blocks).count();
    assert!(records <= 32 * words.len() + 1);
    let log = FlightLog { blocks, ..FlightLog::default() };
    let _ = log.needed_points(0, 12_000);
}
