//! Bytes that are codes from a fixed list, such as states and kinds.
use core::fmt;
use core::marker::PhantomData;

/// Declares a list of codes. The macro creates an enum, the list of its variants, the conversion from a byte, and the names. If a
/// variant has no text, its identifier is its name.
macro_rules! codes {
    (@text $name:ident $text:literal) => { $text };
    (@text $name:ident) => { stringify!($name) };
    ($(#[$doc:meta])* $list:ident { $($(#[$meaning:meta])* $name:ident = $code:literal $(, $text:literal)?;)+ }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum $list {
            $($(#[$meaning])* $name = $code,)+
        }

        impl $list {
            /// All codes, in the order of their numbers.
            pub const ALL: [Self; [$($code),+].len()] = [$(Self::$name),+];

            /// Returns the code with the number `byte`, or `None` if no code has this number.
            pub const fn from_byte(byte: u8) -> Option<Self> {
                match byte {
                    $($code => Some(Self::$name),)+
                    _ => None,
                }
            }

            /// Returns the name of the code.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $crate::code::codes!(@text $name $($text)?),)+
                }
            }
        }

        impl core::fmt::Display for $list {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.pad(self.name())
            }
        }
    };
}
pub(crate) use codes;

/// A fixed list of codes with their names.
pub trait Known: Copy + Eq + fmt::Debug + 'static {
    /// All codes of the list, in the order of their numbers.
    const ALL: &'static [Self];
    /// Name of a code that is not in the list.
    const UNKNOWN: &'static str;

    /// Returns the byte in the wire format.
    fn code(self) -> u8;

    /// Returns the name of the code. All programs use this name.
    fn name(self) -> &'static str;
}

/// A received code. The code is a variant of `T`, or a code that this version does not know.
///
/// Always compare a code with variants of `T` and not with a number.
///
/// ```
/// use jtc_wire::{Code, ControllerState};
///
/// let state = Code::new(2);
/// assert!(state == ControllerState::HoldPos);
/// assert_eq!(state.to_string(), "HoldPos");
/// assert_eq!(Code::<ControllerState>::new(9).known(), None);
/// ```
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Code<T> {
    byte: u8,
    list: PhantomData<T>,
}

impl<T: Known> Code<T> {
    /// Creates the code of a received byte.
    pub const fn new(byte: u8) -> Self {
        Self { byte, list: PhantomData }
    }

    /// Returns the byte in the wire format.
    pub const fn byte(self) -> u8 {
        self.byte
    }

    /// Returns the variant of this code. Returns `None` if this version does not know the code.
    pub fn known(self) -> Option<T> {
        T::ALL.iter().copied().find(|known| known.code() == self.byte)
    }

    /// Returns `true` if the code is one of `wanted`.
    pub fn is_in(self, wanted: &[T]) -> bool {
        wanted.iter().any(|&wanted| self == wanted)
    }

    /// Returns the name of the code. All programs use this name.
    pub fn name(self) -> &'static str {
        self.known().map_or(T::UNKNOWN, T::name)
    }
}

impl<T: Known> PartialEq<T> for Code<T> {
    fn eq(&self, other: &T) -> bool {
        self.byte == other.code()
    }
}

impl<T: Known> From<T> for Code<T> {
    fn from(known: T) -> Self {
        Self::new(known.code())
    }
}

impl<T: Known + Default> Default for Code<T> {
    fn default() -> Self {
        T::default().into()
    }
}

impl<T: Known> fmt::Display for Code<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl<T: Known> fmt::Debug for Code<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.known() {
            Some(known) => known.fmt(f),
            None => write!(f, "{}", self.byte),
        }
    }
}
