//! UCoM figures: the time to number 31 boards, and the time to update one board with 60 KiB. Both times are compared
//! with the time in which the frames occupy the bus. The program also measures the speed of decoding, and the memory
//! of a board.
use std::hint::black_box;

use can_link::{BusEvent, CanFrame, Id, MemberId, TimedBus};
use test_kit::clock::CpuTime;
use ucom::node::Node;
use ucom::{Format, Frame, FromBoard, Function, Profile, ToBoard};
use ucom_host::files::{DbcBoard, dbc};
use ucom_host::master::update::{UpdateImage, UpdateOptions, UpdateTarget};
use ucom_host::master::{Event, InitOptions, Master, Outcome, Request};
use ucom_sim::memory::{MemoryApplication, MemoryFlash, MemoryStore, WirePins};
use ucom_sim::{ChainConfig, ChainSim};

use crate::print;
use crate::world::Result;

const BITRATE: u32 = 1_000_000;
const NS_PER_US: u64 = 1000;

/// PC, bus and chain of boards in virtual time.
struct Bench {
    master: Master,
    bus: TimedBus,
    tool: MemberId,
    boards: Vec<MemberId>,
    chain: ChainSim,
    /// All frames of the bus, in the order in which they were sent.
    received: Vec<CanFrame>,
    /// Time at which the last frame of program data ended on the bus. The next field is the total response time of
    /// the boards to program data, ns.
    asked_at: Option<u64>,
    turn_round_ns: u64,
}

/// Duration and result of a procedure.
struct Cost {
    seconds: f64,
    busy_seconds: f64,
    turn_round_seconds: f64,
    outcome: Outcome,
}

fn to_wire(frame: &Frame) -> Result<CanFrame> {
    Ok(CanFrame::classic(Id::standard(frame.id().into())?, frame.data())?)
}

fn function(frame: &Frame) -> Option<Function> {
    frame.address().ok().map(|(function, _)| function)
}

impl Bench {
    fn new(boards: usize, profile: Profile) -> Self {
        let config = ChainConfig::head(&profile).with_boards(boards, &profile);
        let chain = ChainSim::new(&config, Vec::new(), 1, &profile);
        let mut bus = TimedBus::new(BITRATE, 1);
        let tool = bus.join();
        let boards = (0..chain.members()).map(|_| bus.join()).collect();
        let master = Master::new(profile);
        Self { master, bus, tool, boards, chain, received: Vec::new(), asked_at: None, turn_round_ns: 0 }
    }

    fn now_us(&self) -> u64 {
        self.bus.now_ns() / NS_PER_US
    }

    /// Runs a procedure until it ends, and returns its duration and result.
    fn run(&mut self, request: Request) -> Result<Cost> {
        let before = self.bus.stats();
        self.turn_round_ns = 0;
        let id = self.master.start(self.now_us(), request)?;
        loop {
            self.step()?;
            while let Some(event) = self.master.take_event() {
                let Event::Done { id: done, result } = event else { continue };
                if done != id {
                    continue;
                }
                let after = self.bus.stats();
                let seconds = |ns: u64| ns as f64 * 1e-9;
                return Ok(Cost {
                    seconds: seconds(after.now_ns - before.now_ns),
                    busy_seconds: seconds(after.busy_ns - before.busy_ns),
                    turn_round_seconds: seconds(self.turn_round_ns),
                    outcome: result?,
                });
            }
        }
    }

    /// Sends the due frames of the PC and of all boards, and advances virtual time to the next event.
    fn step(&mut self) -> Result<()> {
        let now = self.now_us();
        self.chain.advance(now);
        for (number, member) in self.boards.iter().enumerate() {
            while let Some(frame) = self.chain.poll(number) {
                self.bus.queue(*member, to_wire(&frame)?)?;
            }
        }
        while let Some(frame) = self.master.poll(now) {
            self.bus.queue(self.tool, to_wire(&frame)?)?;
        }
        let due = self.chain.next_due_us().min(self.master.next_deadline().unwrap_or(u64::MAX)).max(now + 1);
        let due_ns = due.saturating_mul(NS_PER_US).min(self.bus.next_ns().unwrap_or(u64::MAX));
        while let Some(event) = self.bus.advance_to(due_ns) {
            match event.what {
                BusEvent::Received { member, frame } if member == self.tool => self.tell_tool(&frame),
                BusEvent::Received { member, frame } => {
                    if let Some(number) = self.boards.iter().position(|board| *board == member) {
                        self.chain.receive(number, frame.id().value(), Format::BUS, frame.data());
                    }
                }
                BusEvent::Sent { member, frame } => self.sent(member, &frame)?,
                other => return Err(format!("nothing is disturbed here, and yet: {other:?}").into()),
            }
        }
        Ok(())
    }

    fn tell_tool(&mut self, frame: &CanFrame) {
        self.received.push(*frame);
        let received = Frame::received(frame.id().value(), Format::BUS, frame.data());
        if let Ok(frame) = &received
            && matches!(function(frame), Some(Function::DspReady | Function::ProgFinished))
            && let Some(asked) = self.asked_at.take()
        {
            self.turn_round_ns += self.bus.now_ns() - asked;
        }
        let now = self.now_us();
        self.master.handle(now, received);
    }

    fn sent(&mut self, member: MemberId, wire: &CanFrame) -> Result<()> {
        let id = u16::try_from(wire.id().value())?;
        let frame = Frame::new(id, wire.data()).ok_or("a frame of this protocol")?;
        if member == self.tool {
            self.received.push(*wire);
            if function(&frame) == Some(Function::Prog) {
                self.asked_at = Some(self.bus.now_ns());
            }
        } else if let Some(number) = self.boards.iter().position(|board| *board == member) {
            self.chain.sent(number, &frame);
        }
        Ok(())
    }
}

pub(crate) fn figures() -> Result<()> {
    let mut chain = Bench::new(31, Profile::default());
    let cost = chain.run(Request::Init(InitOptions::default()))?;
    let Outcome::Init(report) = &cost.outcome else { return Err("init ended otherwise".into()) };
    if report.boards.len() != 31 {
        return Err(format!("{} of 31 boards have a number", report.boards.len()).into());
    }
    print("ucom_init_31_s", cost.seconds);
    print("ucom_init_31_bus_s", cost.busy_seconds);

    for (name, gap_us) in
        [("ucom_update_60k", Profile::default().prog_frame_gap_us), ("ucom_update_60k_no_gap", 0)]
    {
        update(name, Profile { prog_frame_gap_us: gap_us, ..Profile::default() })?;
    }
    decode(&chain.received)?;
    type Board = Node<MemoryFlash, WirePins, MemoryStore, MemoryApplication>;
    let around = size_of::<(MemoryFlash, WirePins, MemoryStore, MemoryApplication)>();
    print("ucom_node_bytes", (size_of::<Board>() - around) as f64);
    Ok(())
}

/// Updates one board with 60 KiB. The measured time is the duration of the complete procedure, including the last
/// read-back.
fn update(name: &str, profile: Profile) -> Result<()> {
    let mut bench = Bench::new(1, profile);
    bench.run(Request::Init(InitOptions::default()))?;
    let bytes = (0..60 * 1024_u32).map(|i| (37 * i + 11) as u8).collect();
    let image = UpdateImage { bytes, address_words: 0 };
    let options = UpdateOptions::new(vec![UpdateTarget { board: 1, flash_number: None }], image, 0x3AC1);
    let cost = bench.run(Request::Update(options))?;
    let Outcome::Update(report) = &cost.outcome else { return Err("update ended otherwise".into()) };
    if report.failure().is_some() {
        return Err(format!("the update failed: {report:?}").into());
    }
    print(&format!("{name}_s"), cost.seconds);
    print(&format!("{name}_bus_s"), cost.busy_seconds);
    print(&format!("{name}_turn_round_s"), cost.turn_round_seconds);
    // The share is the duration of the update, divided by the time in which its frames occupy the bus. The duration
    // does not include the response times of the boards and the wait after PC_XRESET.
    let waits = cost.turn_round_seconds + f64::from(profile.xreset_wait) * 1e-3;
    print(&format!("{name}_share"), (cost.seconds - waits) / cost.busy_seconds);
    Ok(())
}

/// Prints the number of frames that the library decodes per second. The frames come from the procedure that gives
/// numbers to a chain of boards.
fn decode(received: &[CanFrame]) -> Result<()> {
    let profile = Profile::default();
    let frames: Vec<Frame> = received
        .iter()
        .filter_map(|frame| Frame::received(frame.id().value(), Format::BUS, frame.data()).ok())
        .collect();
    let mut best = f64::INFINITY;
    for _ in 0..20 {
        let start = CpuTime::now();
        for _ in 0..20 {
            for frame in black_box(&frames) {
                black_box(
                    FromBoard::decode(frame, &profile).is_ok() || ToBoard::decode(frame, &profile).is_ok(),
                );
            }
        }
        best = best.min(start.elapsed_ns() / (20 * frames.len()) as f64);
    }
    print("ucom_decode_frames_s", 1e9 / best);
    if let Some(path) = std::env::var_os("OPENJTC_UCOM_FRAMES") {
        // The benchmark of python-can reads this file, which contains one frame per line.
        let text: String = received.iter().map(|frame| format!("(0.0) can0 {}\n", candump(frame))).collect();
        std::fs::write(&path, text)?;
        let board = |number| DbcBoard { number, ..DbcBoard::default() };
        let dbc = dbc(&(1..=31).map(board).collect::<Vec<_>>(), profile.endian);
        std::fs::write(std::path::Path::new(&path).with_extension("dbc"), dbc)?;
    }
    Ok(())
}

/// Returns a frame in the format of candump.
fn candump(frame: &CanFrame) -> String {
    let data: String = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
    format!("{:03X}#{data}", frame.id().value())
}
