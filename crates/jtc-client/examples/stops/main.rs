//! Measures the time until a Stop is on the line, and prints one JSON object. Run the example with `cargo run --profile dist -p jtc-client
//! --example stops [N]` for N Stops under each load.
//!
//! The agent owns a pseudo-terminal at 115,200 Bd, to which a simulated controller is connected. The viewers are in a separate process.
#[cfg(unix)]
#[path = "../../tests/common/mod.rs"]
#[allow(dead_code, reason = "the tests use more")]
mod common;
#[cfg(unix)]
mod crowd;
#[cfg(unix)]
mod line;
#[cfg(unix)]
mod measure;
#[cfg(unix)]
mod operator;

#[cfg(unix)]
fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match words.as_slice() {
        [what, address] if what == "crowd" => crowd::look(address),
        [] => measure::print(200),
        [n] => measure::print(n.parse().expect("how many Stops")),
        _ => panic!("stops [N]"),
    }
}

#[cfg(not(unix))]
fn main() {
    println!("{{}}");
}
