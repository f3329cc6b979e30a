//! `ucom record` and `ucom replay`: frames of a bus to a file and back.

use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use cli_kit::{Output, OutputFile, Stop};
use serde_json::json;
use ucom_host::ProfileFile;
use ucom_host::files::recording::{
    CandumpWriter, Record, RecordedFrame, Recording, RecordingError, RecordingFormat, RecordingWriter,
    profile_path,
};
use ucom_host::master::{Master, counted};
use ucom_host::session::{CleanupList, Link, protocol_frame, recorded, replayed};

use super::params::open_output;
use crate::args::{LinkArgs, RecordArgs, ReplayArgs};
use crate::failure::{FAULT, Failure};
use crate::interrupt::listen;
use crate::session::shared_numbers;
use crate::words::Decoder;

/// So often what was recorded reaches the file: a recorder that is killed loses no more.
const FLUSH: Duration = Duration::from_secs(1);

/// Where frames go.
enum Sink {
    File(RecordingWriter),
    Stdout(CandumpWriter<std::io::Stdout>),
}

impl Sink {
    fn write(&mut self, record: &Record, name: &str) -> Result<(), ucom_host::files::RecordingError> {
        match self {
            Self::File(writer) => writer.write(record, Some(name)),
            Self::Stdout(writer) => writer.write(record),
        }
    }

    fn flush(&mut self) -> Result<(), RecordingError> {
        match self {
            Self::File(writer) => writer.flush(),
            // Line by line by itself.
            Self::Stdout(_) => Ok(()),
        }
    }
}

fn failed(e: RecordingError) -> Failure {
    Failure::new(FAULT, "recording", e).hint("is the disk full?")
}

/// Reports that a recording does not end as one does.
pub fn report_broken_off(recording: &Recording, file: &Path, out: &Output) {
    if let Some(why) = &recording.broken_off {
        let (file, whole) = (file.display(), recording.records.len());
        let are = if whole == 1 { "is" } else { "are" };
        out.note(format!("{file}: {why}; the {} before {are} whole", counted(whole, "frame")));
    }
}

/// Records until Ctrl-C, so long, or so many frames.
pub fn record(args: &RecordArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let stop = listen(&CleanupList::default())?;
    let profile = link.profile()?;
    let stdout = args.file.as_os_str() == "-";
    let format = RecordingFormat::of_path(&args.file);
    if !stdout {
        let ending = args.file.extension().map(|e| e.to_string_lossy().into_owned());
        if let Some(other) =
            ending.filter(|e| !["log", "candump", "fzi", "fzican", "mcap"].contains(&e.as_str()))
        {
            let what = format!("{}: nothing writes .{other} here", args.file.display());
            return Err(
                Failure::usage(what).hint("forms go by the ending: .log candump, .fzi FZI-CAN, .mcap MCAP")
            );
        }
    }
    let beside = (format != RecordingFormat::Mcap).then(|| profile_path(&args.file));
    let files = [Some(args.file.clone()), beside].into_iter().flatten().filter(|_| !stdout);
    let files: Vec<OutputFile> =
        files.map(|file| open_output(&file, args.force.force)).collect::<Result<_, _>>()?;
    let mut bus = link.open()?;
    let mut sink = if stdout {
        Sink::Stdout(CandumpWriter::new(std::io::stdout()))
    } else {
        Sink::File(RecordingWriter::create(&args.file, format, &profile.to_toml()).map_err(Failure::usage)?)
    };
    files.into_iter().for_each(OutputFile::is_written);
    let channel = bus.url().rsplit(['/', ':']).next().unwrap_or("can0").to_owned();
    let mut decoder = Decoder::new(profile);
    // It only listens: who answers to which number.
    let mut master = Master::new(profile);
    let (start, mut flushed) = (Instant::now(), Instant::now());
    let (mut frames, mut left_out) = (0_u64, 0_u64);
    while !stop.asked() && frames < args.count.unwrap_or(u64::MAX) {
        let rest = args.duration.map_or(Duration::MAX, |d| d.saturating_sub(start.elapsed()));
        if rest.is_zero() {
            break;
        }
        if flushed.elapsed() >= FLUSH {
            flushed = Instant::now();
            sink.flush().map_err(failed)?;
        }
        let received = bus.receive(rest.min(Duration::from_millis(100)))?;
        bus.news().iter().for_each(|news| out.note(news));
        let Some(frame) = received else { continue };
        let time = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let frame = recorded(&frame);
        master.handle(bus.now_us(), protocol_frame(&frame));
        while master.take_event().is_some() {}
        let name = decoder.describe(bus.now_us(), &protocol_frame(&frame)).name;
        let record =
            Record { time_ns: time.as_nanos() as u64, channel: channel.clone(), direction: None, frame };
        match sink.write(&record, &name) {
            Ok(()) => frames += 1,
            // FZI-CAN has no form for frames of other protocols.
            Err(_) if format == RecordingFormat::FziCan && protocol_frame(&record.frame).is_err() => {
                left_out += 1
            }
            // `ucom record - | head` has what it wanted.
            Err(RecordingError::Io { source: e, .. }) if stdout => {
                Output::lose(&e);
                break;
            }
            Err(e) => return Err(failed(e)),
        }
    }
    let shared = shared_numbers(&master);
    master.shared_numbers().iter().for_each(|error| out.note(format!("{error}\n  {}", error.hint())));
    match sink {
        Sink::File(writer) => writer.finish().map_err(Failure::usage)?,
        Sink::Stdout(_) => {
            Output::bytes(&[]);
            return Ok(());
        }
    }
    let (file, time_s) = (args.file.display().to_string(), start.elapsed().as_secs_f64());
    let value = json!({ "file": file, "frames": frames, "left_out": left_out, "time_s": time_s, "shared_numbers": shared });
    out.result(&value, || {
        let missing =
            if left_out > 0 { format!(", {left_out} foreign ones left out") } else { String::new() };
        format!("{file}: {} in {time_s:.1} s{missing}", counted(frames as usize, "frame"))
    });
    Ok(())
}

/// Sends a recording's frames when they are due.
pub fn replay(args: &ReplayArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    if !(args.speed.is_finite() && args.speed > 0.0) {
        return Err(Failure::usage(format!("--speed {}: it must be above 0", args.speed)));
    }
    let recording = Recording::read(&args.file).map_err(Failure::usage)?;
    report_broken_off(&recording, &args.file, out);
    let intrusive = |record: &Record| is_intrusive(&record.frame);
    let (guarded, due): (Vec<&Record>, Vec<&Record>) =
        recording.records.iter().partition(|record| !args.intrusive && intrusive(record));
    let cleanup = CleanupList::default();
    let stop = listen(&cleanup)?;
    let mut bus = link.open()?;
    if args.intrusive {
        cleanup.begin_other("what the boards took of the recording is not known", "ucom scan");
    }
    let sent = play(&due, args.speed, &mut bus, &stop, out)?;
    let value = json!({ "sent": sent, "left_out": guarded.len(), "frames": recording.records.len(), "broken_off": recording.broken_off });
    out.result(&value, || {
        let hint = match guarded.len() {
            0 => String::new(),
            n => format!(
                ", {n} left out that reset, number, program, start or move boards (--intrusive sends them)"
            ),
        };
        format!("{} sent{hint}", counted(sent as usize, "frame"))
    });
    Ok(())
}

fn play(records: &[&Record], speed: f64, bus: &mut Link, stop: &Stop, out: &Output) -> Result<u64, Failure> {
    let bar = out.bar(records.len() as u64, "replay");
    let first = records.first().map_or(0, |r| r.time_ns);
    let start = Instant::now();
    let mut sent = 0;
    for record in records {
        let due_s = record.time_ns.saturating_sub(first) as f64 * 1e-9 / speed;
        let due = Duration::try_from_secs_f64(due_s).unwrap_or(Duration::MAX);
        while !stop.asked() {
            let rest = due.saturating_sub(start.elapsed());
            if rest.is_zero() {
                break;
            }
            // What others send is of no interest here, and must not pile up.
            bus.receive(rest.min(Duration::from_millis(100)))?;
            bus.news().iter().for_each(|news| out.note(news));
        }
        if stop.asked() {
            break;
        }
        if let Some(frame) = replayed(&record.frame) {
            bus.send_wire(&frame)?;
            sent += 1;
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(sent)
}

/// A frame of this protocol that changes boards or keeps them running.
pub fn is_intrusive(frame: &RecordedFrame) -> bool {
    let function = protocol_frame(frame).ok().and_then(|f| f.address().ok()).map(|(f, _)| f);
    function.is_some_and(intrusive_function)
}

/// What changes boards or keeps them running; questions and frames of boards do not.
fn intrusive_function(function: ucom::Function) -> bool {
    use ucom::Function;
    let asks = matches!(function, Function::Info | Function::AskReport | Function::DumpIo | Function::DumpCi);
    function.from_pc() && !asks
}
