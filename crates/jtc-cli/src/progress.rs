//! Progress reports for other programs. With `--json`, the command writes events to stderr, with one object per line.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::{Duration, Instant};

use cli_kit::{Failure, Output};
use jtc_host::port::Port;
use jtc_host::sample::is_measured;
use jtc_host::{Session, labels, session};
use jtc_wire::{Code, ControllerState, Status, TrajectoryState};
use serde_json::{Value, json};

/// Text of the page `jtc help events`.
pub(crate) const EVENTS_HELP: &str = include_str!("progress.md");

/// Shortest interval between two sample events, or between two upload events.
const MODEST: Duration = Duration::from_millis(200);

/// State of the controller, state of the trajectory, and error bits in the last report.
type Reported = (Code<ControllerState>, Code<TrajectoryState>, u16);

/// Writer of the JSON events of a command.
#[derive(Clone)]
pub(crate) struct Progress(Rc<Inner>);

struct Inner {
    out: Output,
    /// States and error bits in the last report.
    reported: Cell<Option<Reported>>,
    sampled: Cell<Option<Instant>>,
    uploaded: Cell<Option<Instant>>,
    link: RefCell<Value>,
}

impl Progress {
    /// Starts to print events if JSON was requested.
    pub(crate) fn begin(out: &Output) -> Result<Self, Failure> {
        out.stream()?;
        Ok(Self(Rc::new(Inner {
            out: *out,
            reported: Cell::default(),
            sampled: Cell::default(),
            uploaded: Cell::default(),
            link: RefCell::default(),
        })))
    }

    /// Prints a JSON event.
    pub(crate) fn event(&self, name: &str, value: Value) {
        self.0.out.event(name, value);
    }

    /// Reports all further statuses of this session as events. Callers with a separate status observer pass the statuses to
    /// [`Progress::see`] instead.
    pub(crate) fn watch<P: Port>(&self, session: &mut Session<P>) {
        *self.0.link.borrow_mut() = json!({ "port": session.port().name(), "baud": session.port().baud() });
        let own = self.clone();
        session.observe(move |_, status| own.see(status));
    }

    /// Reports a status. The first status is reported as the event `connected`. The function reports changes of the state at once. While
    /// the arm moves, or while a user can move it by hand, the function reports measured values at a limited rate.
    pub(crate) fn see(&self, s: &Status) {
        let now = (s.state, s.trajectory, s.errors);
        let state = || json!({ "state": s.state.name(), "trajectory": s.trajectory.name(), "errors": labels::causes(s) });
        match self.0.reported.replace(Some(now)) {
            None => {
                let mut value = self.0.link.borrow().clone();
                if let (Value::Object(all), Value::Object(more)) = (&mut value, state()) {
                    all.extend(more);
                }
                self.event("connected", value);
            }
            Some(before) if before != now => self.event("state", state()),
            Some(_) => {}
        }
        if s.state.is_in(&[ControllerState::Operate, ControllerState::Teaching]) && due(&self.0.sampled) {
            self.event("sample", sample(s));
        }
    }

    /// Reports the progress of an upload. `phase` names the motion that is uploaded.
    pub(crate) fn uploading(&self, phase: &str, p: &session::Progress) {
        if due(&self.0.uploaded) || p.segments_done == p.segments {
            let fraction = if p.segments == 0 { 0.0 } else { p.segments_done as f64 / p.segments as f64 };
            let value = json!({
                "phase": phase, "fraction": fraction, "segments_done": p.segments_done, "segments": p.segments,
            });
            self.event("uploading", value);
        }
    }
}

fn due(last: &Cell<Option<Instant>>) -> bool {
    let due = last.get().is_none_or(|at| at.elapsed() >= MODEST);
    if due {
        last.set(Some(Instant::now()));
    }
    due
}

/// Returns the measured values of all joints. The value is null for a joint that does not answer.
fn sample(s: &Status) -> Value {
    let all = |value: fn(&jtc_wire::JointStatus) -> f32| -> Vec<Option<f32>> {
        let joints = s.joints.iter().enumerate();
        joints.map(|(j, joint)| is_measured(s, j).then(|| value(joint) + 0.0)).collect()
    };
    json!({
        "path_s": f64::from(s.point) * 1e-3,
        "position_rad": all(|j| j.position),
        "velocity_rad_s": all(|j| j.velocity),
        "torque_nm": all(|j| j.torque),
    })
}
