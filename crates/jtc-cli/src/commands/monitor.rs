//! `jtc monitor`: live view of the controller. On a terminal, the command shows a full view. Without a terminal, the command prints
//! one line per status.

mod joints;
mod view;

use std::time::{Duration, Instant};

use cli_kit::{Failure, Key, Output, Screen, Stop, figure};
use jtc_host::port::Port;
use jtc_host::sample::is_measured;
use jtc_host::{Session, labels};

use super::status;
use crate::args::MonitorArgs;
use crate::link::LinkPort;
use view::View;

/// Shortest interval between two updates of the view. For any rate of statuses, 25 updates per second are sufficient.
const PICTURE: Duration = Duration::from_millis(40);
/// Time without a status after which the view shows the last values as outdated.
const SILENT: Duration = Duration::from_secs(1);

/// Shows statuses until the user types `q` or Ctrl-C, or until the requested number of statuses has arrived.
pub(super) fn monitor(args: &MonitorArgs, out: &Output) -> Result<(), Failure> {
    let stop = Stop::listen()?;
    let mut session = args.link.session()?;
    let screen = if out.is_json() { None } else { Screen::take()? };
    match screen {
        Some(screen) => live(&mut session, args.count, screen, &stop),
        None => lines(&mut session, args.count, &stop, out),
    }
}

fn lines(
    session: &mut Session<LinkPort>,
    count: Option<u64>,
    stop: &Stop,
    out: &Output,
) -> Result<(), Failure> {
    let mut left = count.unwrap_or(u64::MAX);
    while left > 0 && !stop.asked() && !Output::gone() {
        let s = session.next_status()?;
        let time_s = session.now().as_secs_f64();
        let mut value = status::as_json(&s);
        value["received_s"] = time_s.into();
        out.result(&value, || {
            let position = |(j, joint): (usize, &jtc_wire::JointStatus)| {
                let text = if is_measured(&s, j) { figure(joint.position.into(), 4) } else { "-".into() };
                format!("{text:>8}")
            };
            let q: Vec<String> = s.joints.iter().enumerate().map(position).collect();
            let errors =
                if s.errors == 0 { String::new() } else { format!("   {}", labels::errors_line(&s)) };
            format!(
                "{time_s:8.3} s   {:8} {:7} {:6}{errors}   {}",
                s.state.name(),
                s.trajectory.name(),
                s.point,
                q.join(" ")
            )
        });
        left -= 1;
    }
    Ok(())
}

fn live(
    session: &mut Session<LinkPort>,
    count: Option<u64>,
    mut screen: Screen,
    stop: &Stop,
) -> Result<(), Failure> {
    let mut view = View::new(session.port().name());
    let mut left = count.unwrap_or(u64::MAX);
    let mut drawn: Option<Instant> = None;
    let mut received = session.now();
    while left > 0 && !stop.asked() && !screen.gone() {
        for key in screen.pressed() {
            match key {
                Key::Char('q') | Key::Escape => return Ok(()),
                Key::Char('s') => {
                    view.reply = "stopping".into();
                    screen.draw(|frame| view.draw(frame));
                    view.reply = stop_motion(session);
                }
                key => {
                    view.reply.clear();
                    view.scroll.key(key);
                }
            }
        }
        match session.poll(PICTURE) {
            Ok(Some(s)) => {
                received = session.now();
                view.push(s);
                left -= 1;
            }
            Ok(None) => {}
            Err(e) => return Err(view.lost(e.into())),
        }
        view.silent = Some(session.now().saturating_sub(received)).filter(|time| *time > SILENT);
        view.rate = session.statistics().status_rate();
        view.bad_bytes = session.statistics().bad_bytes;
        if drawn.is_none_or(|at| at.elapsed() >= PICTURE) {
            drawn = Some(Instant::now());
            screen.draw(|frame| view.draw(frame));
        }
    }
    Ok(())
}

/// Stops the motion on its path and returns the result as text.
fn stop_motion(session: &mut Session<LinkPort>) -> String {
    match session.stop() {
        Ok(()) => "stopping on the path".into(),
        Err(e) => format!("stop: {e}"),
    }
}
