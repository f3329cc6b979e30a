//! Tests of PLCs with a simulated arm. The tests check which requests start a motion, which connection may send commands, and which
//! addresses may connect.
use std::io::{Read as _, Write as _};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use jtc_agent::jobs::{Jobs, Stage, Store};
use jtc_agent::line::FrameClass;
use jtc_agent::log::{CommandLog, LIMIT};
use jtc_agent::modbus::codes::{Command, Outcome};
use jtc_agent::modbus::map::holding;
use jtc_agent::modbus::{Allowed, Plc, Server, plc};
use jtc_agent::{LineEvent, Owner};
use jtc_host::port::sim::LivePort;
use jtc_host::{Arm, plan};
use jtc_sim::{Fault, FaultKind, SimConfig, Trigger, World};
use jtc_wire::{ControllerState, Joint, Status};
use proptest::prelude::*;
use test_kit::patience::{LONGEST, until};

/// Sequence number before the first command.
const FIRST: u16 = 700;
const HERE: [u8; 4] = [127, 0, 0, 1];
const THERE: [u8; 4] = [127, 0, 0, 2];

/// A simulated arm with an agent and a Modbus server.
struct Cell {
    owner: Option<Owner>,
    jobs: Arc<Jobs>,
    plc: Arc<Plc>,
    _server: Server,
    address: SocketAddr,
    /// Classes of the sent frames that change the state of the controller.
    sent: Arc<Mutex<Vec<FrameClass>>>,
}

impl Cell {
    fn start(allowed: &[&str]) -> Self {
        Self::with_faults(allowed, Vec::new())
    }

    /// Starts a cell whose simulated arm has these faults.
    fn with_faults(allowed: &[&str], faults: Vec<Fault>) -> Self {
        let arm = Arm::avena();
        let config = SimConfig { baud: Some(921_600), ..SimConfig::new(arm.config(), &arm.parameters()) };
        let sent: Arc<Mutex<Vec<FrameClass>>> = Arc::default();
        let seen = sent.clone();
        let observer = Box::new(move |_, event: &LineEvent| {
            if let LineEvent::Sent { class, .. } = event {
                seen.lock().expect("nobody panics").push(*class);
            }
        });
        let mut world = World::new(config);
        faults.into_iter().for_each(|fault| world.inject(fault));
        let owner = Owner::new(LivePort::new(world), observer);
        let log = Arc::new(Mutex::new(CommandLog::open(None, LIMIT, |_| {}).expect("none")));
        let jobs = Jobs::new(owner.line(), Store::in_memory(), arm);
        jobs.store.put(3, "there and back", &there_and_back(), false, None).expect("a trajectory");
        let plc = Plc::new(owner.line(), jobs.clone(), log, true, FIRST);
        let listener = TcpListener::bind("127.0.0.1:0").expect("an address");
        let address = listener.local_addr().expect("it listens");
        let allowed = allowed.iter().map(|text| text.parse().expect("a network")).collect();
        let _server = Server::start(listener, Allowed::new(allowed), plc.clone()).expect("it serves");
        Self { owner: Some(owner), jobs, plc, _server, address, sent }
    }

    fn connect(&self) -> Client {
        Client(TcpStream::connect(self.address).expect("it listens"))
    }

    fn moves(&self) -> bool {
        self.owner.as_ref().is_some_and(|owner| {
            owner.line().with(|line, _| line.status().is_some_and(|(_, status)| status.is_executing()))
        })
    }

    fn teaches(&self) -> bool {
        let teaching = |status: &Status| status.state == ControllerState::Teaching;
        self.owner.as_ref().is_some_and(|owner| {
            owner.line().with(|line, _| line.status().is_some_and(|(_, status)| teaching(status)))
        })
    }

    /// Recovers the simulated arm to position hold.
    fn recover(&self, client: &mut Client) {
        until("a report", || client.input(4) < 500);
        assert_eq!(client.command(Command::RecoverWithDefaults), Outcome::Done);
        until("a held arm", || client.ask(&[2, 0, 4, 0, 1]) == [2, 1, 1]);
    }
}

fn there_and_back() -> String {
    let (arm, to) = (Arm::avena(), [0.3, -0.2, 0.2, 0.3, -0.2, 0.3]);
    let way = |from: &[f64; 6], to: &[f64; 6]| {
        plan::joint_move(from, to, &arm.config(), 10.0).expect("it is within the limits")
    };
    let (mut there, back) = (way(&[0.0; 6], &to), way(&to, &[0.0; 6]));
    there.points.extend(back.points.into_iter().skip(1));
    there.to_exact_csv()
}

/// Connection of a PLC.
struct Client(TcpStream);

impl Client {
    fn send(&mut self, pdus: &[&[u8]]) {
        let frame = |pdu: &&[u8]| [&[0, 1, 0, 0, 0, pdu.len() as u8 + 1, 9][..], pdu].concat();
        self.0.write_all(&pdus.iter().flat_map(frame).collect::<Vec<u8>>()).expect("it reads");
    }

    /// Returns the next response of the server; `None` if the server has closed the connection.
    fn response(&mut self) -> Option<Vec<u8>> {
        self.0.set_read_timeout(Some(LONGEST)).expect("a time");
        let mut head = [0; 7];
        self.0.read_exact(&mut head).ok()?;
        assert_eq!((head[..5].to_vec(), head[6]), (vec![0, 1, 0, 0, 0], 9));
        let mut pdu = vec![0; usize::from(head[5]) - 1];
        self.0.read_exact(&mut pdu).ok()?;
        Some(pdu)
    }

    fn ask(&mut self, pdu: &[u8]) -> Vec<u8> {
        self.send(&[pdu]);
        self.response().expect("a response")
    }

    fn input(&mut self, at: u8) -> u16 {
        let pdu = self.ask(&[4, 0, at, 0, 1]);
        u16::from_be_bytes([pdu[2], pdu[3]])
    }

    fn next(&mut self) -> u16 {
        self.input(14).wrapping_add(1)
    }

    /// Sends a command and returns its outcome.
    fn command(&mut self, command: Command) -> Outcome {
        let next = self.next();
        let response = self.ask(&order(command, next));
        assert_eq!(response, [16, 0, 0, 0, 8], "{command:?}");
        until("an answer", || self.input(14) == next);
        Outcome::ALL[usize::from(self.input(15))]
    }
}

/// Returns a request that writes all holding registers for trajectory 3 with approach.
fn order(command: Command, sequence: u16) -> Vec<u8> {
    let values = [1000, 1, 3, 100, 1, 1, command as u16, sequence];
    [16, 0, 0, 0, 8, 16]
        .into_iter()
        .chain(values.iter().flat_map(|value: &u16| value.to_be_bytes()))
        .collect()
}

const PRESS: [u8; 5] = [5, 0, 0, 0xFF, 0];
const LET_GO: [u8; 5] = [5, 0, 0, 0, 0];

/// The Stop follows the start command immediately: in the same packet, as a coil that is briefly 1, or as the next
/// command. The arm does not move.
#[test]
fn a_stop_behind_a_start_leaves_the_arm_where_it_is() {
    let cell = Cell::start(&[]);
    let mut client = cell.connect();
    cell.recover(&mut client);
    drop(client);
    // The test passes the requests to the PLC object directly. The command therefore begins only after all requests have arrived, which
    // is the latest possible time.
    let connection = plc::Connection { number: 1000, peer: (IpAddr::from(HERE), 5).into() };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().expect("a runtime");
    let acknowledged = || {
        let pdu = cell.plc.respond(&connection, &[4, 0, 14, 0, 2]);
        (u16::from_be_bytes([pdu[2], pdu[3]]), usize::from(pdu[5]))
    };
    // The test repeats a write until the server has detected that the first connection is closed.
    let write = [6, 0, holding::SPEED as u8, 0, 100];
    until("its turn", || cell.plc.respond(&connection, &write) == write);
    for command in [Command::Start, Command::Recover, Command::TeachOn] {
        for stop in [Command::Stop, Command::None] {
            let begun = cell.jobs.list().len();
            let _entered = runtime.enter();
            let next = acknowledged().0.wrapping_add(1);
            let requests = match stop {
                Command::Stop => vec![order(command, next), order(stop, next.wrapping_add(1))],
                _ => vec![order(command, next), PRESS.to_vec(), LET_GO.to_vec()],
            };
            for request in requests {
                assert!(cell.plc.respond(&connection, &request)[0] < 0x80);
            }
            runtime.block_on(tokio::time::sleep(Duration::from_millis(500)));
            let outcome = Outcome::ALL[acknowledged().1];
            let expected = if stop == Command::Stop { Outcome::Done } else { Outcome::Stopped };
            assert!(outcome == expected || command == Command::Recover, "{command:?} {outcome:?}");
            until("no job", || cell.jobs.list().iter().all(|job| job.stage != Stage::Running));
            for job in &cell.jobs.list()[begun..] {
                assert_eq!((command, &job.stage), (Command::Recover, &Stage::Stopped), "{job:?}");
            }
            assert!(!cell.moves() && !cell.teaches(), "{command:?}");
        }
    }
    cell.plc.left(&connection);
    let mut client = cell.connect();
    // A single packet contains the start command, Stop coil on and Stop coil off.
    for _ in 0..3 {
        let start = order(Command::Start, client.next());
        client.send(&[&start, &PRESS, &LET_GO]);
        for _ in 0..3 {
            assert!(client.response().expect("a response")[0] < 0x80);
        }
        until("no job", || cell.jobs.list().iter().all(|job| job.stage != Stage::Running));
        std::thread::sleep(Duration::from_millis(300));
        assert!(!cell.moves());
    }
    let executed = cell.jobs.list().into_iter().filter(|job| job.done.summary.is_some());
    assert_eq!(executed.count(), 0);
    // The hold-off does not apply to the PLC that sent the Stop.
    assert_eq!(client.command(Command::Start), Outcome::Done);
    until("a motion", || {
        client.input(1);
        cell.moves()
    });
    client.ask(&PRESS);
}

/// A PLC with another address cannot write while the first PLC holds the lease. The second PLC never uses values that the first PLC has
/// written.
#[test]
fn another_plc_commands_when_the_one_before_has_gone_and_begins_with_the_defaults() {
    let cell = Cell::start(&["127.0.0.0/8"]);
    let mut client = cell.connect();
    until("a report", || client.input(4) < 500);
    // The test passes the requests to the PLC object directly, because a test cannot choose the address of a connection.
    let there = plc::Connection { number: 1000, peer: (IpAddr::from(THERE), 5).into() };
    let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
    let _entered = runtime.enter();
    let write = || cell.plc.respond(&there, &[6, 0, holding::TRAJECTORY as u8, 0, 5]);
    client.ask(&[6, 0, holding::SPEED as u8, 0, 50]);
    assert_eq!(write(), [0x86, 6], "one commands at a time");
    let begun = Instant::now();
    assert_eq!(client.command(Command::GripperOn), Outcome::Done);
    drop(client);
    until("the lease", || write() == [6, 0, 2, 0, 5]);
    assert!(begun.elapsed() > Duration::from_secs(1), "{:?}", begun.elapsed());
    let read = |at: usize| cell.plc.respond(&there, &[3, 0, at as u8, 0, 1])[3];
    assert_eq!((read(holding::SPEED), read(holding::TRAJECTORY)), (100, 5));
    // A PLC that commands without a lease keeps the right to command for its watchdog time, or until it disconnects.
    let here = plc::Connection { number: 1001, peer: (IpAddr::from(HERE), 5).into() };
    assert_eq!(cell.plc.respond(&there, &[6, 0, holding::WATCHDOG as u8, 0xEA, 0x60])[0], 6);
    assert_eq!(cell.plc.respond(&here, &[6, 0, 2, 0, 1]), [0x86, 6]);
    cell.plc.left(&there);
    assert_eq!(cell.plc.respond(&here, &[6, 0, 2, 0, 1]), [6, 0, 2, 0, 1]);
}

#[test]
fn eight_may_connect_and_the_ninth_takes_the_place_of_one_that_asks_for_nothing() {
    let cell = Cell::start(&[]);
    let mut first = cell.connect();
    first.ask(&[6, 0, holding::WATCHDOG as u8, 0xEA, 0x60]);
    let mut others: Vec<Client> = (0..7).map(|_| cell.connect()).collect();
    for other in &mut others {
        other.input(0);
    }
    assert!(is_refused(cell.connect()));
    std::thread::sleep(Duration::from_millis(2100));
    for other in &mut others[1..] {
        other.input(0);
    }
    // The connection that sends commands is still open, although it has been silent for as long as the connection
    // that the server closed.
    assert_eq!(cell.connect().input(0), 1);
    assert!(others[0].response().is_none());
    assert_eq!(first.input(0), 1);
}

/// Returns true if the server closes the connection, before or after it receives a request.
fn is_refused(mut client: Client) -> bool {
    let _ = client.0.write_all(&[0, 1, 0, 0, 0, 6, 9, 4, 0, 0, 0, 1]);
    client.response().is_none()
}

#[test]
fn a_connection_that_holds_the_arm_by_a_coil_does_not_give_way() {
    let cell = Cell::start(&[]);
    let mut clients: Vec<Client> = (0..8).map(|_| cell.connect()).collect();
    let silence = || std::thread::sleep(Duration::from_millis(2100));
    // The first seven connections stay open because their coils are 1. The server therefore closes the last connection.
    for (n, client) in clients.iter_mut().enumerate() {
        client.input(0);
        assert_eq!(if n < 7 { client.ask(&PRESS) } else { PRESS.to_vec() }, PRESS);
    }
    silence();
    let mut ninth = cell.connect();
    assert_eq!(ninth.input(0), 1);
    assert!(clients.pop().expect("the last").response().is_none());
    // If all connections hold the arm at rest with a coil, the server accepts no new connection until one coil is 0 again.
    assert_eq!(ninth.ask(&PRESS), PRESS);
    silence();
    assert!(is_refused(cell.connect()));
    assert_eq!(clients[3].ask(&LET_GO), LET_GO);
    silence();
    assert_eq!(cell.connect().input(0), 1);
    assert!(clients.remove(3).response().is_none());
    assert!(clients.iter_mut().all(|client| client.ask(&[1, 0, 0, 0, 1]) == [1, 1, 1]));
}

#[test]
fn who_is_not_named_does_not_get_in() {
    let cell = Cell::start(&["10.1.2.3", "127.0.0.2"]);
    let mut client = cell.connect();
    let _ = client.0.write_all(&[0, 1, 0, 0, 0, 6, 9, 4, 0, 0, 0, 1]);
    assert!(client.response().is_none());
}

#[test]
fn without_a_controller_a_stop_fails_and_nothing_else_is_done() {
    let mut cell = Cell::start(&[]);
    let mut client = cell.connect();
    until("a report", || client.input(4) < 500);
    cell.owner.take().expect("it is there").end();
    assert_eq!((client.input(3), client.ask(&[2, 0, 0, 0, 3])), (1, vec![2, 1, 0b110]));
    assert_eq!(client.ask(&PRESS), [0x85, 4]);
    assert_eq!(client.ask(&[1, 0, 0, 0, 2]), [1, 1, 0], "what failed is not kept");
    for command in [Command::Start, Command::Stop, Command::Clear, Command::Recover, Command::Release] {
        assert_eq!(client.command(command), Outcome::NoController, "{command:?}");
    }
}

/// Returns random write requests.
fn requests() -> impl Strategy<Value = Vec<u8>> {
    let values = prop::collection::vec(prop_oneof![0..15_u16, 690..720_u16, any::<u16>()], 1..9);
    let written = (0..10_u16, values.clone()).prop_map(|(at, values)| {
        let (at, count) = (at.to_be_bytes(), values.len() as u8);
        let values = values.into_iter().flat_map(u16::to_be_bytes);
        [16, at[0], at[1], 0, count, 2 * count].into_iter().chain(values).collect()
    });
    let single = (0..10_u8, prop_oneof![0..15_u16, 690..720_u16]).prop_map(|(at, value)| {
        let value = value.to_be_bytes();
        vec![6, 0, at, value[0], value[1]]
    });
    let bytes = (0..24_u8, prop::collection::vec(any::<u8>(), 0..30))
        .prop_map(|(function, rest)| [vec![function], rest].concat());
    // The requests do not write coils, because the test would count a Stop by a coil as a sent command.
    prop_oneof![4 => written, 4 => single, 2 => bytes]
        .prop_filter("no coil", |pdu| pdu[0] != 5 && pdu[0] != 15)
}

/// Returns true if the request would write the next valid sequence number.
fn is_next(pdu: &[u8]) -> bool {
    let sequence = holding::SEQUENCE;
    let value = match pdu {
        [6, 0, at, high, low] if usize::from(*at) == sequence => [*high, *low],
        [16, 0, at, 0, _, _, values @ ..] => {
            let Some(n) = sequence.checked_sub(usize::from(*at)) else { return false };
            match values.get(2 * n..2 * n + 2) {
                Some(value) => [value[0], value[1]],
                None => return false,
            }
        }
        _ => return false,
    };
    u16::from_be_bytes(value) == FIRST + 1
}

/// A status does not contain the cause of a held stop, so the agent requests the cause from the controller. After an encoder jump, the
/// arm does not execute a motion, even if the errors were cleared.
#[test]
fn j69_a_held_stop_is_read_with_its_cause_and_cleared() {
    // The encoder jump occurs long after the drives were enabled.
    let jump = Fault {
        kind: FaultKind::EncoderJump { joint: Joint::ALL[2], rad: 0.02 },
        trigger: Trigger::InState(ControllerState::HoldPos, 10_000),
        duration_ms: None,
    };
    let cell = Cell::with_faults(&[], vec![jump]);
    let mut client = cell.connect();
    cell.recover(&mut client);
    let bit = |client: &mut Client| client.ask(&[2, 0, 13, 0, 1]) == [2, 1, 1];
    assert!(!bit(&mut client) && client.input(86) == 0);
    until("a cause", || client.input(86) != 0);
    assert_eq!((client.input(86), client.input(87), client.input(93)), (9, 3, 0b100));
    assert!(bit(&mut client) && client.input(92) < 60);
    assert_eq!(client.command(Command::Clear), Outcome::Done);
    until("it is cleared", || !bit(&mut client));
    assert_eq!((client.input(86), client.input(93)), (0, 0b100));
    assert_eq!(client.command(Command::Start), Outcome::Done);
    until("it is refused", || client.input(19) == 4);
    assert_eq!((client.input(20), client.input(21)), (33, 3));
}

/// A write request of a PLC without the next sequence number sends no frame to the controller, begins no job, and
/// does not take the lease.
#[test]
fn nothing_goes_to_the_controller_without_the_next_number() {
    let cell = Cell::start(&[]);
    let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
    let _entered = runtime.enter();
    let mut client = cell.connect();
    until("a report", || client.input(4) < 500);
    let asked = cell.sent.lock().expect("nobody panics").len();
    let connection = plc::Connection { number: 1000, peer: (Ipv4Addr::from(HERE), 5).into() };
    let config = ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) };
    let mut runner = proptest::test_runner::TestRunner::new(config);
    let strategy = requests().prop_filter("not the next number", |pdu| !is_next(pdu));
    let done = runner.run(&strategy, |pdu| {
        let response = cell.plc.respond(&connection, &pdu);
        prop_assert!(response.len() >= 2);
        prop_assert!(cell.jobs.list().is_empty());
        Ok(())
    });
    done.expect("nothing is begun");
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(cell.sent.lock().expect("nobody panics").len(), asked);
    assert_eq!(client.input(14), FIRST, "nothing was acknowledged");
    assert_eq!(client.input(12), 0, "nobody commands");
}
