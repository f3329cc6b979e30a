//! When a recording begins and ends, from the statuses of the controller alone: whoever commanded the motion.
use std::collections::VecDeque;
use std::time::Duration;

use jtc_host::recording::Ending;
use jtc_host::words;
use jtc_wire::{ControllerState, Status, TrajectoryState};

/// What of the time before a motion is recorded with it.
const BEFORE: Duration = Duration::from_millis(500);
/// Most statuses of that.
const BEFORE_MAX: usize = 256;
/// An arm that has rested for so long behind its motion rests.
const REST: Duration = Duration::from_millis(500);
/// A motion that has ended is over after so long also where the arm is not quite at rest.
const OVER: Duration = Duration::from_secs(5);
/// While the arm stands in a pause, or is taught and not led, nothing more is recorded after this time.
const STANDS: Duration = Duration::from_secs(10);
/// A Jog acts for so long (J-58), and some time on its way.
const JOG: Duration = Duration::from_millis(400);
/// Without a status for so long the motion is out of sight.
pub const SILENT: Duration = Duration::from_secs(2);

/// Kinds of motions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Along a trajectory: a run, or the way to its first point.
    Execution,
    /// Joints at given velocities.
    Jog,
    /// By hand.
    Teaching,
}

impl Motion {
    /// As recordings name it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Execution => "execution",
            Self::Jog => "jog",
            Self::Teaching => "teaching",
        }
    }
}

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// A recording begins, with a status that came at this time.
    Begin(Motion, Duration),
    /// A status belongs to it.
    Status(Duration, Box<Status>),
    /// It ends.
    End(Ending),
}

/// A recording that was begun.
struct Open {
    motion: Motion,
    /// Since when the arm stands in a pause or unled.
    stands: Option<Duration>,
    /// Since when its motion is over, and since when the arm rests.
    over: Option<Duration>,
    rests: Option<Duration>,
    last: Status,
}

/// Follows the statuses.
#[derive(Default)]
pub struct Follower {
    before: VecDeque<(Duration, Status)>,
    open: Option<Open>,
    last: Option<(Duration, TrajectoryState, u32)>,
    jogged: Option<Duration>,
}

impl Follower {
    /// A Jog was sent.
    pub fn jog(&mut self, now: Duration) {
        self.jogged = Some(now);
    }

    /// A recording was begun and has not ended.
    pub fn is_recording(&self) -> bool {
        self.open.is_some()
    }

    /// The next status, which came at this time.
    pub fn status(&mut self, now: Duration, status: &Status) -> Vec<Step> {
        let mut steps = self.silence(now);
        let motion = self.motion(now, status);
        // Another motion has a recording of its own, also right behind the last one.
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

    /// No status has come until now.
    pub fn silence(&mut self, now: Duration) -> Vec<Step> {
        let silent = self.last.is_some_and(|(at, ..)| now.saturating_sub(at) > SILENT);
        if !silent {
            return Vec::new();
        }
        self.end("fault", &format!("no status came for {} s", SILENT.as_secs()))
    }

    /// Nobody follows any more: why.
    pub fn end(&mut self, outcome: &str, reason: &str) -> Vec<Step> {
        self.last = None;
        self.before.clear();
        let ending = Ending { outcome: outcome.into(), reason: reason.into(), ..Ending::default() };
        self.open.take().map(|_| Step::End(ending)).into_iter().collect()
    }

    /// What moves the arm, if anything does.
    fn motion(&mut self, now: Duration, status: &Status) -> Option<Motion> {
        if status.state != ControllerState::HoldPos {
            // It acts in HoldPos only.
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

    /// The execution of this status is not the one of the last.
    fn begins_anew(&self, status: &Status) -> bool {
        self.last.is_none_or(|(_, trajectory, point)| {
            !matches!(trajectory, TrajectoryState::Execute | TrajectoryState::Pause) || status.point < point
        })
    }
}

impl Open {
    fn take(&mut self, now: Duration, motion: Option<Motion>, status: &Status) -> Vec<Step> {
        self.last = *status;
        let moves = words::moving_joint(status).is_some();
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

/// How a motion ended of which this is the last status.
fn ending(motion: Motion, status: &Status) -> Ending {
    let fault = status.state == ControllerState::Error || status.errors != 0;
    let (outcome, reason) = match (motion, status.trajectory.known()) {
        _ if fault => ("fault", words::errors_line(status)),
        (Motion::Jog | Motion::Teaching, _) => ("finished", String::new()),
        (_, Some(TrajectoryState::Finish)) => ("finished", String::new()),
        (_, Some(TrajectoryState::Null)) => ("fault", "the controller has no trajectory any more".to_owned()),
        _ => ("stopped", String::new()),
    };
    Ending { outcome: outcome.into(), reason, ..Ending::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An arm that reports every 40 ms.
    struct Arm {
        follower: Follower,
        now: Duration,
        status: Status,
        /// Begin, End and how many statuses lie between.
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
        // Half a second before it, 4.4 s in motion, half a second of rest.
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
        // The next one begins while the arm has not rested for long, or between two statuses.
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
        assert_eq!(ended[2], "fault the controller has no trajectory any more");
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
        // One right behind the other.
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
        // Some statuses that are missing end nothing.
        arm.now += Duration::from_millis(1_500);
        arm.status.point += 1_500;
        arm.run_ms(2_000);
        let steps = arm.follower.silence(arm.now + Duration::from_millis(1_900));
        assert!(steps.is_empty());
        arm.now += Duration::from_millis(2_100);
        let steps = arm.follower.silence(arm.now);
        arm.note(steps);
        assert_eq!(arm.take(), ["begin execution", "fault no status came for 2 s"]);
        assert!(arm.follower.silence(arm.now).is_empty());
        arm.run_ms(1_000);
        let steps = arm.follower.end("stopped", "the agent was ended");
        arm.note(steps);
        assert_eq!(arm.take(), ["begin execution", "stopped the agent was ended"]);
    }
}
