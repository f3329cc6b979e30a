//! Requests and responses of Modbus TCP. The module does no I/O: its functions take the bytes of a request and return
//! the bytes of the response.
//!
//! The Modbus standard consists of *Modbus Application Protocol* V1.1b3 and *Messaging on TCP/IP Implementation Guide*
//! V1.0b. A request is checked in the order of the state diagrams in the standard (function, quantity, address) and
//! then executed. For any received bytes, the server sends a response or closes the connection. A write request is
//! executed completely or not at all.

/// Length of the header of a Modbus request, bytes. The header contains the transaction number, the protocol, the
/// length and the unit.
pub const HEADER_LEN: usize = 7;
/// Longest request or response after the header, bytes.
const PDU_MAX: usize = 253;
/// Largest numbers of bits or registers in one request that the Modbus standard permits.
const READ_BITS_MAX: u16 = 2000;
const READ_REGISTERS_MAX: u16 = 125;
const WRITE_BITS_MAX: u16 = 1968;
const WRITE_REGISTERS_MAX: u16 = 123;

/// The four tables of a Modbus device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    /// Writable bits.
    Coils,
    /// Read-only bits.
    DiscreteInputs,
    /// Writable registers.
    HoldingRegisters,
    /// Read-only registers.
    InputRegisters,
}

/// Reason why a request is not executed, with its exception code in the Modbus standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exception {
    /// The device does not have the requested function.
    Function = 1,
    /// An address of the request does not exist.
    Address = 2,
    /// A quantity, a length or a value in the request is invalid.
    Value = 3,
    /// The device has failed. In this server, exception 4 means that the controller cannot be reached.
    Failure = 4,
    /// The device is busy. In this server, exception 6 means that another connection sends the commands.
    Busy = 6,
}

/// Modbus device that answers requests.
pub trait Device {
    /// Returns `count` bits of a table from address `at`.
    ///
    /// # Errors
    ///
    /// An [`Exception`] if the request is not executed.
    fn bits(&mut self, table: Table, at: u16, count: u16) -> Result<Vec<bool>, Exception>;

    /// Returns `count` registers of a table from address `at`.
    ///
    /// # Errors
    ///
    /// An [`Exception`] if the request is not executed.
    fn registers(&mut self, table: Table, at: u16, count: u16) -> Result<Vec<u16>, Exception>;

    /// Writes all coils from address `at`, or none of them.
    ///
    /// # Errors
    ///
    /// An [`Exception`] if the request is not executed; no coil is written in this case.
    fn write_coils(&mut self, at: u16, values: &[bool]) -> Result<(), Exception>;

    /// Writes all holding registers from address `at`, or none of them.
    ///
    /// # Errors
    ///
    /// An [`Exception`] if the request is not executed; no register is written in this case.
    fn write_registers(&mut self, at: u16, values: &[u16]) -> Result<(), Exception>;
}

/// Header of a Modbus request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Transaction number that the client has chosen, and the unit. The response contains the same transaction number
    /// and the same unit as the request.
    transaction: [u8; 2],
    unit: u8,
    /// Length of the request after the header, bytes.
    pub len: usize,
}

impl Header {
    /// Parses a header; returns `None` if the bytes are not a Modbus header or contain an invalid length. After an
    /// invalid header, the server cannot find the start of the next request.
    pub fn parse(bytes: [u8; HEADER_LEN]) -> Option<Self> {
        let [t0, t1, p0, p1, l0, l1, unit] = bytes;
        let len = usize::from(u16::from_be_bytes([l0, l1])).checked_sub(1)?;
        let whole = [p0, p1] == [0, 0] && (1..=PDU_MAX).contains(&len);
        whole.then_some(Self { transaction: [t0, t1], unit, len })
    }

    /// Returns the response, with its header.
    pub fn respond(&self, pdu: &[u8]) -> Vec<u8> {
        let len = (pdu.len() + 1) as u16;
        let head = [self.transaction, [0, 0], len.to_be_bytes()];
        head.into_iter().flatten().chain([self.unit]).chain(pdu.iter().copied()).collect()
    }
}

/// Returns the response of a device to a request, and `true` if the device executed the request.
pub fn answer(pdu: &[u8], device: &mut impl Device) -> (Vec<u8>, bool) {
    let function = pdu.first().copied().unwrap_or(0);
    match act(pdu, device) {
        Ok(response) => (response, true),
        Err(exception) => (vec![function | 0x80, exception as u8], false),
    }
}

fn act(pdu: &[u8], device: &mut impl Device) -> Result<Vec<u8>, Exception> {
    let (function, rest) = pdu.split_first().ok_or(Exception::Function)?;
    match function {
        1 => read_bits(*function, Table::Coils, rest, device),
        2 => read_bits(*function, Table::DiscreteInputs, rest, device),
        3 => read_registers(*function, Table::HoldingRegisters, rest, device),
        4 => read_registers(*function, Table::InputRegisters, rest, device),
        5 => {
            let (at, value) = two(rest)?;
            let on = match value {
                0xFF00 => true,
                0 => false,
                _ => return Err(Exception::Value),
            };
            device.write_coils(at, &[on])?;
            Ok(pdu.to_vec())
        }
        6 => {
            let (at, value) = two(rest)?;
            device.write_registers(at, &[value])?;
            Ok(pdu.to_vec())
        }
        15 => {
            let (at, count, data) = many(rest, WRITE_BITS_MAX, |count| count.div_ceil(8))?;
            let bit = |n: usize| data.get(n / 8).is_some_and(|byte| byte >> (n % 8) & 1 == 1);
            device.write_coils(at, &(0..count).map(bit).collect::<Vec<_>>())?;
            Ok(pdu.iter().copied().take(5).collect())
        }
        16 => {
            let (at, _, data) = many(rest, WRITE_REGISTERS_MAX, |count| 2 * count)?;
            let values: Vec<u16> = data.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect();
            device.write_registers(at, &values)?;
            Ok(pdu.iter().copied().take(5).collect())
        }
        _ => Err(Exception::Function),
    }
}

fn read_bits(
    function: u8,
    table: Table,
    rest: &[u8],
    device: &mut impl Device,
) -> Result<Vec<u8>, Exception> {
    let (at, count) = span(rest, READ_BITS_MAX)?;
    let bits = device.bits(table, at, count)?;
    let mut packed = vec![0; bits.len().div_ceil(8)];
    for (n, _) in bits.iter().enumerate().filter(|(_, bit)| **bit) {
        packed[n / 8] |= 1 << (n % 8);
    }
    Ok([function, packed.len() as u8].into_iter().chain(packed).collect())
}

fn read_registers(
    function: u8,
    table: Table,
    rest: &[u8],
    device: &mut impl Device,
) -> Result<Vec<u8>, Exception> {
    let (at, count) = span(rest, READ_REGISTERS_MAX)?;
    let values = device.registers(table, at, count)?;
    let bytes = values.iter().flat_map(|value| value.to_be_bytes());
    Ok([function, (2 * values.len()) as u8].into_iter().chain(bytes).collect())
}

/// Returns the two words in the data of a request. Returns an error if the data does not consist of exactly two
/// words.
fn two(rest: &[u8]) -> Result<(u16, u16), Exception> {
    let [a, b, c, d] = rest.try_into().map_err(|_| Exception::Value)?;
    Ok((u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d])))
}

/// Returns the address and the quantity in a request; the quantity must be from 1 to `most`.
fn span(rest: &[u8], most: u16) -> Result<(u16, u16), Exception> {
    two(rest).and_then(|(at, count)| quantity(count, most).map(|_| (at, count)))
}

fn quantity(count: u16, most: u16) -> Result<usize, Exception> {
    if (1..=most).contains(&count) { Ok(usize::from(count)) } else { Err(Exception::Value) }
}

/// Returns the address, the quantity and the values in a request. The length of the values must match the quantity.
fn many(rest: &[u8], most: u16, len: fn(usize) -> usize) -> Result<(u16, usize, &[u8]), Exception> {
    let (head, data) = rest.split_at_checked(5).ok_or(Exception::Value)?;
    let (at, count) = two(&head[..4])?;
    let count = quantity(count, most)?;
    let whole = data.len() == len(count) && usize::from(head[4]) == data.len();
    if whole { Ok((at, count, data)) } else { Err(Exception::Value) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::fuzzing::Sixteen;
    use super::*;

    fn ask(device: &mut Sixteen, pdu: &[u8]) -> Vec<u8> {
        answer(pdu, device).0
    }

    /// The responses to the example requests in the Modbus standard (V1.1b3, 6.1 to 6.12) have the form that the
    /// standard specifies.
    #[test]
    fn requests_are_answered_as_the_standard_has_it() {
        let mut device = Sixteen::default();
        assert_eq!(ask(&mut device, &[5, 0, 2, 0xFF, 0]), [5, 0, 2, 0xFF, 0]);
        assert_eq!(ask(&mut device, &[15, 0, 4, 0, 3, 1, 0b101]), [15, 0, 4, 0, 3]);
        assert_eq!(ask(&mut device, &[1, 0, 0, 0, 8]), [1, 1, 0b0101_0100]);
        assert_eq!(ask(&mut device, &[6, 0, 1, 0xAB, 0xCD]), [6, 0, 1, 0xAB, 0xCD]);
        assert_eq!(ask(&mut device, &[16, 0, 2, 0, 2, 4, 0, 1, 2, 3]), [16, 0, 2, 0, 2]);
        assert_eq!(ask(&mut device, &[3, 0, 1, 0, 3]), [3, 6, 0xAB, 0xCD, 0, 1, 2, 3]);
    }

    #[test]
    fn what_is_wrong_gets_the_exception_of_the_standard_and_writes_nothing() {
        let mut device = Sixteen::default();
        for (pdu, exception) in [
            (&[7][..], 1),
            (&[0x16, 0, 0, 0, 0, 0, 0], 1),
            (&[3, 0, 0, 0, 0], 3),
            (&[3, 0, 0, 0, 126], 3),
            (&[1, 0, 0, 0x07, 0xD1], 3),
            (&[3, 0, 0, 0, 17], 2),
            (&[3, 0xFF, 0xFF, 0, 1], 2),
            (&[3, 0, 0, 0], 3),
            (&[3, 0, 0, 0, 1, 0], 3),
            (&[5, 0, 0, 1, 0], 3),
            (&[5, 0, 16, 0xFF, 0], 2),
            (&[6, 0, 16, 0, 0], 2),
            (&[15, 0, 0, 0, 9, 1, 0], 3),
            (&[15, 0, 0, 0xFF, 0xFF, 1, 0], 3),
            (&[16, 0, 0, 0x80, 1, 2, 0, 0], 3),
            (&[16, 0, 0, 0, 1, 4, 0, 0], 3),
            (&[16, 0, 15, 0, 2, 4, 0, 0, 0, 0], 2),
        ] {
            assert_eq!(ask(&mut device, pdu), [pdu[0] | 0x80, exception], "{pdu:02x?}");
        }
        assert_eq!(device.writes, 0);
    }

    #[test]
    fn what_is_no_modbus_has_no_header() {
        for text in [*b"POST / ", *b"GET /ap", [0x16, 3, 1, 2, 0, 1, 0]] {
            assert_eq!(Header::parse(text), None);
        }
        assert_eq!(Header::parse([0, 1, 0, 0, 0, 1, 9]), None, "nothing behind the header");
        assert_eq!(Header::parse([0, 1, 0, 0, 0, 255, 9]), None, "longer than a request is");
        let header = Header::parse([1, 2, 0, 0, 0, 6, 9]).expect("a header");
        assert_eq!((header.len, header.respond(&[3, 0])), (5, vec![1, 2, 0, 0, 0, 3, 9, 3, 0]));
    }

    proptest! {
        /// For any request, the response has the same function code and a permitted length. No request writes more
        /// entries than the device has.
        #[test]
        fn any_bytes_are_answered(function in 0..24_u8, rest in prop::collection::vec(any::<u8>(), 0..PDU_MAX)) {
            let pdu: Vec<u8> = [function].into_iter().chain(rest).collect();
            let mut device = Sixteen::default();
            let (response, done) = answer(&pdu, &mut device);
            prop_assert!((2..=PDU_MAX).contains(&response.len()));
            prop_assert_eq!(response[0], if done { function } else { function | 0x80 });
            prop_assert!(done || device.writes == 0);
        }
    }
}
