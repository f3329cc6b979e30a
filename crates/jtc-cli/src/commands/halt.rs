//! `jtc stop` and `jtc traj pause`: directly, through an agent, or through the program of this user that has the port.

use std::cell::Cell;
use std::rc::Rc;
use std::time::{Duration, Instant};

use cli_kit::{ErrorKind, Failure, Output};
use jtc_client::agents::registered;
use jtc_host::port::halt::{self, Answer, End, Halt};
use jtc_host::port::{Standstill, is_moving, is_paused};
use jtc_host::{Error, LinkError, PortError, Session};
use jtc_wire::{ControllerState, Status};
use serde_json::{Value, json};

use crate::args::LinkArgs;
use crate::link::{LinkPort, who};
use crate::progress::Progress;

/// A program that has just opened the port, or is about to close it, does not listen for this time.
const CHANGES_HANDS: Duration = Duration::from_millis(500);
/// The same where a program of this user has listened: it may be waiting for the end of another Stop.
const CHANGES_OWN_HANDS: Duration = Duration::from_secs(4);
/// Programs that may have the port one after the other while one Stop is waited for.
const OWNERS: usize = 16;
/// Time after which a Stop, or the end of teaching, is sent again while statuses do not show it.
const AGAIN: Duration = Duration::from_millis(200);
/// Longest time in which a stopped arm comes to rest.
const REST: Duration = Duration::from_secs(5);

/// Stops the arm, and waits until it stands.
pub fn stop(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let progress = Progress::begin(out)?;
    let (mut done, mut failed) = (Vec::new(), None);
    for arm in arms(link) {
        match stop_one(&arm, &progress) {
            Ok(stopped) => done.push(stopped),
            Err(failure) => {
                // Other arms are stopped all the same.
                if let Some(earlier) = failed.replace(failure) {
                    out.failure(&earlier);
                }
            }
        }
    }
    if let Some(failure) = failed {
        done.iter().for_each(|stopped| out.note(stopped.words()));
        return Err(failure);
    }
    let arms: Vec<Value> = done.iter().map(Stopped::json).collect();
    let value = json!({ "command": "stop", "accepted": done.iter().any(|one| one.accepted), "arms": arms });
    out.result(&value, || done.iter().map(Stopped::words).collect::<Vec<_>>().join("\n"));
    Ok(())
}

/// Pauses on the path.
pub fn pause(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let progress = Progress::begin(out)?;
    let (answer, words) = match reach(link, Halt::Pause).map_err(may_be_moving)? {
        Reached::Line(mut session) => {
            progress.watch(&mut session);
            session.pause()?;
            (None, "pausing on the path".to_owned())
        }
        Reached::Holder(answer, _) if answer.accepted || answer.moved => {
            let words = format!("pausing on the path; {}", holder(&answer));
            (Some(answer), words)
        }
        Reached::Holder(answer, _) => {
            let message = format!(
                "nothing is executed that could be paused (state {}, trajectory {}); {}",
                answer.state,
                answer.trajectory,
                holder(&answer)
            );
            return Err(
                Failure::new(ErrorKind::Device, "refused", message).hint("`jtc status` shows the state")
            );
        }
    };
    let value = json!({ "command": "pause", "accepted": true, "holder": answer.as_ref().map(holder_json) });
    out.result(&value, || words);
    Ok(())
}

/// The arms that a Stop is for: that of the port which was named; else all that agents and programs of this user have, or that of the only
/// port.
fn arms(link: &LinkArgs) -> Vec<Arm> {
    if link.port.is_some() {
        return vec![Arm::Of(link.clone())];
    }
    let of_agent = |url: String| Arm::Of(LinkArgs { port: Some(url), ..link.clone() });
    let mut arms: Vec<Arm> = registered().into_iter().map(|agent| of_agent(agent.url)).collect();
    #[cfg(unix)]
    arms.extend(halt::sockets().into_iter().filter(|socket| halt::is_alive(socket)).map(Arm::Behind));
    if arms.is_empty() {
        arms.push(Arm::Of(link.clone()));
    }
    arms
}

/// An arm to stop.
enum Arm {
    /// At a port, or of an agent.
    Of(LinkArgs),
    /// Of the program that listens at this socket.
    #[cfg(unix)]
    Behind(std::path::PathBuf),
}

/// An arm that stands now.
struct Stopped {
    /// The controller accepted the Stop.
    accepted: bool,
    /// The arm was moving.
    moved: bool,
    state: String,
    trajectory: String,
    /// The program that had the port.
    holder: Option<Answer>,
}

impl Stopped {
    fn words(&self) -> String {
        let holder = self.holder.as_ref().map_or(String::new(), |answer| format!("; {}", holder(answer)));
        if self.moved {
            return format!("stopped: the arm stands{holder}");
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
    format!("{}, process {}, has {} and moves the arm no more", answer.program, answer.pid, answer.port)
}

fn holder_json(answer: &Answer) -> Value {
    json!({ "program": answer.program, "pid": answer.pid, "port": answer.port })
}

/// How an arm is reached.
enum Reached {
    /// By a line of our own.
    Line(Session<LinkPort>),
    /// By the program that has the port, which has done it.
    Holder(Answer, Option<End>),
}

/// Opens the line, or asks the program that has the port.
fn reach(link: &LinkArgs, what: Halt) -> Result<Reached, Failure> {
    let start = Instant::now();
    loop {
        let (path, busy) = match link.open_unless_busy(None)? {
            Ok(port) => return Ok(Reached::Line(Session::new(port))),
            Err(PortError::Busy { path }) => (path.clone(), PortError::Busy { path }),
            Err(error) => return Err(error.into()),
        };
        if let Some((answer, stands)) = ask(&path, what)? {
            return Ok(Reached::Holder(answer, stands));
        }
        let patience = if is_own(&path) { CHANGES_OWN_HANDS } else { CHANGES_HANDS };
        if start.elapsed() >= patience {
            return Err(busy.into());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A program of this user listens for this port, or did.
#[cfg(unix)]
fn is_own(path: &str) -> bool {
    !halt::sockets_of(path).is_empty()
}

#[cfg(not(unix))]
fn is_own(_: &str) -> bool {
    false
}

/// Asks the program that has this port, if it is one of this user that listens.
#[cfg(unix)]
fn ask(path: &str, what: Halt) -> Result<Option<(Answer, Option<End>)>, Failure> {
    for socket in halt::sockets_of(path) {
        if let Some(answered) = halt::ask(&socket, what, &who())? {
            return Ok(Some(answered));
        }
    }
    Ok(None)
}

#[cfg(not(unix))]
fn ask(_: &str, _: Halt) -> Result<Option<(Answer, Option<End>)>, Failure> {
    Ok(None)
}

/// Stops one arm. A program that was stopped may end before the arm stands: then the port is free, or another program has it.
fn stop_one(arm: &Arm, progress: &Progress) -> Result<Stopped, Failure> {
    let (mut reached, mut first) = (reach_arm(arm), None::<Answer>);
    for _ in 0..OWNERS {
        let (answer, end) = match reached.map_err(may_be_moving)? {
            Reached::Line(session) => return directly(session, progress, first),
            Reached::Holder(answer, end) => (answer, end),
        };
        let port = Some(answer.port.clone());
        let link = match arm {
            Arm::Of(link) => LinkArgs { port, ..link.clone() },
            #[cfg(unix)]
            Arm::Behind(_) => LinkArgs { port, token_file: None, tls_ca: None, baud: answer.baud },
        };
        let so_far = first.get_or_insert_with(|| answer.clone());
        so_far.accepted |= answer.accepted;
        so_far.moved |= answer.moved;
        match end {
            Some(End { stands: true, moved, state, trajectory, .. }) => {
                let (accepted, moved) = (so_far.accepted, so_far.moved || moved);
                return Ok(Stopped { accepted, moved, state, trajectory, holder: first });
            }
            Some(end) => return Err(still_moving(&end)),
            None => reached = reach(&link, Halt::Stop),
        }
    }
    let failure = Failure::new(
        ErrorKind::Fault,
        "still-moving",
        "one program after the other opens the port of the arm",
    );
    Err(failure.hint("press the emergency stop; `jtc status` shows the joints"))
}

fn reach_arm(arm: &Arm) -> Result<Reached, Failure> {
    match arm {
        Arm::Of(link) => reach(link, Halt::Stop),
        #[cfg(unix)]
        Arm::Behind(socket) => match halt::ask(socket, Halt::Stop, &who())? {
            Some((answer, end)) => Ok(Reached::Holder(answer, end)),
            None => Err(Failure::new(ErrorKind::NoLink, "port", "the program that had the port has ended")
                .hint("`jtc stop --port PATH` stops the arm at its port")),
        },
    }
}

/// Stops over a line of our own. A Stop that the controller refuses has nothing to stop.
fn directly(
    mut session: Session<LinkPort>,
    progress: &Progress,
    holder: Option<Answer>,
) -> Result<Stopped, Failure> {
    progress.watch(&mut session);
    // Statuses that come in before the Stop is confirmed count, too.
    let (moved, own) = (Rc::<Cell<bool>>::default(), progress.clone());
    let seen = Rc::clone(&moved);
    session.observe(move |_, status| {
        own.see(status);
        seen.set(seen.get() || is_moving(status));
    });
    let accepted = match session.stop() {
        Ok(()) => true,
        Err(Error::Link(LinkError::Refused { .. })) => false,
        Err(error) => return Err(error.into()),
    };
    // An arm that is taught is loose, and a Stop holds it.
    let is_taught = |status: &Status| status.state == ControllerState::Teaching;
    let taught = session.last().is_some_and(is_taught);
    if taught {
        session.teach(false)?;
    }
    let (start, mut standstill) = (session.now(), Standstill::after(Halt::Stop));
    let mut written_at = start;
    loop {
        let status = session.next_status()?;
        if session.now().saturating_sub(written_at) >= AGAIN {
            if is_taught(&status) {
                session.teach(false)?;
            } else if is_paused(&status) {
                match session.stop() {
                    // The next statuses show what the controller does.
                    Ok(()) | Err(Error::Link(LinkError::Refused { .. })) => {}
                    Err(error) => return Err(error.into()),
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
            return Err(still_moving(&End::of(&status, &standstill)));
        }
    }
}

fn still_moving(end: &End) -> Failure {
    let what = end.moving.as_deref().unwrap_or_default();
    let message = format!("the arm does not come to rest: {what} (state {})", end.state);
    Failure::new(ErrorKind::Fault, "still-moving", message)
        .hint("press the emergency stop; `jtc status` shows the joints")
}

/// Whoever wants an arm to stand and has no port must know that nothing was sent.
fn may_be_moving(failure: Failure) -> Failure {
    let hint = format!(
        "nothing was sent: if the arm is moving, press the emergency stop (where `jtc traj run` has the port, space pauses and s \
         stops there). {}",
        failure.hint
    );
    Failure { hint, ..failure }
}
