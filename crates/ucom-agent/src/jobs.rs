//! Things that take longer than a request: how they are, and how they ended.
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use agent_kit::api::Problem;
use host_kit::Finding;
use ucom::Admin;
use ucom_host::master::update::UpdateReport;
use ucom_host::master::{BoardSeen, LoadForecast};

/// Jobs that are remembered.
const KEPT: usize = 256;

/// How a job is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    Running,
    Finished,
    /// Somebody cancelled it, or stopped the boards.
    Cancelled,
    Failed,
}

impl Stage {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Finished => "finished",
            Self::Cancelled => "cancelled",
            Self::Failed => "failed",
        }
    }
}

/// What a job brought about.
#[derive(Clone, Debug)]
pub(crate) enum Done {
    /// Who is there, and what is worth a word.
    Chain(Vec<BoardSeen>, Vec<String>),
    /// What is wrong.
    Findings(Vec<Finding>),
    /// What became of each board.
    Update(UpdateReport),
    /// Which boards run, with which flags, and what they make of the bus.
    Running(Vec<(u8, Admin)>, LoadForecast),
}

/// A job, while it goes on and afterwards.
#[derive(Clone, Debug)]
pub(crate) struct Job {
    pub number: u64,
    pub what: String,
    pub client: String,
    pub stage: Stage,
    pub done: Option<Done>,
    pub error: Option<Problem>,
}

#[derive(Default)]
struct Kept {
    jobs: VecDeque<Job>,
    last: u64,
}

/// The jobs of an agent.
#[derive(Default)]
pub(crate) struct Jobs(Mutex<Kept>);

impl Jobs {
    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A new one, which runs.
    pub fn add(&self, what: &str, client: &str) -> Job {
        let mut kept = self.lock();
        kept.last += 1;
        let (what, client) = (what.to_owned(), client.to_owned());
        let job = Job { number: kept.last, what, client, stage: Stage::Running, done: None, error: None };
        if kept.jobs.len() == KEPT {
            kept.jobs.pop_front();
        }
        kept.jobs.push_back(job.clone());
        job
    }

    /// One is over. False: it was before.
    pub fn end(&self, number: u64, stage: Stage, done: Option<Done>, error: Option<Problem>) -> bool {
        let mut kept = self.lock();
        let running = |job: &&mut Job| job.number == number && job.stage == Stage::Running;
        let Some(job) = kept.jobs.iter_mut().find(running) else { return false };
        (job.stage, job.done, job.error) = (stage, done, error);
        true
    }

    /// One by its number.
    pub fn get(&self, number: u64) -> Option<Job> {
        self.lock().jobs.iter().find(|job| job.number == number).cloned()
    }

    /// Those that are remembered, oldest first.
    pub fn list(&self) -> Vec<Job> {
        self.lock().jobs.iter().cloned().collect()
    }
}
