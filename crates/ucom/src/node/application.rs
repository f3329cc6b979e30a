//! Application level of a board: start, control loop, inputs and parameters (D-30 to D-37), and supervision of the PC (D-50).

use super::{App, Application, Flash, Node, Pins, Store};
use crate::admin::Admin;
use crate::buffer::BufferPackage;
use crate::error_code::ErrorCode;
use crate::profile::CiLatch;

/// Debug text that reports the loss of the PC's heartbeat. The board sends this text only if the PC has requested
/// debug texts.
pub(super) const PC_LOST: &[u8] = b"PC alive lost";

impl<F: Flash, P: Pins, S: Store, A: Application> Node<F, P, S, A> {
    /// Stops the application, makes its outputs safe and returns the board to the exloader.
    pub(super) fn stop_application(&mut self) {
        self.stop_loop();
        if self.app != App::Stopped {
            self.application.stop();
        }
        self.app = App::Stopped;
        (self.active, self.debug, self.global_debug) = (false, false, false);
        self.alive_at = None;
        self.outbox.forget_application();
        self.jobs.forget_application();
    }

    /// Queues MCA_DSP_READY, the first heartbeat and the flags after the application has started (D-30, D-37).
    pub(super) fn application_up(&mut self) {
        self.app = App::Up;
        self.outbox.mca_ready = true;
        self.alive_at = Some(self.now_us);
        self.send_admin_unasked();
    }

    /// Starts the control loop. While the control loop runs, the PC must send heartbeats (D-50).
    pub(super) fn run_loop(&mut self) {
        if self.app != App::Up {
            return;
        }
        self.app = App::Running;
        self.application.run(self.now_us, true);
        self.pc_lost_at = Some(self.after_ms(self.config.profile.alive_pc_lost));
        self.step_at = Some(self.now_us.saturating_add(self.config.control_period_us));
        self.so_at = Some(self.after_ms(self.config.profile.so_period));
    }

    /// Ends the control loop. The function makes the outputs safe, even if the control loop was not running.
    pub(super) fn stop_loop(&mut self) {
        self.set_active(false);
        if self.app == App::Running {
            self.app = App::Up;
            self.application.run(self.now_us, false);
        }
        self.pc_lost_at = None;
        self.step_at = None;
        self.so_at = None;
        self.jobs.so = None;
    }

    pub(super) fn set_active(&mut self, active: bool) {
        self.application.outputs(active);
        self.active = active;
    }

    /// Handles the loss of the PC's heartbeat (D-50).
    pub(super) fn pc_lost(&mut self) {
        self.stop_loop();
        self.initial_ci();
        self.send_admin_unasked();
        self.jobs.own_text = Some(PC_LOST);
    }

    /// Sets the controller inputs to their initial values.
    pub(super) fn initial_ci(&mut self) {
        for index in 0..self.application.dimensions().ci {
            let word = self.application.initial_ci(index);
            if let Some(place) = self.application.ci().get_mut(usize::from(index)) {
                *place = word;
            }
        }
        self.application.latch_ci();
    }

    /// Handles MCA_ADMIN_DATA that the PC sent (D-37).
    pub(super) fn set_admin(&mut self, admin: Admin) {
        match (self.app, admin.run) {
            (App::Up, true) => self.run_loop(),
            (App::Running, false) => self.stop_loop(),
            _ => {}
        }
        let active = admin.active && admin.run;
        if active != self.active {
            self.set_active(active);
        }
        (self.debug, self.global_debug) = (admin.debug, admin.global_debug);
        self.answer_admin();
    }

    /// Handles controller inputs that the PC sent (D-34).
    pub(super) fn receive_ci(&mut self, package: &BufferPackage) {
        let dimension = usize::from(self.application.dimensions().ci);
        let applied = put(package, self.application.ci(), dimension);
        let whole = match self.config.profile.ci_latch {
            CiLatch::Frame => true,
            CiLatch::Last => package.covers_last(dimension),
        };
        if !applied {
            self.error(ErrorCode::Data);
        } else if whole {
            self.application.latch_ci();
        }
    }

    /// Handles parameters that the PC sent (D-35).
    pub(super) fn receive_par(&mut self, package: &BufferPackage) {
        let dimension = usize::from(self.application.dimensions().par);
        if !put(package, self.application.par(), dimension) {
            self.error(ErrorCode::Data);
        }
    }
}

/// Copies the words of a package into a buffer of the application. The function returns `true` if the package starts inside the buffer.
fn put(package: &BufferPackage, buffer: &mut [u16], dimension: usize) -> bool {
    let len = buffer.len().min(dimension);
    buffer.get_mut(..len).is_some_and(|buffer| package.apply(buffer).is_ok())
}
