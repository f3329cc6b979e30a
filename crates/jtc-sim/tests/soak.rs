//! A short soak run, and a test that a soak run is repeatable.
use sim_checks::soak::Soak;

#[test]
fn j24_random_commands_and_faults_break_no_invariant() {
    let (mut finished, mut limited_ms) = (0, 0);
    for seed in 1..=6 {
        let mut soak = Soak::new(seed);
        let good = soak.run(60_000);
        println!("seed {seed}: {}", soak.report());
        if !good {
            for entry in soak.world().log().entries() {
                println!("{entry}");
            }
        }
        assert!(good, "seed {seed}: {}", soak.report());
        finished += soak.report().finished;
        limited_ms += soak.report().limited_ms;
    }
    assert!(
        finished > 5,
        "only {finished} motions came to their end: the run does not reach what it should test"
    );
    assert!(limited_ms > 10, "a torque was at its limit for {limited_ms} ms only: J-43 is not tested");
}
