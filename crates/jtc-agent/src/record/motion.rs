//! Finds the start and the end of recordings in the statuses. The statuses show the motions of all clients, so the
//! recordings contain all motions.
use std::collections::VecDeque;
use std::time::Duration;

use jtc_host::labels;
use jtc_host::recording::Ending;
use jtc_wire::{ControllerState, Status, TrajectoryState};

/// Time before a motion that is included in the recording.
const BEFORE: Duration = Duration::from_millis(500);
/// Largest number of statuses before a motion that the recording includes.
const BEFORE_MAX: usize = 256;
/// Time at rest after a motion until its recording ends.
const REST: Duration = Duration::from_millis(500);
/// Longest time from the end of a motion to the end of its recording, even if the arm is not completely at rest.
const OVER: Duration = Duration::from_secs(5);
/// Time at rest in a pause, or in Teaching if no person moves the arm, after which the recorder skips statuses. The
/// recording does not end; it continues when the arm moves.
const STANDS: Duration = Duration::from_secs(10);
/// Time for which a Jog is effective (J-58), plus the transmission time of its frame on the serial line.
const JOG: Duration = Duration::from_millis(400);
/// Time without a status after which the recording of a motion ends, because the connection is considered lost.
pub(super) const SILENT: Duration = Duration::from_secs(2);

/// Kinds of motions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Motion {
    /// Motion along a trajectory: a run of the trajectory, or the approach to its first point.
    Execution,
    /// Jog: joints with commanded velocities.
    Jog,
    /// Teaching: a person moves the arm by hand.
    Teaching,
}

impl Motion {
    /// Returns the name of the motion in recordings.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Execution => "execution",
            Self::Jog => "jog",
            Self::Teaching => "teaching",
        }
    }
}

/// Action that starts, continues or ends a recording.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Step {
    /// Start of a recording: the kind of the motion, and the arrival time of the first status.
    Begin(Motion, Duration),
    /// Next status of the recording.
    Status(Duration, Box<Status>),
    /// End of the recording.
    End(Ending),
}

/// Recording that is in progress.
struct Open {
    motion: Motion,
    /// Time since which the arm has been at rest: in a pause, or in Teaching while no person moves the arm.
    stands: Option<Duration>,
    /// Time of the end of the motion. `rests` is the time since which the arm has been at rest after the motion.
    over: Option<Duration>,
    rests: Option<Duration>,
    last: Status,
}

/// State machine that finds the start and end of recordings in a stream of statuses.
#[derive(Default)]
pub(super) struct Follower {
    before: VecDeque<(Duration, Status)>,
    open: Option<Open>,
    last: Option<(Duration, TrajectoryState, u32)>,
    jogged: Option<Duration>,
}

impl Follower {
    /// Processes a Jog frame that was sent.
    pub(super) fn jog(&mut self, now: Duration) {
        self.jogged = Some(now);
    }

    /// Returns `true` while a recording is in progress.
    pub(super) fn is_recording(&self) -> bool {
        self.open.is_some()
    }

    /// Processes the next status, which arrived at `now`.
    pub(super) fn status(&mut self, now: Duration, status: &Status) -> Vec<Step> {
        let mut steps = self.silence(now);
        let motion = self.motion(now, status);
        // Each motion has its own recording, even if it begins directly after the previous motion.
        let another = motion.is_some_and(|motion| {
            self.open.as_ref().is_some_and(|open| open.motion != motion)
                || motion == Motion::Execution && self.begins_anew(status)
        });
        if another && let Some(open) = self.open.take() {
            steps.push(Step::End(ending(open.motion, &open.last)));
        }
        if self.open.is_none()
            && let Some(motion) = motion
        {
            self.before.retain(|(at, _)| now.saturating_sub(*at) <= BEFORE);
            steps.push(Step::Begin(motion, self.before.front().map_or(now, |(at, _)| *at)));
            steps.extend(self.before.drain(..).map(|(at, status)| Step::Status(at, Box::new(status))));
            self.open = Some(Open { motion, stands: None, over: None, rests: None, last: *status });
        }
        self.last = Some((now, status.trajectory.known().unwrap_or(TrajectoryState::Null), status.point));
        match &mut self.open {
            Some(open) => {
                steps.extend(open.take(now, motion, status));
                if matches!(steps.last(), Some(Step::End(_))) {
                    self.open = None;
                }
            }
            None => {
                if self.before.len() == BEFORE_MAX {
                    self.before.pop_front();
                }
                self.before.push_back((now, *status));
            }
        }
        steps
    }

    /// Processes the absence of statuses until `now`.
    pub(super) fn silence(&mut self, now: Duration) -> Vec<Step> {
        let silent = self.last.is_some_and(|(at, ..)| now.saturating_sub(at) > SILENT);
        if !silent {
            return Vec::new();
        }
        self.end("fault", &format!("no status received for {} s", SILENT.as_secs()))
    }

    /// Ends the recording with `reason`, because the recorder processes no more statuses.
    pub(super) fn end(&mut self, outcome: &str, reason: &str) -> Vec<Step> {
        self.last = None;
        self.before.clear();
        let ending = Ending { outcome: outcome.into(), reason: reason.into(), ..Ending::default() };
        self.open.take().map(|_| Step::End(ending)).into_iter().collect()
    }

    /// Returns the kind of the current motion; `None` if the arm does not move.
    fn motion(&mut self, now: Duration, status: &Status) -> Option<Motion> {
        if status.state != ControllerState::HoldPos {
            // A Jog is effective only in the state HoldPos.
            self.jogged = None;
        }
        if status.is_executing() {
            return Some(Motion::Execution);
        }
        match status.state.known() {
            Some(ControllerState::Teaching) => Some(Motion::Teaching),
            Some(ControllerState::HoldPos) => {
                self.jogged.filter(|at| now.saturating_sub(*at) <= JOG).map(|_| Motion::Jog)
            }
            _ => None,
        }
    }

    /// Returns `true` if this status belongs to a different execution than the previous status.
    fn begins_anew(&self, status: &Status) -> bool {
        self.last.is_none_or(|(_, trajectory, point)| {
            !matches!(trajectory, TrajectoryState::Execute | TrajectoryState::Pause) || status.point < point
        })
    }
}

impl Open {
    fn take(&mut self, now: Duration, motion: Option<Motion>, status: &Status) -> Vec<Step> {
        self.last = *status;
        let moves = labels::moving_joint(status).is_some();
        let paused = self.motion == Motion::Execution && status.trajectory == TrajectoryState::Pause;
        let may_stand = paused || status.state == ControllerState::Teaching;
        let stands = (may_stand && !moves).then(|| *self.stands.get_or_insert(now));
        self.stands = stands;
        let mut steps = Vec::new();
        if stands.is_none_or(|since| now.saturating_sub(since) <= STANDS) {
            steps.push(Step::Status(now, Box::new(*status)));
        }
        if motion.is_some() || paused {
            (self.over, self.rests) = (None, None);
            return steps;
        }
        let over = now.saturating_sub(*self.over.get_or_insert(now));
        self.rests = (!moves).then(|| self.rests.unwrap_or(now));
        if over >= OVER || self.rests.is_some_and(|since| now.saturating_sub(since) >= REST) {
            steps.push(Step::End(ending(self.motion, status)));
        }
        steps
    }
}

/// Returns the outcome of a motion whose last status is `status`.
fn ending(motion: Motion, status: &Status) -> Ending {
    let fault = status.state == ControllerState::Error || status.errors != 0;
    let (outcome, reason) = match (motion, status.trajectory.known()) {
        _ if fault => ("fault", labels::errors_line(status)),
        (Motion::Jog | Motion::Teaching, _) => ("finished", String::new()),
        (_, Some(TrajectoryState::Finish)) => ("finished", String::new()),
        (_, Some(TrajectoryState::Null)) => ("fault", "the controller no longer has a trajectory".to_owned()),
        _ => ("stopped", String::new()),
    };
    Ending { outcome: outcome.into(), reason, ..Ending::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Simulated arm that sends a status every 40 ms.
    struct Arm {
        follower: Follower,
        now: Duration,
        status: Status,
        /// Start and end of each recording, with the number of statuses between them.
        seen: Vec<String>,
        statuses: usize,
    }

    impl Arm {
        fn new() -> Self {
            let mut status = Status::default();
            (status.state, status.trajectory) =
                (ControllerState::HoldPos.into(), TrajectoryState::Stop.into());
            Self {
                follower: Follower::default(),
                now: Duration::from_secs(100),
                status,
                seen: Vec::new(),
                statuses: 0,
            }
        }

        fn note(&mut self, steps: Vec<Step>) {
            for step in steps {
                match step {
                    Step::Begin(motion, _) => {
                        self.statuses = 0;
                        self.seen.push(format!("begin {}", motion.name()));
                    }
                    Step::Status(at, _) => {
                        assert!(at <= self.now);
                        self.statuses += 1;
                    }
                    Step::End(ending) => {
                        self.seen.push(format!("{} {}", ending.outcome, ending.reason).trim().to_owned());
                    }
                }
            }
        }

        fn run_ms(&mut self, ms: u64) {
            for _ in 0..ms / 40 {
                self.now += Duration::from_millis(40);
                if self.status.is_executing() {
                    self.status.point += 40;
                }
                let steps = self.follower.status(self.now, &self.status);
                self.note(steps);
            }
        }

        fn is(&mut self, state: ControllerState, trajectory: TrajectoryState, velocity: f32) {
            (self.status.state, self.status.trajectory) = (state.into(), trajectory.into());
            self.status.joints[2].velocity = velocity;
        }

        fn take(&mut self) -> Vec<String> {
            std::mem::take(&mut self.seen)
        }
    }

    use ControllerState::{Error, HoldPos, Operate, Teaching};
    use TrajectoryState::{Execute, Finish, Null, Pause, Stop};

    #[test]
    fn a_recording_is_as_long_as_its_motion_with_what_is_before_and_behind_it() {
        let mut arm = Arm::new();
        arm.run_ms(60_000);
        assert!(arm.take().is_empty());
        arm.is(Operate, Execute, 0.3);
        arm.run_ms(4_000);
        arm.is(Operate, Stop, 0.1);
        arm.run_ms(400);
        arm.is(HoldPos, Stop, 0.0);
        arm.run_ms(60_000);
        assert_eq!(arm.take(), ["begin execution", "stopped"]);
        // The recording contains the statuses of 0.5 s before the motion, 4.4 s of motion, and 0.5 s at rest.
        assert!((130..=140).contains(&arm.statuses), "{}", arm.statuses);
    }

    #[test]
    fn each_run_has_a_recording_of_its_own() {
        let mut arm = Arm::new();
        for end in [Finish, Stop, Null] {
            arm.is(Operate, Execute, 0.3);
            arm.status.point = 0;
            arm.run_ms(2_000);
            arm.is(HoldPos, end, 0.0);
            arm.run_ms(200);
        }
        // The fourth run begins after a short rest. The fifth run begins between two statuses, so only the decrease
        // of the point index shows it.
        arm.is(Operate, Execute, 0.3);
        arm.run_ms(400);
        arm.status.point = 0;
        arm.run_ms(400);
        arm.is(Error, Null, 0.0);
        arm.status.errors = 1 << 5;
        arm.run_ms(2_000);
        let seen = arm.take();
        assert_eq!(seen.iter().filter(|s| *s == "begin execution").count(), 5);
        let ended: Vec<&str> = seen.iter().filter(|s| !s.starts_with("begin")).map(String::as_str).collect();
        assert_eq!(ended[..2], ["finished", "stopped"]);
        assert_eq!(ended[2], "fault the controller no longer has a trajectory");
        assert!(ended[4].starts_with("fault ") && ended[4].contains("CAN"), "{ended:?}");
    }

    #[test]
    fn a_pause_belongs_to_its_run_and_is_not_recorded_for_ever() {
        let mut arm = Arm::new();
        arm.is(Operate, Execute, 0.3);
        arm.run_ms(2_000);
        arm.is(HoldPos, Pause, 0.0);
        arm.run_ms(3_600_000);
        assert!(arm.statuses < 320, "{}", arm.statuses);
        arm.is(Operate, Execute, 0.3);
        arm.run_ms(2_000);
        arm.is(HoldPos, Finish, 0.0);
        arm.run_ms(2_000);
        assert_eq!(arm.take(), ["begin execution", "finished"]);
        assert!((340..400).contains(&arm.statuses), "{}", arm.statuses);
    }

    #[test]
    fn a_jog_and_teaching_are_recorded_and_an_arm_that_is_pushed_is_not() {
        let mut arm = Arm::new();
        arm.is(HoldPos, Stop, 0.2);
        arm.run_ms(2_000);
        assert!(arm.take().is_empty());
        for _ in 0..20 {
            arm.follower.jog(arm.now);
            arm.run_ms(120);
        }
        arm.is(HoldPos, Stop, 0.0);
        arm.run_ms(2_000);
        assert_eq!(arm.take(), ["begin jog", "finished"]);
        arm.is(Teaching, Stop, 0.0);
        arm.run_ms(3_600_000);
        let unled = arm.statuses;
        assert!(unled < 300, "{unled}");
        arm.is(Teaching, Stop, 0.3);
        arm.run_ms(4_000);
        assert_eq!(arm.statuses, unled + 100);
        arm.is(HoldPos, Stop, 0.0);
        arm.run_ms(2_000);
        assert_eq!(arm.take(), ["begin teaching", "finished"]);
        // The second motion begins directly after the first motion.
        arm.follower.jog(arm.now);
        arm.run_ms(120);
        arm.is(Teaching, Stop, 0.3);
        arm.run_ms(80);
        arm.is(HoldPos, Stop, 0.0);
        arm.run_ms(80);
        arm.is(Operate, Execute, 0.3);
        arm.run_ms(400);
        arm.is(HoldPos, Stop, 0.0);
        arm.run_ms(2_000);
        let begun = ["begin jog", "finished", "begin teaching", "finished", "begin execution", "stopped"];
        assert_eq!(arm.take(), begun);
    }

    #[test]
    fn a_motion_that_is_out_of_sight_ends_there_and_goes_on_in_another() {
        let mut arm = Arm::new();
        arm.is(Operate, Execute, 0.3);
        arm.run_ms(2_000);
        // A few missing statuses do not end a recording.
        arm.now += Duration::from_millis(1_500);
        arm.status.point += 1_500;
        arm.run_ms(2_000);
        let steps = arm.follower.silence(arm.now + Duration::from_millis(1_900));
        assert!(steps.is_empty());
        arm.now += Duration::from_millis(2_100);
        let steps = arm.follower.silence(arm.now);
        arm.note(steps);
        assert_eq!(arm.take(), ["begin execution", "fault no status received for 2 s"]);
        assert!(arm.follower.silence(arm.now).is_empty());
        arm.run_ms(1_000);
        let steps = arm.follower.end("stopped", "the agent has ended");
        arm.note(steps);
        assert_eq!(arm.take(), ["begin execution", "stopped the agent has ended"]);
    }
}
