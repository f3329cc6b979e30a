//! Simulates hours of operation with random commands and faults: `soak --hours 24 --seed 1`. If an invariant is
//! violated, the exit code is 1.
use std::process::ExitCode;
use std::time::Instant;

use sim_checks::soak::Soak;

/// Time after which the example creates a new world with the next seed, ms.
const WORLD_MS: u64 = 600_000;

fn main() -> Result<ExitCode, String> {
    let mut arguments = std::env::args().skip(1);
    let (mut hours, mut seed) = (1.0_f64, 1_u64);
    while let Some(name) = arguments.next() {
        let value = arguments.next().ok_or(format!("{name} needs a value"))?;
        match name.as_str() {
            "--hours" => hours = value.parse().map_err(|e| format!("--hours {value}: {e}"))?,
            "--seed" => seed = value.parse().map_err(|e| format!("--seed {value}: {e}"))?,
            _ => return Err(format!("{name} is no option; there are --hours and --seed")),
        }
    }
    let mut left = (hours * 3.6e6) as u64;
    let start = Instant::now();
    let (mut total, mut finished, mut faults, mut commands) = (0.0, 0, 0, 0);
    while left > 0 {
        let ms = left.min(WORLD_MS);
        let mut soak = Soak::new(seed);
        let good = soak.run(ms);
        let report = soak.report();
        if !good {
            println!("seed {seed}: {report}");
            for entry in soak.world().log().entries() {
                println!("{entry}");
            }
            return Ok(ExitCode::FAILURE);
        }
        total += report.seconds;
        finished += report.finished;
        faults += report.faults;
        commands += report.commands;
        println!("seed {seed}: {report}");
        left -= ms;
        seed += 1;
    }
    let took = start.elapsed().as_secs_f64();
    println!(
        "{:.2} h of virtual time in {took:.1} s ({:.0} times real time): {commands} commands, {faults} faults, \
         {finished} motions finished; every invariant held",
        total / 3600.0,
        total / took
    );
    Ok(ExitCode::SUCCESS)
}
