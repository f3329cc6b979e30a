//! MCAP files with ROS 2 schemas and CDR encoding.

use std::collections::BTreeMap;
use std::io::{Read, Seek, Write};
use std::path::PathBuf;
use std::sync::Arc;

use host_kit::mcap::each_record;
use jtc_wire::{Code, NodeState};
use mcap::records::{self, MessageHeader, Metadata};
use mcap::{Compression, McapError, WriteOptions};

use super::cdr::{Decoder, Encoder};
use super::frames::Frames;
use super::messages::{
    self, COMMANDS_TOPIC, CONTROL_TOPIC, DESCRIPTION_TOPIC, STATE_TOPIC, STATES_TOPIC, TRANSFORMS_TOPIC,
    Topic,
};
use super::reassemble::{Late, Reassembler};
use super::{Ending, Found, RecordingError, RecordingInfo, Writer, schema};
use crate::sample::Sample;
use crate::trajectory::{Loaded, Trajectory};

/// Name of the metadata record with the [`RecordingInfo`].
const METADATA: &str = "openjtc";
/// Name of the metadata record with the [`Ending`], after all messages.
const END: &str = "openjtc_end";
/// Encoding of the trajectories and the log in recordings of version 0.2.0 and earlier. These messages have no schema and contain only the
/// text or the bytes. No program of ROS 2 opens a file with such a channel, so the writer does not use this encoding.
const WITHOUT_SCHEMA: &str = "openjtc";
/// Topic of a flight recorder log, with the bytes that were fetched from the device (J-56).
const LOG_TOPIC: &str = "/jtc/log";
/// Topic of the executed trajectory, as a table with 19 columns of integers and without a header.
const TRAJECTORY_TOPIC: &str = "/jtc/trajectory";
/// Topic of the trajectory of the later runs, in the same format as the executed trajectory.
const THEN_TOPIC: &str = "/jtc/trajectory_then";

impl From<McapError> for RecordingError {
    fn from(e: McapError) -> Self {
        match e {
            McapError::Io(e) => e.into(),
            e => RecordingError::Mcap { path: PathBuf::new(), problem: e.to_string() },
        }
    }
}

/// Writer of MCAP files, which writes each sample as four messages.
pub(super) struct McapWriter<W: Write + Seek> {
    out: mcap::Writer<W>,
    states: u16,
    commands: u16,
    control: u16,
    state: u16,
    names: Vec<String>,
    start_ns: u64,
    /// Frames of the arm and the channel of the transforms, if the arm is known.
    frames: Option<(Frames, u16)>,
    sequence: u32,
    cdr: Encoder,
}

impl<W: Write + Seek> McapWriter<W> {
    pub(super) fn new(out: W, info: &RecordingInfo) -> Result<Self, RecordingError> {
        let mut out = WriteOptions::new()
            .profile("ros2")
            .library(concat!("openjtc ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Lz4))
            .create(out)?;
        out.write_metadata(&Metadata { name: METADATA.into(), metadata: info.to_map() })?;
        let (none, mut cdr) = (BTreeMap::new(), Encoder::default());
        let joint = out.add_schema(schema::JOINT_STATE, "ros2msg", schema::JOINT_STATE_TEXT.as_bytes())?;
        let control = out.add_schema(schema::CONTROL, "ros2msg", schema::CONTROL_TEXT.as_bytes())?;
        let state = out.add_schema(schema::STATE, "ros2msg", schema::STATE_TEXT.as_bytes())?;
        for (topic, trajectory) in [(TRAJECTORY_TOPIC, &info.commanded), (THEN_TOPIC, &info.then)] {
            let Some(text) = trajectory.as_ref().and_then(|t| t.to_int16_csv().ok()) else { continue };
            let message = cdr.start().string(&text).bytes();
            write_once(&mut out, topic, Topic::Description.schema(), info.start_unix_ns, message)?;
        }
        let frames = match &info.description {
            Some(description) => {
                let message = cdr.start().string(description).bytes();
                let (time, schema) = (info.start_unix_ns, Topic::Description.schema());
                write_once(&mut out, DESCRIPTION_TOPIC, schema, time, message)?;
                let text = schema::TRANSFORMS_TEXT.as_bytes();
                let transforms = out.add_schema(schema::TRANSFORMS, "ros2msg", text)?;
                let channel = out.add_channel(transforms, TRANSFORMS_TOPIC, "cdr", &none)?;
                Some((Frames::of(info), channel))
            }
            None => None,
        };
        Ok(Self {
            states: out.add_channel(joint, STATES_TOPIC, "cdr", &none)?,
            commands: out.add_channel(joint, COMMANDS_TOPIC, "cdr", &none)?,
            control: out.add_channel(control, CONTROL_TOPIC, "cdr", &none)?,
            state: out.add_channel(state, STATE_TOPIC, "cdr", &none)?,
            out,
            names: (0..6).map(|j| info.joint_name(j)).collect(),
            start_ns: info.start_unix_ns,
            frames,
            sequence: 0,
            cdr,
        })
    }
}

/// Writes one CDR message to a new channel. `schema` is the name and the text of the ROS 2 message definition.
fn write_once<W: Write + Seek>(
    out: &mut mcap::Writer<W>,
    topic: &str,
    (name, text): (&str, &str),
    time: u64,
    message: &[u8],
) -> Result<(), RecordingError> {
    let schema = out.add_schema(name, "ros2msg", text.as_bytes())?;
    let channel_id = out.add_channel(schema, topic, "cdr", &BTreeMap::new())?;
    let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
    Ok(out.write_to_known_channel(&header, message)?)
}

impl<W: Write + Seek> McapWriter<W> {
    /// Writes a log of a flight recorder as one message.
    pub(super) fn write_log(&mut self, log: &[u8]) -> Result<(), RecordingError> {
        let schema = (schema::BYTES, schema::BYTES_TEXT);
        let message = self.cdr.start().byte_array(log).bytes();
        write_once(&mut self.out, LOG_TOPIC, schema, self.start_ns, message)
    }
}

/// Returns the flight recorder log in a file. Returns `None` if the file does not contain a log.
pub(super) fn read_log(file: impl Read) -> Result<Option<Vec<u8>>, RecordingError> {
    let (mut channel, mut log) = (None, None);
    let read = each_record(file, |record| {
        match record {
            records::Record::Channel(found) if found.topic == LOG_TOPIC => {
                channel = Some((found.id, found.message_encoding));
            }
            records::Record::Message { header, data } => match &channel {
                Some((id, encoding)) if *id == header.channel_id => {
                    log = if encoding == WITHOUT_SCHEMA {
                        Some(data.into_owned())
                    } else {
                        Decoder::new(&data).and_then(|mut cdr| cdr.byte_array().map(<[u8]>::to_vec))
                    };
                }
                _ => {}
            },
            _ => {}
        }
        Ok::<_, RecordingError>(())
    });
    match (read, log) {
        (Err(error), None) => Err(error),
        (_, log) => Ok(log),
    }
}

impl<W: Write + Seek + Send> Writer for McapWriter<W> {
    fn write(&mut self, s: &Sample) -> Result<(), RecordingError> {
        let stamp = self.start_ns + (s.time_s * 1e9).round().max(0.0) as u64;
        let header = |channel_id| MessageHeader {
            channel_id,
            sequence: self.sequence,
            log_time: stamp,
            publish_time: stamp,
        };
        messages::joints(&mut self.cdr, stamp, &self.names, messages::measured(&s.joints));
        self.out.write_to_known_channel(&header(self.states), self.cdr.bytes())?;
        messages::joints(&mut self.cdr, stamp, &self.names, messages::commanded(&s.joints));
        self.out.write_to_known_channel(&header(self.commands), self.cdr.bytes())?;
        messages::control(&mut self.cdr, stamp, &s.joints);
        self.out.write_to_known_channel(&header(self.control), self.cdr.bytes())?;
        messages::state(&mut self.cdr, stamp, s);
        self.out.write_to_known_channel(&header(self.state), self.cdr.bytes())?;

        if let Some((frames, channel)) = &mut self.frames
            && let Some(message) = frames.write(&mut self.cdr, stamp, s)
        {
            self.out.write_to_known_channel(&header(*channel), message)?;
        }
        self.sequence = self.sequence.wrapping_add(1);
        Ok(())
    }

    fn flush(&mut self) -> Result<(), RecordingError> {
        Ok(self.out.flush()?)
    }

    fn end(&mut self, ending: &Ending) -> Result<(), RecordingError> {
        let lost = if ending.lost_samples > 0 { ending.lost_samples.to_string() } else { String::new() };
        let pairs = [("outcome", &ending.outcome), ("reason", &ending.reason), ("lost_samples", &lost)];
        let metadata = pairs.into_iter().filter(|(_, value)| !value.is_empty());
        let metadata = metadata.map(|(key, value)| (key.to_owned(), value.clone())).collect();
        Ok(self.out.write_metadata(&Metadata { name: END.into(), metadata })?)
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordingError> {
        self.out.finish()?;
        self.out.into_inner().flush()?;
        Ok(())
    }
}

/// Topics of the messages of a sample. Each topic has a bit in the mask of received messages.
const SAMPLE_TOPICS: [&str; 4] = [STATES_TOPIC, COMMANDS_TOPIC, CONTROL_TOPIC, STATE_TOPIC];

/// Content of one channel of an MCAP file.
#[derive(Clone, Copy)]
enum Carries {
    /// Messages with a part of each sample; the number is the index into [`SAMPLE_TOPICS`].
    Sample(u8),
    /// The executed trajectory and that of the later runs; `true` if the message has no schema ([`WITHOUT_SCHEMA`]).
    Trajectory(bool),
    Then(bool),
    Description,
    Other,
}

impl Carries {
    fn of(channel: &records::Channel) -> Self {
        let (topic, bare) = (channel.topic.as_str(), channel.message_encoding == WITHOUT_SCHEMA);
        match SAMPLE_TOPICS.iter().position(|known| *known == topic) {
            Some(i) => Self::Sample(i as u8),
            None if topic == TRAJECTORY_TOPIC => Self::Trajectory(bare),
            None if topic == THEN_TOPIC => Self::Then(bare),
            None if topic == DESCRIPTION_TOPIC => Self::Description,
            None => Self::Other,
        }
    }
}

/// Returns the header of a file. Returns `None` if the file is truncated before the header.
///
/// The function searches the whole file, because another program may have moved the header to the end of the file.
pub(super) fn read_info(file: impl Read) -> Option<RecordingInfo> {
    let mut info = None;
    let mut see = |record: records::Record<'_>| match record {
        records::Record::Metadata(metadata) if metadata.name == METADATA => {
            info = Some(RecordingInfo::from_map(&metadata.metadata));
            // The header was found. The error value is used only to end the search.
            Err(RecordingError::Empty { path: PathBuf::new() })
        }
        _ => Ok(()),
    };
    let _ = each_record(file, &mut see);
    info
}

/// Reads a file that [`McapWriter`] wrote, up to the first damaged record. Messages of other topics are ignored.
/// Calls `see` with each sample in time order. Up to `room` incomplete samples are kept in memory, because their
/// missing messages may follow later in the file. `info` is the result of [`read_info`].
pub(super) fn scan(
    file: impl Read,
    mut info: Option<RecordingInfo>,
    room: usize,
    see: &mut dyn FnMut(&Sample),
) -> Result<Found, RecordingError> {
    let mut ending: Option<Ending> = None;
    let (mut commanded, mut then, mut description) = (None, None, None);
    let mut channels: BTreeMap<u16, Carries> = BTreeMap::new();
    let mut gatherer = Reassembler::new(room);
    let start_ns = info.as_ref().map_or(0, |info| info.start_unix_ns);
    let seconds = |time_ns: u64| time_ns.saturating_sub(start_ns) as f64 * 1e-9;
    let mut give = |time_ns: u64, sample: Sample| see(&Sample { time_s: seconds(time_ns), ..sample });
    let read = each_record(file, |record| {
        match record {
            records::Record::Metadata(metadata) if metadata.name == END => {
                ending = Some(RecordingInfo::from_map(&metadata.metadata).ending);
            }
            records::Record::Channel(channel) => {
                channels.insert(channel.id, Carries::of(&channel));
            }
            records::Record::Message { header, data } => {
                let unknown = McapError::UnknownChannel(header.sequence, header.channel_id);
                match *channels.get(&header.channel_id).ok_or(unknown)? {
                    Carries::Sample(topic) => {
                        let time_s = seconds(header.log_time);
                        let late = |Late| RecordingError::Disorder { path: PathBuf::new(), time_s };
                        let sample = gatherer.at(header.log_time, 1 << topic, &mut give).map_err(late)?;
                        let topic = SAMPLE_TOPICS[usize::from(topic)];
                        decode(topic, &data, sample).ok_or_else(|| RecordingError::Message {
                            path: PathBuf::new(),
                            topic: topic.to_owned(),
                            time_s,
                        })?;
                    }
                    Carries::Trajectory(bare) => commanded = trajectory(&data, bare),
                    Carries::Then(bare) => then = trajectory(&data, bare),
                    Carries::Description => {
                        description = Decoder::new(&data).and_then(|mut cdr| cdr.string().map(Arc::from));
                    }
                    Carries::Other => {}
                }
            }
            _ => {}
        }
        Ok(())
    });
    let cut = match read {
        Ok(true) => None,
        Ok(false) => Some("the file was not completed".to_owned()),
        Err(e) if gatherer.is_empty() => return Err(e),
        Err(RecordingError::Mcap { problem, .. }) => Some(format!("the file is incomplete: {problem}")),
        Err(e) => return Err(e),
    };
    gatherer.finish(cut.is_some(), &mut give);
    if let Some(info) = &mut info {
        (info.commanded, info.then, info.description) = (commanded, then, description);
        if let Some(ending) = &ending {
            info.ending = ending.clone();
        }
    }
    let ending = ending.or_else(|| info.as_ref().map(|i| i.ending.clone())).unwrap_or_default();
    Ok(Found { info, ending, cut })
}

/// Reads the text of a trajectory. A `bare` message contains only the text.
fn trajectory(data: &[u8], bare: bool) -> Option<Arc<Trajectory>> {
    let text = if bare { std::str::from_utf8(data).ok()? } else { Decoder::new(data)?.string()? };
    Loaded::parse(text, None).ok().map(|read| Arc::new(read.trajectory))
}

fn decode(topic: &str, data: &[u8], sample: &mut Sample) -> Option<()> {
    let mut cdr = Decoder::new(data)?;
    let joints = &mut sample.joints;
    match topic {
        STATES_TOPIC | COMMANDS_TOPIC => {
            cdr.skip_header()?;
            for _ in 0..cdr.u32()? {
                cdr.skip_string()?;
            }
            let (position, velocity, effort) = (cdr.f64s()?, cdr.f64s()?, cdr.f64s()?);
            for (i, joint) in joints.iter_mut().enumerate() {
                if topic == STATES_TOPIC {
                    (joint.position, joint.velocity, joint.torque) = (position[i], velocity[i], effort[i]);
                } else {
                    (joint.set_position, joint.set_velocity) = (position[i], velocity[i]);
                }
            }
        }
        CONTROL_TOPIC => {
            cdr.skip_header()?;
            let mut columns = [[0.0; 6]; 9];
            for column in &mut columns {
                *column = cdr.array()?;
            }
            for (i, joint) in joints.iter_mut().enumerate() {
                [
                    joint.error,
                    joint.set_acceleration,
                    joint.torque_model,
                    joint.torque_p,
                    joint.torque_i,
                    joint.torque_d,
                    joint.torque_friction,
                    joint.torque,
                    joint.temperature,
                ] = columns.map(|column| column[i]);
            }
        }
        STATE_TOPIC => {
            cdr.skip_header()?;
            (sample.state, sample.trajectory) = (Code::new(cdr.u8()?), Code::new(cdr.u8()?));
            (sample.point, sample.errors, sample.can_current) = (cdr.u32()?, cdr.u16()?, cdr.u32()?);
            for joint in joints.iter_mut() {
                joint.state = NodeState::new(cdr.u8()?);
            }
            for joint in joints.iter_mut() {
                joint.internal = cdr.u16()?;
            }
        }
        _ => {}
    }
    Some(())
}
