//! Body of the fuzz target `modbus_stream`. This target uses only this file and the file `pdu` of the crate.
use super::pdu::{Device, Exception, HEADER_LEN, Header, Table, answer};

/// Longest response, including its header, that the Modbus standard permits, in bytes.
const RESPONSE_MAX: usize = 260;

/// Modbus device with sixteen entries in each table; higher addresses do not exist.
#[derive(Clone, Default, PartialEq, Debug)]
pub(super) struct Sixteen {
    coils: [bool; 16],
    registers: [u16; 16],
    /// Number of executed write requests.
    pub(super) writes: usize,
}

fn part<T: Clone>(all: &[T], at: u16, count: usize) -> Result<Vec<T>, Exception> {
    let at = usize::from(at);
    all.get(at..at + count).map(<[T]>::to_vec).ok_or(Exception::Address)
}

impl Device for Sixteen {
    fn bits(&mut self, _: Table, at: u16, count: u16) -> Result<Vec<bool>, Exception> {
        part(&self.coils, at, count.into())
    }

    fn registers(&mut self, _: Table, at: u16, count: u16) -> Result<Vec<u16>, Exception> {
        part(&self.registers, at, count.into())
    }

    fn write_coils(&mut self, at: u16, values: &[bool]) -> Result<(), Exception> {
        part(&self.coils, at, values.len())?;
        self.coils[usize::from(at)..][..values.len()].copy_from_slice(values);
        self.writes += 1;
        Ok(())
    }

    fn write_registers(&mut self, at: u16, values: &[u16]) -> Result<(), Exception> {
        part(&self.registers, at, values.len())?;
        self.registers[usize::from(at)..][..values.len()].copy_from_slice(values);
        self.writes += 1;
        Ok(())
    }
}

/// Simulates a connection that sends the bytes `data`, and checks the responses:
///
/// - each request receives one response with its transaction number and a permitted length;
/// - the response shows whether the device executed the request;
/// - a refused request writes nothing, and written values can be read back.
///
/// # Panics
///
/// Panics if a check fails.
pub fn modbus_stream(mut data: &[u8]) {
    let mut device = Sixteen::default();
    while let Some((head, rest)) = data.split_first_chunk::<HEADER_LEN>() {
        let Some(header) = Header::parse(*head) else { return };
        let Some((pdu, rest)) = rest.split_at_checked(header.len) else { return };
        data = rest;
        let before = device.clone();
        let (pdu_back, done) = answer(pdu, &mut device);
        let response = header.respond(&pdu_back);
        assert!(response.len() <= RESPONSE_MAX && response.len() > HEADER_LEN + 1);
        assert_eq!((&response[..4], response[6]), (&[head[0], head[1], 0, 0][..], head[6]));
        assert_eq!(usize::from(u16::from_be_bytes([response[4], response[5]])), response.len() - 6);
        assert_eq!(pdu_back[0], if done { pdu[0] } else { pdu[0] | 0x80 });
        if !done {
            assert!(pdu_back.len() == 2 && (1..=3).contains(&pdu_back[1]), "{pdu_back:02x?}");
            assert_eq!(device, before);
            continue;
        }
        let writes = [5, 6, 15, 16].contains(&pdu[0]);
        assert_eq!(device.writes, before.writes + usize::from(writes));
        if writes {
            // Written values must be readable at the same addresses, packed as the Modbus standard requires.
            let (read, count) = match pdu[0] {
                5 => (1, [0, 1]),
                6 => (3, [0, 1]),
                15 => (1, [pdu[3], pdu[4]]),
                _ => (3, [pdu[3], pdu[4]]),
            };
            let (back, done) = answer(&[read, pdu[1], pdu[2], count[0], count[1]], &mut device);
            assert!(done);
            let written = match pdu[0] {
                5 => vec![u8::from(pdu[3] == 0xFF)],
                6 => pdu[3..5].to_vec(),
                15 => masked(&pdu[6..], usize::from(pdu[4])),
                _ => pdu[6..].to_vec(),
            };
            assert_eq!(back[2..], written);
        } else {
            assert_eq!(device, before);
        }
    }
}

/// Sets all bits after the first `count` bits to zero.
fn masked(bytes: &[u8], count: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    if let Some(last) = bytes.last_mut().filter(|_| !count.is_multiple_of(8)) {
        *last &= 0xFF >> (8 - count % 8);
    }
    bytes
}
