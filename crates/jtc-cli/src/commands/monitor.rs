//! `jtc monitor`: the controller live. A full view on a terminal, one line a status elsewhere.

mod view;

use std::io::IsTerminal;
use std::time::Duration;

use cli_kit::{Output, Stop, figure};
use crossterm::event::{self, Event, KeyCode, KeyModifiers};
use jtc_host::port::{Port, SerialPort};
use jtc_host::sample::is_measured;
use jtc_host::{Session, words};

use super::status;
use crate::args::MonitorArgs;
use crate::failure::Failure;
use view::View;

/// Shows statuses until `q`, Ctrl-C, or so many of them.
pub fn monitor(args: &MonitorArgs, out: &Output) -> Result<(), Failure> {
    let mut session = args.link.session()?;
    let full = !out.is_json() && std::io::stdout().is_terminal() && std::io::stdin().is_terminal();
    if full { live(&mut session, args.count) } else { lines(&mut session, args.count, out) }
}

fn lines(session: &mut Session<SerialPort>, count: Option<u64>, out: &Output) -> Result<(), Failure> {
    let stop = Stop::listen()?;
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
            let errors = if s.errors == 0 { String::new() } else { format!("   {}", words::errors_line(&s)) };
            format!(
                "{time_s:8.3} s   {:8} {:7} {:6}{errors}   {}",
                words::state(s.fsm),
                words::tes(s.tes),
                s.point,
                q.join(" ")
            )
        });
        left -= 1;
    }
    Ok(())
}

fn live(session: &mut Session<SerialPort>, count: Option<u64>) -> Result<(), Failure> {
    let mut view = View::new(session.port().name());
    let mut left = count.unwrap_or(u64::MAX);
    let mut terminal = ratatui::try_init()?;
    let mut run = || -> Result<(), Failure> {
        let mut drawn = Duration::ZERO;
        let mut heard = session.now();
        while left > 0 {
            while event::poll(Duration::ZERO)? {
                if let Event::Key(key) = event::read()? {
                    let ctrl_c =
                        key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
                    match key.code {
                        _ if ctrl_c => return Ok(()),
                        KeyCode::Char('q') | KeyCode::Esc => return Ok(()),
                        KeyCode::Char('s') => view.said = stop(session),
                        _ => view.said.clear(),
                    }
                }
            }
            if let Some(s) = session.poll(Duration::from_millis(100))? {
                heard = session.now();
                view.push(s);
                left -= 1;
            }
            view.silent = session.now().saturating_sub(heard) > Duration::from_secs(1);
            view.rate = session.statistics().status_rate();
            view.bad_bytes = session.statistics().bad_bytes;
            // 25 pictures a second are enough, however fast statuses come.
            if session.now() - drawn >= Duration::from_millis(40) || drawn == Duration::ZERO {
                drawn = session.now();
                terminal.draw(|frame| view.draw(frame))?;
            }
        }
        Ok(())
    };
    let done = run();
    ratatui::restore();
    done
}

/// Stops the motion on its path; says what became of it.
fn stop(session: &mut Session<SerialPort>) -> String {
    match session.stop() {
        Ok(()) => "stopping on the path".into(),
        Err(e) => format!("stop: {e}"),
    }
}
