//! Bits of the registers of a serial port.

/// Bits of register CR1.
pub mod cr1 {
    pub const UE: u32 = 1;
    pub const RE: u32 = 4;
    pub const TE: u32 = 8;
    pub const IDLEIE: u32 = 0x10;
    pub const RXNEIE: u32 = 0x20;
    pub const TCIE: u32 = 0x40;
    pub const TXEIE: u32 = 0x80;
    pub const OVER8: u32 = 0x8000;
    pub const RTOIE: u32 = 1 << 26;
    pub const FIFOEN: u32 = 1 << 29;
}

/// Bits of register ISR.
pub mod isr {
    pub const FE: u32 = 2;
    pub const NE: u32 = 4;
    pub const ORE: u32 = 8;
    pub const IDLE: u32 = 0x10;
    pub const RXNE: u32 = 0x20;
    pub const TC: u32 = 0x40;
    pub const TXE: u32 = 0x80;
    pub const RTOF: u32 = 0x800;
    pub const BUSY: u32 = 1 << 16;
    pub const TEACK: u32 = 1 << 21;
    pub const REACK: u32 = 1 << 22;
    pub const TXFE: u32 = 1 << 23;
    pub const RXFF: u32 = 1 << 24;
    /// Flags of ISR that a write to ICR clears.
    pub const STICKY: u32 = FE | NE | ORE | IDLE | TC | RTOF | 1;
}
