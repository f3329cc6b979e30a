//! The same controller on this machine.
use std::collections::VecDeque;

use jtc_core::{Config, Controller, Inputs, POINTS_MAX, Telemetry};
use jtc_sim::Worked;
use jtc_wire::{FrameRef, FrameStatus, LinkEvent, RawPoint, Response, Status};

use super::flight::Flight;
use super::host::Host;

/// Causes of a start after which the controller says that it failed (J-12): watchdog, hard fault, panic.
const FAILED: [u32; 3] = [4, 5, 6];

/// The controller beside the board.
pub struct Shadow {
    controller: Controller<Vec<RawPoint>>,
    /// Lines of the events whose records have not gone out.
    awaiting: VecDeque<usize>,
    /// What the last tick worked off.
    pub worked: Option<Worked>,
}

impl Shadow {
    /// Beside a board that has just started.
    pub fn new(cause: u32) -> Self {
        let points = vec![RawPoint::default(); POINTS_MAX];
        let mut controller = Controller::new(Config::default(), points);
        if FAILED.contains(&cause) {
            controller.raise_internal();
        }
        Self { controller, awaiting: VecDeque::new(), worked: None }
    }

    /// What the last tick computed.
    pub fn telemetry(&self) -> &Telemetry {
        self.controller.telemetry()
    }

    /// Settings.
    pub fn config(&self) -> &Config {
        self.controller.config()
    }

    /// Runs the tick that the board recorded; everything that comes out must be the board's, to the bit.
    pub fn tick(&mut self, flight: &Flight, hosts: &mut [Host; 2]) {
        let line = usize::from(flight.event.line);
        let bytes;
        let host = match flight.event.kind {
            0 => None,
            1 => {
                bytes = hosts[line].frame(&flight.event);
                FrameRef::new_checked(&bytes).map(LinkEvent::Frame)
            }
            _ => {
                let status = FrameStatus::from_byte(flight.event.status).expect("a status code");
                Some(LinkEvent::Bad(Response::bad(flight.event.frame_type, status, flight.event.len)))
            }
        };
        let outputs = self.controller.tick(&Inputs {
            bus: &flight.heard,
            bus_state: flight.bus(),
            safety_input: flight.safety_input,
            host,
            status_free: flight.status_free,
        });
        self.worked = None;
        if outputs.host_done {
            self.worked = host.map(|event| match event {
                LinkEvent::Frame(frame) => Worked::Frame(frame.frame_type as u8),
                LinkEvent::Bad(response) => Worked::Bad(response.status),
            });
            if flight.event.kind != 0 {
                self.awaiting.push_back(line);
            }
            if flight.event.kind == 1 {
                hosts[line].done(&flight.event);
            }
        }
        if outputs.status {
            let status = *self.controller.status_frame();
            self.expect_status(&status, hosts);
        }

        let t = self.controller.telemetry();
        let tick = flight.tick;
        let torque = t.joints.map(|joint| joint.torque.to_bits());
        assert_eq!(torque, flight.torque.map(f64::to_bits), "tick {tick}: bits of the torques");
        assert_eq!(outputs.bus, flight.sent, "tick {tick}: frame on the joint bus");
        let ours = (t.state as u8, t.tes as u8, t.point, t.errors, outputs.safety_output);
        let board = (flight.state, flight.tes, flight.point, flight.errors, flight.safety_output);
        assert_eq!(ours, board, "tick {tick}: state, execution, point, errors, safety output");
        let done = (outputs.host_done && host.is_some(), outputs.status);
        assert_eq!(done, (flight.host_done && host.is_some(), flight.status), "tick {tick}: host");
    }

    /// J-04: the record goes to the line of its frame, the other gets the same status without one.
    fn expect_status(&mut self, bytes: &[u8], hosts: &mut [Host; 2]) {
        let status = Status::parse(bytes).expect("the controller makes good statuses");
        let line = status.response().and_then(|_| self.awaiting.pop_front());
        let without = Status { response: Response::default(), ..status }.emit();
        for (n, host) in hosts.iter_mut().enumerate() {
            let bytes = if line == Some(n) { bytes } else { &without };
            host.expected.extend(bytes);
        }
    }
}
