//! Execution of PLC commands. All PLC connections share one client of the serial line.
use std::sync::Arc;

use agent_kit::api::Problem;
use jtc_host::session::{Flow, RecoverParameters};
use jtc_host::{Error, Session};
use serde_json::json;

use super::codes::{Command, Outcome, error_number};
use super::handshake::Order;
use super::map::View;
use super::plc::Plc;
use crate::jobs::{
    Course, HttpSession, Job, Order as RunOrder, STOPPED, Task, Turn, Unable, recover, run, stopped,
};
use crate::line::Denied;
use crate::owner::ClientPort;

/// Reason why a command of a PLC was not executed.
pub(super) struct Refusal {
    pub outcome: Outcome,
    /// Number of the error; 0 if the refusal has no error number.
    pub error: u16,
    /// Reason as a text.
    pub why: String,
}

impl Refusal {
    fn new(outcome: Outcome) -> Self {
        Self { outcome, error: 0, why: outcome.text().to_owned() }
    }
}

impl From<Problem> for Refusal {
    fn from(error: Problem) -> Self {
        let outcome = match error.code {
            "busy" => Outcome::Busy,
            STOPPED => Outcome::Stopped,
            "not-ready" | "not-paused" | "motion-ended" => Outcome::NotReady,
            "no-link" | "not-confirmed" | "link-lost" | "gone" => Outcome::NoController,
            _ => Outcome::Failed,
        };
        Self { outcome, error: error_number(error.code), why: error.message.clone() }
    }
}

impl From<Unable> for Refusal {
    fn from(unable: Unable) -> Self {
        Problem::from(unable).into()
    }
}

impl From<Denied> for Refusal {
    fn from(denied: Denied) -> Self {
        let outcome = match denied {
            Denied::Stopped { .. } => Outcome::Stopped,
            Denied::Held { .. }
            | Denied::Awaited { .. }
            | Denied::NotHolder
            | Denied::Unattended { .. }
            | Denied::Viewer
            | Denied::Gone => Outcome::Held,
        };
        Self { outcome, error: 0, why: denied.to_string() }
    }
}

impl Plc {
    /// Executes a command of a PLC completely or not at all. `halt` is the number of the last Stop or Pause before the
    /// command.
    pub(super) async fn act(self: &Arc<Self>, order: &Order, halt: u64) -> Result<(), Refusal> {
        if let Some(lost) = self.line.lost() {
            return Err(Refusal { why: lost, ..Refusal::new(Outcome::NoController) });
        }
        let http_session = self.http_session();
        if order.command == Command::Release {
            return self.release(&http_session);
        }
        if order.watchdog_ms == 0 {
            return Err(Refusal::new(Outcome::Value));
        }
        match order.command {
            Command::Start => self.start(&http_session, order, halt),
            Command::Resume => self.resume(&http_session, halt).await,
            Command::Recover | Command::RecoverWithDefaults => {
                self.recover(&http_session, order.command, halt)
            }
            Command::SetSpeed => self.change_speed(&http_session, order.speed).await,
            Command::TeachOn => {
                self.free_to_move()?;
                let turn = http_session.turn()?;
                self.take_lease(&http_session)?;
                self.ask_to_move(&http_session, halt)?;
                let (line, client) = (self.line.clone(), http_session.client);
                let halted = move || line.with(|line, _| line.is_halted(client));
                self.call_in(&http_session, turn, move |session| session.teach_until(halted)).await
            }
            Command::TeachOff => self.call(&http_session, |session| session.teach(false)).await,
            Command::GripperOn => self.call(&http_session, |session| session.gripper(true)).await,
            Command::GripperOff => self.call(&http_session, |session| session.gripper(false)).await,
            Command::Clear => self.call(&http_session, Session::clear_all).await,
            // The agent already executed a Pause, a Stop or a Release when the command arrived.
            Command::None | Command::Pause | Command::Stop | Command::Release => Ok(()),
        }
    }

    /// Returns an error if the Stop or Pause coil of any connection holds the arm at rest.
    fn free_to_move(&self) -> Result<(), Refusal> {
        if self.is_held_by_a_coil() { Err(Refusal::new(Outcome::Coil)) } else { Ok(()) }
    }

    /// Takes or renews the lease. The lease lasts for the watchdog time of the PLC.
    fn take_lease(&self, http_session: &HttpSession) -> Result<(), Refusal> {
        let (policy, lasts) = self.watchdog();
        let taken = self.line.with(|line, now| {
            line.set_policy(http_session.client, policy);
            line.take_lease(http_session.client, Some(lasts), now)
        });
        Ok(taken?)
    }

    /// Returns an error if a client stopped the arm after the command, or if another client did so shortly before the
    /// command.
    fn ask_to_move(&self, http_session: &HttpSession, halt: u64) -> Result<(), Refusal> {
        Ok(self.line.with(|line, now| line.ask_to_move(http_session.client, halt, now))?)
    }

    /// Returns the last status of the controller.
    fn reported(&self) -> View {
        let status =
            self.line.with(|line, now| line.status().map(|(at, status)| (now.saturating_sub(*at), *status)));
        View { status, ..View::default() }
    }

    fn start(
        self: &Arc<Self>,
        http_session: &Arc<HttpSession>,
        order: &Order,
        halt: u64,
    ) -> Result<(), Refusal> {
        let number = order.trajectory;
        let stored = self.jobs.store.get(number).ok_or_else(|| Refusal::new(Outcome::NoTrajectory))?;
        self.free_to_move()?;
        // The session of the PLC client is reserved first. While a job runs, the answer is therefore "busy", and not
        // an error that the running job causes.
        let turn = http_session.turn()?;
        self.take_lease(http_session)?;
        let reported = self.reported();
        if !reported.is_fresh() {
            return Err(Refusal::new(Outcome::NoController));
        }
        if !reported.is_ready() {
            return Err(Refusal { error: error_number("not-ready"), ..Refusal::new(Outcome::NotReady) });
        }
        self.ask_to_move(http_session, halt)?;
        let order = RunOrder {
            course: Course::Along(Arc::new(stored.trajectory.clone())),
            approach: order.approach,
            // The speed register always has a value. Its default of 100 means that the PLC has not chosen a speed.
            speed_percent: Some(order.speed).filter(|speed| *speed != 100).map(f64::from),
            repeat: order.repeat.into(),
            accept_device_limits: false,
        };
        let what = format!("run of trajectory {number}, {}", stored.name);
        let job =
            self.jobs.begin(http_session, turn, what, move |task, session| run(task, session, &order))?;
        self.begun(http_session, &job);
        Ok(())
    }

    fn recover(
        self: &Arc<Self>,
        http_session: &Arc<HttpSession>,
        command: Command,
        halt: u64,
    ) -> Result<(), Refusal> {
        let parameters = if command == Command::RecoverWithDefaults {
            RecoverParameters::ControllerDefaults
        } else {
            RecoverParameters::None
        };
        self.free_to_move()?;
        let turn = http_session.turn()?;
        self.take_lease(http_session)?;
        self.ask_to_move(http_session, halt)?;
        let recover =
            move |task: &Task<'_>, session: &mut Session<ClientPort>| recover(task, session, &parameters);
        let job = self.jobs.begin(http_session, turn, "recover".into(), recover)?;
        self.begun(http_session, &job);
        Ok(())
    }

    fn begun(&self, http_session: &HttpSession, job: &Job) {
        self.set_job(job.number);
        let (policy, _) = self.watchdog();
        self.note(
            "job",
            json!({ "client": http_session.client.0, "job": job.number, "what": job.what, "policy": policy }),
        );
    }

    async fn resume(&self, http_session: &HttpSession, halt: u64) -> Result<(), Refusal> {
        self.free_to_move()?;
        self.take_lease(http_session)?;
        if !self.reported().is_paused() {
            return Err(Refusal { error: error_number("not-paused"), ..Refusal::new(Outcome::NotReady) });
        }
        if http_session.is_moving() {
            self.ask_to_move(http_session, halt)?;
            if let Some(done) = http_session.wish(Flow::Resume).await {
                return Ok(done?);
            }
        }
        let turn = http_session.turn()?;
        self.ask_to_move(http_session, halt)?;
        self.call_in(http_session, turn, Session::resume).await
    }

    async fn change_speed(&self, http_session: &HttpSession, percent: u16) -> Result<(), Refusal> {
        let part = u8::try_from(percent).ok().filter(|percent| (5..=100).contains(percent));
        let part = part.ok_or_else(|| Refusal::new(Outcome::Value))?;
        self.take_lease(http_session)?;
        match http_session.wish(Flow::Speed(part)).await {
            Some(done) => done?,
            None => {
                let set = move |session: &mut Session<ClientPort>| session.set_speed(f64::from(part) / 100.0);
                self.call_in(http_session, http_session.turn()?, set).await?;
            }
        }
        self.set_speed(Some(percent));
        Ok(())
    }

    fn release(&self, http_session: &HttpSession) -> Result<(), Refusal> {
        if let Some(job) = http_session.job() {
            return Err(Unable::Busy(Some(job)).into());
        }
        // If the PLC client does not hold the lease, this call has no effect.
        let _ = self.line.with(|line, now| line.release_lease(http_session.client, now));
        self.line.wake();
        self.resign();
        Ok(())
    }

    /// Takes the lease and runs a short function on the session of the PLC client.
    async fn call<E: Into<Error> + Send + 'static>(
        &self,
        http_session: &HttpSession,
        act: impl FnOnce(&mut Session<ClientPort>) -> Result<(), E> + Send + 'static,
    ) -> Result<(), Refusal> {
        let turn = http_session.turn()?;
        self.take_lease(http_session)?;
        self.call_in(http_session, turn, act).await
    }

    async fn call_in<E: Into<Error> + Send + 'static>(
        &self,
        http_session: &HttpSession,
        turn: Turn,
        act: impl FnOnce(&mut Session<ClientPort>) -> Result<(), E> + Send + 'static,
    ) -> Result<(), Refusal> {
        http_session.act(turn, act).await?.map_err(|error| match error.into() {
            Error::Cancelled => stopped(&self.line, http_session.client).into(),
            error => Problem::of(&error).into(),
        })
    }
}
