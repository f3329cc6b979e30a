//! Conformance tests that program boards.
use crate::master::engine::{Forget, MS};
use crate::master::error::Error;
use crate::master::procedures::conformance::bench::{Bench, list};
use crate::master::procedures::control::enter_exloader;
use crate::master::reports::{ConformanceProgram, Verdict};
use ucom::profile::{HeaderForm, Plan};
use ucom::{BLOCK_LEN, Frame, Function, Header, checksum, data_block};

/// Returns the reason why the programming tests cannot run with this profile; returns `None` if they can run.
fn unfit(bench: &Bench<'_>) -> Option<Verdict> {
    let profile = bench.profile();
    let fits = profile.prog_plan == Plan::VerifyWrite && profile.prog_header == HeaderForm::V1;
    (!fits).then(|| Verdict::Skipped("only with prog.plan = verify-write and prog.header = v1".into()))
}

fn header(bench: &Bench<'_>, program: &ConformanceProgram, cycle: u16) -> Header {
    let profile = bench.profile();
    Header {
        cycle,
        memory: 0,
        address: program.image.address_words,
        length: (program.image.bytes.len() / 2) as u32,
        program_id: checksum(profile.prog_checksum, profile.prog_endian, &program.image.bytes),
        date: program.date,
        target: program.flash_number,
    }
}

/// Sends one block of program data with the frame gap of the profile.
async fn block(bench: &mut Bench<'_>, board: u8, block: &[u8; BLOCK_LEN]) {
    for data in block.chunks(8) {
        bench.send(Function::Prog, board, data).await;
        bench.link.sleep(u64::from(bench.profile().prog_frame_gap_us)).await;
    }
}

/// Returns a board's answer to a block of program data: DSP_READY, DSP_PROGFINISHED or an error.
async fn answer(bench: &mut Bench<'_>, us: u64) -> Option<Frame> {
    let until = bench.link.now() + us;
    loop {
        let came = bench.receive(5 * MS).await;
        let reply = came.into_iter().find(|f| {
            let function = f.address().map(|(function, _)| function);
            matches!(function, Ok(Function::DspReady | Function::ProgFinished | Function::Error))
        });
        if reply.is_some() || bench.link.now() >= until {
            return reply;
        }
    }
}

pub(super) async fn update(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    let Some(program) = &bench.options.program else {
        return Ok(Verdict::Skipped("only with --program IMAGE".into()));
    };
    let flash = Some(program.flash_number);
    if let Some(verdict) = unfit(bench) {
        return Ok(verdict);
    }
    enter_exloader(bench.link, board, flash).await?;
    let times = bench.link.times();
    let endian = bench.profile().prog_endian;
    let data: Vec<[u8; BLOCK_LEN]> = (0..).map_while(|i| data_block(&program.image.bytes, i)).collect();
    for cycle in 1..=2 {
        let head = header(bench, program, cycle).build(endian);
        for (i, next) in core::iter::once(&head).chain(&data).enumerate() {
            block(bench, board, next).await;
            let last = cycle == 2 && i == data.len();
            let slow = cycle == 2 && (i == 0 || last);
            let reply = answer(bench, if slow { times.erase } else { times.ready }).await;
            let wanted = if last { Function::ProgFinished } else { Function::DspReady };
            if reply.and_then(|f| f.address().ok()).is_none_or(|(f, n)| f != wanted || n.number() != board) {
                let reply = reply.map_or_else(|| "silence".into(), |f| f.to_string());
                return Ok(Verdict::Fail(format!(
                    "cycle {cycle}, block {i}: {reply} instead of {}",
                    wanted.name()
                )));
            }
        }
    }
    let wanted = header(bench, program, 2);
    Ok(match bench.info(board).await {
        Some(info) if (info.program_id, info.date) == (wanted.program_id, wanted.date) => Verdict::Pass,
        other => Verdict::Fail(format!(
            "PC_INFO does not contain Program ID 0x{:04X} and date 0x{:04X}: {other:?}",
            wanted.program_id, wanted.date
        )),
    })
}

pub(super) async fn refusals(bench: &mut Bench<'_>, board: u8) -> Result<Verdict, Error> {
    let Some(program) = &bench.options.program else {
        return Ok(Verdict::Skipped("only with --program IMAGE".into()));
    };
    let flash = Some(program.flash_number);
    if let Some(verdict) = unfit(bench) {
        return Ok(verdict);
    }
    let before = enter_exloader(bench.link, board, flash).await?;
    let good = header(bench, program, 1);
    let endian = bench.profile().prog_endian;
    let mut sum = good.build(endian);
    if let Some(byte) = sum.last_mut() {
        *byte ^= 1;
    }
    let target = Header { target: before.flash_number ^ 1, ..good }.build(endian);
    let beyond = Header { address: 0xFFFF_0000, ..good }.build(endian);
    let cases: [(&str, u8, Case); 6] = [
        ("seven bytes", 7, Case::Short),
        ("a pause of 300 ms in a block", 10, Case::Pause),
        ("a header with a wrong sum", 5, Case::Block(sum)),
        ("another board's header", 2, Case::Block(target)),
        ("a header with an address outside the memory", 2, Case::Block(beyond)),
        ("a second cycle with another length", 10, Case::Cycle),
    ];
    for (what, code, case) in cases {
        enter_exloader(bench.link, board, flash).await?;
        // Clears and sets PROG, so that the board discards the previous transfer.
        bench.send(Function::SetStatus, board, &[4, 0]).await;
        bench.send(Function::SetStatus, board, &[4, 4]).await;
        bench.receive(20 * MS).await;
        wrong(bench, board, program, good, &case).await;
        let came = bench.receive(300 * MS).await;
        let errors: Vec<&Frame> = came.iter().filter(|f| f.id() >> 6 == 2).collect();
        if !matches!(errors.as_slice(), [f] if f.id() == 0x080 + u16::from(board) && f.data() == [code]) {
            return Ok(Verdict::Fail(format!(
                "{what}: received {}, expected error {code} once",
                list(&came)
            )));
        }
    }
    bench.send(Function::SetStatus, board, &[4, 0]).await;
    bench.receive(20 * MS).await;
    let after = bench.info(board).await.map(|info| (info.program_id, info.date));
    Ok(match after == Some((before.program_id, before.date)) {
        true => Verdict::Pass,
        false => Verdict::Fail(format!("afterwards, program and date are {after:?}")),
    })
}

/// Sends one faulty transfer to a board. `good` is a correct header for the image.
async fn wrong(bench: &mut Bench<'_>, board: u8, program: &ConformanceProgram, good: Header, case: &Case) {
    let endian = bench.profile().prog_endian;
    match case {
        Case::Short => bench.send(Function::Prog, board, &[0x43; 7]).await,
        Case::Pause => {
            bench.send(Function::Prog, board, &[0x43; 8]).await;
            bench.link.sleep(300 * MS).await;
            // Some boards detect the pause only when the next frame arrives. The test also evaluates the frames that
            // arrive during the pause.
            bench.link.with(|core| core.queue_frame(Some(bench.link.id), next_frame(board), Forget::Nothing));
            bench.link.flush().await;
        }
        Case::Block(bytes) => block(bench, board, bytes).await,
        Case::Cycle => {
            let data: Vec<[u8; BLOCK_LEN]> =
                (0..).map_while(|i| data_block(&program.image.bytes, i)).collect();
            for next in core::iter::once(&good.build(endian)).chain(&data) {
                block(bench, board, next).await;
                answer(bench, bench.link.times().ready).await;
            }
            let other = Header { cycle: 2, length: good.length + 1, ..good };
            block(bench, board, &other.build(endian)).await;
        }
    }
}

/// Returns a frame with the next eight bytes of program data.
fn next_frame(board: u8) -> Frame {
    let number = ucom::Sequence::new(board).unwrap_or(ucom::Sequence::ZERO);
    Frame::of(Function::Prog, number, [0x43; 8].into())
}

/// Program data that a test sends.
enum Case {
    Short,
    Pause,
    Block([u8; BLOCK_LEN]),
    Cycle,
}
