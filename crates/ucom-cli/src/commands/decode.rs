//! Command `ucom decode`: prints frames as text, from a recording, stdin or the live bus.

use std::io::BufRead;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

use cli_kit::{Failure, Output, Stop};
use serde_json::json;
use ucom_host::ProfileFile;
use ucom_host::files::recording::{CandumpReader, Record, RecordedFrame, Recording};
use ucom_host::session::{CleanupList, protocol_frame, recorded};
use ucom_host::{Decoder, Described};

use super::record::{Silence, is_view, one_bus, report_broken_off, unreadable};
use crate::args::{DecodeArgs, LinkArgs};
use crate::interrupt::listen;

/// Maximum number of input lines that are read in advance.
const READ_AHEAD: usize = 64;
/// Interval at which the command checks for Ctrl-C while no input arrives on stdin.
const LOOK: Duration = Duration::from_millis(50);

/// Decodes frames until the end of the input or until Ctrl-C. The exit code is 2 if a file contains no frame.
pub(super) fn decode(args: &DecodeArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let left = args.count.unwrap_or(u64::MAX);
    if args.live {
        return live(left, link, out);
    }
    let stdin = args.file.as_os_str() == "-";
    let mut profile = link.profile()?;
    let stop = listen(&CleanupList::default())?;
    let records: Box<dyn Iterator<Item = Result<Record, Failure>>> = if stdin {
        Box::new(received(&stop)?)
    } else {
        let mut recording = Recording::read(&args.file).map_err(|e| unreadable(e, Some(&args.file)))?;
        report_broken_off(&recording, &args.file, out);
        one_bus(&mut recording, &args.file, args.interface.as_deref())?;
        if let Some((number, back)) = recording.second_start() {
            let (file, back) = (args.file.display(), back.as_secs_f64());
            out.note(format!("{file}: more than one recording: frame {number} is {back:.3} s earlier than the frame before it"));
        }
        // The command uses the profile in the recording, unless the user selects another profile.
        if let (None, Some(text)) = (&link.profile, &recording.profile) {
            profile = ucom::Profile::from_toml(text).map_err(Failure::usage)?;
        }
        Box::new(recording.records.into_iter().map(Ok))
    };
    let mut decoder = Decoder::new(profile);
    let mut frames = 0;
    let mut start = None;
    let mut interface = args.interface.clone();
    for record in records {
        if frames == left || Output::gone() || stop.asked() {
            return Ok(());
        }
        let record = record?;
        if stdin && !is_of(&record, &mut interface, args.interface.is_some())? {
            continue;
        }
        frames += 1;
        let start_ns = *start.get_or_insert(record.time_ns);
        print(&mut decoder, record.time_ns.saturating_sub(start_ns), &record.frame, out);
    }
    if frames == 0 && !stop.asked() {
        return Err(Failure::usage("no frame in the input")
            .next("give a candump log, or one frame in each line: 141#2100011934126E38"));
    }
    Ok(())
}

/// Returns `true` if the record is a frame of the interface that is decoded: the selected interface, or the interface of the first frame.
/// Returns an error for another interface if the user has selected none. A bare frame has no interface.
fn is_of(record: &Record, interface: &mut Option<String>, is_selected: bool) -> Result<bool, Failure> {
    if record.channel.is_empty() {
        return Ok(true);
    }
    let name = interface.get_or_insert_with(|| record.channel.clone());
    if *name != record.channel && !is_selected {
        let (first, second) = (name.escape_debug(), record.channel.escape_debug());
        let what = format!("the input contains the frames of several CAN interfaces: {first}, {second}");
        return Err(Failure::usage(what).next("select one of them with --interface NAME"));
    }
    Ok(*name == record.channel)
}

fn live(mut left: u64, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let stop = listen(&CleanupList::default())?;
    let mut decoder = Decoder::new(link.profile()?);
    let mut bus = link.open()?;
    let mut silence = Silence::begins(out);
    while left > 0 && !stop.asked() && !Output::gone() {
        let received = bus.receive(Duration::from_millis(100))?;
        bus.news().iter().for_each(|news| out.note(news));
        silence.look(received.is_some(), out);
        if let Some(frame) = received {
            print(&mut decoder, bus.now_us() * 1000, &recorded(&frame), out);
            left -= 1;
        }
    }
    Ok(())
}

fn print(decoder: &mut Decoder, time_ns: u64, frame: &RecordedFrame, out: &Output) {
    let described = match frame.error_text() {
        Some(text) => Described {
            name: "error frame".into(),
            who: "-".into(),
            value: json!({ "error_frame": text }),
            text,
        },
        None => decoder.describe(time_ns / 1000, &protocol_frame(frame)),
    };
    let time_s = time_ns as f64 * 1e-9;
    let mut value = json!({
        "time_s": time_s,
        "frame": frame.to_string(),
        "function": described.name,
        "who": described.who,
        "text": described.text,
    });
    if let (Some(value), Some(more)) = (value.as_object_mut(), described.value.as_object()) {
        value.extend(more.clone());
    }
    out.result(&value, || {
        let frame = frame.to_string();
        format!("{time_s:11.6}  {frame:20}  {:14} {:24} {}", described.who, described.name, described.text)
    });
}

/// Returns each line of stdin when the line arrives. Ctrl-C ends the sequence of lines, even while no input
/// arrives.
fn received(stop: &Stop) -> Result<impl Iterator<Item = Result<Record, Failure>> + use<>, Failure> {
    let (sender, lines_read) = sync_channel(READ_AHEAD);
    let read = move || lines(std::io::stdin().lock()).try_for_each(|record| sender.send(record));
    std::thread::Builder::new().name("stdin".into()).spawn(read)?;
    let stop = stop.clone();
    Ok(std::iter::from_fn(move || {
        while !stop.asked() {
            match lines_read.recv_timeout(LOOK) {
                Ok(record) => return Some(record),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return None,
            }
        }
        None
    }))
}

/// Reads candump lines or bare frames, and skips empty lines.
fn lines(input: impl BufRead) -> impl Iterator<Item = Result<Record, Failure>> {
    let texts = input.lines().enumerate();
    texts.filter_map(|(i, line)| match line {
        Err(e) => Some(Err(e.into())),
        Ok(line) if line.trim().is_empty() => None,
        Ok(line) => parsed(line.trim(), i + 1),
    })
}

/// Parses a line of a candump log or a bare frame; returns `None` for a comment.
pub(super) fn parsed(line: &str, number: usize) -> Option<Result<Record, Failure>> {
    let bare = !line.starts_with('(');
    // A bare frame contains no time and no bus name. With an added time and bus name, the bare frame becomes a
    // line of a candump log.
    let full = if bare { format!("(0.0) can0 {line}\n") } else { format!("{line}\n") };
    match CandumpReader::new(full.as_bytes()).next()? {
        Ok(record) if bare => Some(Ok(Record { channel: String::new(), ..record })),
        Ok(record) => Some(Ok(record)),
        Err(e) if is_view(&e) => Some(Err(unreadable(e, None))),
        Err(e) => Some(Err(Failure::usage(format!("line {number}: \"{line}\": {e}"))
            .next("give a candump log, or one frame in each line: 141#2100011934126E38"))),
    }
}
