//! Serial ports on a pseudo-terminal: both directions, timeouts, rates, and the errors of a port that cannot be used.
#![cfg(unix)]

use std::io::{Read, Write};
use std::time::Duration;

use jtc_host::port::{PortError, STANDARD_RATES, SerialPort};
use jtc_host::{Diagnose, Port};
use serialport::{SerialPort as _, TTYPort};

/// The far end, and the path of the near one.
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
        // Nothing there: no error, no wait.
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
