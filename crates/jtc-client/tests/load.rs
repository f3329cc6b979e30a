//! Tests with many viewers and one lease holder. The clients do not disturb each other, and the agent disconnects a
//! client that does not read its messages.
#[allow(dead_code, reason = "the suite uses more")]
mod common;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use common::{Served, socket};
use jtc_host::check::CheckOptions;
use jtc_host::session::{Flow, Outcome};
use jtc_host::{Arm, CheckedTrajectory, plan};
use test_kit::patience::LONGEST;
use tungstenite::Message;

const VIEWERS: usize = 50;

/// Returns the memory use of this process, kB.
fn memory() -> usize {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

#[test]
fn fifty_look_one_commands_and_those_who_never_read_are_put_out_without_a_trace() {
    let served = Served::start(921_600);
    let mut anna = served.operator("anna");
    anna.use_defaults().expect("it takes them");
    anna.wait_ready(LONGEST).expect("it holds the arm");
    let (ended, seen) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
    let address = served.address;
    let viewers: Vec<_> = (0..VIEWERS)
        .map(|_| {
            let (ended, seen) = (ended.clone(), seen.clone());
            std::thread::spawn(move || {
                let mut socket = socket(address, "stream");
                let mut statuses = 0;
                while !ended.load(Ordering::Relaxed) {
                    if let Ok(Message::Text(text)) = socket.read()
                        && text.contains("\"kind\":\"status\"")
                    {
                        statuses += 1;
                    }
                }
                seen.fetch_add(1, Ordering::Relaxed);
                statuses
            })
        })
        .collect();
    // Some clients request all data, but do not read the data.
    let deaf: Vec<_> = ["stream", "line", "foxglove"]
        .iter()
        .flat_map(|path| (0..4).map(move |_| *path))
        .map(|path| socket(address, path))
        .collect();
    std::thread::sleep(Duration::from_secs(1));
    let before = memory();
    let arm = Arm::avena();
    let to = [0.4, -0.3, 0.3, 0.4, -0.3, 0.4];
    let trajectory = plan::joint_move(&[0.0; 6], &to, &arm.config(), 8.0).expect("it is within the limits");
    let checked = CheckedTrajectory::check(&trajectory, &arm, &[0.0; 6], &CheckOptions::default());
    let checked = checked.expect("it is within the limits");
    anna.upload(&checked, |_| Flow::Continue).expect("it takes it");
    anna.execute(&checked).expect("it starts");
    let begun = Instant::now();
    let outcome = anna.follow(|_| {
        if begun.elapsed() > Duration::from_secs(3) {
            // A client sends a Stop under full load.
            let _ = served.get("POST /api/stop");
        }
        Flow::Continue
    });
    assert!(matches!(outcome, Ok(Outcome::Stopped(_))), "{outcome:?}");
    let grown = memory().saturating_sub(before);
    assert!(grown < 64 << 10, "{grown} kB more");
    ended.store(true, Ordering::Relaxed);
    for viewer in viewers {
        let statuses = viewer.join().expect("it looked to the end");
        assert!(statuses > 20, "{statuses} statuses");
    }
    assert_eq!(seen.load(Ordering::Relaxed), VIEWERS);
    drop(deaf);
    anna.fresh_status().expect("nobody was disturbed");
}
