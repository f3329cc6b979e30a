//! Tests of serial ports on a pseudo-terminal: both directions, timeouts, rates, and errors of a port that cannot be
//! used.
#![cfg(unix)]

use std::io::{Read, Write};
use std::time::Duration;

use jtc_host::port::halt::{self, Halt};
use jtc_host::port::{Halts, PortError, STANDARD_RATES, SerialPort};
use jtc_host::{Diagnose, Port, frame};
use jtc_wire::{ControllerState, DataStatus, FrameType, RawPoint, Response, Status, TrajectoryState, fixed};
use serialport::{SerialPort as _, TTYPort};

/// Returns the controller side of a pseudo-terminal, and the path that the host opens.
fn pair() -> (TTYPort, String) {
    let (mut far, near) = TTYPort::pair().expect("a pseudo-terminal");
    far.set_timeout(Duration::from_secs(5)).unwrap();
    let path = near.name().expect("it has a name");
    (far, path)
}

#[test]
fn j01_bytes_go_both_ways_at_every_rate() {
    let (mut far, path) = pair();
    for baud in STANDARD_RATES {
        let mut port = SerialPort::open(&path, baud).unwrap_or_else(|e| panic!("{baud}: {e}"));
        assert_eq!((port.baud(), port.name()), (Some(baud), path.clone()));
        let all: Vec<u8> = (0..=255).collect();
        port.write_all(&all).unwrap();
        let mut got = [0; 256];
        far.read_exact(&mut got).unwrap();
        assert_eq!(got.to_vec(), all);
        far.write_all(&all).unwrap();
        let mut got: Vec<u8> = Vec::new();
        while got.len() < 256 {
            let mut buffer = [0; 100];
            let n = port.read(&mut buffer, Duration::from_secs(5)).unwrap();
            assert!(n > 0);
            got.extend(&buffer[..n]);
        }
        assert_eq!(got, all);
        // If no bytes are available, `read` returns without an error and without waiting.
        assert_eq!(port.read(&mut [0; 8], Duration::ZERO).unwrap(), 0);
    }
}

#[test]
fn what_is_wrong_is_said_with_the_next_command() {
    let (far, path) = pair();
    let mut port = SerialPort::open(&path, 115_200).unwrap();
    let error = SerialPort::open(&path, 115_200).err().expect("busy");
    assert!(matches!(error, PortError::Busy { .. }), "{error}");
    assert!(error.hint().contains("fuser") || !cfg!(target_os = "linux"));
    let error = SerialPort::open("/dev/no-such-port", 115_200).err().expect("not found");
    assert!(matches!(error, PortError::NotFound { .. }) && error.hint().contains("jtc ports"), "{error}");
    drop(far);
    let error = port.read(&mut [0; 8], Duration::from_secs(1)).expect_err("gone");
    assert!(matches!(error, PortError::Gone { .. }), "{error}");
}

/// Returns the path of the door (control socket) of this port.
fn door(path: &str) -> std::path::PathBuf {
    let mut sockets = halt::sockets_of(path).into_iter().filter(|socket| halt::is_alive(socket));
    sockets.next().expect("the program listens")
}

fn status(response: Response) -> [u8; jtc_wire::STATUS_LEN] {
    Status { response, ..Status::default() }.emit()
}

/// J-03: the Stop of another program is never written inside a frame. If a long frame is only partly written, the
/// port drops the rest of this frame before it writes the Stop.
#[test]
fn j03_a_stop_of_another_program_is_never_inside_a_frame() {
    let (mut far, path) = pair();
    let mut port = SerialPort::open(&path, 115_200).unwrap();
    let segment = frame::segment(0, 0, 2, 1, &[RawPoint::default(); 100]).unwrap();
    port.write_all(&segment[..300]).unwrap();
    let socket = door(&path);
    let asked = std::thread::spawn(move || halt::ask(&socket, Halt::Stop, "a test"));
    let mut got = vec![0; 300 + fixed::STOP.len()];
    far.read_exact(&mut got).unwrap();
    assert_eq!((&got[..300], &got[300..]), (&segment[..300], &fixed::STOP[..]));
    let error = port.write_all(&segment[300..]).expect_err("it was given up");
    assert!(error.to_string().contains("a test stopped the arm after this motion was requested"), "{error}");
    // The port blocks uploads and frames that move or release the arm. The port still sends other frames.
    assert!(port.write_all(&segment).is_err() && port.write_all(&fixed::EXECUTE).is_err());
    assert!(port.write_all(&fixed::TEACHING_MODE_ENABLE).is_err());
    // A Pause after the Stop could replace the Stop, and the motion could then be resumed. Therefore the port blocks
    // the Pause.
    assert!(port.write_all(&fixed::PAUSE).is_err());
    port.write_all(&fixed::STOP).unwrap();
    port.write_all(&fixed::GET_INFO).unwrap();
    let mut got = vec![0; fixed::STOP.len() + fixed::GET_INFO.len()];
    far.read_exact(&mut got).unwrap();
    assert_eq!(got, [&fixed::STOP[..], &fixed::GET_INFO].concat());
    // The port owner does not read. The door's thread still finds the response record of the Stop, and the received
    // bytes are kept for the port owner.
    let record = Response::good(FrameType::TrajSetExecStatus, DataStatus::NotAllowed, 7);
    far.write_all(&status(record)).unwrap();
    let (answer, _) = loop {
        // Statuses continue to arrive, as from a real controller.
        far.write_all(&status(Response::default())).unwrap();
        std::thread::sleep(Duration::from_millis(20));
        if asked.is_finished() {
            break asked.join().unwrap().unwrap().unwrap();
        }
    };
    assert_eq!((answer.confirmed, answer.accepted, answer.moved), (true, false, false), "{answer:?}");
    let mut first = [0; jtc_wire::STATUS_LEN];
    assert_eq!(port.read(&mut first, Duration::from_secs(1)).unwrap(), first.len());
    assert_eq!(first, status(record));
}

/// The port sends a Stop again if the Stop arrives damaged or is not answered. If the controller never confirms the Stop, the client
/// receives an error.
#[test]
fn a_stop_is_written_until_the_controller_confirms_it() {
    let (mut far, path) = pair();
    let port = SerialPort::open(&path, 115_200).unwrap();
    let socket = door(&path);
    let asked = std::thread::spawn(move || halt::ask(&socket, Halt::Stop, "a test"));
    let mut got = [0; fixed::STOP.len()];
    for _ in 0..8 {
        far.read_exact(&mut got).unwrap();
        assert_eq!(got, fixed::STOP);
    }
    let error = asked.join().unwrap().expect_err("nothing confirms it");
    assert!(
        matches!(error, PortError::NotHalted { .. }) && error.hint().contains("emergency stop"),
        "{error}"
    );
    drop(port);
    assert!(halt::sockets_of(&path).is_empty(), "the socket goes with the port");
}

/// Writes a Stop or Pause through the door of a port on which the controller does not answer.
fn halt_unconfirmed(path: &str, halt: Halt) {
    let socket = door(path);
    std::thread::spawn(move || halt::ask(&socket, halt, "a test")).join().unwrap().expect_err("unconfirmed");
}

/// A motion was requested before the Stop, but its frames come much later, for example because the request was in a
/// queue. The port rejects these frames.
#[test]
fn a_motion_requested_before_a_stop_does_not_pass_however_late_its_turn_comes() {
    let (_far, path) = pair();
    let mut port = SerialPort::open(&path, 115_200).unwrap();
    let none = Halts::default();
    assert_eq!(port.halts(), none);
    // Before the Stop, the port sends the frames of a motion.
    port.ask_to_move_after(none.all).unwrap();
    port.write_all(&fixed::EXECUTE).unwrap();
    halt_unconfirmed(&path, Halt::Stop);
    assert_eq!(port.halts(), Halts { all: 1, stops: 1 });
    // This pause is longer than the 3 s in which the port rejects new requests.
    std::thread::sleep(Duration::from_millis(3100));
    for _ in 0..10 {
        port.ask_to_move_after(none.all).unwrap();
        let error = port.write_all(&fixed::EXECUTE).expect_err("requested before the Stop");
        assert!(matches!(error, PortError::Halted { by: Some(_) }), "{error}");
    }
    // The port sends the frames of a motion that was requested after the Stop.
    port.ask_to_move_after(1).unwrap();
    port.write_all(&fixed::EXECUTE).unwrap();
}

/// J-33: a controller rejects a Pause while it decelerates after a Stop. An older controller accepts this Pause and pauses the motion.
/// Therefore the port writes no Pause after a Stop.
#[test]
fn j33_no_pause_is_written_after_a_stop_and_no_stopped_motion_is_resumed() {
    let (mut far, path) = pair();
    let mut port = SerialPort::open(&path, 115_200).unwrap();
    let read = |far: &mut TTYPort, frames: &[[u8; 7]]| {
        for frame in frames {
            let mut got = vec![0; frame.len()];
            far.read_exact(&mut got).unwrap();
            assert_eq!(got, frame);
        }
    };
    halt_unconfirmed(&path, Halt::Pause);
    read(&mut far, &[fixed::PAUSE; 8]);
    // After another program's Pause, the port owner may still send a Pause. After another program's Stop, every Pause
    // is rejected.
    port.write_all(&fixed::PAUSE).unwrap();
    halt_unconfirmed(&path, Halt::Stop);
    read(&mut far, &[fixed::PAUSE; 1]);
    read(&mut far, &[fixed::STOP; 8]);
    for _ in 0..5 {
        assert!(port.write_all(&fixed::PAUSE).is_err());
        halt_unconfirmed(&path, Halt::Pause);
    }
    std::thread::sleep(Duration::from_millis(3100));
    port.ask_to_resume().unwrap();
    assert!(port.write_all(&fixed::EXECUTE).is_err(), "a stopped motion is not resumed");
    port.ask_to_move().unwrap();
    port.write_all(&fixed::EXECUTE).unwrap();
    read(&mut far, &[fixed::EXECUTE; 1]);
    // After a Pause without a Stop, a client can resume the motion.
    halt_unconfirmed(&path, Halt::Pause);
    std::thread::sleep(Duration::from_millis(3100));
    port.ask_to_resume().unwrap();
    port.write_all(&fixed::EXECUTE).unwrap();
    read(&mut far, &[fixed::PAUSE; 8]);
    read(&mut far, &[fixed::EXECUTE; 1]);
}

/// Starts a simulated controller that calls `next` with the received bytes, and sends the status that `next` returns. Returns the thread of
/// the controller, and a flag that ends this thread.
fn controller(
    mut far: TTYPort,
    mut next: impl FnMut(&[u8]) -> Status + Send + 'static,
) -> (std::sync::Arc<std::sync::atomic::AtomicBool>, std::thread::JoinHandle<()>) {
    use std::sync::atomic::{AtomicBool, Ordering};
    let over = std::sync::Arc::<AtomicBool>::default();
    let end = std::sync::Arc::clone(&over);
    far.set_timeout(Duration::from_millis(20)).unwrap();
    let thread = std::thread::spawn(move || {
        let mut buffer = [0; 256];
        while !end.load(Ordering::SeqCst) {
            let n = far.read(&mut buffer).unwrap_or(0);
            // The result is ignored, because statuses can be lost if the host does not read from the line for some
            // time.
            let _ = far.write_all(&next(&buffer[..n]).emit());
        }
    });
    (over, thread)
}

fn is_in(bytes: &[u8], frame: &[u8]) -> bool {
    bytes.windows(frame.len()).any(|window| window == frame)
}

/// The port repeats the command that ends teaching until the statuses show that teaching has ended. Until then, the
/// arm does not count as at rest.
#[test]
fn the_end_of_teaching_is_written_until_statuses_show_it() {
    for heard in [1, 2, 5, u32::MAX] {
        let (far, path) = pair();
        let _port = SerialPort::open(&path, 115_200).unwrap();
        let mut ends = 0;
        let (over, thread) = controller(far, move |bytes| {
            ends += u32::from(is_in(bytes, &fixed::TEACHING_MODE_DISABLE));
            let record = Response::good(FrameType::TrajSetExecStatus, DataStatus::NotAllowed, 1);
            let taught = ends < heard;
            Status {
                state: if taught { ControllerState::Teaching } else { ControllerState::HoldPos }.into(),
                response: if is_in(bytes, &fixed::STOP) { record } else { Response::default() },
                ..Status::default()
            }
        });
        let (answer, end) = halt::ask(&door(&path), Halt::Stop, "a test").unwrap().unwrap();
        let end = end.expect("the program has the port still");
        assert!(answer.confirmed && answer.moved, "{answer:?}");
        assert_eq!(end.stands, heard != u32::MAX, "{end:?}");
        assert!(
            end.stands || end.moving.as_ref().is_some_and(|moving| moving.contains("teaching")),
            "{end:?}"
        );
        over.store(true, std::sync::atomic::Ordering::SeqCst);
        thread.join().unwrap();
    }
}

/// Teaching was requested but has not begun, so the statuses cannot show its end. The port considers it ended when
/// the response record of the command that ends teaching has arrived.
#[test]
fn teaching_that_did_not_begin_is_ended_with_a_record() {
    for heard in [1, 3, u32::MAX] {
        let (far, path) = pair();
        let mut port = SerialPort::open(&path, 115_200).unwrap();
        port.write_all(&fixed::TEACHING_MODE_ENABLE).unwrap();
        let mut ends = 0;
        let (over, thread) = controller(far, move |bytes| {
            let is_end = is_in(bytes, &fixed::TEACHING_MODE_DISABLE);
            ends += u32::from(is_end);
            let good = |frame| Response::good(frame, DataStatus::NoError, 1);
            let response = match () {
                () if is_in(bytes, &fixed::STOP) => good(FrameType::TrajSetExecStatus),
                () if is_end && ends >= heard => good(FrameType::TeachingModeDisable),
                () => Response::default(),
            };
            Status { state: ControllerState::HoldPos.into(), response, ..Status::default() }
        });
        let (_, end) = halt::ask(&door(&path), Halt::Stop, "a test").unwrap().unwrap();
        assert_eq!(end.expect("an end").stands, heard != u32::MAX, "{heard}");
        over.store(true, std::sync::atomic::Ordering::SeqCst);
        thread.join().unwrap();
    }
}

/// If a trajectory is paused after a Stop, the port sends the Stop again.
#[test]
fn a_pause_that_came_after_the_stop_is_stopped() {
    for heard in [2, 3, u32::MAX] {
        let (far, path) = pair();
        let _port = SerialPort::open(&path, 115_200).unwrap();
        let mut stops = 0;
        let (over, thread) = controller(far, move |bytes| {
            let is_stop = is_in(bytes, &fixed::STOP);
            stops += u32::from(is_stop);
            let record = Response::good(FrameType::TrajSetExecStatus, DataStatus::NoError, 1);
            let paused = stops < heard;
            Status {
                state: ControllerState::HoldPos.into(),
                trajectory: if paused { TrajectoryState::Pause } else { TrajectoryState::Stop }.into(),
                response: if is_stop { record } else { Response::default() },
                ..Status::default()
            }
        });
        let (_, end) = halt::ask(&door(&path), Halt::Stop, "a test").unwrap().unwrap();
        let end = end.expect("an end");
        assert_eq!(end.stands, heard != u32::MAX, "{end:?}");
        assert!(end.stands || end.moving.as_ref().is_some_and(|moving| moving.contains("paused")), "{end:?}");
        over.store(true, std::sync::atomic::Ordering::SeqCst);
        thread.join().unwrap();
    }
}

/// Two programs of the superuser may have one port open at the same time. The later program does not replace the
/// socket of the earlier program. Each program removes only a socket that it has created.
#[test]
fn a_socket_of_a_living_program_is_left_alone() {
    let (_far, path) = pair();
    let port = SerialPort::open(&path, 115_200).unwrap();
    let socket = door(&path);
    let kept = socket.with_extension("kept");
    std::fs::rename(&socket, &kept).unwrap();
    // Another program has created its own socket at this path.
    let other = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    drop(port);
    assert!(socket.exists(), "it is not the port's own");
    std::fs::remove_file(kept).unwrap();
    let port = SerialPort::open(&path, 115_200).unwrap();
    drop(port);
    assert!(halt::is_alive(&socket));
    drop(other);
    std::fs::remove_file(&socket).unwrap();
}

/// The deadline applies to the whole request, even if its bytes arrive slowly. Therefore a slow request cannot
/// prevent the port from closing.
#[test]
fn a_request_that_comes_byte_by_byte_is_given_up() {
    let (_far, path) = pair();
    let _port = SerialPort::open(&path, 115_200).unwrap();
    let mut stream = std::os::unix::net::UnixStream::connect(door(&path)).unwrap();
    // The door closes the connection before the request line is complete. The transmission of the complete request would take much more
    // than one second.
    let closed = (0..100).any(|_| {
        std::thread::sleep(Duration::from_millis(100));
        stream.write_all(b" ").is_err()
    });
    assert!(closed);
}
