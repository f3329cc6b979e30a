//! Tests of the master with the boards of the crate `ucom`.

use ucom_host::master::{InitOptions, Outcome, Request};

use super::bench::Bench;

pub(super) fn initialised(flash_ids: &[u16]) -> Bench {
    let mut bench = Bench::chain(flash_ids);
    match bench.go(Request::Init(InitOptions::default()), 60) {
        Ok(Outcome::Init(report)) => assert!(report.is_ok(), "{:?}", report.findings),
        other => panic!("{other:?}"),
    }
    bench
}

/// P-2: the test numbers chains of 1, 3 and 31 boards. After the last board, the master sends PC_INIT with the next
/// number, except after board 31, because number 32 does not exist.
#[test]
fn p2_init_of_real_boards() {
    for count in [1_u16, 3, 31] {
        let ids: Vec<u16> = (1..=count).collect();
        let mut bench = initialised(&ids);
        for (i, _) in ids.iter().enumerate() {
            assert_eq!(bench.board(i).number().map(|n| n.number()), Some(i as u8 + 1));
        }
        let highest = bench
            .sent()
            .iter()
            .filter_map(|t| u16::from_str_radix(&t[..3], 16).ok())
            .filter(|id| id >> 6 == 10)
            .max();
        assert_eq!(highest, Some(0x280 + (count + 1).min(31)));
    }
}
