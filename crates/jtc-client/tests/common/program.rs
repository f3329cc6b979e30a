//! Program that holds the lease and uses HTTP.
use serde_json::{Value, json};
use test_kit::patience::Patience;
use test_kit::written::text_with;

use super::Served;

/// Program that holds the lease.
pub(crate) struct Program<'a> {
    pub served: &'a Served,
    pub key: String,
}

impl<'a> Program<'a> {
    pub(crate) fn new(served: &'a Served, name: &str, lasts_s: f64, policy: &str) -> Self {
        let body = json!({ "name": name, "lasts_s": lasts_s, "policy": policy });
        let (status, grant) = served.api("POST /api/lease", None, Some(body));
        assert_eq!((status, grant["held"].as_bool()), (200, Some(true)), "{grant}");
        Self { served, key: grant["key"].as_str().expect("a key").to_owned() }
    }

    pub(crate) fn ask(&self, request: &str, body: Option<Value>) -> (u16, Value) {
        self.served.api(request, Some(&self.key), body)
    }

    /// Begins a job.
    pub(crate) fn begin(&self, request: &str, body: Value) -> u64 {
        let (status, job) = self.ask(request, Some(body));
        assert_eq!(status, 202, "{job}");
        job["number"].as_u64().expect("a number")
    }

    pub(crate) fn recover(&self) {
        let job = self.begin("POST /api/recover", json!({ "defaults": true }));
        let done = self.over(job);
        assert_eq!(done["stage"], "finished", "{done}");
    }

    /// Waits for the end of the job and returns the job. The function renews the lease while it waits.
    pub(crate) fn over(&self, job: u64) -> Value {
        over(self.served, job, || drop(self.ask("PUT /api/lease", None)))
    }
}

/// Waits for the end of the job and returns the job.
pub(crate) fn over(served: &Served, job: u64, mut meanwhile: impl FnMut()) -> Value {
    let mut patience = Patience::begin();
    loop {
        let (status, job) = served.api(&format!("GET /api/jobs/{job}"), None, None);
        assert_eq!(status, 200);
        if job["stage"] != "running" {
            return job;
        }
        meanwhile();
        patience.pause(format_args!("the end of the job: {job}"));
    }
}

/// Waits for an event of `kind` after the event number `after`. Returns the event and its number.
pub(crate) fn event(served: &Served, after: u64, kind: &str) -> (u64, Value) {
    let (mut patience, mut last) = (Patience::begin(), after);
    loop {
        let (_, found) = served.api(&format!("GET /api/events?after={last}&wait_s=2"), None, None);
        for event in found["events"].as_array().expect("events") {
            let number = event["number"].as_u64().expect("a number");
            assert_eq!(number, last + 1, "none is left out");
            last = number;
            if event["event"]["kind"] == kind {
                return (number, event["event"].clone());
            }
        }
        patience.pause(format_args!("{kind} behind {after}"));
    }
}

/// Checks that the agent refuses the request of a viewer, of an operator without the lease, and of an operator that
/// waits for the lease.
pub(crate) fn is_for_the_one_who_commands(served: &Served, request: &str, body: &Value) {
    let ask =
        |token: &String, key: Option<&str>| served.api_as(Some(token), request, key, Some(body.clone()));
    let (operator, viewer) = (&served.tokens.operator, &served.tokens.viewer);
    for (token, key) in [(viewer, None), (operator, None), (operator, Some("x"))] {
        let (status, error) = ask(token, key);
        let helps = error["next"].as_str().is_some_and(|next| !next.is_empty());
        assert!(status == 403 && helps, "{request}: {status} {error}");
    }
    let waits = json!({ "name": "bob", "ask": true });
    let (_, grant) = served.api("POST /api/lease", None, Some(waits));
    let (status, error) = ask(operator, grant["key"].as_str());
    assert!(status == 409 && error["message"].as_str().is_some_and(|m| m.contains("anna")), "{error}");
}

/// Returns the lines of the command log that contain this command; at least one must exist.
pub(crate) fn logged(served: &Served, what: &str) -> Vec<Value> {
    let text = text_with(&served.log, &[what]);
    let lines = text.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    lines.filter(|line| line["command"].as_str().is_some_and(|command| command.contains(what))).collect()
}
