//! Tests of the socketcand protocol over TCP, with a simple client that shares no code with the server.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use can_link::{CanBus, CanFrame, Id, SocketcandServer, VirtualHub, open};
use test_kit::patience::LONGEST;

use super::{frame, numbered, socketcand_bench, take, until};

/// Simple client that works like the client in python-can.
struct Raw(TcpStream);

impl Raw {
    fn connect(server: &SocketcandServer) -> Self {
        let stream = TcpStream::connect(server.local_addr()).unwrap();
        stream.set_read_timeout(Some(LONGEST)).unwrap();
        Self(stream)
    }

    /// Reads once, like python-can does.
    fn read(&mut self) -> String {
        let mut buffer = [0; 256];
        let count = self.0.read(&mut buffer).unwrap();
        String::from_utf8(buffer[..count].to_vec()).unwrap()
    }

    fn write(&mut self, text: &str) {
        self.0.write_all(text.as_bytes()).unwrap();
    }

    fn ask(&mut self, text: &str) -> String {
        self.write(text);
        self.read()
    }

    fn raw_mode(server: &SocketcandServer) -> Self {
        let mut raw = Self::connect(server);
        assert_eq!(raw.read(), "< hi >");
        assert_eq!(raw.ask("< open can0 >"), "< ok >");
        assert_eq!(raw.ask("< rawmode >"), "< ok >");
        raw
    }

    /// Reads until the text contains `end`.
    fn read_until(&mut self, end: &str) -> String {
        let mut text = String::new();
        while !text.contains(end) {
            let more = self.read();
            assert!(!more.is_empty(), "the connection ended after {text:?}");
            text += &more;
        }
        text
    }
}

/// Stops a thread when the guard is dropped, even if a test fails.
struct Guard<'a>(&'a AtomicBool);

impl Drop for Guard<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn answers_come_alone_and_no_frame_is_glued_to_them() {
    let (server, hub) = socketcand_bench();
    let mut node = hub.join();
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let _guard = Guard(&stop);
        // The thread sends frames on the bus all the time.
        scope.spawn(|| {
            for number in 0.. {
                node.send(&numbered(number)).unwrap();
                std::thread::sleep(Duration::from_micros(100));
                if stop.load(Ordering::Relaxed) {
                    break;
                }
            }
        });
        let alone = (0..50).any(|_| {
            let mut client = Raw::connect(&server);
            assert_eq!(client.read(), "< hi >");
            // The client receives no frames before raw mode.
            assert_eq!(client.ask("< open can0 >"), "< ok >");
            client.write("< rawmode >");
            client.0.peek(&mut [0]).unwrap();
            // A frame that the server does not delay would arrive during these 3 ms. On a busy computer, the wait can
            // take longer, so delayed frames can also arrive.
            std::thread::sleep(Duration::from_millis(3));
            let first = client.read();
            assert!(first.starts_with("< ok >"), "{first}");
            // The delayed frames arrive without a gap in their numbers.
            let text = client.read_until(" >< frame 100 ");
            let text = text + &client.read_until(" >< frame 100 ");
            let numbers: Vec<_> = text.split(" >").filter_map(|line| line.get(line.len() - 8..)).collect();
            let numbers: Vec<_> =
                numbers.iter().filter_map(|hex| u32::from_str_radix(hex, 16).ok()).collect();
            assert!(numbers.len() > 1 && numbers.windows(2).all(|pair| pair[0] + 1 == pair[1]), "{text}");
            first == "< ok >"
        });
        assert!(alone, "a frame always shares the segment of the answer");
    });
}

#[test]
fn what_was_on_the_bus_before_raw_mode_is_not_received() {
    let (server, hub) = socketcand_bench();
    let mut node = hub.join();
    let mut client = Raw::connect(&server);
    assert_eq!(client.read(), "< hi >");
    assert_eq!(client.ask("< open can0 >"), "< ok >");
    node.send(&numbered(0)).unwrap();
    assert_eq!(client.ask("< rawmode >"), "< ok >");
    node.send(&numbered(1)).unwrap();
    let text = client.read_until(" 00000001 >");
    assert_eq!(text.matches("frame").count(), 1, "{text}");
}

#[test]
fn frames_are_lines_with_a_time_and_two_blanks_without_data() {
    let (server, hub) = socketcand_bench();
    let mut node = hub.join();
    let mut client = Raw::raw_mode(&server);
    node.send(&frame(0x680, &[])).unwrap();
    let line = client.read_until(">");
    let words: Vec<_> = line.split(' ').collect();
    let [_, "frame", "680", time, "", ">"] = words[..] else { panic!("{line}") };
    let (seconds, micros) = time.split_once('.').unwrap();
    assert!(seconds.parse::<u64>().unwrap() > 1_600_000_000 && micros.len() == 6, "{line}");
    node.send(&CanFrame::classic(Id::extended(0x680).unwrap(), &[1, 0xAB]).unwrap()).unwrap();
    let line = client.read_until(">");
    assert!(line.starts_with("< frame 00000680 ") && line.ends_with(" 01AB >"), "{line}");
}

#[test]
fn commands_may_be_cut_anywhere_and_glued_together() {
    let (server, hub) = socketcand_bench();
    let mut node = hub.join();
    let commands = b"< send 281 0  >< send 1C1 2 2 f >< send 00000281 8 1 2 3 4 5 6 7 8 >";
    let expected = [
        frame(0x281, &[]),
        frame(0x1C1, &[2, 15]),
        CanFrame::classic(Id::extended(0x281).unwrap(), &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap(),
    ];
    let mut client = Raw::raw_mode(&server);
    client.0.set_nodelay(true).unwrap();
    for cut in (0..commands.len()).step_by(7) {
        client.0.write_all(&commands[..cut]).unwrap();
        client.0.write_all(&commands[cut..]).unwrap();
        for frame in expected {
            assert_eq!(take(&mut node), frame);
        }
    }
}

#[test]
fn clients_hear_each_other_and_not_themselves_in_the_order_of_the_bus() {
    let (server, hub) = socketcand_bench();
    let mut node = hub.join();
    let mut clients: Vec<_> = (0..3).map(|_| open(&server.url("can0")).unwrap()).collect();
    let count = 300;
    std::thread::scope(|scope| {
        for (number, client) in clients.iter_mut().enumerate() {
            scope.spawn(move || {
                for k in 0..count {
                    client.send(&frame(number as u32, &[0, k as u8, (k >> 8) as u8])).unwrap();
                }
            });
        }
    });
    let order: Vec<_> = (0..3 * count).map(|_| take(&mut node)).collect();
    for (number, client) in clients.iter_mut().enumerate() {
        for frame in order.iter().filter(|frame| frame.id().value() != number as u32) {
            assert_eq!(take(client), *frame);
        }
    }
    node.send(&frame(9, &[])).unwrap();
    for client in &mut clients {
        assert_eq!(take(client), frame(9, &[]), "none of its own frames came back");
    }
}

#[test]
fn a_client_that_reads_nothing_stalls_nobody_and_its_misses_are_counted() {
    // On this bus, a sender waits forever for a member whose queue is full. A client that does not read must not
    // block the sender in this way.
    let hub = VirtualHub::with_timeout(Duration::MAX);
    let server = SocketcandServer::bind("127.0.0.1:0", &[("can0", &hub)]).unwrap();
    let mut node = hub.join();
    let mut sleeper = Raw::raw_mode(&server);
    let mut listener = open(&server.url("can0")).unwrap();
    // Number of frames that exceeds the client's queue and the buffers of every operating system.
    let count = 100_000;
    let (done, waited) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let mut received = 0;
        for number in 0..count {
            node.send(&numbered(number)).unwrap();
            // A client that reads must receive all frames.
            if number % 1000 == 999 {
                while received <= number {
                    assert_eq!(take(&mut listener), numbered(received));
                    received += 1;
                }
            }
        }
        done.send(node).unwrap();
    });
    let mut node = waited.recv_timeout(LONGEST).expect("the sleeper holds up the bus");
    assert!(server.stats().missed > 0, "{:?}", server.stats());
    // The client that did not read is still connected, and now reads the oldest queued frames. When the queue of the
    // client has space again, the client receives new frames.
    assert!(sleeper.read_until(">").contains(" 00000000 >"));
    until(|| {
        sleeper.read();
        node.send(&numbered(count)).unwrap();
        let before = server.stats().missed;
        node.send(&numbered(count)).unwrap();
        before == server.stats().missed
    });
    sleeper.read_until(&format!(" {count:08X} >"));
}

#[test]
fn what_has_no_form_is_counted_and_what_is_not_understood_does_no_harm() {
    let (server, hub) = socketcand_bench();
    let mut node = hub.join();
    let mut client = Raw::connect(&server);
    assert_eq!(client.read(), "< hi >");
    assert_eq!(client.ask("< rawmode >"), "< error unknown command >");
    assert_eq!(client.ask("< send 281 0  >"), "< error unknown command >");
    assert_eq!(client.ask("<echo>"), "< echo >");
    assert_eq!(client.ask("< open can0 >"), "< ok >");
    assert_eq!(client.ask("< subscribe 0 0 123 >"), "< error unknown command >");
    assert_eq!(client.ask("< rawmode >"), "< ok >");
    // In raw mode the server must not send error texts, because python-can could not parse them.
    client.write("< noise >< send 281 9 >< send xyz 0  ><<<>>> \u{e4} < \u{e4} >");
    client.write(&"x".repeat(100_000));
    client.write(&format!("< {}", "y".repeat(100_000)));
    node.send(&CanFrame::fd(Id::standard(1).unwrap(), &[1; 12]).unwrap()).unwrap();
    node.send(&CanFrame::remote(Id::standard(1).unwrap(), 0).unwrap()).unwrap();
    assert_eq!(client.ask("< echo >"), "< echo >");
    node.send(&numbered(7)).unwrap();
    assert!(client.read_until(">").contains(" 00000007 >"));
    until(|| server.stats().not_carried == 2);
    let stats = server.stats();
    assert!(stats.not_understood >= 9 && stats.received == 0, "{stats:?}");
    // The command `bcmmode` ends raw mode. The client must then receive no frames.
    assert_eq!(client.ask("< bcmmode >"), "< ok >");
    node.send(&numbered(8)).unwrap();
    assert_eq!(client.ask("< echo >"), "< echo >");
    client.write("< send 5 0  >");
    assert_eq!(take(&mut node), frame(5, &[]));
}

#[test]
fn an_unknown_bus_is_refused_with_what_there_is() {
    let (server, _hub) = socketcand_bench();
    let mut client = Raw::connect(&server);
    assert_eq!(client.read(), "< hi >");
    assert_eq!(client.ask("< open can7 >"), "< error no such bus; there is can0 >");
    assert_eq!(client.read(), "", "and the connection ends");
    let error = open(&server.url("can7")).err().expect("no such bus").to_string();
    assert!(error.contains("opening the bus") && error.contains("there is can0"), "{error}");
}

/// The server must deliver frames that a client sent before it disconnected, even if the client has not read its
/// received frames.
#[test]
fn the_last_frames_of_a_client_are_delivered() {
    let (server, hub) = socketcand_bench();
    let mut node = hub.join();
    for number in 0..20 {
        let mut client = open(&server.url("can0")).unwrap();
        for k in 0..100 {
            node.send(&numbered(k)).unwrap();
        }
        client.send(&numbered(number)).unwrap();
        drop(client);
        assert_eq!(take(&mut node), numbered(number));
    }
    until(|| server.stats().clients == 0);
}

#[test]
fn ten_thousand_visitors_leave_nothing_behind() {
    let (server, _hub) = socketcand_bench();
    let texts: [&[u8]; 5] = [b"", b"< open can0 >", b"< open can0 >< rawmode >", b"<", &[0xFF; 3000]];
    for number in 0..10_000 {
        let mut stream = TcpStream::connect(server.local_addr()).unwrap();
        // An error is ignored, because the server has perhaps already closed the connection.
        let _ = stream.write_all(texts[number % texts.len()]);
        if number % 16 == 15 {
            // The test never opens more connections than the server accepts.
            until(|| server.stats().accepted > number as u64 && server.stats().clients < 32);
        }
    }
    until(|| server.stats().clients == 0);
    let stats = server.stats();
    assert_eq!((stats.accepted, stats.turned_away), (10_000, 0));
    drop(Raw::raw_mode(&server));
}

#[test]
fn more_clients_than_there_is_room_for_are_turned_away() {
    let (server, _hub) = socketcand_bench();
    let clients: Vec<_> = (0..64).map(|_| Raw::raw_mode(&server)).collect();
    let mut one_more = Raw::connect(&server);
    match one_more.0.read(&mut [0; 10]) {
        Ok(count) => assert_eq!(count, 0),
        Err(error) => assert_eq!(error.kind(), ErrorKind::ConnectionReset),
    }
    // The counter changes after the connection is closed.
    until(|| server.stats().turned_away == 1);
    drop(clients);
    until(|| server.stats().clients == 0);
    Raw::raw_mode(&server);
}

#[test]
fn a_taken_address_is_an_error_with_the_way_out() {
    let (server, hub) = socketcand_bench();
    let again = SocketcandServer::bind(server.local_addr(), &[("can0", &hub)]).err().expect("taken");
    let message = again.to_string();
    assert!(message.contains(&server.local_addr().to_string()) && message.contains("Port 0"), "{message}");
}
