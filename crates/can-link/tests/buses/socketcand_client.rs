//! Tests of the socketcand client: frames that the client refuses, and errors if a server disconnects or does not use
//! the protocol.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener};
use std::time::Duration;

use can_link::{AnswerError, CanBus, CanError, CanFrame, ErrorState, Id, OpenError, SocketcandBus, open};
use test_kit::patience::LONGEST;

use super::{frame, numbered, socketcand_bench, take};

#[test]
fn the_client_reports_when_the_server_goes_and_when_it_was_never_there() {
    let (server, hub) = socketcand_bench();
    let url = server.url("can0");
    let mut client = open(&url).unwrap();
    let mut node = hub.join();
    node.send(&numbered(1)).unwrap();
    assert_eq!(take(&mut client), numbered(1));
    drop(server);
    let error = client.receive(LONGEST).expect_err("the server is gone");
    assert!(matches!(error, CanError::Closed { .. }) && error.to_string().contains(&url), "{error}");
    assert!(matches!(client.receive(Duration::ZERO), Err(CanError::Closed { .. })), "for good");
    assert!(matches!(client.send(&numbered(1)), Err(CanError::Closed { .. })));
    let error = open(&url).err().expect("no server").to_string();
    assert!(error.contains("cannot connect") && error.contains(&url), "{error}");
}

#[test]
fn the_client_refuses_what_the_protocol_cannot_carry() {
    let (server, _hub) = socketcand_bench();
    let mut client = open(&server.url("can0")).unwrap();
    for frame in [
        CanFrame::fd(Id::standard(1).unwrap(), &[1]).unwrap(),
        CanFrame::remote(Id::standard(1).unwrap(), 1).unwrap(),
    ] {
        let error = client.send(&frame).expect_err("no form").to_string();
        assert!(error.contains("multicast:ADDR:PORT"), "{error}");
    }
}

/// Tests servers that do not use the protocol: the client must return an error for each server, without a panic or an
/// endless wait.
#[test]
fn servers_that_are_none_end_in_words() {
    let end_with = |texts: &'static [&'static str]| {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let server = std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            for text in texts {
                stream.write_all(text.as_bytes()).unwrap();
                std::thread::sleep(Duration::from_millis(2));
            }
            let _ = stream.shutdown(Shutdown::Write);
            let _ = stream.read_to_end(&mut Vec::new());
        });
        let bus = SocketcandBus::connect("127.0.0.1", port, "can0");
        let result = bus.map(|mut bus| {
            let mut frames = Vec::new();
            let end = loop {
                match bus.receive(LONGEST) {
                    Ok(Some(frame)) => frames.push(frame),
                    Ok(None) => panic!("it must end"),
                    Err(error) => break error,
                }
            };
            assert!(matches!(end, CanError::Closed { .. }), "{end}");
            (frames, bus.ignored(), bus.state().errors)
        });
        server.join().unwrap();
        result
    };
    assert!(matches!(
        end_with(&["HTTP/1.1 400 Bad Request\r\n"]),
        Err(OpenError::SetUp(CanError::Closed { .. }))
    ));
    let refused = end_with(&["< hi >", "< error could not open bus >"]);
    assert!(
        matches!(&refused, Err(OpenError::SetUp(CanError::Answer(AnswerError::Refused { answer, .. }))) if answer == "could not open bus")
    );
    // All messages arrive in one piece. The messages have the old and the new format, with and without blanks between
    // bytes; the last one is incomplete.
    let (frames, ignored, errors) = end_with(&[
        "< hi >< ok >< ok >< frame 123 1.0 11 22 >< frame 123 1.0 1122 >\n< frame 00000001 2.5  >",
        "< error 040 1.0 >< rtr 123 1.0 >< frame 5 zz 11 >< frame 12",
    ])
    .unwrap();
    let one = CanFrame::classic(Id::extended(1).unwrap(), &[]).unwrap();
    assert_eq!(frames, [frame(0x123, &[0x11, 0x22]), frame(0x123, &[0x11, 0x22]), one]);
    assert_eq!((ignored, errors), (2, ErrorState::BusOff));
    assert_eq!(
        end_with(&["< hi >< ok >< ok >< error 040 1 >< error 100 2 >"]).unwrap().2,
        ErrorState::Active
    );
}
