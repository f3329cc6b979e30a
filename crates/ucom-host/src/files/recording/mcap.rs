//! Reads and writes MCAP files with one channel `/can` of JSON messages. Foxglove, PlotJuggler and the MCAP tools can read these files.

use host_kit::mcap::each_record;
use mcap::records::{self, MessageHeader, Metadata};
use mcap::{Compression, McapError, WriteOptions};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{Seek, Write};
use std::path::PathBuf;

use super::{Direction, FrameKind, Record, RecordedFrame, Recording, RecordingError, hex_bytes};

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
const TOPIC: &str = "/can";
const METADATA: &str = "ucom";
/// JSON schema of a message in the channel.
const SCHEMA: &str = r#"{
  "title": "CanFrame",
  "type": "object",
  "properties": {
    "channel": {"type": "string", "description": "interface"},
    "id": {"type": "integer", "description": "identifier"},
    "extended": {"type": "boolean"},
    "kind": {"enum": ["data", "remote", "fd", "error"]},
    "length": {"type": "integer", "description": "bytes; of a remote frame the bytes asked for"},
    "data": {"type": "string", "description": "payload, hexadecimal"},
    "sent": {"type": "boolean", "description": "by the recorder itself"},
    "name": {"type": "string", "description": "decoded meaning"},
    "fd_flags": {"type": "integer"},
    "dlc": {"type": "integer", "description": "raw DLC above 8 of a classic frame"}
  },
  "required": ["channel", "id", "extended", "kind", "length", "data"]
}"#;

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Data,
    Remote,
    Fd,
    Error,
}

#[derive(Serialize, Deserialize)]
struct Message {
    channel: String,
    id: u32,
    extended: bool,
    kind: Kind,
    length: u8,
    data: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    sent: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fd_flags: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dlc: Option<u8>,
}

impl Message {
    fn of(record: &Record, name: Option<&str>) -> Self {
        let f = &record.frame;
        let (kind, fd_flags) = match f.kind {
            FrameKind::Data => (Kind::Data, None),
            FrameKind::Remote { .. } => (Kind::Remote, None),
            FrameKind::Fd { flags } => (Kind::Fd, Some(flags)),
            FrameKind::Error => (Kind::Error, None),
        };
        let length = if let FrameKind::Remote { length } = f.kind { length } else { f.data.len() as u8 };
        Self {
            channel: record.channel.clone(),
            id: f.id,
            extended: f.extended,
            kind,
            length,
            data: f.data.iter().map(|b| format!("{b:02X}")).collect(),
            sent: record.direction.map(|d| d == Direction::Sent),
            name: name.map(str::to_owned),
            fd_flags,
            dlc: f.dlc,
        }
    }

    fn record(self, time_ns: u64) -> Option<Record> {
        let kind = match self.kind {
            Kind::Data => FrameKind::Data,
            Kind::Remote => FrameKind::Remote { length: self.length },
            Kind::Fd => FrameKind::Fd { flags: self.fd_flags.unwrap_or(0) },
            Kind::Error => FrameKind::Error,
        };
        let most = if matches!(kind, FrameKind::Fd { .. }) { 64 } else { 8 };
        let data = hex_bytes(&self.data, most)?;
        if self.id > if self.extended || kind == FrameKind::Error { 0x1FFF_FFFF } else { 0x7FF } {
            return None;
        }
        let direction = self.sent.map(|sent| if sent { Direction::Sent } else { Direction::Received });
        let frame = RecordedFrame { id: self.id, extended: self.extended, kind, data, dlc: self.dlc };
        Some(Record { time_ns, channel: self.channel, direction, frame })
    }
}

impl From<McapError> for RecordingError {
    fn from(e: McapError) -> Self {
        match e {
            McapError::Io(e) => e.into(),
            e => damaged(e.to_string()),
        }
    }
}

fn damaged(problem: String) -> RecordingError {
    RecordingError::Mcap { path: PathBuf::new(), problem }
}

/// Writes records to an MCAP file.
pub struct McapWriter<W: Write + Seek> {
    out: mcap::Writer<W>,
    channel: u16,
    sequence: u32,
}

impl<W: Write + Seek> McapWriter<W> {
    /// Creates a writer and stores the profile as metadata of the file.
    pub fn new(out: W, profile: &str) -> Result<Self, RecordingError> {
        let mut out = WriteOptions::new()
            .library(concat!("openjtc ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Lz4))
            .create(out)?;
        let metadata = BTreeMap::from([("profile".to_owned(), profile.to_owned())]);
        out.write_metadata(&Metadata { name: METADATA.into(), metadata })?;
        let schema = out.add_schema("CanFrame", "jsonschema", SCHEMA.as_bytes())?;
        let channel = out.add_channel(schema, TOPIC, "json", &BTreeMap::new())?;
        Ok(Self { out, channel, sequence: 0 })
    }

    /// Adds a frame to the file; `name` describes the frame in words.
    pub fn write(&mut self, record: &Record, name: Option<&str>) -> Result<(), RecordingError> {
        let header = MessageHeader {
            channel_id: self.channel,
            sequence: self.sequence,
            log_time: record.time_ns,
            publish_time: record.time_ns,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let json = serde_json::to_vec(&Message::of(record, name)).map_err(|e| damaged(e.to_string()))?;
        Ok(self.out.write_to_known_channel(&header, &json)?)
    }

    /// Ends the open chunk, so that the data written so far can be read even if later data are lost.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        Ok(self.out.flush()?)
    }

    /// Writes the index and the end of the MCAP file.
    pub fn finish(mut self) -> Result<W, RecordingError> {
        self.out.finish()?;
        Ok(self.out.into_inner())
    }
}

/// Reads a complete MCAP file. If the writer of the file was killed, the function reads all complete records.
pub fn read_mcap(file: &[u8]) -> Result<Recording, RecordingError> {
    let mut recording = Recording::default();
    let mut channels = BTreeMap::new();
    let read = each_record(file, |record| {
        match record {
            records::Record::Metadata(metadata) if metadata.name == METADATA => {
                recording.profile = metadata.metadata.get("profile").cloned();
            }
            records::Record::Channel(channel) => {
                channels.insert(channel.id, channel.topic == TOPIC && channel.message_encoding == "json");
            }
            records::Record::Message { header, data } => {
                let unknown = McapError::UnknownChannel(header.sequence, header.channel_id);
                if !*channels.get(&header.channel_id).ok_or(unknown)? {
                    return Ok(());
                }
                let message = serde_json::from_slice::<Message>(&data).map_err(|e| damaged(e.to_string()))?;
                let bad = || damaged(format!("message {}: not a CAN frame", header.sequence));
                recording.records.push(message.record(header.log_time).ok_or_else(bad)?);
            }
            _ => {}
        }
        Ok(())
    });
    // If the writer was killed, the length of the last chunk is missing, so the read error can occur before the end
    // of the file. The missing end mark shows that the file is incomplete and not damaged.
    let ended = file.len() >= 2 * MAGIC.len() && file.ends_with(MAGIC);
    let broken_off = |why: String| format!("the file ends after {} bytes{why}", file.len());
    recording.broken_off = match read {
        Ok(true) => None,
        Ok(false) => Some(broken_off(String::new())),
        Err(e) if file.starts_with(MAGIC) && !ended => Some(broken_off(format!(" ({e})"))),
        Err(e) => return Err(e),
    };
    Ok(recording)
}
