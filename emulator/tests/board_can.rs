//! Joint bus and FDCAN controller of the board: timing, filters, errors and bus-off.
mod rig;

use std::collections::BTreeSet;

use can_link::{CanFrame, Id};
use jtc_bus::Request;
use jtc_core::{ControllerState, error};
use jtc_sim::{FaultKind, SimConfig};
use openjtc_emulator::clock::{MILLISECOND, Time, to_us};
use openjtc_emulator::fdcan::{CanPeers, Outcome};
use openjtc_emulator::{BoardConfig, Port};
use rig::{BOARDS, Rig};

const FDCAN1: u32 = 0x4000_A000;
const MESSAGE_RAM: u32 = 0x4000_AC00;

/// Returns the identifiers of answers to Move, ChangeFsm and ChangeMode (J-11).
fn expected() -> BTreeSet<u16> {
    [0x200, 0x210, 0x2F0].into_iter().flat_map(|base| (0..7).map(move |node| base + node)).collect()
}

/// J-10: the configuration of the CAN controller, with the register names of RM0399. The timing registers contain the
/// values minus one.
#[test]
fn j10_registers_of_the_controller() {
    for board in BOARDS {
        let mut rig = Rig::new(board);
        rig.run(20);
        let state = rig.board.machine.chip().fdcan.state();
        assert_eq!(state.rates, (1_000_000, 5_000_000), "{board}");
        // The values are NSJW 2, NBRP 5, NTSEG1 12, NTSEG2 4, TDC on, DBRP 1, DTSEG1 12, DTSEG2 4, DSJW 2. Each
        // register field contains its value minus one.
        assert_eq!(state.nbtp, 1 << 25 | 4 << 16 | 11 << 8 | 3, "{board}");
        assert_eq!(state.dbtp, 1 << 23 | 11 << 8 | 3 << 4 | 1, "{board}");
        assert_eq!(state.tdcr, 13 << 8, "{board}: the sample point, 13 of 17, after the loop delay");
        // In CCCR, the bits TXP, BRSE and FDOE are set. The bits INIT and CCE are not set. The bit DAR is not set
        // (retransmission is on), and NISO is not set (ISO format).
        assert_eq!(state.cccr, 1 << 14 | 1 << 9 | 1 << 8, "{board}");
        // The CAN controller rejects remote frames and frames that match no filter, with 11-bit and 29-bit identifiers.
        let gfc = rig.register(FDCAN1 + 0x80);
        assert_eq!(gfc & 3, 3, "{board}: RRFS, RRFE");
        assert!(gfc >> 2 & 3 >= 2 && gfc >> 4 & 3 >= 2, "{board}: ANFE, ANFS {gfc:#x}");
        assert!(state.online && !state.bus_off, "{board}");
    }
}

/// J-10: each filter accepts one identifier and stores its frames in a dedicated buffer.
#[test]
fn j10_filters_are_the_expected_answers() {
    let mut rig = Rig::new(BOARDS[0]);
    rig.run(20);
    let sidfc = rig.register(FDCAN1 + 0x84);
    let (start, count) = (sidfc & 0xFFFC, sidfc >> 16 & 0xFF);
    assert_eq!(rig.register(FDCAN1 + 0x88) >> 16 & 0x7F, 0, "no filter for 29 bits");
    let filters: Vec<u32> = (0..count).map(|n| rig.register(MESSAGE_RAM + start + 4 * n)).collect();
    let ids: BTreeSet<u16> = filters.iter().map(|f| (f >> 16 & 0x7FF) as u16).collect();
    let buffers: BTreeSet<u32> = filters.iter().map(|f| f & 0x3F).collect();
    assert!(filters.iter().all(|f| f >> 27 & 7 == 7 && f >> 9 & 3 == 0), "SFEC: store into a buffer");
    assert_eq!((ids, buffers.len()), (expected(), filters.len()));
    assert_eq!(rig.board.machine.chip().fdcan.ram.outside, 0, "nothing beyond the message RAM");
}

/// Nodes that acknowledge frames but do not send frames.
struct Mute;

impl CanPeers for Mute {
    fn receive(&mut self, _: Time, _: &CanFrame, _: &mut Vec<(Time, CanFrame)>) {}
    fn acknowledge(&self) -> bool {
        true
    }
}

/// J-10, J-15: of all frames that can occur on a CAN bus, only the expected answers reach the controller.
#[test]
fn j10_only_expected_frames_arrive() {
    let mut rig = Rig::with(BOARDS[0], BoardConfig { no_bus: true, ..Default::default() });
    rig.board.machine.chip().fdcan.wire.peers = Some(Box::new(Mute));
    rig.run(20);
    let standard = |id: u32| Id::standard(id).expect("11 bits");
    let extended = |id: u32| Id::extended(id).expect("29 bits");
    let mut offered = Vec::new();
    for id in 0..0x800 {
        offered.push(CanFrame::fd(standard(id), &[id as u8; 16]).expect("16 bytes"));
    }
    let fd = offered.len();
    for id in expected().into_iter().map(u32::from) {
        for id in [id, id << 18, id << 18 | 0x3_FFFF] {
            offered.push(CanFrame::fd(extended(id), &[1; 16]).expect("16 bytes"));
            offered.push(CanFrame::classic(extended(id), &[2; 8]).expect("8 bytes"));
            offered.push(CanFrame::remote(extended(id), 8).expect("8 bytes"));
        }
        offered.push(CanFrame::remote(standard(id), 8).expect("8 bytes"));
    }
    let classic = offered.len();
    for id in 0..0x800 {
        offered.push(CanFrame::classic(standard(id), &[3; 8]).expect("8 bytes"));
    }

    let mut received = Vec::new();
    for (n, frames) in offered.chunks(5).enumerate() {
        for frame in frames {
            let chip = rig.board.machine.chip();
            let now = chip.now();
            chip.fdcan.wire.put(now, *frame);
        }
        rig.step();
        received.extend(rig.flight.received.iter().map(|f| (n * 5, *f)));
    }
    rig.wait("everything was offered", 3_000, |rig| rig.board.machine.chip().fdcan.wire.waiting() == 0);
    rig.run(3);
    let ids: Vec<u16> = received.iter().map(|(_, f)| f.id).collect();
    assert_eq!(ids, expected().into_iter().collect::<Vec<_>>(), "each once");
    assert!(received.iter().all(|(n, f)| *n < fd + 10 && f.data() == [f.id as u8; 16]));
    // The filters cannot distinguish classic frames from CAN FD frames. Therefore, the driver drops and counts the
    // classic frames with the 21 expected identifiers (J-15).
    assert!(classic > fd && rig.flight.wrong_format == 21, "{}", rig.flight.wrong_format);
    let fdcan = &rig.board.machine.chip().fdcan;
    assert_eq!((fdcan.stored, fdcan.state().lost), (42, 0));
}

/// Returns start time and torques of the frames that the controller sent in the last millisecond.
fn moves(rig: &Rig) -> Vec<(Time, [f64; 6])> {
    let good = rig.bus.iter().filter(|e| e.from_controller && e.outcome == Outcome::Good);
    good.filter_map(|e| {
        let frame = jtc_bus::Frame::new(e.frame.id().value() as u16, e.frame.data())?;
        match Request::parse(&frame) {
            Ok(Request::Move { torque, .. }) => Some((e.start, torque)),
            _ => None,
        }
    })
    .collect()
}

/// J-14, J-12: the controller reports the error at once, and leaves bus-off as ISO 11898-1 requires. The controller
/// never sends a torque that waited during bus-off.
#[test]
fn j14_after_bus_off_no_stale_frame() {
    // The arm starts in a pose in which gravity requires torque.
    let sim = SimConfig { start: [0.0, 0.5, -0.4, 0.3, 0.0, 0.0], ..SimConfig::default() };
    let mut rig = Rig::with(BOARDS[0], BoardConfig { sim, ..Default::default() });
    rig.bring_up(Port::Usart2);
    rig.run(50);
    assert!(moves(&rig).iter().any(|(_, t)| t.iter().any(|t| t.abs() > 1.0)), "the arm is held");

    rig.inject(FaultKind::BusOff);
    rig.wait("bus-off", 20, |rig| rig.board.machine.chip().fdcan.state().bus_off);
    let off = rig.board.machine.now();
    rig.run(2);
    assert_eq!(rig.state(), ControllerState::Error, "at once");
    assert!(rig.telemetry().errors & error::INTERNAL_CAN != 0);
    rig.run(30);
    rig.board.heal(FaultKind::BusOff);
    let healed = rig.board.machine.now();
    let mut first = None;
    for _ in 0..200 {
        rig.step();
        let moves = moves(&rig);
        assert!(moves.len() <= 1, "J-12: one broadcast a tick");
        for (time, torque) in moves {
            assert_eq!(torque, [0.0; 6], "J-14: a stale frame at {} µs", to_us(time));
            first.get_or_insert(time);
        }
    }
    let first = first.expect("it comes back by itself");
    println!(
        "bus-off for {} µs, back {} µs after that",
        to_us(healed - off),
        to_us(first.saturating_sub(healed))
    );
    assert!(first > off + 129 * 11 * MILLISECOND / 1000, "129 times 11 recessive bits are waited for");
    // The error remains until the host clears it (J-21). After the host has cleared the error, operation continues.
    assert_eq!(rig.state(), ControllerState::Error);
    rig.ask(Port::Usart2, &jtc_sim::host::clear_all());
    rig.wait_for_hold(15_000);
}

/// Injects a bus fault. Returns the number of ticks from the fault to the state Error, and the CAN error word of the
/// status.
fn ticks_to_error(rig: &mut Rig, kind: FaultKind) -> (u64, u32) {
    let before = rig.ticks;
    rig.inject(kind);
    rig.wait("Error", 50, |rig| rig.state() == ControllerState::Error);
    let ticks = rig.ticks - before;
    assert_eq!(rig.flight.torque, [0.0; 6], "J-12: zero in the tick of the error");
    let sent = rig.flight.sent.as_ref().map(Request::parse);
    assert!(matches!(sent, Some(Ok(Request::Move { torque, .. })) if torque == [0.0; 6]), "{sent:?}");
    rig.run(60);
    (ticks, rig.status(Port::Usart2).can_current)
}

#[test]
fn j14_five_moves_without_acknowledge_are_a_transmit_timeout() {
    let mut rig = Rig::new(BOARDS[0]);
    rig.bring_up(Port::Usart2);
    let (ticks, flags) = ticks_to_error(&mut rig, FaultKind::NoAcknowledge);
    // J-15: the controller ignores a frame that is shorter than its identifier requires. The test covers every node
    // that may send this frame.
    assert!((5..=7).contains(&ticks), "{ticks} ticks");
    assert!(flags & 1 != 0, "{flags:#x}");
    assert!(!rig.board.machine.chip().fdcan.state().bus_off, "a missing acknowledge alone makes no bus-off");
    let loud: Vec<_> = rig.bus.iter().filter(|e| e.outcome == Outcome::Good).collect();
    assert!(loud.is_empty(), "{loud:?}");
    rig.board.heal(FaultKind::NoAcknowledge);
    for _ in 0..100 {
        rig.step();
        let moves = moves(&rig);
        assert!(moves.len() <= 1, "what was not acknowledged is not sent late");
        assert!(moves.iter().all(|(_, torque)| *torque == [0.0; 6]));
    }
    assert_eq!(moves(&rig).len(), 1);
}

#[test]
fn j14_a_silent_joint_is_a_receive_timeout_of_that_node() {
    for node in [0, 3, 5] {
        let mut rig = Rig::new(BOARDS[0]);
        rig.bring_up(Port::Usart2);
        let (ticks, flags) = ticks_to_error(&mut rig, FaultKind::NodeSilent { node });
        assert!((5..=7).contains(&ticks), "{ticks} ticks");
        assert_eq!(flags, 1 << (8 + node), "{flags:#x}");
    }
}

#[test]
fn j14_j23_a_silent_gripper_is_shown_and_takes_nothing_away() {
    let mut rig = Rig::new(BOARDS[0]);
    rig.bring_up(Port::Usart2);
    rig.inject(FaultKind::NodeSilent { node: 6 });
    rig.run(50);
    assert_eq!((rig.state(), rig.telemetry().errors), (ControllerState::HoldPos, 0));
    let status = rig.status(Port::Usart2);
    assert_eq!((status.can_error, status.can_current), (0, 1 << 14));
}

/// J-15: the controller ignores a frame that is too short for its identifier, for every node that may send the frame.
#[test]
fn j15_short_answers_are_no_answers() {
    let mut rig = Rig::with(BOARDS[0], BoardConfig { no_bus: true, ..Default::default() });
    rig.board.machine.chip().fdcan.wire.peers = Some(Box::new(Mute));
    let short = [0, 1, 7, 8, 12].map(|len| vec![0xFF; len]);
    let mut received = 0;
    // After a reset, nodes may be silent for 2 s without an error. The test therefore runs for 2.6 s.
    for ms in 0..2_600 {
        if ms >= 20 {
            let id = Id::standard(0x200 + ms % 7).expect("11 bits");
            let chip = rig.board.machine.chip();
            let now = chip.now();
            let frame = CanFrame::fd(id, &short[(ms / 7 % 5) as usize]).expect("a length of CAN FD");
            chip.fdcan.wire.put(now, frame);
        }
        rig.step();
        received += rig.flight.received.len();
    }
    assert!(received > 2_500, "they were received: {received}");
    assert_eq!(rig.state(), ControllerState::Error, "nobody has answered a Move");
    assert_eq!(rig.status(Port::Usart2).can_current, 0x7F00, "and the bus is well");
}
