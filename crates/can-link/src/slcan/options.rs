//! Options of an SLCAN adapter, and the bit rates that have codes in the protocol.

/// Bit rates of the codes `S0` to `S8`, bit/s. Code 7 has the rate that LAWICEL defines; some CANable firmware
/// interprets it as 750,000 bit/s.
pub(crate) const BIT_RATES: [u32; 9] =
    [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

/// Data bit rates of CAN FD, bit/s, and their `Y` codes on CANable 2.
pub(crate) const DATA_RATES: [(u32, u8); 4] =
    [(1_000_000, 1), (2_000_000, 2), (4_000_000, 4), (5_000_000, 5)];

/// Options of an SLCAN adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SlcanOptions {
    /// Device: `/dev/ttyACM0`, `COM7`, or `tcp:HOST:PORT`.
    pub device: String,
    /// Bit rate of the bus, bit/s; with `None` the adapter keeps its own setting.
    pub rate: Option<u32>,
    /// Bit rate of the CAN FD data phase, bit/s; with `None` the adapter keeps its own setting.
    pub data_rate: Option<u32>,
    /// Rate of the serial line, bit/s; USB adapters ignore it.
    pub baud: u32,
}

impl SlcanOptions {
    /// Default rate of the serial line, bit/s.
    pub const BAUD: u32 = 115_200;
}
