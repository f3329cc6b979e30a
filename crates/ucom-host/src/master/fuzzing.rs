//! Code of the fuzz targets: the target runs a procedure while random frames arrive at any time. A panic or an
//! endless wait in the procedure is an error.
use crate::master::engine::Event;
use crate::master::interface::Master;
use crate::master::reports::update::{UpdateImage, UpdateOptions, UpdateTarget};
use crate::master::reports::{
    AdminChange, InitOptions, ProbeOptions, Request, RunBoard, RunOptions, StopLevel,
};
use ucom::{Format, Frame, Profile, Status};

/// Longest virtual time that a procedure may take for any input, in µs. The limit is the product of the number of attempts, the number of
/// blocks and the longest timeout.
const LIMIT_US: u64 = 3_600_000_000;

fn request(choice: u8) -> Request {
    let force = choice & 128 != 0;
    let board = choice >> 4 & 3;
    match choice & 15 {
        0 => Request::Scan,
        1 => Request::Init(InitOptions { force, ..Default::default() }),
        2 => Request::Repair { board, flash_number: 0x21, force },
        3 => Request::Info { board },
        4 => Request::SetStatus { board, mask: Status(choice), value: Status(choice), force },
        5 => Request::Reset { board: Some(board), force },
        6 => Request::XReset { board, force },
        7 => Request::Start { board, force },
        8 => Request::Stop { board, level: StopLevel::Application, force },
        9 => Request::Admin { board, change: AdminChange { run: Some(true), ..Default::default() }, force },
        10 => Request::Describe { board, fresh: force },
        11 => Request::InitialInputs { board },
        12 => {
            let boards = vec![RunBoard { board, ..Default::default() }];
            Request::Run(RunOptions { boards, active: true, force })
        }
        13 => Request::Probe(ProbeOptions { init: force, alive: force, image: Some([1; 64].into()), force }),
        _ => {
            let image = UpdateImage { bytes: [choice; 64].into(), address_words: 0 };
            let targets = vec![UpdateTarget { board, flash_number: None }];
            Request::Update(UpdateOptions { force, ..UpdateOptions::new(targets, image, 0x3AC1) })
        }
    }
}

/// Runs a procedure with random input. The first byte of the input selects the procedure. The remaining bytes of the input contain frames:
/// pause in ms, identifier, length, data.
pub fn frames(data: &[u8]) {
    let Some((&choice, mut rest)) = data.split_first() else { return };
    let mut master = Master::new(Profile::default());
    let mut now = 0_u64;
    let Ok(id) = master.start(now, request(choice)) else { return };
    let mut done = 0;
    while let Some((&[pause, high, low, length], tail)) = rest.split_first_chunk::<4>() {
        let (payload, tail) = tail.split_at(usize::from(length & 15).min(tail.len()));
        rest = tail;
        let until = now + u64::from(pause) * 1000;
        pass(&mut master, &mut now, until, &mut done);
        let format = Format { extended: high & 128 != 0, remote: high & 64 != 0, fd: high & 32 != 0 };
        let identifier = u32::from(u16::from_be_bytes([high & 15, low]));
        master.handle(now, Frame::received(identifier, format, payload));
    }
    master.cancel(id);
    let limit = now + LIMIT_US;
    while master.is_busy() {
        assert!(now < limit, "{id:?} does not end");
        let next = now + 60_000_000;
        pass(&mut master, &mut now, next, &mut done);
    }
    while let Some(event) = master.take_event() {
        done += usize::from(matches!(event, Event::Done { .. }));
    }
    assert_eq!(done, 1);
}

fn pass(master: &mut Master, now: &mut u64, until: u64, done: &mut usize) {
    while *now < until {
        let mut sent = 0;
        while master.poll(*now).is_some() {
            sent += 1;
            assert!(sent < 10_000, "frames without end");
        }
        while let Some(event) = master.take_event() {
            *done += usize::from(matches!(event, Event::Done { .. }));
        }
        let next = master.next_deadline().unwrap_or(until);
        *now = next.clamp(*now + 1, until);
    }
}
