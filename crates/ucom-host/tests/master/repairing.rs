//! Tests of the repair of one board's number (5.4). Whichever frames are lost, the repair never succeeds while two
//! boards have the same number.

use super::bench::Exit;
use ucom_host::master::{AddressError, Error, IdentityError, Outcome, Request};

use super::bench::{Bench, Fault};
use super::chain::initialised;
use super::update::{options, recorded, update};

const FLASH: [u16; 4] = [0x21, 0x42, 0x63, 0x04];

/// Returns a chain of four boards. The given boards have rebooted; the outgoing pins of the other boards are still on.
fn rebooted(boards: &[u8]) -> Bench {
    let mut bench = initialised(&FLASH);
    for board in boards {
        bench.go(Request::Reset { board: Some(*board), force: false }, 20).unwrap();
    }
    bench
}

fn repair(bench: &mut Bench, board: u8) -> Result<Outcome, Error> {
    let flash_number = FLASH[usize::from(board) - 1];
    bench.go(Request::Repair { board, flash_number, force: false }, 120)
}

fn numbers(bench: &mut Bench) -> Vec<u8> {
    (0..FLASH.len()).map(|i| bench.board(i).number().map_or(0, |n| n.number())).collect()
}

/// Checks that the result of the repair of board 2 is correct: after a success, only this board has the number.
fn is_sound(bench: &mut Bench, result: &Result<Outcome, Error>, what: &str) {
    let numbers = numbers(bench);
    match result {
        Ok(_) => assert_eq!(numbers, [1, 2, 3, 0], "{what}: {result:?}"),
        Err(
            Error::Identity(IdentityError::NumberShared { given_back: true, .. })
            | Error::Identity(IdentityError::WrongBoard { .. }),
        ) => {
            assert_eq!((numbers[1], numbers[3]), (0, 0), "{what}: {result:?}");
        }
        // With any other error, the board did not receive the number, or the outgoing pin of its neighbour is still
        // on. Such an error does not show which boards have numbers.
        Err(error) => assert!([1, 3, 4].contains(&error.exit()), "{what}: {result:?}"),
    }
}

/// D-21: boards 2 and 4 have no number, and the outgoing pins of the boards before them are on. Only the selected board takes the number.
#[test]
fn d21_a_number_goes_to_one_board_only() {
    let mut bench = rebooted(&[2, 4]);
    let result = repair(&mut bench, 2);
    assert!(matches!(&result, Ok(Outcome::Repaired(seen)) if seen.info.flash_number == 0x42), "{result:?}");
    is_sound(&mut bench, &result, "nothing lost");
    // The outgoing pins are on again, so board 4 also gets its number. The repair of board 1, which has its number,
    // sends no PC_INIT and does not switch off a pin.
    assert!(repair(&mut bench, 4).is_ok());
    assert_eq!(numbers(&mut bench), [1, 2, 3, 4]);
    let before = (bench.count("281#"), bench.count("1C1#0200"));
    assert!(repair(&mut bench, 1).is_ok());
    assert_eq!((bench.count("281#"), bench.count("1C1#0200")), before);
}

/// The incoming pin of the first board is always active, so without a number the first board would take any number.
/// Therefore the master refuses to repair another board until the first board has its number.
#[test]
fn d21_the_first_board_takes_any_number() {
    let mut bench = rebooted(&[1, 3]);
    let error = repair(&mut bench, 3).unwrap_err();
    assert_eq!(error, Error::Address(AddressError::MayTakeNumber { board: 3, other: 1 }));
    assert_eq!((error.exit(), numbers(&mut bench)), (4, vec![0, 2, 0, 4]));
    repair(&mut bench, 1).unwrap();
    repair(&mut bench, 3).unwrap();
    assert_eq!(numbers(&mut bench), [1, 2, 3, 4]);
}

/// The test loses or doubles each frame of a repair in turn. The repair always succeeds, and only the selected board
/// gets the number.
#[test]
fn d21_no_single_fault_gives_a_number_twice() {
    let (from, to) = {
        let mut bench = rebooted(&[2, 4]);
        let before = bench.log.len();
        repair(&mut bench, 2).unwrap();
        (before, bench.log.len())
    };
    for fault in [Fault::Lost, Fault::Doubled] {
        for at in from..to {
            let mut bench = rebooted(&[2, 4]);
            bench.fault = Some((at, fault));
            let result = repair(&mut bench, 2);
            is_sound(&mut bench, &result, &format!("frame {at} {fault:?}"));
            assert!(result.is_ok(), "frame {at} {fault:?}: {result:?}");
        }
    }
}

/// Several frames are lost together: commands that switch off the pin before board 4, answers of board 3, and answers
/// of board 2. The repair never succeeds while two boards have the same number.
#[test]
fn d21_no_losses_give_a_number_twice() {
    let mut shared = 0;
    for lowering in [0, 1, 3, 4, 9] {
        for others_answers in [0, 3, u32::MAX] {
            for acknowledges in [0, 1, 2, u32::MAX] {
                for answers in [0, 1, 5, u32::MAX] {
                    let mut bench = rebooted(&[2, 4]);
                    bench.lose = vec![
                        ("< 1C3#0200", lowering),
                        ("> 143#", others_answers),
                        ("> 0C2#", acknowledges),
                        ("> 142#", answers),
                    ];
                    let what = format!("{:?}", bench.lose);
                    let result = repair(&mut bench, 2);
                    is_sound(&mut bench, &result, &what);
                    shared += u32::from(matches!(
                        result,
                        Err(Error::Identity(IdentityError::NumberShared { given_back: true, .. }))
                    ));
                }
            }
        }
    }
    assert!(shared > 0, "a pin that stays on silently is found out by its consequence");
}

/// U-4: an update repairs a number with the same steps.
#[test]
fn u4_an_update_gives_a_number_to_one_board_only() {
    let mut bench = rebooted(&[4]);
    let id = bench.master.start(bench.now, Request::Update(options(&[2], 128))).unwrap();
    bench.until(|b| b.count("042#") > 0);
    // Board 2 reboots when XRESET is sent. Boards 2 and 4 then have no number.
    let reset = super::bench::frame("002#");
    let now = bench.now;
    bench.members[1].receive(now, &reset);
    let Ok(Outcome::Update(report)) = bench.wait(id, 120) else { panic!() };
    assert_eq!((report.exit(), numbers(&mut bench)), (0, vec![1, 2, 3, 0]), "{report:?}");
    assert!(bench.count("282#") > 1, "it was repaired");
    assert_eq!(update(&mut bench, recorded(options(&[2], 128), &report)).exit(), 0);
}
