//! Measures the processor time for one simulated millisecond of arm, drives, bus and controller while the arm follows
//! a motion. Prints one JSON object.
use jtc_sim::{ModelError, Operator, SimConfig, host};
use jtc_wire::ExecCommand;
use test_kit::clock::CpuTime;

/// Number of simulated milliseconds per measurement.
const BATCH: u32 = 200;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let config = SimConfig { baud: None, model_error: ModelError::default(), ..SimConfig::default() };
    let mut operator = Operator::new(config);
    operator.bring_up()?;
    let points = host::there_and_back(&[0.0; 6], &[0.6, -0.4, 0.5, 0.8, -0.6, 0.7], 2.5, 20, 10);
    operator.upload(&points, 10)?;
    operator.ask(&host::exec(ExecCommand::Execute))?;
    let world = &mut operator.world;
    let mut sink = [0; 4096];
    let mut times: Vec<f64> = (0..400)
        .map(|_| {
            let start = CpuTime::now();
            for _ in 0..BATCH {
                world.step();
                std::hint::black_box(world.host_read(&mut sink));
            }
            start.elapsed_ns() / f64::from(BATCH)
        })
        .collect();
    times.sort_by(f64::total_cmp);
    // The result is the 10th percentile of the measured times. The minimum is not used, because ticks during the
    // motion and after the motion have different costs.
    let ns = times[times.len() / 10];
    println!(
        "{{\"name\":\"simulated_millisecond\",\"ns\":{ns:.1},\"real_time_factor\":{:.0},\"state\":\"{:?}\"}}",
        1e6 / ns,
        world.telemetry().state,
    );
    Ok(())
}
