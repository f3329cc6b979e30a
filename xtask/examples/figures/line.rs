//! Time to upload 12 000 points over serial lines with three bit rates, in virtual time.
use jtc_host::session::Flow;
use jtc_host::{Arm, CheckOptions, CheckedTrajectory, Trajectory};
use jtc_sim::SimConfig;

use crate::world::{Result, holding};
use crate::{path, print};

pub(crate) fn figures() -> Result<()> {
    let trajectory = Trajectory { step_ms: path::STEP_MS, points: path::smooth(12_000) };
    let checked = CheckedTrajectory::check(&trajectory, &Arm::avena(), &[0.0; 6], &CheckOptions::default())?;
    for baud in [115_200, 921_600, 3_000_000] {
        let mut session = holding(SimConfig { baud: Some(baud), ..SimConfig::default() })?;
        let report = session.upload(&checked, |_| Flow::Continue)?;
        let share = report.line_share.ok_or("a line with a rate has a share")?;
        print(&format!("upload_{baud}_share"), share);
        print(&format!("upload_{baud}_s"), report.time_s);
    }
    Ok(())
}
