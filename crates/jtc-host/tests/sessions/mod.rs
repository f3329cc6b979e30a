//! Tests of sessions with the complete simulated controller, and with a scripted controller.

mod checked;
mod denied;
mod from_outside;
mod heavier;
mod imported;
mod link;
mod presence;
mod recover;
mod runs;
mod scripted;

use std::time::Duration;

use jtc_core::Config;
use jtc_host::port::sim::SimPort;
use jtc_host::{Session, Trajectory, plan};
use jtc_sim::{Fault, FaultKind, SimConfig, Trigger, World};
use jtc_wire::ControllerState;

type Sim = Session<SimPort>;

fn session(baud: Option<u32>) -> Sim {
    Session::new(SimPort::new(World::new(SimConfig { baud, ..SimConfig::default() })))
}

/// Returns a session in HoldPos with the default parameters.
fn ready(baud: Option<u32>) -> Sim {
    let mut s = session(baud);
    s.use_defaults().unwrap();
    s.wait_hold(Duration::from_secs(15)).unwrap();
    s
}

/// Returns a motion of joint 1 from the zero pose to `to`, at `percent` % of the limits.
fn motion(to: f64, percent: f64) -> Trajectory {
    plan::joint_move(&[0.0; 6], &[to, 0.0, 0.0, 0.0, 0.0, 0.0], &Config::avena(), percent).unwrap()
}

fn inject(s: &mut Sim, kind: FaultKind, trigger: Trigger, ms: u64) {
    s.port_mut().world_mut().inject(Fault { kind, trigger, duration_ms: Some(ms) });
}

/// Injects a fault and waits for the error that it causes.
fn fail(s: &mut Sim, kind: FaultKind, ms: u64) {
    inject(s, kind, Trigger::At(0), ms);
    s.wait_for("error", Duration::from_secs(1), |s| s.state == ControllerState::Error).unwrap();
}
