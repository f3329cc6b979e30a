//! Metrics of the controller, the arm, the serial line and the agent, in the Prometheus text format.
use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use jtc_host::sample::is_measured;
use jtc_host::{Arm, labels};
use jtc_wire::{ControllerState, Info, Joint, Status, TrajectoryState};
use prometheus::{CounterVec, GaugeVec, Opts, Registry, TextEncoder};

use super::Agent;
use agent_kit::api::{Problem, Refusals};

/// Content type of the Prometheus text format. Programs that prefer another format of metrics also accept
/// this content type.
const FORMAT: &str = "text/plain; version=0.0.4; charset=utf-8";

/// Value of a metric, and the values of its labels.
type Labelled = (Vec<String>, f64);

/// Page that contains all metrics.
#[derive(Default)]
struct Page(Registry);

impl Page {
    /// Adds metrics whose values can rise and fall.
    fn gauges(
        &self,
        name: &str,
        help: &str,
        labels: &[&str],
        values: impl IntoIterator<Item = Labelled>,
    ) -> prometheus::Result<()> {
        let family = GaugeVec::new(Opts::new(name, help), labels)?;
        for (of, value) in values {
            family.get_metric_with_label_values(&of)?.set(value);
        }
        self.0.register(Box::new(family))
    }

    /// Adds metrics whose values only rise.
    fn counters(
        &self,
        name: &str,
        help: &str,
        labels: &[&str],
        values: impl IntoIterator<Item = (&'static str, u64)>,
    ) -> prometheus::Result<()> {
        let family = CounterVec::new(Opts::new(name, help), labels)?;
        for (of, value) in values {
            let of = if labels.is_empty() { &[][..] } else { &[of][..] };
            family.get_metric_with_label_values(of)?.inc_by(value as f64);
        }
        self.0.register(Box::new(family))
    }

    fn gauge(&self, name: &str, help: &str, value: f64) -> prometheus::Result<()> {
        self.gauges(name, help, &[], [(Vec::new(), value)])
    }

    fn counter(&self, name: &str, help: &str, value: u64) -> prometheus::Result<()> {
        self.counters(name, help, &[], [("", value)])
    }

    /// Adds a metric for a state: 1 for the current state, 0 for all other states.
    fn state(&self, name: &str, help: &str, all: &[&'static str], is: &str) -> prometheus::Result<()> {
        let unknown = (!all.contains(&is)).then_some(is);
        let states = all.iter().copied().chain(unknown);
        let values = states.map(|state| (vec![state.to_owned()], f64::from(u8::from(state == is))));
        self.gauges(name, help, &["state"], values)
    }

    /// Adds the values in a status of the controller.
    fn status(&self, status: &Status, arm: &Arm) -> prometheus::Result<()> {
        self.state(
            "jtc_controller_state",
            "State of the controller: 1 for the current state",
            &ControllerState::ALL.map(|state| state.name()),
            status.state.name(),
        )?;
        self.state(
            "jtc_trajectory_state",
            "State of the trajectory: 1 for the current state",
            &TrajectoryState::ALL.map(|state| state.name()),
            status.trajectory.name(),
        )?;
        self.gauge("jtc_trajectory_point", "Current 1 ms point of the trajectory", status.point.into())?;
        let (now, occurred) = (labels::errors(status.errors), labels::errors(status.occurred));
        self.gauge("jtc_controller_errors", "Number of current errors of the controller", now.len() as f64)?;
        self.gauge(
            "jtc_controller_occurred_errors",
            "Number of errors since the last clear",
            occurred.len() as f64,
        )?;
        self.gauges(
            "jtc_controller_error",
            "1 for each current error of the controller",
            &["error"],
            now.into_iter().map(|error| (vec![error.to_owned()], 1.0)),
        )?;
        self.joints(status, arm)
    }

    /// Adds the metrics of all joints that have measured values.
    fn joints(&self, status: &Status, arm: &Arm) -> prometheus::Result<()> {
        let each = |value: &dyn Fn(usize) -> f64| -> Vec<Labelled> {
            let measured = Joint::ALL.into_iter().filter(|joint| is_measured(status, joint.index()));
            measured.map(|joint| (vec![joint.number().to_string()], value(joint.index()))).collect()
        };
        let (joints, limits) = (&status.joints, &arm.joints);
        let position = |j: usize| f64::from(joints[j].position);
        let velocity = |j: usize| f64::from(joints[j].velocity);
        let torque = |j: usize| f64::from(joints[j].torque);
        let label = &["joint"];
        self.gauges("jtc_joint_position_radians", "Measured position", label, each(&position))?;
        self.gauges("jtc_joint_velocity_radians_per_second", "Measured velocity", label, each(&velocity))?;
        self.gauges("jtc_joint_torque_newton_meters", "Torque that the drive reports", label, each(&torque))?;
        self.gauges(
            "jtc_joint_temperature_celsius",
            "Temperature that the drive reports",
            label,
            each(&|j| joints[j].temperature.into()),
        )?;
        let errors = Joint::ALL.map(|joint| {
            let errors = labels::joint_errors(joints[joint.index()].internal).len();
            (vec![joint.number().to_string()], errors as f64)
        });
        self.gauges("jtc_joint_errors", "Errors that the controller has found at the joint", label, errors)?;
        self.gauges(
            "jtc_joint_position_limit_ratio",
            "Joint position relative to its limits: 0 in the middle, 1 at a limit",
            label,
            each(&|j| {
                let (low, high) = (limits[j].position_min, limits[j].position_max);
                (2.0 * position(j) - low - high).abs() / (high - low)
            }),
        )?;
        self.gauges(
            "jtc_joint_velocity_limit_ratio",
            "Speed divided by its limit",
            label,
            each(&|j| velocity(j).abs() / limits[j].velocity_max),
        )?;
        self.gauges(
            "jtc_joint_torque_limit_ratio",
            "Torque divided by its limit",
            label,
            each(&|j| torque(j).abs() / limits[j].torque_max),
        )
    }

    /// Adds the identity of the controller.
    fn info(&self, info: &Info) -> prometheus::Result<()> {
        let texts = [info.firmware(), info.revision(), info.board.as_str(), info.arm.as_str()];
        self.gauges(
            "jtc_controller_info",
            "Identity of the controller; always 1",
            &["firmware", "revision", "board", "arm"],
            [(texts.map(str::to_owned).to_vec(), 1.0)],
        )?;
        self.gauge(
            "jtc_controller_uptime_seconds",
            "Time since the controller started",
            info.uptime_ms as f64 / 1000.0,
        )?;
        self.counter("jtc_controller_starts_total", "Starts of the controller", info.boots.into())?;
        self.counter(
            "jtc_controller_lost_records_total",
            "Records that the controller lost because its queue was full",
            info.lost_records.into(),
        )
    }

    /// Adds the counters of frames and statuses on the serial line.
    fn line(&self, agent: &Agent) -> prometheus::Result<()> {
        let (counts, received) = agent.line.with(|line, _| (line.counts(), line.received()));
        self.counter("jtc_statuses_total", "Statuses received", received.frames)?;
        self.counter(
            "jtc_damaged_statuses_total",
            "Received statuses with an invalid checksum",
            received.bad_frames,
        )?;
        self.counter(
            "jtc_skipped_bytes_total",
            "Received bytes that belong to no frame",
            received.skipped_bytes,
        )?;
        self.counter("jtc_frames_sent_total", "Sent frames that change a state", counts.sent)?;
        self.counters(
            "jtc_frames_answered_total",
            "Answered frames that change a state",
            &["answer"],
            [("accepted", counts.accepted), ("refused", counts.refused)],
        )?;
        self.counter("jtc_frames_denied_total", "Frames of clients that the agent refused", counts.denied)?;
        self.counter("jtc_put_outs_total", "Clients that the agent disconnected", counts.put_out)?;
        self.counter("jtc_halts_total", "Requested Stops and Pauses", agent.line.last_halt())?;
        self.counter(
            "jtc_halts_not_taken_total",
            "Stops and Pauses that the controller did not confirm after many attempts",
            counts.not_taken,
        )
    }

    /// Adds the metrics of the agent itself.
    fn agent(&self, agent: &Agent) -> prometheus::Result<()> {
        let simulated = agent.simulated.to_string();
        self.gauges(
            "jtc_build_info",
            "Version of the agent; always 1",
            &["version", "simulated"],
            [(vec![env!("CARGO_PKG_VERSION").to_owned(), simulated], 1.0)],
        )?;
        let (held, clients) = agent.line.with(|line, _| (line.lease().is_some(), line.clients()));
        self.gauge("jtc_lease_held", "1 while a client holds the lease", f64::from(u8::from(held)))?;
        self.gauge("jtc_clients", "Connected clients, including the agent's own client", clients as f64)?;
        let lost = f64::from(u8::from(agent.line.lost().is_some()));
        self.gauge("jtc_port_lost", "1 if the port is lost", lost)?;
        let (running, ended) = agent.jobs.counts();
        self.gauge("jtc_jobs_running", "Running jobs", running as f64)?;
        self.counters(
            "jtc_jobs_total",
            "Ended jobs by stage",
            &["outcome"],
            [("finished", ended.finished), ("stopped", ended.stopped), ("failed", ended.failed)],
        )?;
        self.counter("jtc_events_total", "Events of the agent", agent.jobs.journal.last())?;
        self.counter("jtc_log_lost_lines_total", "Lines missing in the log of commands", agent.lost_lines())
    }
}

/// Returns metrics in the text format of Prometheus.
#[utoipa::path(
    get,
    path = "/metrics",
    operation_id = "get_metrics",
    responses((status = 200, description = "Metrics", body = String, content_type = "text/plain"), Refusals)
)]
pub(super) async fn metrics(State(agent): State<Agent>) -> Result<impl IntoResponse, Problem> {
    let identity = agent.identity().await;
    let page = || -> prometheus::Result<String> {
        let page = Page::default();
        page.agent(&agent)?;
        page.line(&agent)?;
        let status = agent.line.with(|line, now| {
            line.status().map(|(at, status)| (now.saturating_sub(*at).as_secs_f64(), *status))
        });
        if let Some((age, status)) = &status {
            page.gauge("jtc_status_age_seconds", "Time since the last status", *age)?;
            page.status(status, &identity.arm)?;
        }
        if let Some(info) = &identity.info {
            page.info(info)?;
        }
        TextEncoder::new().encode_to_string(&page.0.gather())
    };
    let page = page().map_err(|error| {
        Problem::new("metrics", error.to_string(), "read the same values with GET /api/status")
            .kind(jtc_host::ErrorKind::Fault)
    })?;
    Ok(([(header::CONTENT_TYPE, FORMAT)], page))
}
