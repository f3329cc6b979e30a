//! Unrolled loops: with constant indices the compiler keeps the recursion in registers and drops unused
//! parts.

/// Repeats the block for each of the numbers, with the name as a constant of that value.
macro_rules! unroll {
    ($k:ident in [$($n:literal),+] $body:block) => {
        $({
            const $k: usize = $n;
            $body
        })+
    };
}

pub(crate) use unroll;
