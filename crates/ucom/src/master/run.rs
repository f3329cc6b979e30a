//! From a started board to a running control loop, in the order of the protocol: description, initial inputs, inputs,
//! parameters, life signs, loop, outputs.

use std::collections::BTreeMap;
use std::prelude::v1::*;

use super::control::{AdminChange, change_flags, start_application};
use super::io::{Kind, describe, read_initial_inputs};
use super::link::Link;
use super::load::LoadForecast;
use super::request::mca_start;
use super::{Error, Outcome};
use crate::{Admin, BufferPackage, Dimensions, ToBoard};

/// A value for an input or a parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// The edge's text, or its number.
    pub name: String,
    /// The word.
    pub value: u16,
}

/// What a board gets before its control loop starts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunBoard {
    /// Its number.
    pub board: u8,
    /// Inputs that differ from the board's initial ones.
    pub ci: Vec<Setting>,
    /// Parameters.
    pub par: Vec<Setting>,
}

/// Which boards to run, and how far.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunOptions {
    /// The boards.
    pub boards: Vec<RunBoard>,
    /// Enable the outputs at the end.
    pub active: bool,
    /// Also when the bus would be too busy or another PC is on it.
    pub force: bool,
}

/// What runs now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunReport {
    /// Flags of each board.
    pub boards: Vec<(u8, Admin)>,
    /// Forecast of the bus load with all running boards.
    pub load: LoadForecast,
}

pub(crate) async fn run(link: Link, options: RunOptions) -> Result<Outcome, Error> {
    for plan in &options.boards {
        link.board(plan.board)?;
    }
    link.become_master(options.force).await?;
    // First everything that can be refused: names, load.
    let mut described = BTreeMap::new();
    for plan in &options.boards {
        let seen = start_application(&link, plan.board).await?;
        let description = describe(&link, plan.board, &seen.info).await?;
        for (kind, settings) in [(Kind::Ci, &plan.ci), (Kind::Par, &plan.par)] {
            for setting in settings {
                description.find(plan.board, kind, &setting.name)?;
            }
        }
        described.insert(plan.board, description);
    }
    let load = forecast(&link, &described.iter().map(|(n, d)| (*n, d.dimensions())).collect());
    if load.exceeds() && !options.force {
        return Err(Error::Load(load));
    }
    let mut boards = Vec::new();
    for plan in &options.boards {
        let Some(description) = described.get(&plan.board) else { continue };
        let mut ci = read_initial_inputs(&link, plan.board, description.dimensions().ci).await?;
        for setting in &plan.ci {
            let index = description.find(plan.board, Kind::Ci, &setting.name)?;
            if let Some(place) = ci.get_mut(usize::from(index)) {
                *place = setting.value;
            }
        }
        link.with(|core| {
            if let Some(data) = core.data.get_mut(&plan.board) {
                data.ci = ci;
            }
            core.send_inputs(plan.board);
        });
        for setting in &plan.par {
            let index = description.find(plan.board, Kind::Par, &setting.name)?;
            link.with(|core| core.send_parameter(plan.board, index, setting.value));
        }
        // Nothing may start before its values have left.
        link.flush().await;
        mca_start(&link, plan.board).await?;
        repeat_inputs(&link, plan.board);
        let running = AdminChange { run: Some(true), ..Default::default() };
        let mut admin = change_flags(&link, plan.board, running).await?;
        if options.active {
            admin = change_flags(&link, plan.board, AdminChange { active: Some(true), ..running }).await?;
        }
        boards.push((plan.board, admin));
    }
    Ok(Outcome::Running(RunReport { boards, load }))
}

fn repeat_inputs(link: &Link, board: u8) {
    link.with(|core| {
        let next = core.now + core.times.ci;
        if let Some(data) = core.data.get_mut(&board) {
            data.repeat = Some(next);
        }
    });
}

/// With the boards that run already (P-19).
fn forecast(link: &Link, wanted: &BTreeMap<u8, Dimensions>) -> LoadForecast {
    link.with(|core| {
        let now = core.now;
        let mut all = wanted.clone();
        for (number, board) in core.boards.iter().filter(|(_, b)| b.running(now)) {
            if let Some(data) = core.data.get(&number) {
                let so = data.so.dimension() as u16;
                let known = Dimensions { ci: data.ci.len() as u16, so, par: 0 };
                all.entry(number).or_insert(known);
            } else if board.so_at.is_some() {
                // Its size is not known here: at least one package each way.
                all.entry(number).or_insert(Dimensions { ci: 1, so: 1, par: 0 });
            }
        }
        LoadForecast::new(all.values(), &core.profile)
    })
}

impl super::shared::Core {
    /// Writes one parameter; the shadow takes it as assumed (D-35).
    ///
    /// The package holds this word alone (DLC 4, which every receiver takes): words beside it may be unknown here and must
    /// not be touched.
    pub(crate) fn send_parameter(&mut self, board: u8, index: u16, value: u16) -> bool {
        let Some(to) = crate::Sequence::new(board) else { return false };
        let Some(data) = self.data.get_mut(&board) else { return false };
        if index >= data.par.len() {
            return false;
        }
        data.par.wrote(index, value);
        let package = BufferPackage { offset: index, count: 1, words: [value, 0, 0] };
        let payload = package.payload(self.profile.endian, true);
        let frame = crate::Frame::of(ToBoard::Par(package).function(), to, payload);
        self.queue_frame(None, frame, super::shared::Forget::Nothing);
        true
    }
}
