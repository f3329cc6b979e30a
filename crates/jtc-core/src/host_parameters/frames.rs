//! Conversion of the parameters in received frames, whose values have the order of the wire format. The controller refuses a frame with a
//! value that is not finite (J-06).
use jtc_dynamics::{ArmModel, Link, Origin};
use jtc_wire::{DataStatus, Floats};

use super::{HostParameters, NO_TABLE, TABLE_FLOATS, check_model};
use crate::JOINTS;
use crate::config::Config;
use crate::host::slices::{SliceOutcome, SliceProgress};
use crate::parameters::{PidGains, TableOf};

impl HostParameters {
    /// Checks and copies a model from a frame in slices, like [`set_model`](Self::set_model).
    pub(crate) fn take_model(
        &mut self,
        floats: &Floats<'_>,
        progress: SliceProgress,
        at: Option<&[f64; JOINTS]>,
        config: &Config,
    ) -> SliceOutcome {
        match read_model(floats) {
            Ok(model) => self.set_model(&model, progress, at, config),
            Err(status) => SliceOutcome::Refused(status),
        }
    }

    /// Loads the gains and the model of a stored arm. The controller checks the gains against the model when a host requests them.
    pub(crate) fn load(
        &mut self,
        pid: &Floats<'_>,
        model: &Floats<'_>,
        config: &Config,
    ) -> Result<(), DataStatus> {
        let (pid, model) = (read_pid(pid)?, read_model(model)?);
        self.check_pid(&pid, config)?;
        self.put_pid(&pid);
        check_model(&model, config)?;
        self.put_model(&model, None, config)
    }

    pub(crate) fn take_polynomial(&mut self, floats: &Floats<'_>, config: &Config) -> Result<(), DataStatus> {
        // Each joint has 4 or 6 coefficients. The coefficient with the highest index comes first.
        let count = if floats.len() == 4 * JOINTS { 4 } else { 6 };
        let mut polynomial = [[0.0; 6]; JOINTS];
        for (j, coefficients) in polynomial.iter_mut().enumerate() {
            for (i, c) in coefficients.iter_mut().take(count).rev().enumerate() {
                *c = finite(floats, count * j + i)?;
            }
        }
        self.set_polynomial(&polynomial, config)
    }

    /// Checks and copies the friction tables of a frame, in as many ticks as [`take_tables`](Self::take_tables) needs.
    pub(crate) fn take_table(
        &mut self,
        floats: &Floats<'_>,
        progress: SliceProgress,
        config: &Config,
    ) -> SliceOutcome {
        self.take_tables(|j| read_table(floats, j), progress, config)
    }
}

/// Returns the gains of all joints from `floats`, which have the order of the wire format.
pub(crate) fn read_pid(floats: &Floats<'_>) -> Result<[PidGains; JOINTS], DataStatus> {
    let mut gains = [PidGains::default(); JOINTS];
    for (j, gain) in gains.iter_mut().enumerate() {
        let at = |i: usize| finite(floats, 5 * j + i);
        *gain = PidGains { kp: at(0)?, ki: at(1)?, kd: at(2)?, int_min: at(3)?, int_max: at(4)? };
    }
    Ok(gains)
}

fn read_model(floats: &Floats<'_>) -> Result<ArmModel, DataStatus> {
    let mut next = Reader { floats, next: 0 };
    let mut model = ArmModel::default();
    for joint in &mut model.joints {
        *joint = next.origin()?;
    }
    for link in &mut model.links {
        *link = Link { origin: next.origin()?, inertia: next.take()?, mass: next.float()? };
    }
    Ok(model)
}

/// Returns value `i` of the frame. Refuses a value that is NaN, infinite or missing (J-06).
fn finite(floats: &Floats<'_>, i: usize) -> Result<f64, DataStatus> {
    floats.get(i).filter(|f| f.is_finite()).map(f64::from).ok_or(DataStatus::IncorrectValue)
}

/// Reader that returns the values of a frame one after the other and refuses values that are not finite.
struct Reader<'a> {
    floats: &'a Floats<'a>,
    next: usize,
}

impl Reader<'_> {
    fn float(&mut self) -> Result<f64, DataStatus> {
        self.next += 1;
        finite(self.floats, self.next - 1)
    }

    fn take<const N: usize>(&mut self) -> Result<[f64; N], DataStatus> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.float()?;
        }
        Ok(values)
    }

    fn origin(&mut self) -> Result<Origin, DataStatus> {
        Ok(Origin { xyz: self.take()?, rpy: self.take()? })
    }
}

fn read_table(floats: &Floats<'_>, joint: usize) -> Result<TableOf<f32>, DataStatus> {
    let mut table = NO_TABLE;
    let start = joint * TABLE_FLOATS;
    let slots =
        table.velocity.iter_mut().chain(&mut table.temperature).chain(table.torque.iter_mut().flatten());
    for (i, slot) in slots.enumerate() {
        *slot = floats.get(start + i).filter(|f| f.is_finite()).ok_or(DataStatus::IncorrectValue)?;
    }
    for axis in [&table.velocity, &table.temperature] {
        if axis.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err(DataStatus::IncorrectValue);
        }
    }
    Ok(table)
}
