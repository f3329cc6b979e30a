//! Loops written out: with constant indices the compiler keeps the recursion in registers and drops unused
//! parts.

/// Repeats the block with the name standing for each of the numbers in turn.
macro_rules! unroll {
    ($k:ident in [$($n:literal),+] $body:block) => {
        $({
            const $k: usize = $n;
            $body
        })+
    };
}

pub(crate) use unroll;
