//! Tests that recordings in both formats are written and read again, and that other files are rejected.

use jtc_wire::{ControllerState, NodeState, TrajectoryState};

use super::*;
use crate::sample::Sample;

fn samples(n: usize) -> Vec<Sample> {
    (0..n)
        .map(|i| {
            let t = i as f64 * 1e-3;
            let mut s = Sample::default();
            (s.state, s.trajectory) = (ControllerState::Operate.into(), TrajectoryState::Execute.into());
            (s.time_s, s.point, s.errors, s.can_current) = (t, i as u32, 0x8001, 1 << 8);
            for (j, joint) in s.joints.iter_mut().enumerate() {
                joint.set_position = (t + j as f64).sin();
                joint.position = joint.set_position - 1e-3;
                joint.error = 4e-4;
                joint.torque = -12.5 * j as f64;
                joint.temperature = 31.0;
                (joint.state, joint.internal) = (NodeState::ENABLED, 1 << j);
            }
            s
        })
        .collect()
}

fn same(a: f64, b: f64) -> bool {
    (a.is_nan() && b.is_nan()) || (a - b).abs() < 1e-9
}

fn check(name: &str) -> Recording {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    let mut info = RecordingInfo {
        arm: "avena".into(),
        source: "simulator".into(),
        commanded_by: "anna".into(),
        ..Default::default()
    };
    for (j, joint) in info.joints.iter_mut().enumerate() {
        *joint = JointInfo {
            name: format!("joint_{}", j + 1),
            position_min_rad: -3.0,
            position_max_rad: 3.0,
            velocity_max_rad_s: 1.5,
            torque_max_nm: 40.5,
            position_error_max_rad: 0.09,
            origin: [0.1, 0.2, 0.3, 0.0, 1.570796, 0.0],
        };
    }
    let written = samples(1500);
    assert_eq!(write_all(&path, &info, &written).unwrap(), 1500);
    let read = Recording::read(&path).unwrap();
    assert_eq!(read.samples.len(), written.len());
    for (a, b) in read.samples.iter().zip(&written) {
        assert!(same(a.time_s, b.time_s));
        assert_eq!(
            (a.state, a.trajectory, a.point, a.errors, a.can_current),
            (b.state, b.trajectory, b.point, b.errors, b.can_current)
        );
        for (a, b) in a.joints.iter().zip(&b.joints) {
            for (x, y) in [
                (a.set_position, b.set_position),
                (a.position, b.position),
                (a.error, b.error),
                (a.velocity, b.velocity),
                (a.torque_p, b.torque_p),
                (a.torque, b.torque),
                (a.temperature, b.temperature),
            ] {
                assert!(same(x, y), "{x} is not {y}");
            }
            assert_eq!((a.state, a.internal), (b.state, b.internal));
        }
    }
    if let Some(read) = &read.info {
        assert_eq!(*read, info);
    }
    read
}

fn read_csv(bytes: &[u8]) -> Result<Found, RecordingError> {
    csv::scan(bytes, &mut |_| ())
}

fn read_mcap(bytes: &[u8]) -> Result<(Found, usize), RecordingError> {
    let mut samples = 0;
    let found = mcap::scan(bytes, mcap::read_info(bytes), ROOM, &mut |_| samples += 1)?;
    Ok((found, samples))
}

#[test]
fn mcap_comes_back_with_its_limits() {
    assert!(check("run.mcap").info.is_some());
}

#[test]
fn csv_comes_back() {
    check("run.csv");
}

#[test]
fn what_is_no_recording_is_refused_by_name() {
    assert!(matches!(Format::of(Path::new("x.txt")), Err(RecordingError::UnknownFormat { .. })));
    assert!(read_csv(b"t,q1\n0,1\n").err().unwrap().to_string().contains("time_s"));
    let error = read_csv(b"time_s,q2_position_rad\n0,1\n0.1,abc\n").err().unwrap().to_string();
    assert!(error.contains("line 3") && error.contains("q2_position_rad"), "{error}");
    assert!(read_mcap(b"not an mcap file").is_err());
}

/// The test truncates a file at any byte. The reader returns all samples of complete blocks in the order of writing, and reports the
/// truncation.
#[test]
fn a_file_that_breaks_off_is_read_as_far_as_it_is_whole() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["run.mcap", "run.csv"] {
        let path = dir.path().join(name);
        let mut recorder = Recorder::create(&path, &RecordingInfo::default()).unwrap();
        let mut sizes = Vec::new();
        for (i, sample) in samples(1000).iter().enumerate() {
            recorder.write(sample).unwrap();
            if i % 100 == 99 {
                recorder.flush().unwrap();
                sizes.push(std::fs::metadata(&path).unwrap().len() as usize);
            }
        }
        recorder.finish_as(&Ending { outcome: "finished".into(), ..Ending::default() }).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let read = Recording::read(&path).unwrap();
        assert_eq!((read.samples.len(), read.ending.outcome.is_empty()), (1000, name == "run.csv"));
        if name == "run.mcap" {
            assert_eq!(read.cut, None);
        }
        let cut = dir.path().join(format!("cut-{name}"));
        for (k, size) in sizes.iter().enumerate() {
            for more in [0, 1, 9, 700, 5000] {
                let length = size + more;
                if sizes.get(k + 1).is_some_and(|next| length >= *next) || length >= bytes.len() {
                    continue;
                }
                std::fs::write(&cut, &bytes[..length]).unwrap();
                let read = Recording::read(&cut).unwrap_or_else(|e| panic!("{length} bytes: {e}"));
                assert!(read.samples.len() >= 100 * (k + 1), "{name}: {} of {length}", read.samples.len());
                for (i, sample) in read.samples.iter().enumerate() {
                    assert_eq!(sample.point, i as u32);
                    assert!(sample.joints.iter().all(|j| j.temperature == 31.0 && j.position.is_finite()));
                }
                // After the last block, only the end of the MCAP file is missing, so the description of the missing
                // part is not checked.
                if k + 1 == sizes.len() && more > 0 {
                    continue;
                }
                let missing = read.cut.unwrap_or_default();
                assert!(
                    missing.contains("is incomplete") || missing.contains("not completed"),
                    "{missing:?}"
                );
            }
        }
        std::fs::write(&cut, "").unwrap();
        assert!(matches!(Recording::read(&cut), Err(RecordingError::Empty { .. })));
    }
}

/// The length field of a record inside a compressed chunk claims one terabyte. The reader must report the damage and
/// must not reserve this memory.
#[test]
fn a_damaged_length_takes_no_memory() {
    let mut file = b"\x89MCAP0\r\n".to_vec();
    // LZ4 frame with one uncompressed block. The block contains the opcode and the length of a message.
    let mut data = b"\x04\x22\x4D\x18\x60\x40\x82\x09\0\0\x80\x05".to_vec();
    data.extend((1_u64 << 40).to_le_bytes());
    data.extend([0; 4]);
    file.push(6);
    file.extend((8 + 8 + 8 + 4 + 4 + 3 + 8 + data.len() as u64).to_le_bytes());
    file.extend([0; 16]);
    file.extend((1_u64 << 40).to_le_bytes());
    file.extend([0; 4]);
    file.extend([3, 0, 0, 0]);
    file.extend(b"lz4");
    file.extend((data.len() as u64).to_le_bytes());
    file.extend(data);
    let error = read_mcap(&file).err().unwrap().to_string();
    assert!(error.contains("length"), "{error}");
}

/// The index entry for the metadata points beyond the end of the file. The reader ignores this index entry and still
/// finds the metadata.
#[test]
fn a_damaged_index_takes_nothing_away() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.mcap");
    let info = RecordingInfo { arm: "avena".into(), ..Default::default() };
    write_all(&path, &info, &samples(3)).unwrap();
    let mut file = std::fs::read(&path).unwrap();
    let name = b"\x07\0\0\0openjtc";
    let at = file.windows(name.len()).rposition(|bytes| bytes == name).unwrap();
    // In an index entry, the offset and the length are stored before the name.
    file[at - 16..at - 8].copy_from_slice(&(u64::MAX - 8).to_le_bytes());
    file[at - 8..at].copy_from_slice(&u64::from(16_u8).to_le_bytes());
    let (found, samples) = read_mcap(&file).unwrap();
    assert_eq!((samples, found.info.unwrap().arm), (3, "avena".to_owned()));
}

#[test]
fn how_the_run_ended_comes_back() {
    let dir = tempfile::tempdir().unwrap();
    let ending =
        Ending { outcome: "fault".into(), reason: "no status, for 2 s\nand more".into(), lost_samples: 17 };
    let info = RecordingInfo { ending: ending.clone(), ..Default::default() };
    for name in ["a.mcap", "a.csv"] {
        let path = dir.path().join(name);
        write_all(&path, &info, &samples(3)).unwrap();
        let read = Recording::read(&path).unwrap();
        assert_eq!((read.samples.len(), read.ending.outcome.as_str()), (3, "fault"), "{name}");
        assert_eq!(read.ending.lost_samples, 17, "{name}");
        assert_eq!(read.ending.reason.replace('\n', " "), "no status, for 2 s and more", "{name}");
    }
}

/// Counts the messages of a file by topic.
fn counted(path: &Path) -> std::collections::BTreeMap<String, usize> {
    let mut topics = std::collections::BTreeMap::new();
    let mut counts = std::collections::BTreeMap::new();
    host_kit::mcap::each_record::<RecordingError>(File::open(path).unwrap(), |record| {
        match record {
            ::mcap::records::Record::Channel(channel) => drop(topics.insert(channel.id, channel.topic)),
            ::mcap::records::Record::Message { header, .. } => {
                *counts.entry(topics[&header.channel_id].clone()).or_default() += 1;
            }
            _ => {}
        }
        Ok(())
    })
    .unwrap();
    counts
}

/// The file contains all data that a reader needs to understand the values: the arm, its gains and limits, and the
/// identity of the controller. Poses of the links are written at most 50 times a second, at any sample rate. Poses are
/// written only if the position of a joint is known.
#[test]
fn a_recording_of_an_arm_stands_alone() {
    let dir = tempfile::tempdir().unwrap();
    let device = DeviceIdentity { board: "board".into(), firmware: "1.2.3".into(), revision: "abc".into() };
    let info = RecordingInfo { device: Some(device), ..RecordingInfo::of(&crate::Arm::avena()) };
    assert!(info.gains.is_some() && info.hash.is_some());
    for (step_ms, n, transforms) in [(1, 2000, 100), (25, 80, 80), (40, 50, 50)] {
        let path = dir.path().join(format!("every-{step_ms}.mcap"));
        let mut written = samples(n);
        written.iter_mut().enumerate().for_each(|(i, s)| s.time_s = 1e-3 * (i * step_ms) as f64);
        write_all(&path, &info, &written).unwrap();
        let counts = counted(&path);
        assert_eq!(
            (counts["/joint_states"], counts["/tf"], counts["/robot_description"]),
            (n, transforms, 1)
        );
        let read = Recording::read(&path).unwrap();
        assert_eq!((read.samples.len(), read.info.as_ref()), (n, Some(&info)));
    }
    let path = dir.path().join("unknown.mcap");
    let mut written = samples(100);
    written.iter_mut().flat_map(|s| &mut s.joints).for_each(|joint| joint.position = f64::NAN);
    write_all(&path, &info, &written).unwrap();
    assert!(!counted(&path).contains_key("/tf"));
    // If the arm is unknown, the file does not contain a robot description.
    write_all(&path, &RecordingInfo::default(), &samples(100)).unwrap();
    assert_eq!(counted(&path).len(), 4);
}
