//! The trajectory that the arm follows for a job, for those who look: what is commanded stands in no status.
use std::sync::{Mutex, MutexGuard, PoisonError};

use jtc_host::Trajectory;
use jtc_host::sample::Sample;
use jtc_wire::Status;

/// What a job has the arm follow now, if one does.
#[derive(Default)]
pub struct Followed(Mutex<Option<(Trajectory, u8)>>);

impl Followed {
    fn lock(&self) -> MutexGuard<'_, Option<(Trajectory, u8)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// It follows this one until what is returned is dropped. Measurements are so many ticks old (J-62).
    pub fn begin(&self, trajectory: &Trajectory, delay_ticks: u8) -> impl Drop + use<'_> {
        *self.lock() = Some((trajectory.clone(), delay_ticks));
        Following(self)
    }

    /// The values of a status, with the commanded ones where they are known.
    pub fn sample(&self, status: &Status) -> Sample {
        match &*self.lock() {
            Some((trajectory, delay_ticks)) => Sample::following(0.0, status, trajectory, *delay_ticks),
            None => Sample::from_status(0.0, status),
        }
    }
}

struct Following<'a>(&'a Followed);

impl Drop for Following<'_> {
    fn drop(&mut self) {
        *self.0.lock() = None;
    }
}
