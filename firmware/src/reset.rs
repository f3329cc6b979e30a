//! Cause of the start of the processor, determined from the flags of the RCC and from the data of the previous
//! program run.

/// Cause of the start of the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Cause {
    /// The power was switched on, or the supply voltage was too low.
    PowerOn = 1,
    /// The reset button was pressed, or a debugger used the reset pin.
    Pin = 2,
    /// A debugger or a program requested the reset.
    Software = 3,
    /// The tick did not complete in time.
    Watchdog = 4,
    /// The processor took a hard fault.
    HardFault = 5,
    /// The program panicked: it reached a state that should be impossible.
    Panic = 6,
}

impl Cause {
    /// Returns `true` if the program failed. In this case the controller reports the failure until a host clears the
    /// failure.
    pub const fn failed(self) -> bool {
        matches!(self, Self::Watchdog | Self::HardFault | Self::Panic)
    }

    /// Returns the cause as text.
    pub const fn name(self) -> &'static str {
        match self {
            Self::PowerOn => "power-on",
            Self::Pin => "reset pin",
            Self::Software => "software",
            Self::Watchdog => "watchdog",
            Self::HardFault => "hard fault",
            Self::Panic => "panic",
        }
    }
}

/// Kind of failure that ended the program. The record of the failure survives the reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The processor took a hard fault.
    HardFault,
    /// The program panicked.
    Panic,
}

const BROWN_OUT: u32 = 1 << 21;
const PIN: u32 = 1 << 22;
const POWER_ON: u32 = 1 << 23;
const SOFTWARE: u32 = 1 << 24;
const WATCHDOG: u32 = 1 << 26;

/// Returns `true` if the memory has lost its contents, so that the data of the previous program run are invalid.
pub const fn lost_power(rsr: u32) -> bool {
    rsr & (POWER_ON | BROWN_OUT) != 0
}

/// Determines the cause of the start from the register RCC_RSR and from the data of the previous program run.
///
/// Every reset pulls the reset pin, so the function checks the pin's flag last. The function uses `failure` only after
/// a software reset or a watchdog reset. A program that fails requests a software reset, but the watchdog can be
/// faster.
pub const fn cause(rsr: u32, failure: Option<Failure>) -> Cause {
    match failure {
        _ if lost_power(rsr) => Cause::PowerOn,
        Some(Failure::HardFault) if rsr & (SOFTWARE | WATCHDOG) != 0 => Cause::HardFault,
        Some(Failure::Panic) if rsr & (SOFTWARE | WATCHDOG) != 0 => Cause::Panic,
        _ if rsr & WATCHDOG != 0 => Cause::Watchdog,
        _ if rsr & SOFTWARE != 0 => Cause::Software,
        _ if rsr & PIN != 0 => Cause::Pin,
        _ => Cause::PowerOn,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_cause_is_told_from_the_others() {
        // The arguments are combinations of flags that the chip reports. Every cause except a wake-up also sets the
        // flag of the reset pin.
        assert_eq!(cause(POWER_ON | BROWN_OUT | PIN, None), Cause::PowerOn);
        assert_eq!(cause(BROWN_OUT | PIN, None), Cause::PowerOn);
        assert_eq!(cause(PIN, None), Cause::Pin);
        assert_eq!(cause(PIN | SOFTWARE, None), Cause::Software);
        assert_eq!(cause(PIN | WATCHDOG, None), Cause::Watchdog);
        for (failure, expected) in [(Failure::HardFault, Cause::HardFault), (Failure::Panic, Cause::Panic)] {
            assert_eq!(cause(PIN | SOFTWARE, Some(failure)), expected);
            assert_eq!(
                cause(PIN | WATCHDOG, Some(failure)),
                expected,
                "the watchdog was faster than the reset"
            );
            assert_eq!(
                cause(POWER_ON | PIN, Some(failure)),
                Cause::PowerOn,
                "memory without power is random"
            );
            assert_eq!(cause(PIN, Some(failure)), Cause::Pin, "somebody pressed the button since");
            assert!(expected.failed());
        }
    }
}
