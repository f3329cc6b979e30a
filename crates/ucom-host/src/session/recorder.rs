//! Recording of a bus: frames with their times and names.

use std::io::Write;
use std::path::Path;

use can_link::CanFrame;
use ucom::Profile;

use super::link::{protocol_frame, recorded};
use crate::ProfileFile;
use crate::decoder::Decoder;
use crate::files::recording::{CandumpWriter, Record, RecordingError, RecordingFormat, RecordingWriter};
use crate::master::Master;

enum Sink {
    File(RecordingWriter),
    Stream(CandumpWriter<Box<dyn Write>>),
}

/// Recording of a bus that is in progress. The recorder contains a master that only listens, so that the numbers of the boards are known.
pub struct Recorder {
    sink: Sink,
    /// `true` if the file format cannot represent frames of other protocols.
    only_protocol: bool,
    channel: String,
    decoder: Decoder,
    master: Master,
    frames: u64,
    left_out: u64,
}

impl Recorder {
    /// Creates a recording as a file. The profile is stored in the file or next to the file; `channel` is the name of the bus in the
    /// recording.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn file(
        path: &Path,
        format: RecordingFormat,
        profile: Profile,
        channel: &str,
    ) -> Result<Self, RecordingError> {
        let sink = Sink::File(RecordingWriter::create(path, format, &profile.to_toml())?);
        let only_protocol = format == RecordingFormat::FziCan;
        Ok(Self { only_protocol, ..Self::new(sink, profile, channel) })
    }

    /// Creates a recording as a stream of lines in the format of candump.
    pub fn stream(out: impl Write + 'static, profile: Profile, channel: &str) -> Self {
        Self::new(Sink::Stream(CandumpWriter::new(Box::new(out))), profile, channel)
    }

    fn new(sink: Sink, profile: Profile, channel: &str) -> Self {
        let (decoder, master) = (Decoder::new(profile), Master::new(profile));
        Self { sink, only_protocol: false, channel: channel.into(), decoder, master, frames: 0, left_out: 0 }
    }

    /// Writes a frame to the recording. The frame was received at the session time `now_us`, and at the time `time_ns` since 1970.
    ///
    /// # Errors
    /// Returns an error if the frame cannot be written.
    pub fn take(&mut self, now_us: u64, time_ns: u64, frame: &CanFrame) -> Result<(), RecordingError> {
        let frame = recorded(frame);
        self.master.handle(now_us, protocol_frame(&frame));
        while self.master.take_event().is_some() {}
        let name = self.decoder.describe(now_us, &protocol_frame(&frame)).name;
        let record = Record { time_ns, channel: self.channel.clone(), direction: None, frame };
        let written = match &mut self.sink {
            Sink::File(writer) => writer.write(&record, Some(&name)),
            Sink::Stream(writer) => writer.write(&record),
        };
        match written {
            Ok(()) => self.frames += 1,
            Err(_) if self.only_protocol && protocol_frame(&record.frame).is_err() => self.left_out += 1,
            Err(e) => return Err(e),
        }
        Ok(())
    }

    /// Writes all data to the file, so that they are not lost if the recorder is killed afterwards.
    ///
    /// # Errors
    /// Returns an error if the data cannot be written.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        match &mut self.sink {
            Sink::File(writer) => writer.flush(),
            // The recorder already writes a stream line by line, so no data remain to be written.
            Sink::Stream(_) => Ok(()),
        }
    }

    /// Returns the number of written frames.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Returns the number of frames of other protocols that the file format cannot represent.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Returns a master that only listens and has received the recorded frames.
    pub fn master(&self) -> &Master {
        &self.master
    }

    /// Ends the recording.
    ///
    /// # Errors
    /// Returns an error if the end of the file cannot be written.
    pub fn finish(self) -> Result<(), RecordingError> {
        match self.sink {
            Sink::File(writer) => writer.finish(),
            Sink::Stream(_) => Ok(()),
        }
    }
}
