//! Tests of firmware updates by HTTP: upload of an image, write to a board, and read back.
use crate::common;

use std::time::Duration;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use common::Served;
use serde_json::{Value, json};

/// Returns the example image in the protocol document, in base64. The Program ID of the example image is 0x4B3F.
fn golden(bytes: usize) -> String {
    STANDARD.encode((0..bytes).map(|i| (37 * i + 11) as u8).collect::<Vec<u8>>())
}

fn request(boards: Value, bytes: usize) -> Value {
    json!({ "boards": boards, "image": golden(bytes), "format": "bin", "date": "2009-06-01" })
}

/// D-44, D-45: after an update, the board reports the checksum and the date of the image.
#[test]
fn d44_an_image_is_uploaded_written_and_read_back() {
    let (served, key) = Served::numbered(2);
    let before = served.board(2);
    let flash = before["flash_number"].as_u64().expect("a number");
    let body = request(json!([{ "board": 2, "flash_number": flash }]), 1000);
    let number = served.begin("POST /api/updates", &key, Some(body.clone()));
    // While an update runs, the agent accepts no other update and no other command.
    let (status, busy) = served.api("POST /api/updates", Some(&key), Some(body.clone()));
    assert_eq!((status, busy["code"].as_str()), (409, Some("busy")), "{busy}");
    assert_eq!(served.api("POST /api/boards/1/start", Some(&key), None).0, 409);
    let job = served.over(number);
    let board = &job["update"]["boards"][0];
    assert_eq!(
        (job["stage"].as_str(), board["outcome"].as_str()),
        (Some("finished"), Some("verified")),
        "{job}"
    );
    assert_eq!((board["verified"].as_bool(), board["program_id_after"].as_u64()), (Some(true), Some(0x4B3F)));
    assert_ne!(board["program_id_before"], 0x4B3F, "{job}");
    let after = served.board(2);
    assert_eq!(
        (after["program_id"].as_u64(), after["flash_date"].as_str()),
        (Some(0x4B3F), Some("2009-06-01"))
    );
    // Events report the progress of the update until the end of both cycles.
    let (_, all) = served.api(&format!("GET /api/events?job={number}"), None, None);
    let entries = all["events"].as_array().expect("events");
    let all: Vec<&Value> = entries.iter().map(|e| &e["event"]).collect();
    let progress: Vec<&&Value> = all.iter().filter(|event| event["kind"] == "progress").collect();
    let bytes: Vec<u64> = progress.iter().filter_map(|event| event["bytes"].as_u64()).collect();
    assert!(bytes.len() > 2 && bytes.is_sorted() && bytes.last() == Some(&2176), "{bytes:?}");
    // Within a cycle there are at most five progress events per second, so that they do not remove other events from the journal.
    let times: Vec<(f64, &Value)> = entries
        .iter()
        .filter(|entry| entry["event"]["kind"] == "progress" && entry["event"]["bytes"] != 2176)
        .map(|entry| (entry["unix_s"].as_f64().expect("a time"), &entry["event"]["cycle"]))
        .collect();
    assert!(times.windows(2).all(|w| w[0].1 != w[1].1 || w[1].0 - w[0].0 > 0.1), "{times:?}");
    assert_eq!(all.last().map(|event| &event["outcome"]), Some(&json!("finished")));
    // After a second update with the same image, the agent reports the board as up to date.
    let job = served.job("POST /api/updates", &key, Some(body));
    assert_eq!(job["update"]["boards"][0]["outcome"], "up-to-date", "{job}");
}

/// D-62: if the same image has another address, the agent writes its bytes again. A program without a record in the
/// agent is not reported as verified. U-3: if an update has no date, the board keeps the date of its program.
#[test]
fn d62_what_the_agent_wrote_is_what_it_knows() {
    let (served, key) = Served::numbered(1);
    let record = |address: u8, sum: &str| {
        let text = format!(":04{address:02X}000001020304{sum}\n:00000001FF\n");
        json!({ "boards": [{ "board": 1 }], "image": STANDARD.encode(text), "date": "2009-06-01" })
    };
    let update = |body: Value| {
        let job = served.job("POST /api/updates", &key, Some(body));
        let board = &job["update"]["boards"][0];
        let outcome = board["outcome"].as_str().unwrap_or_default().to_owned();
        (outcome, board["verified"] == true, job["stage"].as_str().unwrap_or_default().to_owned())
    };
    let is = |outcome: &str, verified: bool, stage: &str| (outcome.to_owned(), verified, stage.to_owned());
    let (low, high) = (record(0, "F2"), record(4, "EE"));
    assert_eq!(update(low.clone()), is("verified", true, "finished"));
    assert_eq!(update(low.clone()), is("up-to-date", true, "finished"));
    assert_eq!(update(high.clone()), is("verified", true, "finished"));
    let mut today = high.clone();
    today.as_object_mut().expect("an object").remove("date");
    assert_eq!(update(today), is("up-to-date", true, "finished"));
    let mut again = high;
    again["rewrite"] = json!(true);
    assert_eq!(update(again), is("verified", true, "finished"));
}

/// D-46: the request declares the file as raw binary, but the file contains records. The agent starts no job for a raw binary
/// file that contains records.
#[test]
fn d46_records_are_no_raw_bytes() {
    let (served, key) = Served::numbered(1);
    for text in
        [":00000001FF\n", ":0400000001020304F3\n", "S9030000FC\n", "dear reader, this is no firmware\n"]
    {
        let mut body = request(json!([{ "board": 1 }]), 1000);
        body["image"] = json!(STANDARD.encode(text));
        let (status, error) = served.api("POST /api/updates", Some(&key), Some(body));
        assert_eq!(status, 422, "{text}: {error}");
    }
}

/// D-46: the agent fills a gap of an image only on request. The result of the job then shows the gap and the byte.
#[test]
fn d46_a_gap_is_filled_on_request_and_shown() {
    let (served, key) = Served::numbered(1);
    let hole = ":0400000001020304F2\n:0400100001020304E2\n:00000001FF\n";
    let mut body = json!({ "boards": [{ "board": 1 }], "image": STANDARD.encode(hole), "dry_run": true });
    let (status, error) = served.api("POST /api/updates", Some(&key), Some(body.clone()));
    assert!(status == 422 && error["next"].to_string().contains("set fill_gaps to 255"), "{status} {error}");
    for wrong in [json!(256), json!(-1), json!("FF"), json!(true)] {
        body["fill_gaps"] = wrong;
        assert_eq!(served.api("POST /api/updates", Some(&key), Some(body.clone())).0, 422);
    }
    body["fill_gaps"] = json!(0x3E);
    let job = served.job("POST /api/updates", &key, Some(body));
    let notes = json!(["gap of 12 bytes at word address 0x2 filled with 3E"]);
    assert_eq!((&job["update"]["notes"], &job["stage"]), (&notes, &json!("finished")), "{job}");
}

/// D-46: the agent does not send an image to a board if the image is for another board.
#[test]
fn d46_the_wrong_board_and_what_is_no_image_are_refused() {
    let (served, key) = Served::numbered(1);
    let wrong = request(json!([{ "board": 1, "flash_number": 0x7777 }]), 1000);
    let job = served.job("POST /api/updates", &key, Some(wrong));
    assert_eq!(
        (job["stage"].as_str(), job["update"]["boards"][0]["outcome"].as_str()),
        (Some("failed"), Some("not-started"))
    );
    assert_ne!(served.board(1)["program_id"], 0x4B3F);
    for body in [
        json!({ "boards": [], "image": golden(10), "format": "bin" }),
        json!({ "boards": [{ "board": 1 }], "image": "no base64!" }),
        json!({ "boards": [{ "board": 1 }], "image": STANDARD.encode(":00000001XX"), "format": "hex" }),
        json!({ "boards": [{ "board": 1 }], "image": golden(10), "format": "bin", "date": "2023-02-29" }),
        json!({ "boards": [{ "board": 1 }], "image": golden(2 << 20), "format": "bin" }),
        json!({ "boards": [{ "board": 1 }], "image": golden(10), "format": "exe" }),
        json!({ "boards": [{ "board": 1 }] }),
        json!({ "boards": [1], "image": golden(10), "format": "bin" }),
    ] {
        let (status, error) = served.api("POST /api/updates", Some(&key), Some(body.clone()));
        assert!(
            status == 422 && !error["message"].as_str().unwrap_or_default().is_empty(),
            "{status} {error}"
        );
        // The message has no words of the program, such as the name of a type.
        assert!(!error["message"].to_string().contains("struct"), "{error}");
    }
    assert_eq!(
        served.api("GET /api/jobs", None, None).1.as_array().map(Vec::len),
        Some(2),
        "nothing more was begun"
    );
}

/// Boards continue to run if the agent refuses their update, or if the update is only a dry run. When the lease lapses, the agent
/// still stops the boards whose update was refused.
#[test]
fn boards_whose_update_is_refused_are_still_stopped_at_the_lapse() {
    let (served, key) = Served::numbered(2);
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    let key = served.lease("anna", 5.0, "stop");
    served.run(&key, &[1, 2]);
    let last = served.last_event();
    let mut body = request(json!([{ "board": 1 }, { "board": 2 }]), 1000);
    body["dry_run"] = json!(true);
    let job = served.job("POST /api/updates", &key, Some(body));
    assert!(job["error"]["message"].as_str().is_some_and(|m| m.contains("running")), "{job}");
    assert_eq!(served.board(1)["state"], "running");
    served.event(last, "stopped", |event| event["kind"] == "stopped" && event["boards"] == json!([1, 2]));
}

/// D-46: a Stop does not end an update that is in progress. The lease holder can cancel an update.
#[test]
fn d46_a_stop_does_not_end_an_update_and_a_cancel_does() {
    let (served, key) = Served::numbered(1);
    let progress = |event: &Value| event["kind"] == "progress";
    let mut peer = served.chain.peer();
    let last = served.last_event();
    let number = served.begin("POST /api/updates", &key, Some(request(json!([{ "board": 1 }]), 1000)));
    served.event(last, "progress", progress);
    assert_eq!(served.api("POST /api/stop", Some(&key), None).0, 200);
    common::frame(&mut *peer, 0x600, &[0, 0, 0, 0]);
    let running = served.api(&format!("GET /api/jobs/{number}"), None, None).1;
    let job = served.over(number);
    assert_eq!(running["stage"], "running", "the Stop did not wait for it: {running}");
    assert_eq!(
        (job["stage"].as_str(), job["update"]["boards"][0]["verified"].as_bool()),
        (Some("finished"), Some(true)),
        "{job}"
    );
    served.event(last, "stopped", |event| event["kind"] == "stopped");
    // The test cancels an update with another image.
    let last = served.last_event();
    let number = served.begin("POST /api/updates", &key, Some(request(json!([{ "board": 1 }]), 60_000)));
    served.event(last, "progress", progress);
    assert_eq!(served.api(&format!("DELETE /api/jobs/{number}"), Some(&key), None).0, 204);
    let job = served.over(number);
    assert_eq!(
        (job["stage"].as_str(), job["update"]["boards"][0]["outcome"].as_str()),
        (Some("cancelled"), Some("cancelled")),
        "{job}"
    );
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(served.api(&format!("DELETE /api/jobs/{number}"), Some(&key), None).0, 409);
    // The flash was not erased, so the board still has its old program. However, since the start of an update, the
    // agent does not know the contents of the flash (D-62). The agent therefore reports only that the program is up to
    // date.
    let job = served.job("POST /api/updates", &key, Some(request(json!([{ "board": 1 }]), 1000)));
    assert_eq!(job["update"]["boards"][0]["outcome"], "program-up-to-date", "{job}");
}

#[test]
fn a_doctor_finds_nothing_wrong_and_then_a_board_that_is_silent() {
    let (served, key) = Served::numbered(2);
    let worst = |job: &Value| job["findings"][0]["severity"].as_str().map(str::to_owned);
    let job = served.job("POST /api/doctor", &key, None);
    assert_eq!((job["stage"].as_str(), worst(&job).as_deref()), (Some("finished"), Some("good")), "{job}");
    served.chain.fault("foreign-frames");
    let job = served.job("POST /api/doctor", &key, None);
    assert!(worst(&job).is_some_and(|worst| worst != "good"), "{job}");
}
