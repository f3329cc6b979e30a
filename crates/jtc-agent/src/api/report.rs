//! Reports of motions as web pages.
use agent_kit::api::{Number, Problem, Refusals};
use axum::extract::State;
use axum::http::{HeaderName, header};
use utoipa::ToSchema;

use super::Agent;
use super::body::blocking;
use super::runs::found;
use crate::jobs::Stage;

/// Content security policy of a report. The policy permits the report's own script and style, but no access to this
/// agent or any other server.
const PAGE_POLICY: &str = "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; frame-ancestors 'self'";

/// Page that a browser opens without other files.
#[derive(ToSchema)]
#[schema(value_type = String)]
#[expect(dead_code, reason = "describes a body")]
pub(super) struct ReportPage(String);

/// Returns the report of the last motion of a finished job: a page with figures and plots.
///
/// The page is like the report of `jtc traj run`. Its data are the statuses received during the motion. The agent keeps
/// the reports of the last 16 jobs, up to 64 MB in total.
#[utoipa::path(
    get,
    path = "/api/jobs/{number}/report",
    operation_id = "get_report",
    params(("number" = u64, Path, description = "Number of the job")),
    responses(
        (status = 200, description = "Report page", body = ReportPage, content_type = "text/html"),
        (status = 404, description = "No job has this number, or the job has no report", body = Problem),
        (status = 409, description = "The job is still running", body = Problem),
        Refusals
    )
)]
pub(super) async fn report(
    State(agent): State<Agent>,
    Number(number): Number<u64>,
) -> Result<([(HeaderName, &'static str); 4], String), Problem> {
    let job = found(&agent, number)?;
    if job.stage == Stage::Running {
        let message = format!("job {number} is still running: its report is written when it has ended");
        return Err(Problem::new("busy", message, "request the report again after the event ended"));
    }
    let report = job.done.report.ok_or_else(|| {
        let message = format!(
            "job {number} has no report: it moved nothing, or reports of later jobs have replaced it"
        );
        let next = "find the jobs with a report with GET /api/jobs; `jtc serve --record` keeps all motions";
        Problem::nothing("report", number, "/api/jobs").message(message).next(next)
    })?;
    let room = agent.reports.clone().acquire_owned().await;
    let page = blocking(move || {
        let page = report.html();
        drop(room);
        page
    });
    let headers = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CONTENT_SECURITY_POLICY, PAGE_POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    Ok((headers, page.await?))
}
