//! Tests of boards that were started with `force` on a bus that cannot carry all inputs. The master still sends heartbeats in time, and the
//! inputs that it sends are up to date.

use std::collections::VecDeque;

use ucom::Profile;
use ucom_host::master::{InitOptions, Request, RunBoard, RunOptions, frame_bits};

use super::bench::{Bench, CI, MS, frame};

const BOARDS: u8 = 8;

/// Returns a bus with eight running boards whose inputs alone would need 108 % of the bus time.
fn overloaded() -> Bench {
    let profile = Profile { ci_period: 1, so_period: 1000, ..Profile::default() };
    let ids: Vec<u16> = (1..=BOARDS.into()).collect();
    let mut bench = Bench::chain_with(&ids, profile);
    bench.go(Request::Init(InitOptions::default()), 20).unwrap();
    let board = |board| RunBoard { board, ..Default::default() };
    let options = RunOptions { boards: (1..=BOARDS).map(board).collect(), active: true, force: true };
    bench.go(Request::Run(options), 60).unwrap();
    bench
}

/// D-34, D-50: while inputs of a board wait for the bus, the master does not queue them again. Therefore a change of an input reaches the
/// board soon, even after a long overload, and heartbeats are sent in time.
#[test]
fn d34_d50_inputs_that_wait_are_never_stale() {
    let mut bench = overloaded();
    for round in 1..20 {
        bench.run(1_000);
        let now = bench.now;
        let value = 1000 + round;
        bench.master.set_input(now, BOARDS, CI[0], value).unwrap();
        bench.run(4);
        assert_eq!(bench.board(usize::from(BOARDS) - 1).application.ci[0], value, "after {round} s");
    }
    let alive = bench.times_of("680#");
    let steps: Vec<u64> = alive.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(steps.iter().all(|step| (450 * MS..=550 * MS).contains(step)), "{steps:?}");
    assert!((0..BOARDS.into()).all(|i| bench.board(i).application.running));
    // The master repeats the inputs of every board, not only of the first board.
    for board in 1..=u16::from(BOARDS) {
        let since = bench.now - 2_000 * MS;
        let repeated = bench.log.iter().filter(|(at, _, f)| *at > since && f.id() == 0x340 + board).count();
        assert!(repeated >= 4, "board {board}: {repeated} in 2 s");
    }
}

/// D-50: between the master and the bus there are other queues, for example the queue of a socket. The master sends
/// no more inputs than the bus can carry. Otherwise, heartbeats would wait for the earlier inputs in these queues.
#[test]
fn d50_no_more_inputs_than_the_bus_carries() {
    let mut bench = overloaded();
    let (master, start) = (&mut bench.master, bench.now);
    let mut queue = VecDeque::new();
    let (mut spare, mut longest, mut heartbeats) = (0, 0, 0);
    for ms in 0..30_000 {
        let now = start + ms * MS;
        if ms % 500 == 0 {
            (1..=BOARDS)
                .for_each(|n| master.handle(now, Ok(frame(&format!("{:03X}#", 0x680 + u16::from(n))))));
        }
        while let Some(frame) = master.poll(now) {
            queue.push_back((now, frame));
        }
        // The bus carries 1 Mbit/s; `spare` is the free bus time in bits. Unused bus time cannot be used later, so
        // `spare` is reset when the queue is empty.
        spare += MS;
        while let Some((since, next)) = queue.front()
            && spare >= frame_bits(next.dlc())
        {
            spare -= frame_bits(next.dlc());
            if next.id() == 0x680 {
                longest = longest.max(now - since);
                heartbeats += 1;
            }
            queue.pop_front();
        }
        if queue.is_empty() {
            spare = 0;
        }
        while master.take_event().is_some() {}
    }
    assert!(heartbeats >= 59, "{heartbeats}");
    assert!(longest <= 200 * MS, "a heartbeat waited {longest} µs");
}

/// D-34: the driver takes only one frame every 20 ms. The queue then contains at most one package of each board's
/// inputs, with the latest values.
#[test]
fn d34_a_slow_driver_has_a_short_queue() {
    let mut bench = overloaded();
    let (master, start) = (&mut bench.master, bench.now);
    for ms in (0..10_000).step_by(20) {
        (1..=BOARDS).for_each(|n| {
            master.handle(start + ms * MS, Ok(frame(&format!("{:03X}#", 0x680 + u16::from(n)))));
        });
        master.poll(start + ms * MS);
    }
    let now = start + 10_000 * MS;
    master.set_input(now, 1, CI[0], 4321).unwrap();
    let waiting: Vec<String> = core::iter::from_fn(|| master.poll(now)).map(|f| f.to_string()).collect();
    let inputs = waiting.iter().filter(|f| f.starts_with("34")).count();
    assert_eq!(inputs, usize::from(BOARDS), "{waiting:?}");
    assert!(waiting.iter().any(|f| f.starts_with("341#0000E110")), "{waiting:?}");
}
