//! Measurement of Stops under each load. For comparison, it also measures simple round trips to a server that uses
//! the HTTP library of the agent.
use std::net::TcpListener;
use std::time::{Duration, Instant};

use serde_json::{Map, Value};
use test_kit::http::Http;

use crate::common::Served;
use crate::crowd::Crowd;
use crate::line::{self, Watch};
use crate::operator::Operator;

/// Time between two Stops, within which the record of the first Stop arrives. A random time up to `AT_ANY_TIME_US` is
/// added, so that Stops occur at random times between two statuses.
const BETWEEN: Duration = Duration::from_millis(220);
const AT_ANY_TIME_US: u64 = 120_000;
/// Longest wait for an event. If the event does not occur within this time, the measurement has failed.
const PATIENCE: Duration = Duration::from_secs(10);
/// Number of bytes of an upload that the agent has written to the line before the Stop.
const UPLOADED: usize = 300;

/// Measurements under one load, ms.
#[derive(Default)]
struct Samples {
    /// Time from the start of the request (before it connects) to the first and to the last byte of the Stop on the line.
    first: Vec<f64>,
    last: Vec<f64>,
    /// Time from a request to the response of a server that answers every request at once.
    bare: Vec<f64>,
    /// Silence after an interrupted frame.
    gaps: Vec<f64>,
    queued_most: usize,
}

/// Measures `n` Stops under each load and prints the results. If a measurement fails, its load is listed under `failed` with the cause.
pub(crate) fn print(n: usize) {
    let (port, watch) = line::begin();
    let served = Served::start_on(port, None, &[]);
    let bare = bare_server();
    let operator = Operator::come(&served, &watch);
    std::thread::sleep(Duration::from_secs(1));
    let (mut figures, mut failed) = (Map::new(), Map::new());
    let mut take = |load: &str, measured: Result<Samples, String>| match measured {
        Ok(samples) => samples.put(&mut figures, load),
        Err(why) => drop(failed.insert(load.to_owned(), why.into())),
    };
    take("idle", measure("idle", n, &served, &bare, &watch, 0));
    let crowd = Crowd::gather(served.address);
    take("viewers", measure("viewers", n, &served, &bare, &watch, 0));
    operator.upload(true);
    take("upload", measure("upload", n, &served, &bare, &watch, UPLOADED));
    figures.insert("stop.viewers_hz".into(), crowd.dismiss().into());
    if !failed.is_empty() {
        figures.insert("failed".into(), failed.into());
    }
    println!("{}", Value::Object(figures));
}

/// Starts a server that answers every request at once, with the library and the settings of the agent.
fn bare_server() -> Http {
    let listener = TcpListener::bind("127.0.0.1:0").expect("an address");
    let address = listener.local_addr().expect("it listens");
    let router = axum::Router::new().route("/", axum::routing::post(async || "{}"));
    std::thread::spawn(move || jtc_agent::serve::serve(router, listener, None, || false));
    Http { address, operator: String::new() }
}

fn measure(
    what: &str,
    n: usize,
    served: &Served,
    bare: &Http,
    watch: &Watch,
    uploaded: usize,
) -> Result<Samples, String> {
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    let mut samples = Samples::default();
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    watch.look().queued_most = 0;
    for _ in 0..n {
        // The xorshift64 generator selects a random time in the status cycle and a random position in a frame.
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        std::thread::sleep(BETWEEN + Duration::from_micros(state % AT_ANY_TIME_US));
        let asked = Instant::now();
        answered("the bare server", bare.get("POST /").0)?;
        samples.bare.push(ms(asked.elapsed()));
        wait("bytes of an upload", || watch.look().since_stop >= uploaded)?;
        let before = watch.look().stops.len();
        let asked = Instant::now();
        answered("a Stop", served.get("POST /api/stop").0)?;
        wait("a Stop on the line", || watch.look().stops.len() > before)?;
        let stop = watch.look().stops[before];
        samples.first.push(ms(stop.first_byte.saturating_duration_since(asked)));
        samples.last.push(ms(stop.last_byte.saturating_duration_since(asked)));
        samples.gaps.extend(stop.gap.map(ms));
    }
    eprintln!("{what}: {n} Stops");
    samples.queued_most = watch.look().queued_most;
    Ok(samples)
}

fn answered(what: &str, status: u16) -> Result<(), String> {
    if status == 200 { Ok(()) } else { Err(format!("{what}: HTTP status {status}")) }
}

fn wait(what: &str, reached: impl Fn() -> bool) -> Result<(), String> {
    let begun = Instant::now();
    while !reached() {
        if begun.elapsed() >= PATIENCE {
            return Err(format!("{what}: none within {} s", PATIENCE.as_secs()));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok(())
}

impl Samples {
    fn put(&self, figures: &mut Map<String, Value>, load: &str) {
        let kinds =
            [("stop", "first", &self.first), ("stop", "last", &self.last), ("bare", "http", &self.bare)];
        for (group, kind, samples) in kinds {
            let mut sorted = samples.clone();
            sorted.sort_by(f64::total_cmp);
            let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
            for (name, share) in [("median", 0.5), ("99", 0.99), ("worst", 1.0)] {
                figures.insert(format!("{group}.{load}_{kind}_{name}_ms"), at(share).into());
            }
        }
        if !self.gaps.is_empty() {
            let lowest = self.gaps.iter().copied().fold(f64::INFINITY, f64::min);
            figures.insert(format!("stop.{load}_gap_ms"), lowest.into());
            figures.insert(format!("stop.{load}_abandoned"), self.gaps.len().into());
        }
        figures.insert(format!("stop.{load}_queued_bytes"), self.queued_most.into());
    }
}
