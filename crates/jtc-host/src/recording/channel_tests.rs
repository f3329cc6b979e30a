//! Tests that each channel of an MCAP file has a schema that fits its messages, and that the files of earlier versions are still read.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use ::mcap::{MessageStream, Summary};

use super::{Recording, RecordingInfo, read_log, write_with_log};
use crate::Arm;
use crate::log::FlightLog;
use crate::sample::Sample;
use crate::trajectory::{Loaded, Trajectory};

/// Fields of each type of a ROS 2 message definition: type and number of elements.
type Types = BTreeMap<String, Vec<(String, Count)>>;

#[derive(Clone, Copy)]
enum Count {
    One,
    Fixed(usize),
    Sequence,
}

/// Reads a ROS 2 message definition. The type of the message itself has the name "".
fn types(text: &str) -> Types {
    let (mut types, mut name) = (Types::from([(String::new(), Vec::new())]), String::new());
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if let Some(next) = line.strip_prefix("MSG: ") {
            next.clone_into(&mut name);
        } else if !line.is_empty() && !line.contains('=') {
            let field = line.split_whitespace().next().unwrap();
            let (kind, count) = match field.split_once('[') {
                None => (field, Count::One),
                Some((kind, "]")) => (kind, Count::Sequence),
                Some((kind, n)) => (kind, Count::Fixed(n.trim_end_matches(']').parse().unwrap())),
            };
            types.entry(name.clone()).or_default().push((kind.to_owned(), count));
        }
    }
    types
}

/// Reader of a message by its definition alone.
struct Walk<'a> {
    types: &'a Types,
    body: &'a [u8],
    at: usize,
}

impl Walk<'_> {
    fn skip(&mut self, size: usize, n: usize) -> Option<()> {
        if n > 0 {
            self.at = self.at.next_multiple_of(size) + size * n;
        }
        (self.at <= self.body.len()).then_some(())
    }

    fn length(&mut self) -> Option<usize> {
        self.skip(4, 1)?;
        Some(u32::from_le_bytes(self.body[self.at - 4..self.at].try_into().unwrap()) as usize)
    }

    fn message(&mut self, name: &str) -> Option<()> {
        let types = self.types;
        for (kind, count) in types.get(name)? {
            let n = match count {
                Count::One => 1,
                Count::Fixed(n) => *n,
                Count::Sequence => self.length()?,
            };
            match kind.as_str() {
                "uint8" => self.skip(1, n)?,
                "uint16" => self.skip(2, n)?,
                "int32" | "uint32" => self.skip(4, n)?,
                "float64" => self.skip(8, n)?,
                "string" => {
                    for _ in 0..n {
                        let length = self.length()?;
                        self.skip(1, length)?;
                        assert_eq!(self.body[self.at - 1], 0, "a string ends with a zero");
                    }
                }
                other => {
                    for _ in 0..n {
                        self.message(other)?;
                    }
                }
            }
        }
        Some(())
    }
}

/// Checks that each channel has a ROS 2 schema and CDR messages, and that each message has exactly the fields of its schema. Returns the
/// type of each topic.
fn fitting(file: &[u8]) -> BTreeMap<String, String> {
    let summary = Summary::read(file).unwrap().unwrap();
    let mut found = BTreeMap::new();
    for channel in summary.channels.values() {
        let schema = channel.schema.as_ref().unwrap_or_else(|| panic!("{}: no schema", channel.topic));
        assert_eq!((schema.encoding.as_str(), channel.message_encoding.as_str()), ("ros2msg", "cdr"));
        found.insert(channel.topic.clone(), schema.name.clone());
    }
    for message in MessageStream::new(file).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        let types = types(std::str::from_utf8(&schema.data).unwrap());
        let body = message.data.strip_prefix(&[0, 1, 0, 0]).expect("little-endian CDR");
        let mut walk = Walk { types: &types, body, at: 0 };
        walk.message("").unwrap_or_else(|| panic!("{} is cut off", message.channel.topic));
        assert_eq!(walk.at, body.len(), "{}: bytes after the last field", message.channel.topic);
    }
    found
}

fn trajectory(end: f64) -> Arc<Trajectory> {
    let line = |t: f64, q: f64| format!("{t},{q},{q},{q},{q},{q},{q}\n");
    let text = format!("t,q1,q2,q3,q4,q5,q6\n{}{}{}", line(0.0, 0.0), line(1.0, 0.5 * end), line(2.0, end));
    Arc::new(Loaded::parse(&text, None).unwrap().trajectory)
}

/// Returns the points as the integers of the wire format, in which a recording has them.
fn raw(trajectory: &Option<Arc<Trajectory>>) -> Vec<jtc_wire::RawPoint> {
    trajectory.as_ref().unwrap().raw().unwrap()
}

fn full_info() -> RecordingInfo {
    RecordingInfo {
        commanded: Some(trajectory(0.1)),
        then: Some(trajectory(0.2)),
        ..RecordingInfo::of(&Arm::avena())
    }
}

/// ROS 2's own programs refuse a whole file if one channel has no schema, and a plain reader loop ends at the first
/// message of such a channel.
#[test]
fn each_channel_has_a_schema_that_fits_its_messages() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("all.mcap");
    let (info, log) = (full_info(), [7, 0, 255, 3, 4]);
    let mut sample = Sample::default();
    sample.joints.iter_mut().for_each(|joint| joint.position = 0.5);
    write_with_log(std::fs::File::create(&path).unwrap(), &path, &info, &[sample], &log).unwrap();
    let found = fitting(&std::fs::read(&path).unwrap());
    let types: Vec<_> = found.iter().map(|(topic, name)| (topic.as_str(), name.as_str())).collect();
    let expected = [
        ("/joint_commands", "sensor_msgs/msg/JointState"),
        ("/joint_states", "sensor_msgs/msg/JointState"),
        ("/jtc/control", "openjtc_msgs/msg/JointControl"),
        ("/jtc/log", "std_msgs/msg/UInt8MultiArray"),
        ("/jtc/state", "openjtc_msgs/msg/ControllerState"),
        ("/jtc/trajectory", "std_msgs/msg/String"),
        ("/jtc/trajectory_then", "std_msgs/msg/String"),
        ("/robot_description", "std_msgs/msg/String"),
        ("/tf", "tf2_msgs/msg/TFMessage"),
    ];
    assert_eq!(types, expected);
    assert_eq!(read_log(&path).unwrap().as_deref(), Some(&log[..]));
    let read = Recording::read(&path).unwrap();
    let back = read.info.unwrap();
    assert_eq!((read.samples.len(), back.description.is_some()), (1, true));
    assert_eq!((raw(&back.commanded), raw(&back.then)), (raw(&info.commanded), raw(&info.then)));
}

/// The files in tests/recordings are made with version 0.2.0, which wrote trajectories and logs without a schema.
#[test]
fn recordings_of_version_0_2_0_are_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings");
    let run = Recording::read(&folder.join("run-0.2.0.mcap")).unwrap();
    assert_eq!((run.samples.len(), run.ending.outcome.as_str(), run.cut), (33, "finished", None));
    let commanded = run.info.unwrap().commanded.expect("the executed trajectory");
    assert_eq!((commanded.step_ms, commanded.points.len()), (100, 9));
    assert!((commanded.points[8].position[5] - 0.1).abs() < 1e-4);
    let log = FlightLog::load(&folder.join("log-0.2.0.mcap")).unwrap();
    assert!(!log.blocks.is_empty());
}

/// The channel of the later runs in the form of version 0.2.0.
#[test]
fn the_trajectory_of_the_later_runs_in_version_0_2_0_is_read() {
    let (info, none) = (full_info(), BTreeMap::new());
    let mut out = ::mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    let metadata = ::mcap::records::Metadata { name: "openjtc".into(), metadata: info.to_map() };
    out.write_metadata(&metadata).unwrap();
    for (topic, trajectory) in [("/jtc/trajectory", &info.commanded), ("/jtc/trajectory_then", &info.then)] {
        let channel_id = out.add_channel(0, topic, "openjtc", &none).unwrap();
        let header = ::mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 };
        let text = trajectory.as_ref().unwrap().to_int16_csv().unwrap();
        out.write_to_known_channel(&header, text.as_bytes()).unwrap();
    }
    out.finish().unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("then.mcap");
    std::fs::write(&path, out.into_inner().into_inner()).unwrap();
    let read = Recording::read(&path).unwrap().info.unwrap();
    assert_eq!((raw(&read.commanded), raw(&read.then)), (raw(&info.commanded), raw(&info.then)));
}
