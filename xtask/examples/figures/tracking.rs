//! Position errors of the arm, with and without feed-forward. The arm model of the controller has the same errors as
//! in the demo.
use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;

use jtc_core::ControllerState;
use jtc_host::Point;
use jtc_host::session::{Flow, Outcome};
use jtc_sim::{SimConfig, World};
use jtc_wire::RawPoint;

use crate::world::{Result, executing};
use crate::{path, print};

/// Position errors of an execution for each joint: sums of the squares, largest errors, and number of samples.
#[derive(Clone, Copy, Default)]
struct Errors {
    squares: [f64; 6],
    largest: [f64; 6],
    samples: u32,
}

impl Errors {
    fn add(&mut self, world: &World) {
        let telemetry = world.telemetry();
        if telemetry.state != ControllerState::Operate {
            return;
        }
        self.samples += 1;
        for (j, joint) in telemetry.joints.iter().enumerate() {
            let error = joint.position_error();
            self.squares[j] += error * error;
            self.largest[j] = self.largest[j].max(error.abs());
        }
    }
}

/// Returns the recorded motion of the existing arm and `true` if the data of the recording are available. Without these
/// data, returns a smooth motion and `false`.
fn motion() -> Result<(Vec<RawPoint>, bool)> {
    let data = std::env::var_os("OPENJTC_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/avena")),
        PathBuf::from,
    );
    let Ok(text) = std::fs::read_to_string(data.join("TrajectoryInt.csv")) else {
        return Ok((path::raw(&path::smooth(1_001))?, false));
    };
    let mut points = Vec::new();
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let numbers: Vec<i16> =
            line.split(',').skip(1).map(|cell| cell.trim().parse()).collect::<std::result::Result<_, _>>()?;
        let six = |at: usize| -> Result<[i16; 6]> {
            Ok(numbers.get(at..at + 6).ok_or("not 19 columns")?.try_into()?)
        };
        points.push(RawPoint { position: six(0)?, velocity: six(6)?, acceleration: six(12)? });
    }
    Ok((points, true))
}

/// Returns one point per millisecond, interpolated linearly, with velocity and acceleration 0. With these points, the
/// controller uses only PID and gravity compensation.
fn straight(points: &[RawPoint]) -> Result<Vec<RawPoint>> {
    let step = usize::from(path::STEP_MS);
    let mut fine = Vec::with_capacity(points.len() * step);
    for pair in points.windows(2) {
        let (from, to) = (Point::from(&pair[0]).position, Point::from(&pair[1]).position);
        for k in 0..step {
            let share = k as f64 / step as f64;
            let position = std::array::from_fn(|j| from[j] + share * (to[j] - from[j]));
            fine.push(Point { position, ..Point::default() });
        }
    }
    fine.extend(points.last().map(|last| Point { position: Point::from(last).position, ..Point::default() }));
    path::raw(&fine)
}

fn follow(name: &str, points: &[RawPoint], step_ms: u16) -> Result<()> {
    let start = points.first().map_or([0.0; 6], |point| Point::from(point).position);
    let config = SimConfig { baud: None, start, ..SimConfig::default() };
    let mut session = executing(config, points, step_ms)?;
    let errors = Rc::new(RefCell::new(Errors::default()));
    let sums = Rc::clone(&errors);
    session.port_mut().observe(move |world| sums.borrow_mut().add(world));
    let outcome = session.follow(|_| Flow::Continue);
    let finished = matches!(outcome, Ok(Outcome::Finished(_)));
    if !finished {
        eprintln!("{name} did not get to its end: {outcome:?}");
    }
    let Errors { squares, largest, samples } = *errors.borrow();
    let rms = squares.map(|sum| 1e3 * (sum / f64::from(samples.max(1))).sqrt());
    for (j, (rms, largest)) in rms.iter().zip(largest).enumerate() {
        print(&format!("{name}_joint_{}_rms_mrad", j + 1), *rms);
        print(&format!("{name}_joint_{}_max_mrad", j + 1), 1e3 * largest);
    }
    print(&format!("{name}_worst_rms_mrad"), rms.into_iter().fold(0.0, f64::max));
    print(&format!("{name}_finished"), f64::from(u8::from(finished)));
    Ok(())
}

pub(crate) fn figures() -> Result<()> {
    let (points, recorded) = motion()?;
    print("tracking_recorded_motion", f64::from(u8::from(recorded)));
    follow("tracking", &points, path::STEP_MS)?;
    follow("tracking_plain", &straight(&points)?, 1)
}
