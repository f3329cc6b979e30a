//! Reports about the last motions of the arm. The agent stores the data of these motions, and generates the page of
//! a report on request.
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use jtc_host::recording::{Ending, RecordingInfo};
use jtc_host::report::{Digest, Facts, ReportInput, RunFailure, html};
use jtc_host::session::{LinkStatistics, Outcome, UploadReport};
use jtc_host::{Arm, Error};

use super::{Job, Task};

/// Largest number of jobs whose reports are stored.
const KEPT: usize = 16;
/// Largest total size of all stored reports, bytes. The report of a motion of ten minutes or more needs about 20 MB.
const BYTES_MAX: usize = 64 << 20;

/// Data of a report about a motion.
#[derive(Clone, Debug)]
pub struct MotionReport {
    info: RecordingInfo,
    digest: Digest,
    facts: Vec<Facts>,
    failure: Option<RunFailure>,
}

/// Data about a motion that its samples do not contain.
pub(super) struct Made<'a> {
    /// Phase of the job: `approach` or `motion`.
    pub phase: &'a str,
    /// Number of motions that the job finished before this motion; approaches are not counted.
    pub before: u32,
    /// Outcome of the motion.
    pub outcome: &'a Result<Outcome, Error>,
    /// Statistics of the upload of the motion.
    pub upload: &'a UploadReport,
    /// Statistics of the connection since the end of the previous motion, or since the start of the job.
    pub link: LinkStatistics,
    /// Start time of the motion, since 1970.
    pub began: Duration,
    /// Name of the serial port.
    pub port: String,
    /// Bit rate of the serial line, Bd.
    pub baud: Option<u32>,
}

impl MotionReport {
    /// Returns the data of a job's motion; `None` if the agent received no sample of the motion.
    pub(super) fn new(task: &Task<'_>, arm: &Arm, digest: Digest, made: &Made<'_>) -> Option<Self> {
        if digest.samples() == 0 {
            return None;
        }
        let (outcome, reason) = match made.outcome {
            Ok(Outcome::Finished(_)) => ("finished", String::new()),
            Ok(Outcome::Stopped(_)) | Err(Error::Cancelled) => ("stopped", String::new()),
            Err(error) => ("fault", error.to_string()),
        };
        let info = RecordingInfo {
            source: made.port.clone(),
            commanded_by: task.http_session.name.clone(),
            trajectory: task.what.to_owned(),
            start_unix_ns: made.began.as_nanos() as u64,
            ending: Ending { outcome: outcome.into(), reason, ..Ending::default() },
            // The robot description is dropped because the page of the report does not show it.
            description: None,
            ..RecordingInfo::of(arm)
        };
        let failure = if info.ending.is_fault() { digest.failure(&info, &info.ending) } else { None };
        let failure = failure.map(|found| match made.outcome {
            Err(error) => found.with_error(error),
            Ok(_) => found,
        });
        let row = |name: &str, value: String| (name.to_owned(), value);
        let job = Facts {
            title: "Job".into(),
            rows: vec![
                row("Number", task.job.to_string()),
                row("Part of the job", made.phase.to_owned()),
                row("Earlier motions", made.before.to_string()),
                row("Ended", outcome.to_owned()),
            ],
        };
        let facts = vec![job, Facts::of_link(made.upload, &made.link, made.baud)];
        Some(Self { info, digest, facts, failure })
    }

    /// Returns the report as a web page that does not load data from a network.
    pub fn html(&self) -> String {
        let Self { info, digest, facts, failure } = self;
        html(&ReportInput { facts, failure: failure.as_ref(), ..ReportInput::new(info, digest) })
    }

    /// Returns the approximate size of the report in memory, bytes.
    fn bytes(&self) -> usize {
        self.digest.bytes()
    }
}

/// Removes the oldest reports until the remaining reports are within the limits.
pub(super) fn make_room(jobs: &mut VecDeque<Job>) {
    let (mut reports, mut bytes) = (0, 0);
    for report in jobs.iter_mut().rev().map(|job| &mut job.done.report) {
        let Some(own) = report.as_deref().map(MotionReport::bytes) else { continue };
        (reports, bytes) = (reports + 1, bytes + own);
        if reports > KEPT || bytes > BYTES_MAX {
            *report = None;
        }
    }
}

/// Report of the last motion of a job.
pub(super) type Kept = Option<Arc<MotionReport>>;

#[cfg(test)]
mod tests {
    use jtc_host::Sample;

    use super::super::{Done, Stage};
    use super::*;

    fn job(number: u64, samples: usize) -> Job {
        let mut digest = Digest::new();
        (0..samples).for_each(|k| digest.push(&Sample { time_s: k as f64 * 0.04, ..Sample::default() }));
        let report =
            MotionReport { info: RecordingInfo::default(), digest, facts: Vec::new(), failure: None };
        let report = (samples > 0).then(|| Arc::new(report));
        let done = Done { report, ..Done::default() };
        Job { number, what: "".into(), client: "".into(), stage: Stage::Finished, done, error: None }
    }

    fn kept(jobs: &VecDeque<Job>) -> Vec<u64> {
        jobs.iter().filter(|job| job.done.report.is_some()).map(|job| job.number).collect()
    }

    /// The reports of the last jobs are stored within the limits, and a page can be generated from each of them.
    #[test]
    fn reports_of_the_last_jobs_are_kept_within_their_memory() {
        let mut jobs: VecDeque<Job> = (0..20).map(|n| job(n, usize::from(n % 10 != 9))).collect();
        make_room(&mut jobs);
        assert_eq!(kept(&jobs).len(), KEPT);
        assert_eq!(kept(&jobs)[0], 2, "9 and 19 have none, and take no room");
        let mut long: VecDeque<Job> = (0..6).map(|n| job(n, 16_000)).collect();
        make_room(&mut long);
        let left = kept(&long);
        assert!(left.len() < 6 && left.last() == Some(&5), "{left:?}");
        let bytes: usize =
            long.iter().filter_map(|job| job.done.report.as_deref().map(MotionReport::bytes)).sum();
        assert!(bytes > BYTES_MAX / 2 && bytes <= BYTES_MAX, "{bytes}");
        let page = jobs[0].done.report.is_none()
            && jobs[3].done.report.as_ref().is_some_and(|r| r.html().contains("</html>"));
        assert!(page);
    }
}
