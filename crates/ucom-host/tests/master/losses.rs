//! Tests in which several chosen frames are lost together. Tests with a single fault do not cover such losses.

use ucom::Profile;
use ucom::node::Phase;
use ucom_host::master::{InitOptions, Request, RunBoard, RunOptions, StopLevel};

use super::bench::{Bench, Exit};
use super::chain::initialised;
use super::update::{options, update};

fn running(boards: &[u8], flash_ids: &[u16]) -> Bench {
    let mut bench = initialised(flash_ids);
    let boards = boards.iter().map(|board| RunBoard { board: *board, ..Default::default() }).collect();
    bench.go(Request::Run(RunOptions { boards, active: true, force: false }), 30).unwrap();
    bench.run(2_000);
    bench
}

/// D-21, D-24: the acknowledgement and the first frame of DSP_INFO are lost. The later frames with this number show
/// that a board has accepted the number, so the master must not repeat PC_INIT. Otherwise, the next board would take
/// the same number, because these boards switch on their outgoing pin by themselves.
#[test]
fn d24_any_frame_of_an_answer_means_the_number_is_taken() {
    let profile = Profile { chain_auto_opinit: true, ..Profile::default() };
    let mut bench = Bench::chain_with(&[0x21, 0x42, 0x63], profile);
    bench.lose = vec![("> 0C1#01", 1), ("> 141#2100", 1)];
    let result = bench.go(Request::Init(InitOptions::default()), 60);
    let numbers: Vec<_> = (0..3).map(|i| bench.board(i).number().map(|n| n.number())).collect();
    assert_eq!(numbers, [Some(1), Some(2), Some(3)], "{result:?}");
}

/// D-46, U-4: a board never answers PC_XRESET. If PC_XRESET is lost, the application still runs, and the master sends the command again.
#[test]
fn d46_a_lost_xreset_is_repeated() {
    let mut bench = initialised(&[0x21]);
    bench.go(Request::Start { board: 1, force: false }, 10).unwrap();
    bench.lose = vec![("< 041#", 1)];
    let report = update(&mut bench, options(&[1], 128));
    assert_eq!(report.exit(), 0, "{report:?}");
    assert_eq!(report.boards[0].attempts, 1);
}

/// A stop command stops the board even if the board's answers do not arrive.
#[test]
fn a_stop_does_not_depend_on_answers() {
    for lost in ["> 141#", "> 601#"] {
        for (level, phase) in [(StopLevel::Loop, Phase::Ready), (StopLevel::Application, Phase::Idle)] {
            let mut bench = running(&[1], &[0x21]);
            bench.lose = vec![(lost, 1000)];
            let result = bench.go(Request::Stop { board: 1, level, force: true }, 30);
            assert!(!bench.board(0).application.running, "{lost} {level:?}: {result:?}");
            assert_eq!(bench.board(0).phase(), phase, "{lost} {level:?}: {result:?}");
        }
    }
}

/// D-51: the stop of all boards is a single frame. If this frame is lost, a repetition stops the boards.
#[test]
fn d51_a_lost_stop_is_repeated() {
    let mut bench = running(&[1, 2], &[0x21, 0x42]);
    bench.lose = vec![("< 600#", 1)];
    bench.cut = vec![1];
    bench.run(6_000);
    assert!(!bench.board(0).application.running);
}
