//! Tests of the host's side of SLCAN with adapters: our own adapter on a pseudo-terminal and over TCP, and simulated
//! adapters of other manufacturers.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use can_link::{
    AnswerError, CanBus, CanError, CanFrame, ControllerState, ErrorState, Id, OpenError, SlcanAdapter,
    SlcanBus, SlcanOptions, VirtualBus, VirtualHub, open,
};
use test_kit::patience::LONGEST;

use super::{frame, take, until};

/// An adapter between a port and a bus, in its own thread.
struct Running {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<SlcanAdapter>>,
}

impl Running {
    fn start(mut port: impl Read + Write + Send + 'static, mut bus: VirtualBus) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let mut adapter = SlcanAdapter::new();
            adapter.set_state(ControllerState::without_counters(ErrorState::Warning));
            let mut latest = None;
            while adapter.turn(&mut port, &mut bus).is_ok() {
                if asked.load(Ordering::Relaxed) {
                    // The thread ends when the host has closed the channel, or after 2 s. Until then it also
                    // processes bytes that the host wrote before the stop request and that are still in the terminal.
                    let latest = *latest.get_or_insert_with(|| Instant::now() + Duration::from_secs(2));
                    if !adapter.is_open() || Instant::now() >= latest {
                        break;
                    }
                }
            }
            adapter
        });
        Self { stop, thread: Some(thread) }
    }

    fn end(mut self) -> SlcanAdapter {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap()
    }
}

/// Checks all kinds of frames in both directions, and the state; returns the adapter.
fn check(url: &str, adapter: Running, mut node: VirtualBus) -> SlcanAdapter {
    let mut bus = open(url).unwrap();
    let mut frames = Vec::new();
    for id in [Id::standard(0x7FF).unwrap(), Id::extended(0x1FFF_FFFF).unwrap()] {
        for len in 0..=8 {
            frames.push(CanFrame::classic(id, &[0xA5, 0, 0xFF, 7, 1, 2, 3, 4][..len]).unwrap());
            frames.push(CanFrame::remote(id, len).unwrap());
        }
        for len in [0, 8, 12, 16, 20, 24, 32, 48, 64] {
            frames.push(CanFrame::fd(id, &vec![len as u8; len]).unwrap());
            frames.push(CanFrame::fd(id, &vec![len as u8; len]).unwrap().with_brs(false));
        }
    }
    for frame in &frames {
        bus.send(frame).unwrap();
        assert_eq!(take(&mut node), *frame);
        node.send(frame).unwrap();
        assert_eq!(take(&mut bus), *frame);
    }
    // The test sends bursts in both directions at the same time. The two sides must not block each other, and must not
    // lose or reorder frames.
    let count = 3000;
    std::thread::scope(|scope| {
        let node = &mut node;
        scope.spawn(move || {
            for number in 0..count {
                node.send(&frame(1, &u32::to_be_bytes(number))).unwrap();
                assert_eq!(take(node), frame(2, &number.to_be_bytes()));
            }
        });
        for number in 0..count {
            bus.send(&frame(2, &u32::to_be_bytes(number))).unwrap();
        }
    });
    for number in 0..count {
        assert_eq!(take(&mut bus), frame(1, &number.to_be_bytes()));
    }
    assert_eq!(bus.receive(Duration::ZERO).unwrap(), None);
    assert_eq!(bus.state().errors, ErrorState::Warning);
    // The last frame must arrive although no call waits for it.
    bus.send(&frame(3, &[])).unwrap();
    drop(bus);
    assert_eq!(take(&mut node), frame(3, &[]));
    adapter.end()
}

#[cfg(target_os = "linux")]
#[test]
fn all_frames_go_both_ways_over_a_pseudo_terminal() {
    use serialport::{SerialPort, TTYPort};
    let (mut port, line) = TTYPort::pair().unwrap();
    port.set_timeout(Duration::from_millis(1)).unwrap();
    // `line` stays open so that the terminal continues to exist.
    let hub = VirtualHub::new();
    let adapter = Running::start(port, hub.join());
    let device = line.name().unwrap();
    let adapter = check(&format!("slcan:{device}@1000000?data=5000000"), adapter, hub.join());
    assert_eq!((adapter.rates(), adapter.is_open()), ((Some(1_000_000), Some(5_000_000)), false));
}

/// Starts a thread that acts as an adapter over TCP; `play` is called with the connection.
fn served<R: Send + 'static>(play: impl FnOnce(TcpStream) -> R + Send + 'static) -> (String, JoinHandle<R>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let device = format!("tcp:{}", listener.local_addr().unwrap());
    let thread = std::thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        stream.set_nodelay(true).unwrap();
        play(stream)
    });
    (device, thread)
}

#[test]
fn all_frames_go_both_ways_over_tcp() {
    let hub = VirtualHub::new();
    let bus = hub.join();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("slcan:tcp:{}@500000", listener.local_addr().unwrap());
    let client = std::thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        stream.set_nodelay(true).unwrap();
        stream.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
        Running::start(stream, bus)
    });
    // The adapter starts when the host connects.
    let hub_bus = hub.join();
    let opened = std::thread::spawn(move || {
        let adapter = client.join().unwrap();
        (adapter, ())
    });
    let mut bus = open(&url).unwrap();
    let (adapter, ()) = opened.join().unwrap();
    let mut node = hub_bus;
    for number in 0..500_u32 {
        bus.send(&frame(2, &number.to_be_bytes())).unwrap();
        assert_eq!(take(&mut node), frame(2, &number.to_be_bytes()));
        node.send(&frame(1, &[])).unwrap();
        assert_eq!(take(&mut bus), frame(1, &[]));
    }
    drop(bus);
    assert_eq!(adapter.end().rates(), (Some(500_000), None));
}

fn options(device: &str, rate: Option<u32>, data_rate: Option<u32>) -> SlcanOptions {
    SlcanOptions { device: device.to_owned(), rate, data_rate, baud: SlcanOptions::BAUD }
}

/// Reads lines until the end of the stream; `answer` returns the answer to each line.
fn play(mut stream: TcpStream, mut answer: impl FnMut(&str) -> String) -> Vec<String> {
    let mut lines = Vec::new();
    let mut line = String::new();
    let mut byte = [0];
    while stream.read(&mut byte).is_ok_and(|count| count == 1) {
        if byte[0] != b'\r' {
            line.push(byte[0] as char);
            continue;
        }
        if stream.write_all(answer(&line).as_bytes()).is_err() {
            break;
        }
        lines.push(std::mem::take(&mut line));
    }
    lines
}

/// Some firmware answers only the version request. The host must still send frames to such an adapter.
#[test]
fn an_adapter_that_never_answers_is_written_to_all_the_same() {
    let (device, adapter) = served(|stream| {
        play(stream, |line| if line == "V" { "b158aa7 somewhere\r".to_owned() } else { String::new() })
    });
    let mut bus = SlcanBus::open(&options(&device, Some(125_000), None)).unwrap();
    for number in 0..200 {
        bus.send(&frame(0x100, &[number])).unwrap();
    }
    assert_eq!(bus.state(), ControllerState::default());
    drop(bus);
    let lines = adapter.join().unwrap();
    let frames: Vec<_> = (0..200).map(|number| format!("t1001{number:02X}")).collect();
    let first = lines.iter().position(|line| line == "S4").unwrap();
    assert_eq!(lines[first..first + 2], ["S4", "O"]);
    assert_eq!(lines[first + 2..], [frames, vec!["C".to_owned()]].concat());
}

/// The host waits while the adapter's transmit queue is full. After a bell character the host must send the frame
/// again, so that no frame is lost or out of order.
#[test]
fn refused_frames_are_sent_again_in_order() {
    let (device, adapter) = served(|stream| {
        let mut refused = 0;
        let mut taken = Vec::new();
        play(stream, |line| match line.as_bytes() {
            [b't', ..] if refused < 3 => {
                refused += 1;
                "\u{7}".to_owned()
            }
            [b't', ..] => {
                refused = 0;
                taken.push(line.to_owned());
                // A frame from the bus arrives before the confirmation.
                "t7000\rz\r".to_owned()
            }
            [b'V'] => "V1013\r".to_owned(),
            _ => "\r".to_owned(),
        });
        taken
    });
    let mut bus = SlcanBus::open(&options(&device, Some(1_000_000), None)).unwrap();
    for number in 0..50 {
        bus.send(&frame(0x100, &[number])).unwrap();
    }
    for _ in 0..50 {
        assert_eq!(take(&mut bus), frame(0x700, &[]));
    }
    // The adapter must receive the last frame although no call waits for it.
    bus.send(&frame(0x100, &[50])).unwrap();
    drop(bus);
    let expected: Vec<_> = (0..=50).map(|number| format!("t1001{number:02X}")).collect();
    assert_eq!(adapter.join().unwrap(), expected);
}

#[test]
fn a_queue_that_stays_full_is_an_error_with_a_cause() {
    let (device, _adapter) = served(|stream| {
        play(stream, |line| match line.as_bytes() {
            [b't', ..] => "\u{7}".to_owned(),
            [b'V'] => "V1013\r".to_owned(),
            _ => "\r".to_owned(),
        })
    });
    let mut bus = SlcanBus::open(&options(&device, None, None)).unwrap();
    bus.send(&frame(1, &[])).unwrap();
    let error = bus.send(&frame(2, &[])).unwrap_err().to_string();
    assert!(error.contains("transmit queue is full") && error.contains("bit rate"), "{error}");
}

#[test]
fn states_come_by_themselves_from_newer_adapters() {
    let (device, _adapter) = served(|stream| {
        play(stream, |line| match line {
            "V" => "V1013\r".to_owned(),
            "O" => "\rsp130007\r".to_owned(),
            "F" => "\u{7}".to_owned(),
            _ => "\r".to_owned(),
        })
    });
    let mut bus = SlcanBus::open(&options(&device, None, None)).unwrap();
    let state = ControllerState { errors: ErrorState::Passive, tec: Some(7), rec: Some(130) };
    until(|| bus.state() == state);
}

#[test]
fn what_cannot_be_set_is_an_error_that_lists_what_can() {
    let error = SlcanBus::open(&options("/dev/null", Some(123), None)).err().unwrap().to_string();
    assert!(
        error.contains("123 bit/s") && error.contains("10000, 20000") && error.contains("1000000"),
        "{error}"
    );
    let error = SlcanBus::open(&options("/dev/null", None, Some(3))).err().unwrap().to_string();
    assert!(error.contains("data bit rate") && error.contains("5000000"), "{error}");
    let error = open("slcan:/dev/nothing/here@1000000").err().unwrap().to_string();
    assert!(error.contains("plugged in") && error.contains("/dev/nothing/here"), "{error}");
    // This adapter does not support CAN FD, so opening the bus with a data bit rate must fail.
    let (device, _adapter) = served(|stream| {
        play(stream, |line| match line.as_bytes() {
            [b'Y', ..] => "\u{7}".to_owned(),
            [b'V'] => "V1013\r".to_owned(),
            _ => "\r".to_owned(),
        })
    });
    let error = SlcanBus::open(&options(&device, None, Some(5_000_000))).err().unwrap();
    assert!(
        matches!(
            error,
            OpenError::SetUp(CanError::Answer(AnswerError::Refused {
                step: "setting the data bit rate",
                ..
            }))
        ),
        "{error}"
    );
}

#[test]
fn a_port_without_an_adapter_and_one_that_goes_are_distinguished() {
    let (device, mute) = served(|mut stream| stream.read_to_end(&mut Vec::new()).map(|_| ()));
    let error = SlcanBus::open(&options(&device, None, None)).err().unwrap();
    assert!(
        matches!(error, OpenError::SetUp(CanError::Answer(AnswerError::NoAnswer { .. })))
            && error.to_string().contains("baud"),
        "{error}"
    );
    mute.join().unwrap().unwrap();
    let (device, adapter) = served(|stream| {
        let end = stream.try_clone().unwrap();
        play(stream, |line| {
            if line.starts_with('t') {
                let _ = end.shutdown(std::net::Shutdown::Both);
            }
            "V\r\r".to_owned()
        })
    });
    let mut bus = SlcanBus::open(&options(&device, None, None)).unwrap();
    bus.send(&frame(1, &[])).unwrap();
    let error = loop {
        match bus.receive(LONGEST) {
            Ok(_) => {}
            Err(error) => break error,
        }
    };
    assert!(matches!(error, CanError::Closed { .. }), "{error}");
    assert!(matches!(bus.send(&frame(1, &[])), Err(CanError::Closed { .. })));
    drop(bus);
    adapter.join().unwrap();
}

/// Tests the adapter's side according to the manual: the answers of the adapter in each state.
#[test]
fn the_adapter_answers_by_the_manual() {
    let mut adapter = SlcanAdapter::new();
    let reply = |adapter: &mut SlcanAdapter, text: &str, room: bool| {
        adapter.input(text.as_bytes(), |_| room);
        String::from_utf8(adapter.take_output()).unwrap()
    };
    for (text, answer) in [
        ("O\r", "\u{7}"),
        ("t1000\r", "\u{7}"),
        ("S9\r", "\u{7}"),
        ("S", ""),
        ("8\r", "\r"),
        ("Y3\r", "\u{7}"),
        ("Y5\r", "\r"),
        ("F\r", "\u{7}"),
        ("C\r", "\u{7}"),
        ("V\rN\r", "V1013\rNSIM0\r"),
        ("O\r", "\r"),
        ("O\r", "\u{7}"),
        ("S8\r", "\u{7}"),
        ("F\r", "F00\r"),
        ("t1001AA\rT000001000\rr1000\rb1009000000000000000000000000\r", "z\rZ\rz\rz\r"),
        ("t1001A\rt8000\rq\r", "\u{7}\u{7}\u{7}"),
        ("\r", "\r"),
        ("C\r", "\r"),
        ("Z1\r", "\r"),
        ("L\r", "\r"),
        ("t1000\r", "\u{7}"),
    ] {
        assert_eq!(reply(&mut adapter, text, true), answer, "{text:?}");
    }
    adapter.received(&frame(0x100, &[1]));
    assert_eq!(adapter.take_output(), b"t1001010000\r", "with a time stamp");
    assert_eq!(reply(&mut adapter, "C\rO\rt1000\r", false), "\r\r\u{7}", "no room");
    assert_eq!(reply(&mut adapter, &"x".repeat(100_000), true), "");
    assert_eq!(reply(&mut adapter, "\rt1000\r", true), "\u{7}z\r");
}
