//! Unrolled loops. With constant indices the compiler keeps the recursion in registers and removes unused parts.

/// Repeats the block for each of the numbers in the list. In the block, the name is a constant with the current number
/// as its value.
macro_rules! unroll {
    ($k:ident in [$($n:literal),+] $body:block) => {
        $({
            const $k: usize = $n;
            $body
        })+
    };
}

pub(crate) use unroll;
