//! Recorder of a controller without nodes.
extern crate std;
use std::boxed::Box;
use std::vec;
use std::vec::Vec;

use jtc_wire::{IMAGE_MAX, RawPoint};

use crate::controller::Controller;
use crate::io::{HostEvent, Inputs, Outputs};
use crate::recorder::{BLOCK_WORDS, Block, Log, Record, Recorder};
use crate::{Config, ControllerState};

/// Outputs of a tick without a frame.
pub(in crate::recorder) const OUTPUTS: Outputs = Outputs {
    bus: None,
    safety_output: true,
    status: false,
    record_line: None,
    answer_line: None,
    store: false,
    host_done: 0,
};

/// Controller in Init whose recorder has 60 empty blocks.
pub(in crate::recorder) struct Bench {
    pub controller: Box<Controller<[RawPoint; 4]>>,
    pub recorder: Recorder<Vec<Block>, 1>,
}

impl Bench {
    /// Creates a bench whose arm has a known hash.
    pub(crate) fn new() -> Self {
        let mut bench = Self::unnamed();
        for _ in 0..IMAGE_MAX {
            bench.controller.hash_arm();
        }
        assert!(bench.controller.extensions.hash.is_some());
        bench
    }

    /// Creates a bench whose arm has no hash yet.
    pub(crate) fn unnamed() -> Self {
        let mut controller = Box::new(Controller::new(Config::avena(), [RawPoint::default(); 4]));
        controller.state = ControllerState::Init;
        let recorder = Recorder::new([vec![[0; BLOCK_WORDS]; 60]], false);
        Self { controller, recorder }
    }

    /// Records ticks without inputs. The controller does not execute these ticks.
    pub(crate) fn record(&mut self, ticks: usize) {
        for _ in 0..ticks {
            self.record_event(&[]);
        }
    }

    /// Records a tick with events of hosts. The controller does not execute this tick.
    pub(crate) fn record_event(&mut self, host: &[HostEvent<'_>]) {
        self.recorder.record(&mut self.controller, &Inputs { host, ..Inputs::QUIET }, &OUTPUTS);
    }

    /// Executes and records a tick. If `differs` is `true`, the recorded safety output is not the output of the controller.
    pub(crate) fn tick(&mut self, host: &[HostEvent<'_>], differs: bool) {
        let inputs = Inputs { host, ..Inputs::QUIET };
        let outputs = self.controller.tick(&inputs);
        let recorded = Outputs { safety_output: outputs.safety_output != differs, ..outputs };
        self.recorder.record(&mut self.controller, &inputs, &recorded);
    }

    /// Records a snapshot of the present state.
    pub(crate) fn snapshot(&mut self) {
        self.recorder.snapshot(&self.controller);
        self.recorder.writer.commit();
    }

    pub(crate) fn blocks(&self) -> Vec<Block> {
        self.recorder.blocks().copied().collect()
    }

    /// Returns the number of recorded ticks after each snapshot.
    pub(crate) fn ticks_after_snapshots(&self) -> Vec<usize> {
        let mut ticks = Vec::new();
        for record in Log::new(&self.blocks()) {
            match record {
                Record::Snapshot(_) => ticks.push(0),
                Record::Tick { .. } => *ticks.last_mut().expect("a log begins with a snapshot") += 1,
            }
        }
        ticks
    }
}
