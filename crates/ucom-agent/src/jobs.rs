//! Jobs: requests that take longer than one HTTP request. Each job has a stage and a result.
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use agent_kit::api::Problem;
use host_kit::Finding;
use ucom::Admin;
use ucom_host::master::update::UpdateReport;
use ucom_host::master::{BoardSeen, LoadForecast};

/// Maximum number of jobs that the agent stores.
const KEPT: usize = 256;

/// Stage of a job: running, or the outcome after its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    Running,
    Finished,
    /// A client or a Stop cancelled the job.
    Cancelled,
    Failed,
}

impl Stage {
    /// Returns the name of the job's stage.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Finished => "finished",
            Self::Cancelled => "cancelled",
            Self::Failed => "failed",
        }
    }
}

/// Result of a job.
#[derive(Clone, Debug)]
pub(crate) enum Done {
    /// Boards of the chain, and notes about unusual observations.
    Chain(Vec<BoardSeen>, Vec<String>),
    /// Findings of a doctor job.
    Findings(Vec<Finding>),
    /// Result of a firmware update for each board, and notes about its images.
    Update(UpdateReport, Vec<String>),
    /// Running boards with their flags, and the predicted bus load.
    Running(Vec<(u8, Admin)>, LoadForecast),
}

/// Job that is running or has ended.
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

/// Jobs of an agent.
#[derive(Default)]
pub(crate) struct Jobs(Mutex<Kept>);

impl Jobs {
    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a running job.
    pub(crate) fn add(&self, what: &str, client: &str) -> Job {
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

    /// Ends a job. Returns `false` if the job had already ended.
    pub(crate) fn end(&self, number: u64, stage: Stage, done: Option<Done>, error: Option<Problem>) -> bool {
        let mut kept = self.lock();
        let running = |job: &&mut Job| job.number == number && job.stage == Stage::Running;
        let Some(job) = kept.jobs.iter_mut().find(running) else { return false };
        (job.stage, job.done, job.error) = (stage, done, error);
        true
    }

    /// Returns a job by its job number.
    pub(crate) fn get(&self, number: u64) -> Option<Job> {
        self.lock().jobs.iter().find(|job| job.number == number).cloned()
    }

    /// Returns the stored jobs, oldest first.
    pub(crate) fn list(&self) -> Vec<Job> {
        self.lock().jobs.iter().cloned().collect()
    }
}
