//! Commands `ucom record` and `ucom replay`: write the frames of a bus to a file, and send recorded frames again.

use std::path::Path;
use std::time::{Duration, Instant};

use cli_kit::{Diagnose, ErrorKind, Failure, Output, OutputFile, Stop};
use serde_json::json;
use ucom_host::files::recording::{RecordProblem, Recording, RecordingError, RecordingFormat, profile_path};
use ucom_host::master::counted;
use ucom_host::session::{self, CleanupList, Operator, Recorder, ReplayPlan, Unsent};

use super::params::open_output;
use crate::args::{LinkArgs, RecordArgs, ReplayArgs};
use crate::interrupt::listen;
use crate::session::shared_numbers;

/// Interval at which received frames are written to the file. If the recorder is killed, it loses at most the frames of one
/// second.
const FLUSH: Duration = Duration::from_secs(1);

fn failed(e: RecordingError) -> Failure {
    Failure::new(ErrorKind::Fault, "recording", e).next("check if the disk is full")
}

/// Reports that a recording is incomplete.
pub(super) fn report_broken_off(recording: &Recording, file: &Path, out: &Output) {
    if let Some(why) = &recording.broken_off {
        let (file, whole) = (file.display(), recording.records.len());
        let are = if whole == 1 { "is" } else { "are" };
        out.note(format!("{file}: {why}; the {} before this point {are} complete", counted(whole, "frame")));
    }
}

/// Time without a frame after which the command reports that the bus is silent.
const SILENCE: Duration = Duration::from_millis(1500);

/// Reports once that no frame has arrived on the bus yet, and what the user can check. Only users need the note about
/// silence, not programs.
pub(super) struct Silence {
    since: Instant,
    over: bool,
}

impl Silence {
    /// Starts to observe the bus. Programs do not get the note about silence, because they detect silence themselves.
    pub(super) fn begins(out: &Output) -> Self {
        Self { since: Instant::now(), over: out.is_json() }
    }

    /// Checks whether the bus is silent. A command calls this function each time it polls the bus. `came` is `true` if
    /// a frame has arrived.
    pub(super) fn look(&mut self, came: bool, out: &Output) {
        if !came && self.since.elapsed() < SILENCE {
            return;
        }
        if !std::mem::replace(&mut self.over, true) && !came {
            out.note(
                "no frame was received yet: boards send nothing until a PC requests it or their control \
                 loop runs (run `ucom scan` in another terminal); `ucom doctor` checks bus and boards",
            );
        }
    }
}

/// Records frames until Ctrl-C, for the requested time, or until the requested number of frames.
pub(super) fn record(args: &RecordArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let stop = listen(&CleanupList::default())?;
    let profile = link.profile()?;
    let stdout = args.file.as_os_str() == "-";
    let format = RecordingFormat::of_path(&args.file);
    let files = if stdout { Vec::new() } else { outputs(args, format)? };
    let mut bus = link.open()?;
    let channel = bus.url().rsplit(['/', ':']).next().unwrap_or("can0").to_owned();
    let mut recorder = match stdout {
        true => Recorder::stream(std::io::stdout(), profile, &channel),
        false => Recorder::file(&args.file, format, profile, &channel).map_err(Failure::usage)?,
    };
    files.into_iter().for_each(OutputFile::is_written);
    let (start, mut flushed) = (Instant::now(), Instant::now());
    let began_at = host_kit::unix_time();
    let mut silence = Silence::begins(out);
    while !stop.asked() && recorder.frames() < args.count.unwrap_or(u64::MAX) {
        let rest = args.duration.map_or(Duration::MAX, |d| d.saturating_sub(start.elapsed()));
        if rest.is_zero() {
            break;
        }
        if flushed.elapsed() >= FLUSH {
            flushed = Instant::now();
            recorder.flush().map_err(failed)?;
        }
        let received = bus.receive(rest.min(Duration::from_millis(100)))?;
        bus.news().iter().for_each(|news| out.note(news));
        silence.look(received.is_some(), out);
        let Some(frame) = received else { continue };
        // The times in a recording never decrease, even if the clock is changed during the recording.
        let time = began_at + start.elapsed();
        match recorder.take(bus.now_us(), time.as_nanos() as u64, &frame) {
            Ok(()) => {}
            // A write error on stdout ends the recording. This error is not a fault if the reader has disconnected, as
            // in `ucom record - | head`; `lose` distinguishes this case.
            Err(RecordingError::Io { source: e, .. }) if stdout => {
                Output::lose(&e);
                break;
            }
            Err(e) => return Err(failed(e)),
        }
    }
    let shared = shared_numbers(recorder.master());
    recorder.master().shared_numbers().iter().for_each(|e| out.note(format!("{e}\n  {}", e.hint())));
    let (frames, left_out) = (recorder.frames(), recorder.left_out());
    recorder.finish().map_err(Failure::usage)?;
    if stdout {
        Output::bytes(&[]);
        return Ok(());
    }
    let (file, time_s) = (args.file.display().to_string(), start.elapsed().as_secs_f64());
    let value = json!({ "file": file, "frames": frames, "left_out": left_out, "time_s": time_s, "shared_numbers": shared });
    out.result(&value, || {
        let missing = if left_out > 0 {
            format!(", {left_out} frames of other protocols not written")
        } else {
            String::new()
        };
        format!("{file}: {} in {time_s:.1} s{missing}", counted(frames as usize, "frame"))
    });
    Ok(())
}

/// Opens the output files before the recording starts. The extension of the file name selects the format of the recording.
fn outputs(args: &RecordArgs, format: RecordingFormat) -> Result<Vec<OutputFile>, Failure> {
    let ending = args.file.extension().map(|e| e.to_string_lossy().into_owned());
    let known = ["log", "candump", "fzi", "fzican", "mcap"];
    if let Some(other) = ending.filter(|e| !known.contains(&e.as_str())) {
        let what = format!("{}: recordings cannot have the format .{other}", args.file.display());
        let forms = "the file name selects the format: .log candump, .fzi FZI-CAN, .mcap MCAP";
        return Err(Failure::usage(what).next(forms));
    }
    let beside = (format != RecordingFormat::Mcap).then(|| profile_path(&args.file));
    let files = [Some(args.file.clone()), beside].into_iter().flatten();
    files.map(|file| open_output(&file, args.overwrite)).collect()
}

/// Stop signal and output of a replay.
struct Player<'a> {
    stop: Stop,
    out: &'a Output,
}

impl Operator for Player<'_> {
    fn stop_asked(&self) -> bool {
        self.stop.asked()
    }

    fn note(&self, text: String) {
        self.out.note(text);
    }
}

/// Sends the frames of a recording at their recorded times.
pub(super) fn replay(args: &ReplayArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    if !(args.speed.is_finite() && args.speed > 0.0) {
        return Err(Failure::usage(format!(
            "--speed {} is out of range, expected a value above 0",
            args.speed
        )));
    }
    let mut recording = Recording::read(&args.file).map_err(|e| unreadable(e, Some(&args.file)))?;
    report_broken_off(&recording, &args.file, out);
    one_bus(&mut recording, &args.file, args.interface.as_deref())?;
    if let Some((number, back)) = recording.second_start() {
        let what = format!(
            "{}: the file contains more than one recording: the time of frame {number} is {:.3} s before the \
             time of frame {}; nothing was sent",
            args.file.display(),
            back.as_secs_f64(),
            number - 1
        );
        return Err(Failure::usage(what).next("write each recording to its own file"));
    }
    if args.force {
        out.note("--force has no effect, because this command does not check the bus");
    }
    let cleanup = CleanupList::default();
    let player = Player { stop: listen(&cleanup)?, out };
    let mut bus = link.open()?;
    let ReplayPlan { due, unsent } = ReplayPlan::new(&recording.records, args.intrusive, &bus);
    if args.intrusive {
        cleanup.begin_other("it is not known which frames of the recording the boards received", "ucom scan");
    }
    let bar = out.bar(due.len() as u64, "replay");
    let sent = session::replay(&due, args.speed, &mut bus, &player, || bar.inc(1))?;
    bar.finish_and_clear();
    let left_out: usize = unsent.values().sum();
    let why: serde_json::Map<_, _> = unsent.iter().map(|(why, n)| (why.name().into(), json!(n))).collect();
    let value = json!({
        "sent": sent,
        "left_out": left_out,
        "left_out_why": why,
        "frames": recording.records.len(),
        "broken_off": recording.broken_off,
    });
    out.result(&value, || {
        let mut text = format!("{} sent", counted(sent as usize, "frame"));
        unsent.iter().for_each(|(why, n)| text += &format!("; not sent: {}", unsent_words(*why, *n)));
        text
    });
    Ok(())
}

fn unsent_words(why: Unsent, number: usize) -> String {
    match why {
        Unsent::Intrusive => format!(
            "{} that would reset, number, program, start or move boards (--intrusive sends them)",
            counted(number, "frame")
        ),
        Unsent::Error => format!("{}, which only a CAN controller can send", counted(number, "error frame")),
        Unsent::Remote => format!("{}, which this bus cannot carry", counted(number, "remote frame")),
        Unsent::Fd => format!("{}, which this bus cannot carry", counted(number, "CAN FD frame")),
        Unsent::Invalid => format!("{} without a valid identifier or length", counted(number, "frame")),
    }
}

/// Returns `true` if a line has the format that candump shows in a terminal.
pub(super) fn is_view(error: &RecordingError) -> bool {
    matches!(error, RecordingError::Line { problem: RecordProblem::View, .. })
}

/// Returns the failure for a file that is not a recording. Without `file`, the input is stdin.
pub(super) fn unreadable(error: RecordingError, file: Option<&Path>) -> Failure {
    let is_view = is_view(&error);
    let text = error.to_string();
    // Some errors already contain the file name.
    let file = file.map(|file| file.display().to_string()).filter(|file| !text.contains(file));
    Failure::usage(file.map_or_else(|| text.clone(), |file| format!("{file}: {text}"))).next(if is_view {
        "record again with `ucom record` or `candump -L`"
    } else {
        "valid formats are candump -L, FZI-CAN 1.2 and MCAP"
    })
}

/// Keeps the frames of one CAN interface. Returns an error if the recording contains several interfaces and none is selected, or if it
/// does not contain the selected interface.
pub(super) fn one_bus(recording: &mut Recording, file: &Path, asked: Option<&str>) -> Result<(), Failure> {
    let all = recording.interfaces();
    let listed: Vec<String> =
        all.iter().map(|(name, n)| format!("{} ({})", name.escape_debug(), counted(*n, "frame"))).collect();
    let (file, listed) = (file.display(), listed.join(", "));
    match asked {
        Some(name) if !all.contains_key(name) && !all.is_empty() => {
            let what = format!("{file}: no frame of the interface {name}, the file contains {listed}");
            Err(Failure::usage(what))
        }
        None if all.len() > 1 => {
            let what = format!("{file}: the file contains the frames of several CAN interfaces: {listed}");
            Err(Failure::usage(what).next("select one of them with --interface NAME"))
        }
        _ => {
            recording.records.retain(|record| asked.is_none_or(|name| record.channel == name));
            Ok(())
        }
    }
}
