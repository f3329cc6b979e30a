//! Tests with random frames on the bus, and with boards that use other profiles.

use proptest::prelude::*;
use ucom::profile::{AliveMode, Endian};
use ucom::{Checksum, Profile};
use ucom_host::master::update::UpdateOutcome;
use ucom_host::master::{InitOptions, Outcome, Request, RunBoard, RunOptions, Setting};

use super::bench::{Bench, CI, PAR, SO};
use super::update::{check_program, options, update};

proptest! {
    /// The test sends random frames at any time during any procedure. The master never panics and never waits endlessly, and each procedure
    /// ends exactly once.
    #[test]
    fn any_frames_into_any_procedure(data in prop::collection::vec(any::<u8>(), 0..400)) {
        ucom_host::master::fuzzing::frames(&data);
    }

    /// This test is like the previous test, but uses identifiers of boards 1 to 3 and valid lengths, so that the master accepts more of the
    /// frames.
    #[test]
    fn likely_frames_into_any_procedure(
        choice: u8,
        frames in prop::collection::vec((0_u8..40, 0_u8..28, 1_u8..4, prop::collection::vec(any::<u8>(), 0..=8)), 0..80),
    ) {
        let mut data = vec![choice];
        for (pause, function, number, payload) in frames {
            let id = u16::from(function) << 6 | u16::from(number);
            data.extend([pause, (id >> 8) as u8, id as u8, payload.len() as u8]);
            data.extend(payload);
        }
        ucom_host::master::fuzzing::frames(&data);
    }
}

/// The test performs init, update and run with boards that have other profiles. In each case, the boards and the master use the same
/// profile.
#[test]
fn other_profiles() {
    let profiles = [
        Profile { endian: Endian::Big, prog_endian: Endian::Big, ..Profile::default() },
        Profile {
            string_count_includes_header: true,
            pd_short_last: true,
            prog_checksum: Checksum::Sum16,
            ..Profile::default()
        },
        Profile {
            chain_auto_opinit: true,
            dlc_strict: true,
            alive_mode: AliveMode::Both,
            ..Profile::default()
        },
        Profile { xreset_keeps_init: false, alive_mode: AliveMode::Unicast, ..Profile::default() },
        Profile { addr_first: 0, addr_broadcast: ucom::profile::Broadcast::ThirtyOne, ..Profile::default() },
        Profile { addr_broadcast: ucom::profile::Broadcast::None, ..Profile::default() },
    ];
    for profile in profiles {
        let mut bench = Bench::chain_with(&[0x0121, 0x0142, 0x0163], profile);
        let Ok(Outcome::Init(report)) = bench.go(Request::Init(InitOptions::default()), 60) else { panic!() };
        assert!(report.is_ok(), "{profile:?}: {:?}", report.findings);
        let first = profile.addr_first as u8;
        let numbers: Vec<_> = report.boards.iter().map(|b| (b.number, b.info.flash_number)).collect();
        assert_eq!(numbers, [(first, 0x0121), (first + 1, 0x0142), (first + 2, 0x0163)]);
        assert!(report.boards.iter().all(|b| b.description.as_deref() == Some("UCoM2 head pan")));
        let report = update(&mut bench, options(&[first + 1], 1000));
        assert_eq!(report.boards[0].outcome, UpdateOutcome::Verified, "{profile:?}: {report:?}");
        check_program(&mut bench, 1, 1000);
        let board = RunBoard {
            board: first + 2,
            ci: vec![Setting { name: CI[1].into(), value: 0x1234 }],
            par: vec![Setting { name: PAR[2].into(), value: 0xABCD }],
        };
        let run = RunOptions { boards: vec![board], active: true, force: false };
        bench.go(Request::Run(run), 60).unwrap_or_else(|e| panic!("{profile:?}: {e}"));
        bench.run(4_000);
        let board = bench.board(2);
        assert!(board.application.active, "{profile:?}");
        assert_eq!(
            (board.application.latched_ci.clone(), board.application.par[2]),
            (vec![7, 0x1234], 0xABCD)
        );
        assert_eq!(bench.master.description(first + 2).unwrap().so, SO);
    }
}
