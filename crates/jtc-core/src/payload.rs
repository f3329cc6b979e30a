//! The payload on its way into the model (J-60): for half a second the arm that the control law computes with is between the one
//! with the last payload and the one with the next, so that neither makes a step in torque.
use jtc_dynamics::{Dynamics, LinkInertias};

use crate::JOINTS;
use crate::remembered::remembered;

/// Length of that way, ms.
pub(crate) const BLEND_MS: u16 = 500;

/// From one payload to another.
#[derive(Clone, Debug)]
pub(crate) struct PayloadBlend {
    from: LinkInertias,
    to: LinkInertias,
    left_ms: u16,
}

/// What is remembered of it: the other end of the way is the arm with its payload.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlendState {
    left_ms: u16,
    /// Numbers of the arm that the way began with, unless it has ended.
    from: Option<[[f64; 7]; JOINTS]>,
}

remembered!(BlendState { left_ms, from });

impl PayloadBlend {
    /// What is remembered of it.
    pub fn state(&self) -> BlendState {
        BlendState { left_ms: self.left_ms, from: (self.left_ms > 0).then(|| self.from.numbers()) }
    }

    /// Goes on from there, with the dynamics of the arm and all of its payload.
    pub fn restore(&mut self, state: &BlendState, dynamics: &mut Dynamics) {
        *self = Self::none(dynamics);
        if let Some(from) = &state.from {
            self.left_ms = state.left_ms.min(BLEND_MS);
            self.from = LinkInertias::from_numbers(from);
            dynamics.set_inertias(&self.between());
        }
    }

    /// The arm at the present place of the way.
    fn between(&self) -> LinkInertias {
        self.from.toward(&self.to, 1.0 - f64::from(self.left_ms) * (1.0 / BLEND_MS as f64))
    }

    /// Nothing is on its way.
    pub fn none(dynamics: &Dynamics) -> Self {
        let now = dynamics.inertias();
        Self { from: now, to: now, left_ms: 0 }
    }

    /// From the arm `now`, which may be on its way itself, to the one with the `next` payload.
    pub fn begin(&mut self, now: &Dynamics, next: &Dynamics) {
        *self = Self { from: now.inertias(), to: next.inertias(), left_ms: BLEND_MS };
    }

    /// The model was made anew, with the whole payload in it.
    pub fn forget(&mut self) {
        self.left_ms = 0;
    }

    /// Time left, ms.
    pub fn left_ms(&self) -> u16 {
        self.left_ms
    }

    /// A tick of the way.
    pub fn step(&mut self, dynamics: &mut Dynamics) {
        match self.left_ms {
            0 => {}
            1 => self.end(dynamics),
            _ => {
                self.left_ms -= 1;
                dynamics.set_inertias(&self.between());
            }
        }
    }

    /// The rest of the way at once: nobody is held by it.
    pub fn end(&mut self, dynamics: &mut Dynamics) {
        if core::mem::take(&mut self.left_ms) > 0 {
            dynamics.set_inertias(&self.to);
        }
    }
}
