//! Tests of jogging over a slow connection. Requests that arrive late do not move a joint.
use crate::common;

use std::time::Duration;

use common::Served;
use common::program::Program;
use serde_json::{Value, json};
use test_kit::patience::{Patience, until};

/// Waits until the controller holds the arm and accepts jogging. The controller accepts jogging only after the joints
/// carry their load.
fn ready(anna: &Program<'_>) {
    anna.recover();
    let still = json!({ "rates_rad_s": vec![0.0; 6] });
    until("an arm that can be jogged", || anna.ask("POST /api/jog", Some(still.clone())).0 == 204);
}

/// Returns the time of the present status and the position in this status, as a user sees them.
fn seen(served: &Served) -> (u64, f64) {
    let (_, status) = served.api("GET /api/status", None, None);
    let position = status["controller"]["joints"][5]["position_rad"].as_f64().expect("it is measured");
    (status["at_ms"].as_u64().expect("a time"), position)
}

/// Requests a jog of the last joint, and returns the response. The request contains the time of the status that the
/// user saw.
fn jog(anna: &Program<'_>, as_of_ms: u64, rate: f64) -> (u16, Value) {
    let body = json!({ "rates_rad_s": [0.0, 0.0, 0.0, 0.0, 0.0, rate] });
    anna.ask(&format!("POST /api/jog?as_of_ms={as_of_ms}"), Some(body))
}

#[test]
fn a_jog_moves_by_what_was_seen_just_now_and_not_by_what_was_seen_before() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    ready(&anna);
    let (old_ms, before) = seen(&served);
    std::thread::sleep(Duration::from_millis(700));
    for _ in 0..5 {
        let (status, error) = jog(&anna, old_ms, 0.3);
        assert_eq!((status, error["code"].as_str()), (409, Some("late")), "{error}");
        assert!(error["value"].as_f64().is_some_and(|late| late >= 700.0), "{error}");
        assert_eq!(error["limit"], 500.0, "{error}");
        assert!(error["next"].as_str().is_some_and(|next| next.contains("faster connection")), "{error}");
        std::thread::sleep(Duration::from_millis(100));
    }
    let (now_ms, after) = seen(&served);
    assert!((after - before).abs() < 1e-3, "{before} {after}");
    assert!(now_ms >= old_ms + 1_200, "{old_ms} {now_ms}");
    // A jog request with the time of the present status moves the joint.
    let mut patience = Patience::begin();
    loop {
        let (now_ms, position) = seen(&served);
        if position > before + 0.05 {
            break;
        }
        let (status, error) = jog(&anna, now_ms, 0.3);
        assert_eq!(status, 204, "{error}");
        patience.pause(format_args!("a jog away from {before}: {position}"));
    }
    // The agent accepts a request to end a jog with any delay, and even with a time that no agent has sent.
    for as_of_ms in [old_ms, u64::MAX] {
        let (status, error) = jog(&anna, as_of_ms, 0.0);
        assert_eq!(status, 204, "{error}");
    }
    // A request to end the jog needs no time, but an invalid time is refused.
    let body = json!({ "rates_rad_s": vec![0.0; 6] });
    assert_eq!(anna.ask("POST /api/jog?as_of_ms=-1", Some(body.clone())).0, 400);
    assert_eq!(anna.ask("POST /api/jog", Some(body)).0, 204);
}

#[test]
fn a_status_that_no_agent_has_shown_yet_is_none() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    ready(&anna);
    let (now_ms, before) = seen(&served);
    let (status, error) = jog(&anna, now_ms + 60_000, 0.3);
    assert_eq!((status, &error["value"]), (400, &json!((now_ms + 60_000) as f64)), "{error}");
    assert!(error["limit"].as_f64().is_some_and(|limit| limit >= now_ms as f64), "{error}");
    assert!((seen(&served).1 - before).abs() < 1e-3);
}

/// Each status of a stream contains its time. Clients can therefore detect late messages, even if the messages arrive
/// at regular intervals.
#[test]
fn each_status_of_a_stream_has_the_time_when_it_was_made() {
    let served = Served::start(921_600);
    let (before, mut times) = (seen_at(&served), Vec::new());
    served.stream("/api/stream", |message| {
        if message["kind"] == "status" {
            times.push(message["at_ms"].as_u64().expect("a time"));
        }
        times.len() == 10
    });
    let after = seen_at(&served);
    assert!(times.is_sorted() && times.first() >= Some(&before) && times.last() <= Some(&after), "{times:?}");
}

fn seen_at(served: &Served) -> u64 {
    served.api("GET /api/status", None, None).1["at_ms"].as_u64().expect("a time")
}
