//! Tests of the flight recorder by HTTP: its state, its log as a file, and the start of a new log.
use crate::common;

use common::Served;
use common::program::Program;
use jtc_host::log::{Account, FlightLog};
use jtc_host::recording::Recording;
use serde_json::{Value, json};
use test_kit::written::text_with;

fn blocks(served: &Served) -> u64 {
    let (status, log) = served.api_as(Some(&served.tokens.viewer), "GET /api/log/status", None, None);
    assert_eq!((status, log["state"].as_str()), (200, Some("recording")), "{log}");
    log["blocks"].as_u64().expect("a number")
}

#[test]
fn the_log_is_a_recording_that_can_be_replayed_and_is_cleared_by_the_one_who_commands() {
    let served = Served::start(460_800);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    anna.recover();
    let before = blocks(&served);
    let job = anna.begin("POST /api/moves", json!({ "to_rad": [0.5, 0.0, 0.0, 0.0, 0.0, 0.0] }));
    assert_eq!(anna.over(job)["stage"], "finished");
    assert!(blocks(&served) > before, "it records");
    // Two requests for the log are sent at the same time. The agent serves one of them, and refuses the other request
    // or serves it afterwards. While the log is read, the agent serves other requests.
    let (viewer, operator) = (&served.tokens.viewer, &served.tokens.operator);
    let files = std::thread::scope(|scope| {
        let both = [(); 2].map(|()| scope.spawn(|| served.bytes_as(Some(operator), "GET /api/log")));
        assert_eq!(served.get("POST /api/pause").0, 200);
        assert_eq!(served.api("GET /api/info", None, None).0, 200);
        both.map(|one| one.join().expect("an answer"))
    });
    assert!(files.iter().any(|(status, ..)| *status == 200), "{files:?}");
    let refused = files.iter().filter(|(status, ..)| *status != 200);
    for (status, _, body) in refused {
        let error: Value = serde_json::from_slice(body).expect("JSON");
        assert_eq!((*status, error["code"].as_str()), (409, Some("busy")), "{error}");
    }
    let (_, head, file) = files.iter().find(|(status, ..)| *status == 200).expect("one of them");
    assert!(head.to_ascii_lowercase().contains("content-type: application/octet-stream"), "{head}");

    // The file is equal to the output of `jtc log fetch`: a recording that any MCAP tool can read. The file also
    // contains the original log, from which the calculation of each tick can be repeated.
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("log.mcap");
    std::fs::write(&path, file).expect("a file");
    let samples = Recording::read(&path).expect("a recording").samples;
    let account = Account::of(FlightLog::load(&path).expect("a log"), None, "the test");
    assert!(account.replayed.difference.is_none() && account.replayed.same > 1000, "{:?}", account.story);
    assert_eq!(samples.len(), account.replayed.ticks.len());
    let said: Vec<&str> = account.story.events.iter().map(|event| event.text.as_str()).collect();
    assert!(said.iter().any(|text| text.contains("HoldPos")), "{said:?}");

    // The response contains the values of every tick in the last 0.5 s, in 501 rows. The values are equal to the
    // values in the recording.
    let (status, values) = served.api_as(Some(operator), "GET /api/log/values?last_s=0.5", None, None);
    assert_eq!(status, 200, "{values}");
    let column = |of: &Value| -> Vec<f64> {
        of.as_array().expect("a column").iter().map(|value| value.as_f64().expect("a number")).collect()
    };
    let times = column(&values["times_s"]);
    assert_eq!((times.len(), times.last()), (501, Some(&0.0)));
    assert!(times.windows(2).all(|two| (two[1] - two[0] - 1e-3).abs() < 1e-9), "{times:?}");
    let joints = values["joints"].as_array().expect("joints");
    assert_eq!((joints.len(), values["state"].as_str()), (6, Some("HoldPos")));
    let last = samples.last().expect("samples");
    for (joint, then) in joints.iter().zip(&last.joints) {
        let columns = ["position_rad", "commanded_rad", "error_rad", "velocity_rad_s", "torque_nm"]
            .map(|key| column(&joint[key]));
        assert!(columns.iter().all(|column| column.len() == times.len()));
        // The arm was at rest during all ticks of the response.
        let [position, commanded, error, velocity, torque] = columns.map(|column| column[column.len() - 1]);
        assert!(
            (position - then.position).abs() < 1e-3 && (commanded - then.set_position).abs() < 1e-6,
            "{joint}"
        );
        assert!(error.abs() < 2e-3 && velocity.abs() < 0.02 && (torque - then.torque).abs() < 2.0, "{joint}");
    }
    let (status, error) = served.api_as(Some(operator), "GET /api/log/values?last_s=61", None, None);
    assert_eq!(
        (status, error["value"].as_f64(), error["limit"].as_f64()),
        (400, Some(61.0), Some(60.0)),
        "{error}"
    );
    assert_eq!(served.api_as(Some(viewer), "GET /api/log/values", None, None).0, 403);

    // Clients without the right of an operator cannot read or clear the log.
    assert_eq!(served.api_as(Some(viewer), "GET /api/log", None, None).0, 403);
    let mut looks = served.session("bob", Some(viewer));
    assert!(looks.log_status().is_ok() && looks.fetch_log(|_, _| {}).is_err());
    for (token, key) in [(viewer, None), (operator, None)] {
        assert_eq!(served.api_as(Some(token), "DELETE /api/log", key, None).0, 403);
    }
    assert_eq!(served.api_as(None, "DELETE /api/log", Some(&anna.key), None).0, 403);
    assert_eq!(anna.ask("DELETE /api/log", None).0, 204);
    text_with(&served.log, &["\"clear log\""]);
    let (_, _, file) = served.bytes_as(Some(operator), "GET /api/log");
    std::fs::write(&path, &file).expect("a file");
    if let Ok(log) = FlightLog::load(&path) {
        let again = Account::of(log, None, "the test");
        let last = account.replayed.ticks.last().map(|tick| tick.tick);
        assert!(again.replayed.ticks.first().map(|tick| tick.tick) > last, "what was before is gone");
    } else {
        let error: Value = serde_json::from_slice(&file).expect("JSON");
        assert_eq!(error["code"], "empty-log");
    }
}
