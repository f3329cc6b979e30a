//! `jtc jog`: moves one joint at a time, with keys or at a specified velocity.

use std::time::Duration;

use cli_kit::{ErrorKind, Failure, Key, Keys, Output, Stop};
use jtc_host::arm::Arm;
use jtc_host::labels;
use jtc_host::port::halt::still_moving_help;
use jtc_host::{Error, LinkError, Session};
use jtc_wire::{ControllerState, DataStatus, JOINTS, Joint, Status, TrajectoryState};
use serde_json::json;

use crate::args::JogArgs;
use crate::link::LinkPort;
use jtc_host::session::BRING_UP;

/// Time for which one key press moves the joint. A terminal repeats a pressed key after half a second, and then at intervals that are
/// shorter than this constant.
const HELD: Duration = Duration::from_millis(150);
/// Joint velocities that the user can select with keys, rad/s.
const RATES: [f64; 6] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5];
/// Index in [`RATES`] of the highest velocity at which jogging with keys can begin.
const FIRST_MAX: usize = 2;

/// Moves the joint until a key, the time limit or a signal ends the jog. Waits until the arm is at rest.
pub(super) fn jog(args: &JogArgs, out: &Output) -> Result<(), Failure> {
    let rate = args.rate.map(|rate| if args.deg { rate.to_radians() } else { rate });
    if let Some(rate) = rate
        && !rate.is_finite()
    {
        return Err(Failure::usage(format!("{rate} is not a valid rate; nothing was sent")));
    }
    let stop = Stop::listen()?;
    let mut session = args.link.session()?;
    let mut begin = session.fresh_status()?;
    if begin.state == ControllerState::HoldPos && !labels::is_held(&begin) {
        out.note("waiting until all drives are enabled");
        let held = |s: &Status| s.state == ControllerState::Error || labels::is_held(s) || stop.asked();
        session.wait_for("HoldPos with all drives enabled", BRING_UP, held)?;
        if !stop.asked() {
            begin = session.wait_ready(BRING_UP)?;
        }
    }
    if stop.asked() {
        let message = "cancelled during the wait for the drives; no joint was jogged".into();
        return Err(Failure { message, ..Failure::of(&Error::Cancelled) });
    }
    session.settle_for_jog().map_err(refused)?;
    if let Some(joint) = args.joint.and_then(|joint| Joint::from_number(joint.into()))
        && labels::is_absent(&begin, joint.index())
    {
        let message = format!("{joint} is set absent and cannot be moved");
        return Err(Failure::new(ErrorKind::Refused, "absent-joints", message)
            .next("`jtc bench show` shows which joints are absent"));
    }
    let end = args.duration.map(|s| session.now() + Duration::from_secs_f64(s.clamp(0.0, 86_400.0)));
    let over = |session: &Session<LinkPort>| stop.asked() || end.is_some_and(|end| session.now() >= end);
    let jogged = match (args.joint.and_then(|joint| Joint::from_number(joint.into())), rate) {
        (Some(joint), Some(rate)) => one(&mut session, joint, rate, over),
        _ => with_keys(&mut session, out, over),
    };
    // The command stops the arm at once after every end of the jog, without waiting for the timeout of the controller.
    let rested = without_error(session.last().copied()).and_then(|()| rest(&mut session));
    // If an error has switched off the torque, it is the cause of all other failures. The error may also be the
    // only failure, because the jog itself can succeed. Therefore the command reports this error first.
    without_error(session.fresh_status().ok())?;
    let now = match (jogged, rested) {
        // During a held stop, the controller rejects a jog. The command then reports the held stop, because it is the
        // cause of the rejected jog.
        (_, Err(failure)) if failure.code == "held-stop" => return Err(failure),
        (jogged, rested) => jogged.and(rested)?,
    };
    let value = json!({
        "from_rad": begin.positions(),
        "to_rad": now.positions(),
    });
    out.result(&value, || moved(&begin, &now));
    Ok(())
}

fn moved(from: &Status, to: &Status) -> String {
    let ways = Joint::ALL.into_iter().zip(from.positions().into_iter().zip(to.positions()));
    let moved: Vec<String> = ways
        .filter(|(_, (from, to))| (to - from).abs() > 1e-3)
        .map(|(joint, (from, to))| {
            format!("{joint}: {from:.3} to {to:.3} rad ({:.1}°)", (to - from).to_degrees())
        })
        .collect();
    if moved.is_empty() { "nothing moved".into() } else { moved.join("\n") }
}

fn one(
    session: &mut Session<LinkPort>,
    joint: Joint,
    rate: f64,
    over: impl Fn(&Session<LinkPort>) -> bool,
) -> Result<(), Failure> {
    let mut velocity = [0.0; JOINTS];
    velocity[joint.index()] = rate;
    session.jog_while(&velocity, over).map_err(refused)
}

/// Returns the index of the initial velocity. The velocity is at most a percentage of the velocity limit of the
/// slowest joint. The percentage is the default speed of a move.
fn first_rate(session: &mut Session<LinkPort>) -> Result<usize, Failure> {
    let share = 1e-2 * session.move_speed(None)?.percent;
    let arm = if session.has_extensions() { session.device_arm()? } else { Arm::avena() };
    let limits = arm.config().joints.map(|joint| joint.velocity_max);
    Ok(rate_within(share * limits.into_iter().fold(f64::INFINITY, f64::min)))
}

/// Returns the index in [`RATES`] of the highest initial velocity that is allowed and is at most `most`, rad/s.
/// Returns 0 if all velocities are higher.
fn rate_within(most: f64) -> usize {
    RATES[..=FIRST_MAX].iter().rposition(|rate| *rate <= most).unwrap_or(0)
}

/// State of the joint that the keys move, with its selected velocity and its present motion.
struct Held {
    joint: Joint,
    rate: usize,
    /// Direction of the motion, and the time of the last key press for this direction.
    moving: Option<(f64, Duration)>,
}

impl Held {
    /// Handles a key press. Returns `false` if the key ends the jog.
    fn press(&mut self, key: Key, now: Duration) -> bool {
        match key {
            Key::Char('q' | 'Q') | Key::Escape => return false,
            Key::Char(c @ '1'..='6') => {
                let number = c.to_digit(10).unwrap_or(1) as usize;
                (self.joint, self.moving) = (Joint::from_number(number).unwrap_or(self.joint), None);
            }
            Key::Right | Key::Char('l' | 'd') => self.moving = Some((1.0, now)),
            Key::Left | Key::Char('h' | 'a') => self.moving = Some((-1.0, now)),
            Key::Up | Key::Char('+' | '=') => self.rate = (self.rate + 1).min(RATES.len() - 1),
            Key::Down | Key::Char('-' | '_') => self.rate = self.rate.saturating_sub(1),
            // Any other key stops the joint, because the user may be searching for the stop key.
            _ => self.moving = None,
        }
        true
    }

    /// Returns the commanded velocity of each joint.
    fn velocity(&mut self, now: Duration) -> [f64; JOINTS] {
        self.moving = self.moving.filter(|(_, pressed)| now < *pressed + HELD);
        let mut velocity = [0.0; JOINTS];
        velocity[self.joint.index()] = self.moving.map_or(0.0, |(direction, _)| direction * RATES[self.rate]);
        velocity
    }
}

fn with_keys(
    session: &mut Session<LinkPort>,
    out: &Output,
    over: impl Fn(&Session<LinkPort>) -> bool,
) -> Result<(), Failure> {
    let Some(mut keys) = Keys::listen() else {
        return Err(Failure::usage("jogging with keys needs a terminal; nothing was sent").next(
            "`jtc jog JOINT RATE` moves one joint while the command runs, for example `jtc jog 3 0.1`",
        ));
    };
    out.note("1..6 select a joint, hold ← or → to move it, ↑ ↓ change the rate, q ends");
    let mut held = Held { joint: Joint::ALL[0], rate: first_rate(session)?, moving: None };
    let (mut shown, mut moved) = (String::new(), false);
    while !over(session) && !keys.gone() {
        let now = session.now();
        if !keys.pressed().into_iter().all(|key| held.press(key, now)) {
            return Ok(());
        }
        let velocity = held.velocity(now);
        let moves = velocity != [0.0; JOINTS];
        if moves || moved {
            session.jog(&velocity).map_err(refused)?;
        }
        moved = moves;
        let at = session.last().map_or(0.0, |s| s.positions()[held.joint.index()]);
        let line = format!(
            "{}  {at:+.3} rad ({:+.1}°)  rate {} rad/s",
            held.joint,
            at.to_degrees(),
            RATES[held.rate]
        );
        if line != shown && !out.is_json() {
            eprint!("\r\x1b[K{line}");
            shown = line;
        }
        session.pass(Duration::from_millis(20))?;
    }
    Ok(())
}

/// Returns the failure of a jog that the controller rejected, with the reason.
fn refused(error: Error) -> Failure {
    let failure = Failure::of(&error);
    match &error {
        Error::Link(LinkError::Refused { state, trajectory, code, .. }) => {
            let next = match code {
                DataStatus::IncorrectValue => {
                    "the rate is above the velocity limit of the joint: see `jtc arm show`"
                }
                _ if *state != ControllerState::HoldPos => "jogging needs the state HoldPos: `jtc recover`",
                _ if *trajectory == TrajectoryState::Pause => "a trajectory is paused: `jtc traj stop` first",
                _ => "the arm is not at rest yet: see `jtc status`",
            };
            failure.next(next)
        }
        _ => failure,
    }
}

/// Returns an error if the controller is in the state Error and no longer holds the arm.
fn without_error(status: Option<Status>) -> Result<(), Failure> {
    match status {
        Some(status) if status.state == ControllerState::Error => {
            let reason = labels::errors_line(&status);
            Err(Failure::new(
                ErrorKind::Fault,
                "jog-fault",
                format!("the controller has released the arm: {reason}"),
            )
            .next(labels::next_step(&status)))
        }
        _ => Ok(()),
    }
}

/// Waits until every joint is at rest, and returns the last status. If a joint does not come to rest, the failure is
/// `still-moving`.
fn rest(session: &mut Session<LinkPort>) -> Result<Status, Failure> {
    eprint!("{}", if std::io::IsTerminal::is_terminal(&std::io::stderr()) { "\r\x1b[K" } else { "" });
    session.jog_to_rest().map_err(|error| Failure::of(&error))?.ok_or_else(|| {
        Failure::new(ErrorKind::Fault, "still-moving", "the arm still moves").next(still_moving_help())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j58_a_key_counts_for_a_moment_and_its_joint_only() {
        let ms = Duration::from_millis;
        let mut held = Held { joint: Joint::ALL[0], rate: 3, moving: None };
        assert!(held.press(Key::Char('3'), ms(0)) && held.press(Key::Right, ms(10)));
        assert_eq!(held.velocity(ms(20)), [0.0, 0.0, 0.1, 0.0, 0.0, 0.0]);
        assert_eq!(held.velocity(ms(159)), [0.0, 0.0, 0.1, 0.0, 0.0, 0.0]);
        assert_eq!(held.velocity(ms(160)), [0.0; JOINTS]);
        // Any other key stops the joint, even a key that selects another joint.
        for key in [Key::Char('x'), Key::Char('4'), Key::Home] {
            held.press(Key::Left, ms(200));
            assert_ne!(held.velocity(ms(201)), [0.0; JOINTS]);
            held.press(key, ms(202));
            assert_eq!(held.velocity(ms(203)), [0.0; JOINTS], "{key:?}");
        }
        (0..9).for_each(|_| assert!(held.press(Key::Up, ms(0))));
        assert_eq!(RATES[held.rate], 0.5);
        assert!(!held.press(Key::Char('q'), ms(0)) && !held.press(Key::Escape, ms(0)));
    }

    #[test]
    fn the_keys_begin_with_a_rate_that_is_slow_for_the_arm() {
        let first = [
            (10.0, 0.05),
            (0.5, 0.05),
            (0.05, 0.05),
            (0.049, 0.02),
            (0.02, 0.02),
            (0.015, 0.01),
            (0.01, 0.01),
            (0.003, 0.01),
            (0.0, 0.01),
            (f64::NAN, 0.01),
        ];
        for (most, rate) in first {
            assert_eq!(RATES[rate_within(most)], rate, "{most}");
        }
    }
}
