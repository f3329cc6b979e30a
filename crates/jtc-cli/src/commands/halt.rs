//! Commands `jtc stop` and `jtc traj pause`. The command sends its request directly to the controller, through an agent, or through a
//! program of this user that has opened the port.

use std::cell::Cell;
use std::panic::resume_unwind;
#[cfg(unix)]
use std::path::PathBuf;
use std::rc::Rc;
use std::time::{Duration, Instant};

use cli_kit::{ErrorKind, Failure, Output, error_object};
use jtc_client::agents::{Registered, is_same_port, registered};
use jtc_host::port::halt::{self, Answer, End, Halt};
use jtc_host::port::{Standstill, is_moving, is_paused, usb_names};
use jtc_host::{Error, LinkError, PortError, Session};
use jtc_wire::{ControllerState, Status};
use serde_json::{Value, json};

use crate::args::LinkArgs;
use crate::link::{LinkPort, who};
use crate::progress::Progress;

/// Longest time directly after a program has opened the port, or directly before it closes the port, in which the
/// program does not accept Stops.
const CHANGES_HANDS: Duration = Duration::from_millis(500);
/// Like [`CHANGES_HANDS`], for a port whose program belongs to this user and has accepted Stops before. The time is
/// longer, because this program may be waiting for the end of an earlier Stop.
const CHANGES_OWN_HANDS: Duration = Duration::from_secs(4);
/// Largest number of programs that may open the port one after another during one Stop.
const OWNERS: usize = 16;
/// Time after which a Stop, or the request to end teaching, is sent again if the statuses do not show its effect.
const AGAIN: Duration = Duration::from_millis(200);
/// Longest wait until a stopped arm is at rest.
const REST: Duration = Duration::from_secs(5);

/// Error code if the arm does not come to rest after a confirmed Stop.
const STILL_MOVING: &str = "still-moving";

/// Stops the arm, and waits until the arm is at rest.
pub(super) fn stop(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let arms = arms(link);
    let not_asked = if link.port.is_some() { Vec::new() } else { not_asked(&arms) };
    out.stream()?;
    // The Stops of all arms run in parallel, so that no Stop waits for another Stop.
    let ends: Vec<Result<Stopped, Failure>> = std::thread::scope(|scope| {
        let stops: Vec<_> =
            arms.iter().map(|arm| scope.spawn(|| stop_one(arm, &Progress::begin(out)?))).collect();
        let ends = stops.into_iter().map(|stop| stop.join().unwrap_or_else(|panic| resume_unwind(panic)));
        ends.map(|end| end.map_err(|error| error.told(Halt::Stop))).collect()
    });
    let mut failed: Vec<&Failure> = ends.iter().filter_map(|end| end.as_ref().err()).collect();
    let is_only_one = ends.len() == 1 && !failed.is_empty();
    let words: Vec<String> = ends.iter().flatten().map(Stopped::words).collect();
    if !is_only_one {
        failed.iter().for_each(|failure| out.warn(&failure.message, &failure.next.to_string()));
    }
    if !not_asked.is_empty() {
        out.note(format_args!(
            "jtc: no Stop was sent to {}, because no program of this user has that port open; `jtc stop \
             --port PATH` stops an arm there",
            not_asked.join(", ")
        ));
    }
    if is_only_one {
        return ends.into_iter().next().map_or(Ok(()), |end| end.map(drop));
    }
    let arms: Vec<Value> =
        ends.iter().map(|end| end.as_ref().map_or_else(failed_json, Stopped::json)).collect();
    let accepted = ends.iter().flatten().any(|one| one.accepted);
    let mut value = json!({ "command": "stop", "accepted": accepted, "arms": arms, "not_asked": not_asked });
    // An arm that still moves is the most urgent failure, so the command lists it first.
    failed.sort_by_key(|failure| failure.code != STILL_MOVING);
    if let Some(failure) = failed.first() {
        value["error"] = error_object(failure);
    }
    if out.is_json() || !words.is_empty() {
        out.result(&value, || words.join("\n"));
    }
    failed.first().map_or(Ok(()), |failure| Err(Failure::shown(failure.kind)))
}

fn failed_json(failure: &Failure) -> Value {
    json!({ "error": error_object(failure) })
}

/// Lists the USB ports to which the command sends no Stop.
fn not_asked(arms: &[Arm]) -> Vec<String> {
    let asked: Vec<&str> = arms.iter().filter_map(Arm::port).collect();
    if asked.is_empty() {
        // No port is known, so the command uses the only port of the computer. No other port can be listed.
        return Vec::new();
    }
    let is_asked = |name: &String| asked.iter().any(|port| is_same_port(port, name));
    usb_names().into_iter().filter(|name| !is_asked(name)).collect()
}

/// Pauses the motion on its path.
pub(super) fn pause(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let progress = Progress::begin(out)?;
    let (answer, words) = match reach(link, Halt::Pause, false).map_err(|error| error.told(Halt::Pause))? {
        Reached::Line(session) => {
            let mut session = *session;
            progress.watch(&mut session);
            session.pause().map_err(|error| match error {
                // If the controller rejects the Pause, no motion is in progress. The failure then must not warn that
                // the arm may be moving.
                Error::Link(LinkError::Refused { .. }) => error.into(),
                error => unconfirmed(error).told(Halt::Pause),
            })?;
            (None, "pausing on the path".to_owned())
        }
        Reached::Holder(answer, _) if answer.accepted || answer.moved => {
            let words = format!("pausing on the path; {}", holder(&answer));
            (Some(answer), words)
        }
        Reached::Holder(answer, _) => {
            let message = format!(
                "no motion to pause (state {}, trajectory {}); {}",
                answer.state,
                answer.trajectory,
                holder(&answer)
            );
            return Err(
                Failure::new(ErrorKind::Device, "refused", message).next("`jtc status` shows the state")
            );
        }
    };
    let value = json!({ "command": "pause", "accepted": true, "holder": answer.as_ref().map(holder_json) });
    out.result(&value, || words);
    Ok(())
}

/// Returns the arms that the command stops. If the user has specified a port, the result is the arm at that port. Otherwise the result
/// contains the arms of all agents and programs of this user. If no agent or program runs, the result is the arm at the only port.
fn arms(link: &LinkArgs) -> Vec<Arm> {
    if link.port.is_some() {
        return vec![Arm::Of { link: link.clone(), port: None }];
    }
    let of_agent = |agent: Registered| {
        let link = LinkArgs { port: Some(agent.url), ..link.clone() };
        Arm::Of { link, port: Some(agent.port) }
    };
    let agents = registered();
    #[cfg(unix)]
    let behind = behind(link, &agents);
    let mut arms: Vec<Arm> = agents.into_iter().map(of_agent).collect();
    #[cfg(unix)]
    arms.extend(behind);
    if arms.is_empty() {
        arms.push(Arm::Of { link: link.clone(), port: None });
    }
    arms
}

/// Returns the arms of the programs that have a socket for Stops. The result includes killed programs whose socket
/// still exists, because their arms may still be moving.
#[cfg(unix)]
fn behind(link: &LinkArgs, agents: &[Registered]) -> Vec<Arm> {
    let (alive, stale): (Vec<_>, Vec<_>) =
        halt::sockets().into_iter().partition(|socket| halt::is_alive(socket));
    let arm = |socket: PathBuf| {
        let port = halt::port_of(&socket);
        let link = LinkArgs { port: port.clone(), token_file: None, tls_ca: None, baud: link.baud };
        Arm::Behind { socket, link }
    };
    let is_reached = |socket: &PathBuf, port: &str| {
        alive.iter().any(|other| other.file_name() == socket.file_name())
            || agents.iter().any(|agent| is_same_port(&agent.port, port))
    };
    let left: Vec<Arm> = stale
        .into_iter()
        .filter(|socket| halt::port_of(socket).is_some_and(|port| !is_reached(socket, &port)))
        .map(arm)
        .collect();
    alive.iter().cloned().map(arm).chain(left).collect()
}

/// Arm that the command stops.
enum Arm {
    /// Arm at a port, or arm of an agent that has opened the port.
    Of { link: LinkArgs, port: Option<String> },
    /// Arm of the program that listens, or has listened, at this socket.
    #[cfg(unix)]
    Behind { socket: PathBuf, link: LinkArgs },
}

impl Arm {
    /// Returns the port of the arm, if the port is known.
    fn port(&self) -> Option<&str> {
        match self {
            Self::Of { port, .. } => port.as_deref(),
            #[cfg(unix)]
            Self::Behind { link, .. } => link.port.as_deref(),
        }
    }

    fn link(&self) -> &LinkArgs {
        match self {
            Self::Of { link, .. } => link,
            #[cfg(unix)]
            Self::Behind { link, .. } => link,
        }
    }
}

/// Result of a Stop for an arm that is at rest.
struct Stopped {
    /// `true` if the controller accepted the Stop.
    accepted: bool,
    /// `true` if the arm was moving before the Stop.
    moved: bool,
    state: String,
    trajectory: String,
    /// Answer of the program that had opened the port.
    holder: Option<Answer>,
}

impl Stopped {
    fn words(&self) -> String {
        let holder = self.holder.as_ref().map_or(String::new(), |answer| format!("; {}", holder(answer)));
        if self.moved {
            return format!("stopped: the arm is at rest{holder}");
        }
        format!("nothing was moving: state {}, trajectory {}{holder}", self.state, self.trajectory)
    }

    fn json(&self) -> Value {
        json!({
            "accepted": self.accepted,
            "moved": self.moved,
            "state": self.state,
            "trajectory": self.trajectory,
            "holder": self.holder.as_ref().map(holder_json),
        })
    }
}

fn holder(answer: &Answer) -> String {
    format!(
        "{}, process {}, has {}: its earlier requests are void, and it may request a new motion after 3 s",
        answer.program, answer.pid, answer.port
    )
}

fn holder_json(answer: &Answer) -> Value {
    json!({ "program": answer.program, "pid": answer.pid, "port": answer.port })
}

/// Progress of a Stop or Pause request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Sent {
    Nothing,
    /// The controller may have received the request.
    Unconfirmed,
    /// The controller has received the request.
    Confirmed,
}

/// Failure of a Stop or Pause; the arm may still be moving.
#[derive(Debug)]
struct NotHalted {
    sent: Sent,
    failure: Failure,
}

impl From<Failure> for NotHalted {
    fn from(failure: Failure) -> Self {
        Self { sent: Sent::Nothing, failure }
    }
}

impl NotHalted {
    fn after(sent: Sent, failure: impl Into<Failure>) -> Self {
        Self { sent, failure: failure.into() }
    }

    /// Returns this failure with its progress raised to at least `sent`: an earlier program at the port has already
    /// sent the same Stop.
    fn at_least(self, sent: Sent) -> Self {
        Self { sent: self.sent.max(sent), ..self }
    }

    /// Adds to the failure the progress of the Stop or Pause, and a reliable method to stop the arm.
    fn told(self, halt: Halt) -> Failure {
        let name = if halt == Halt::Stop { "Stop" } else { "Pause" };
        if self.failure.code == STILL_MOVING {
            return self.failure;
        }
        let what = match self.sent {
            Sent::Nothing => {
                "nothing was sent: if the arm is moving, press the emergency stop (if `jtc traj run` has the \
                 port, press space there to pause or s to stop)"
                    .to_owned()
            }
            Sent::Unconfirmed => {
                format!(
                    "the {name} was sent, but is not confirmed: if the arm is moving, press the emergency \
                     stop"
                )
            }
            Sent::Confirmed => format!(
                "the controller has confirmed the {name}, but no status shows that the arm is at rest: if \
                 the arm moves, press the emergency stop"
            ),
        };
        let next = self.failure.next.to_string();
        // If the hint of the error also mentions the emergency stop, this hint is omitted, because `what` already
        // mentions it.
        let hint = if next.contains("emergency stop") { what } else { format!("{what}. {next}") };
        Failure { next: hint.trim_end_matches([' ', '.']).to_owned().into(), ..self.failure }
    }
}

/// Connection to an arm that the command stops or pauses.
#[expect(clippy::large_enum_variant, reason = "there is one for each arm, for a moment")]
enum Reached {
    /// Separate connection to the serial line.
    Line(Box<Session<LinkPort>>),
    /// Answer of the program that has opened the port and has executed the request.
    Holder(Answer, Option<End>),
}

/// Opens the serial line, or sends the request to the program that has opened the port. `own` is `true` if a program of this user had
/// opened the port shortly before.
fn reach(link: &LinkArgs, what: Halt, mut own: bool) -> Result<Reached, NotHalted> {
    let start = Instant::now();
    loop {
        let (path, busy) = match link.open_to_halt()? {
            Ok(port) => return Ok(Reached::Line(Box::new(Session::new(port)))),
            Err(PortError::Busy { path }) => (path.clone(), PortError::Busy { path }),
            Err(error) => return Err(Failure::from(error).into()),
        };
        if let Some((answer, stands)) = ask(&path, what)? {
            return Ok(Reached::Holder(answer, stands));
        }
        own |= is_own(&path);
        let patience = if own { CHANGES_OWN_HANDS } else { CHANGES_HANDS };
        if start.elapsed() >= patience {
            return Err(Failure::from(busy).into());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Returns `true` if a program of this user accepts, or has accepted, Stops for this port.
#[cfg(unix)]
fn is_own(path: &str) -> bool {
    !halt::sockets_of(path).is_empty()
}

#[cfg(not(unix))]
fn is_own(_: &str) -> bool {
    false
}

/// Sends the request to the program that has opened this port, if the program belongs to this user and accepts
/// requests. Returns `None` if no such program answers.
#[cfg(unix)]
fn ask(path: &str, what: Halt) -> Result<Option<(Answer, Option<End>)>, NotHalted> {
    for socket in halt::sockets_of(path) {
        if let Some(answered) = ask_at(&socket, what)? {
            return Ok(Some(answered));
        }
    }
    Ok(None)
}

/// Sends the request to the program that listens at this socket. An error does not mean that nothing was sent: the
/// program may have sent the frame without answering.
#[cfg(unix)]
fn ask_at(socket: &std::path::Path, what: Halt) -> Result<Option<(Answer, Option<End>)>, NotHalted> {
    halt::ask(socket, what, &who()).map_err(|error| NotHalted::after(Sent::Unconfirmed, error))
}

#[cfg(not(unix))]
fn ask(_: &str, _: Halt) -> Result<Option<(Answer, Option<End>)>, NotHalted> {
    Ok(None)
}

/// Stops one arm, and waits until the arm is at rest. If the program that has executed the Stop ends before that, the
/// function sends the Stop again. The function uses the port directly, or the next program that has opened the port.
fn stop_one(arm: &Arm, progress: &Progress) -> Result<Stopped, NotHalted> {
    let (mut reached, mut first) = (reach_arm(arm), None::<Answer>);
    for _ in 0..OWNERS {
        let sent = if first.is_some() { Sent::Confirmed } else { Sent::Nothing };
        let (answer, end) = match reached.map_err(|error| error.at_least(sent))? {
            Reached::Line(session) => {
                return directly(*session, progress, first).map_err(|error| error.at_least(sent));
            }
            Reached::Holder(answer, end) => (answer, end),
        };
        // The command uses the port and the bit rate at which the controller has answered.
        let link = LinkArgs { port: Some(answer.port.clone()), baud: answer.baud, ..arm.link().clone() };
        let so_far = first.get_or_insert_with(|| answer.clone());
        so_far.accepted |= answer.accepted;
        so_far.moved |= answer.moved;
        match end {
            Some(End { stands: true, moved, state, trajectory, .. }) => {
                let (accepted, moved) = (so_far.accepted, so_far.moved || moved);
                return Ok(Stopped { accepted, moved, state, trajectory, holder: first });
            }
            Some(end) => return Err(NotHalted::after(Sent::Confirmed, still_moving(&end))),
            None => reached = reach(&link, Halt::Stop, true),
        }
    }
    let message = "the port of the arm is busy: other programs open it one after the other";
    let failure = Failure::new(ErrorKind::Fault, STILL_MOVING, message).next(halt::still_moving_help());
    Err(NotHalted::after(Sent::Confirmed, failure))
}

fn reach_arm(arm: &Arm) -> Result<Reached, NotHalted> {
    match arm {
        Arm::Of { link, .. } => reach(link, Halt::Stop, false),
        #[cfg(unix)]
        Arm::Behind { socket, link } => {
            let start = Instant::now();
            loop {
                if let Some((answer, end)) = ask_at(socket, Halt::Stop)? {
                    return Ok(Reached::Holder(answer, end));
                }
                // The program does not answer, because it has ended or is busy with other clients. If its port is
                // known, the command sends the Stop to this port, or to the program that has opened it now.
                if link.port.is_some() {
                    return reach(link, Halt::Stop, true);
                }
                if start.elapsed() >= CHANGES_OWN_HANDS {
                    let message = "the program that used the port has ended, and the port was not found";
                    let failure = Failure::new(ErrorKind::NoLink, "port", message);
                    return Err(failure.next("`jtc stop --port PATH` stops the arm at its port").into());
                }
                std::thread::sleep(Duration::from_millis(20));
            }
        }
    }
}

/// Stops the arm through a separate connection. If the controller rejects the Stop, no motion is in progress.
fn directly(
    mut session: Session<LinkPort>,
    progress: &Progress,
    holder: Option<Answer>,
) -> Result<Stopped, NotHalted> {
    progress.watch(&mut session);
    // `moved` becomes `true` if any status shows a motion, even a status before the controller confirms the Stop.
    let (moved, own) = (Rc::<Cell<bool>>::default(), progress.clone());
    let seen = Rc::clone(&moved);
    session.observe(move |_, status| {
        own.see(status);
        seen.set(seen.get() || is_moving(status));
    });
    let accepted = match session.stop() {
        Ok(()) => true,
        Err(Error::Link(LinkError::Refused { .. })) => false,
        Err(error) => return Err(unconfirmed(error)),
    };
    let confirmed = |error: Error| NotHalted::after(Sent::Confirmed, error);
    // In Teaching, a hand can move the arm. Therefore the command also ends Teaching, so that the controller holds
    // the arm after the Stop.
    let is_taught = |status: &Status| status.state == ControllerState::Teaching;
    let taught = session.last().is_some_and(is_taught);
    if taught {
        session.end_teaching().map_err(confirmed)?;
    }
    let (start, mut standstill) = (session.now(), Standstill::after(Halt::Stop));
    let mut written_at = start;
    loop {
        let status = session.next_status().map_err(|error| confirmed(error.into()))?;
        if session.now().saturating_sub(written_at) >= AGAIN {
            if is_taught(&status) {
                session.end_teaching().map_err(confirmed)?;
            } else if is_paused(&status) {
                match session.stop() {
                    // A rejected Stop is not an error here, because the next statuses show whether the arm is at
                    // rest.
                    Ok(()) | Err(Error::Link(LinkError::Refused { .. })) => {}
                    Err(error) => return Err(confirmed(error)),
                }
            }
            written_at = session.now();
        }
        standstill.see(session.now(), &status);
        if standstill.is_reached() {
            return Ok(Stopped {
                accepted: accepted || taught || holder.as_ref().is_some_and(|answer| answer.accepted),
                moved: moved.get() || taught || holder.as_ref().is_some_and(|answer| answer.moved),
                state: status.state.to_string(),
                trajectory: status.trajectory.to_string(),
                holder,
            });
        }
        if session.now().saturating_sub(start) >= REST {
            let end = End::of(&status, &standstill);
            return Err(NotHalted::after(Sent::Confirmed, still_moving(&end)));
        }
    }
}

fn still_moving(end: &End) -> Failure {
    let what = end.moving.as_deref().unwrap_or_default();
    let message = format!("the arm does not come to rest: {what} (state {})", end.state);
    Failure::new(ErrorKind::Fault, STILL_MOVING, message).next(end.next_step())
}

/// Returns the failure for a frame that the controller did not confirm, or that an agent rejected.
fn unconfirmed(error: Error) -> NotHalted {
    let sent = match error {
        Error::Link(LinkError::Denied { .. }) => Sent::Nothing,
        _ => Sent::Unconfirmed,
    };
    NotHalted::after(sent, error)
}
