//! State of the worker thread: the port, its session, and the arm model for the motion checks.

use std::cell::Cell;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use jtc_client::agents::{owner_of, registered};
use jtc_client::{AgentPort, Options};
use jtc_core::Payload;
use jtc_host::port::SerialPort;
use jtc_host::port::sim::SimPort;
use jtc_host::session::BRING_UP;
use jtc_host::{Arm, Port, Sample, Session};
use jtc_sim::{FaultPlan, SimConfig, World};

use super::port::{AnyPort, Line};
use super::shared::{Asked, Shared};
use super::tape::Tape;
use crate::error::Failure;

/// Maximum wait for a status between jobs.
const IDLE: Duration = Duration::from_millis(10);
/// Maximum delay for which a simulator catches up with real time. After a larger delay, the simulator skips the missed time.
const BEHIND: Duration = Duration::from_millis(100);

/// A simulated controller with its arm.
pub(crate) struct Simulated {
    pub seed: u64,
    /// Speed as a factor of real time. `None` means as fast as possible. Simulated time then passes only while a caller waits.
    pub speed: Option<f64>,
    pub faults: FaultPlan,
    /// Payload of the simulated arm that the controller does not know.
    pub payload: Payload,
}

/// Kind of connection.
pub(crate) enum Way {
    Simulated(Box<Simulated>),
    /// Serial port and its bit rate. If an agent owns the port, the connection uses the agent.
    Serial {
        path: String,
        baud: u32,
    },
    /// Agent at `http://…` or `https://…`.
    Agent {
        url: String,
    },
}

/// Target and credentials of a connection.
pub(crate) struct Target {
    pub way: Way,
    /// Arm that the caller passed to `connect`.
    pub arm: Option<Arc<Arm>>,
    /// Name of this program that agents show to other clients.
    pub name: String,
    pub token: Option<String>,
    pub certificates: Option<PathBuf>,
}

/// State of the worker.
pub(crate) struct WorkerState {
    pub session: Session<AnyPort>,
    /// Arm that the caller passed, or the built-in arm. If the controller has extensions, the arm of the controller is used instead.
    pub arm: Arc<Arm>,
    /// `true` if the caller passed an arm to `connect`.
    pub named: bool,
    pub shared: Arc<Shared>,
    pub tape: Rc<Tape>,
    /// `true` if time passes between calls, as on a real controller.
    time_passes: bool,
    /// `true` if this connection has enabled Teaching, or has possibly enabled it.
    pub teaching: bool,
}

impl WorkerState {
    /// Connects to the controller. A simulated controller receives its parameters and then holds its arm.
    pub(crate) fn open(target: Target, shared: Arc<Shared>, asked: &Asked) -> Result<Self, Failure> {
        let arm = target.arm.clone().unwrap_or_else(|| Arc::new(Arm::avena()));
        let (tape, pace) = (Rc::<Tape>::default(), Rc::<Cell<Option<f64>>>::default());
        let (port, speed, stored) = match target.way {
            Way::Simulated(simulated) => {
                let speed = simulated.speed;
                let (port, stored) = simulator(*simulated, &arm, &target.arm, &tape, &pace)?;
                (Line::Simulated(Box::new(port)), Some(speed), stored)
            }
            Way::Agent { ref url } => (Line::Other(agent(url, &target)?), None, false),
            Way::Serial { ref path, baud } => (Line::Other(serial(path, baud, &target)?), None, false),
        };
        let time_passes = speed.is_none_or(|speed| speed.is_some());
        let session = Session::new(AnyPort::new(port, Arc::clone(&shared)));
        let named = target.arm.is_some();
        let mut state = Self { session, arm, named, shared, tape, time_passes, teaching: false };
        observe(&mut state.session, &state.shared);
        if let Some(speed) = speed {
            state.bring_up(stored, asked)?;
            pace.set(speed);
        } else {
            // If the controller does not answer, the error is reported here and not at the first motion.
            state.session.fresh_status()?;
        }
        Ok(state)
    }

    /// Brings a simulated controller to position hold, as fast as possible.
    fn bring_up(&mut self, stored: bool, asked: &Asked) -> Result<(), Failure> {
        let status = self.session.fresh_status()?;
        if status.jtc_init != 0 && stored {
            self.session.use_defaults()?;
        } else if status.jtc_init != 0 {
            let set = self.arm.parameter_set();
            self.session.push_until(&set, || asked.is_halted(), |_| {})?;
        }
        self.session.wait_ready_until(2 * BRING_UP, || asked.is_halted())?;
        Ok(())
    }

    /// Returns the name of the port.
    pub(crate) fn port_name(&self) -> String {
        self.session.port().name()
    }

    /// Begins a job. The port sends frames that move the arm until a Stop is requested. The job does not mistake a late answer to an
    /// earlier Stop for its own answer.
    pub(crate) fn begin(&mut self, asked: &Asked) -> Result<(), Failure> {
        self.session.port_mut().begin(asked.at());
        if let Some(time) = self.session.port().unsettled() {
            self.session.pass(time)?;
        }
        Ok(())
    }

    /// Returns `true` if time passes between calls. Statuses then also arrive without a job.
    pub(crate) fn time_passes(&self) -> bool {
        self.time_passes
    }

    /// Reads statuses between jobs. If the line is lost, the next job reports the loss.
    pub(crate) fn idle(&mut self) {
        match self.session.poll(IDLE) {
            Ok(_) => {}
            Err(_) => std::thread::sleep(IDLE),
        }
    }

    /// Returns the arm of the controller. If the controller cannot report its arm, returns the arm that the caller passed, or the
    /// built-in arm.
    pub(crate) fn device_arm(&mut self) -> Result<Arm, Failure> {
        let mut arm = match self.session.info()? {
            None => return Ok((*self.arm).clone()),
            Some(info) if self.arm.hash().ok().flatten() == Some(info.hash) => return Ok((*self.arm).clone()),
            Some(_) => self.session.device_arm()?,
        };
        // A controller does not store poses, so the poses are copied from the arm of this connection.
        arm.poses = self.arm.poses.clone();
        Ok(arm)
    }

    /// Like [`Self::device_arm`], for motions. Returns an error if the arm that the caller passed differs from the arm of the
    /// controller.
    pub(crate) fn arm_to_move(&mut self) -> Result<Arm, Failure> {
        let arm = self.device_arm()?;
        let differences = if self.named { self.arm.differences(&arm) } else { Vec::new() };
        let Some(first) = differences.first() else { return Ok(arm) };
        Err(Failure::refused(
            "other-arm",
            format!(
                "the controller has another arm than {}: {} differences, the first: {first}; nothing was \
                 sent",
                self.arm.name,
                differences.len()
            ),
            "send this arm with `robot.push_arm(arm)` in Init or Error, or connect without `arm=` to use the \
             controller's arm",
        ))
    }

    /// Returns an error if the arm that the caller passed differs from the arm of the controller.
    pub(crate) fn same_arm(&mut self) -> Result<(), Failure> {
        if self.named { self.arm_to_move().map(drop) } else { Ok(()) }
    }
}

/// Opens a port to a simulated controller. The returned flag is `true` if the arm is stored in the memory of the controller.
fn simulator(
    simulated: Simulated,
    arm: &Arm,
    named: &Option<Arc<Arm>>,
    tape: &Rc<Tape>,
    pace: &Rc<Cell<Option<f64>>>,
) -> Result<(SimPort, bool), Failure> {
    let image = named.as_ref().map(|arm| arm.image()).transpose();
    let image = image.map_err(|error| Failure::usage(format!("{}: {error}", arm.name)))?.flatten();
    let stored = image.is_some();
    let mut config = SimConfig::new(arm.config(), &arm.parameters()).with_drive_torques(arm.drive_torque_max);
    if stored {
        // The controller reads the arm from its memory, as on a board.
        (config.controller, config.stored_arm) = (jtc_core::Config::avena(), image);
    }
    let Simulated { seed, faults, payload, .. } = simulated;
    (config.seed, config.faults, config.arm.payload) = (seed, faults, payload);
    let mut port = SimPort::new(World::new(config));
    let (tape, pace) = (Rc::clone(tape), Rc::clone(pace));
    let mut since = None;
    port.observe(move |world| {
        if world.ticked() {
            tape.push(&Sample::from(world.telemetry()));
        }
        let Some(speed) = pace.get() else { return };
        let now = Duration::from_micros(world.now_us());
        let (start, zero) = *since.get_or_insert((Instant::now(), now));
        let due = (now - zero).div_f64(speed);
        let real = start.elapsed();
        if real > due + BEHIND {
            since = Some((Instant::now(), now));
        }
        std::thread::sleep(due.saturating_sub(real));
    });
    Ok((port, stored))
}

/// Opens a line through an agent.
fn agent(url: &str, target: &Target) -> Result<Box<dyn Port>, Failure> {
    let own = registered().into_iter().find(|agent| agent.url == url.trim_end_matches('/'));
    let token = match (&target.token, &own) {
        (Some(token), _) => Some(token.clone()),
        (None, Some(own)) => operator(&own.token_file),
        (None, None) => None,
    };
    let certificates =
        target.certificates.clone().or_else(|| own.as_ref().and_then(|own| own.certificate.clone()));
    // The policy is Stop, because a motion must not continue after this program has disconnected.
    let options = Options { name: target.name.clone(), token, policy: Some("stop"), certificates };
    Ok(Box::new(AgentPort::open(url, &options)?))
}

/// Reads the token of the operator from the token file of the local agent. Without a token, the agent itself refuses the connection.
fn operator(file: &std::path::Path) -> Option<String> {
    #[derive(serde::Deserialize)]
    struct Tokens {
        operator: String,
    }
    let tokens: Tokens = toml::from_str(&std::fs::read_to_string(file).ok()?).ok()?;
    Some(tokens.operator)
}

/// Opens a serial port, or the line of the agent that owns the port.
fn serial(path: &str, baud: u32, target: &Target) -> Result<Box<dyn Port>, Failure> {
    match owner_of(path) {
        Some(owner) => agent(&owner.url, target),
        None => Ok(Box::new(SerialPort::open(path, baud)?)),
    }
}

/// Publishes every status that the session receives from now on, in any procedure.
pub(crate) fn observe(session: &mut Session<AnyPort>, shared: &Arc<Shared>) {
    let shared = Arc::clone(shared);
    session.observe(move |_, status| shared.publish(status));
}
