//! Application of a simulated board, connected to the CI, SO and PAR words of the protocol.
use super::file::BoardConfig;
use super::model::Model;
use super::texts::{Texts, latin1};
use ucom::Dimensions;
use ucom::node::{Application, Text};

/// Time in µs from the start of the application until it accepts requests.
const UP_US: u64 = 60_000;
/// Longest time, in s, for which one call simulates the axes.
const MOST_S: f64 = 5.0;

/// Application of a simulated board: its model, connected to the CI, SO and PAR words of the protocol.
#[derive(Clone, Debug)]
pub(super) struct SimApplication {
    model: Model,
    texts: Texts,
    received: Vec<u16>,
    ci: Vec<u16>,
    par: Vec<u16>,
    so: Vec<u16>,
    up_at: u64,
    /// Time up to which the model has been simulated, µs.
    moved_us: u64,
    running: bool,
    active: bool,
    debug: Vec<Vec<u8>>,
}

impl SimApplication {
    pub(crate) fn new(config: &BoardConfig) -> Self {
        let model = Model::new(&config.axes);
        let name = format!("{} control", config.description);
        Self {
            texts: Texts::new(&name, model.ci_names(), model.so_names(), model.par_names()),
            received: model.initial_ci().to_vec(),
            ci: model.initial_ci().to_vec(),
            par: model.initial_par().to_vec(),
            so: model.outputs().collect(),
            model,
            up_at: 0,
            moved_us: 0,
            running: false,
            active: false,
            debug: Vec::new(),
        }
    }

    /// Simulates the axes up to `now_us`, even if the application does not run.
    pub(crate) fn pass(&mut self, now_us: u64) {
        // After `MOST_S`, an axis without drive is at rest, so a longer simulation is not necessary.
        let seconds = (now_us.saturating_sub(self.moved_us) as f64 * 1e-6).min(MOST_S);
        self.moved_us = self.moved_us.max(now_us);
        let driven = self.running && self.active;
        if let Some(text) = self.model.advance(seconds, driven, &self.ci, &self.par) {
            self.print(&text);
        }
    }

    /// Handles a power loss. The axes are not driven any more, and the application loses its state.
    pub(crate) fn power_lost(&mut self, now_us: u64) {
        self.pass(now_us);
        self.stop();
        self.debug.clear();
    }

    /// Returns `true` if the outputs of the board drive the axes.
    pub(crate) fn is_driven(&self) -> bool {
        self.running && self.active
    }

    fn print(&mut self, text: &str) {
        if self.debug.len() < 32 {
            self.debug.push(latin1(text));
        }
    }
}

impl Application for SimApplication {
    fn start(&mut self, now_us: u64) {
        self.pass(now_us);
        self.received.copy_from_slice(self.model.initial_ci());
        self.ci.copy_from_slice(self.model.initial_ci());
        self.par.copy_from_slice(self.model.initial_par());
        self.up_at = now_us + UP_US;
        self.print("application started");
    }

    fn stop(&mut self) {
        (self.running, self.active) = (false, false);
    }

    fn is_up(&mut self, now_us: u64) -> bool {
        now_us >= self.up_at
    }

    fn dimensions(&self) -> Dimensions {
        let [ci, so, par] = [self.received.len(), self.so.len(), self.par.len()].map(|n| n as u16);
        Dimensions { ci, so, par }
    }

    fn text(&self, text: Text) -> &[u8] {
        self.texts.get(text)
    }

    fn initial_ci(&self, index: u16) -> u16 {
        self.model.initial_ci().get(usize::from(index)).copied().unwrap_or(0)
    }

    fn ci(&mut self) -> &mut [u16] {
        &mut self.received
    }

    fn latch_ci(&mut self) {
        self.ci.copy_from_slice(&self.received);
    }

    fn par(&mut self) -> &mut [u16] {
        &mut self.par
    }

    fn sample_so(&mut self) {
        self.so.clear();
        self.so.extend(self.model.outputs());
    }

    fn so(&self) -> &[u16] {
        &self.so
    }

    fn run(&mut self, now_us: u64, running: bool) {
        self.pass(now_us);
        self.running = running;
        self.print(if running { "control loop runs" } else { "control loop ended" });
    }

    fn step(&mut self, now_us: u64) {
        self.pass(now_us);
    }

    fn outputs(&mut self, active: bool) {
        self.active = active;
    }

    fn debug_text(&self) -> Option<&[u8]> {
        self.debug.first().map(Vec::as_slice)
    }

    fn debug_done(&mut self) {
        if !self.debug.is_empty() {
            self.debug.remove(0);
        }
    }
}
