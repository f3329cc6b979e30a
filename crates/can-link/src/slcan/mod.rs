//! CAN over a serial line in the ASCII protocol of LAWICEL's adapters (SLCAN), with the CAN FD lines of CANable 2: the
//! [host's side](SlcanBus) and the [adapter's side](SlcanAdapter).

mod adapter;
mod host;
pub(crate) mod line;
mod port;

pub use adapter::{AdapterError, SlcanAdapter};
pub use host::{SlcanBus, SlcanOptions};

/// Bit rates of the codes `S0` to `S8`, bit/s. Code 7 is LAWICEL's; some firmware of CANable adapters takes it for 750,000.
pub(crate) const BIT_RATES: [u32; 9] =
    [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

/// Data bit rates of CAN FD, bit/s, and their `Y` codes on CANable 2.
pub(crate) const DATA_RATES: [(u32, u8); 4] =
    [(1_000_000, 1), (2_000_000, 2), (4_000_000, 4), (5_000_000, 5)];
