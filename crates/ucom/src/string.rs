//! Transmission of strings: first a header package that contains the number of packages, and then packages of up to 8
//! characters (D-13, D-14).

use core::fmt;

use crate::frame::Payload;
use crate::profile::Profile;

/// Characters of Latin-1, one byte each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Latin1<'a>(pub &'a [u8]);

impl Latin1<'_> {
    /// Returns the characters of the text.
    pub fn chars(&self) -> impl Iterator<Item = char> + '_ {
        self.0.iter().map(|byte| char::from(*byte))
    }
}

impl fmt::Display for Latin1<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use fmt::Write;
        self.chars().try_for_each(|character| f.write_char(character))
    }
}

/// Returns the `i`-th package of a string; returns `None` after the last package. Package 0 is the header of the string, and the other
/// packages are data.
///
/// A text longer than `string.max` characters is truncated.
pub fn string_package(text: &[u8], i: u16, profile: &Profile) -> Option<Payload> {
    let text = text.get(..profile.string_limit()).unwrap_or(text);
    let Some(i) = i.checked_sub(1) else {
        let count = text.len().div_ceil(8) as u16 + u16::from(profile.string_count_includes_header);
        let [c0, c1] = profile.endian.bytes(count);
        return Some(Payload::of([c0, c1, 0, 0, 0, 0, 0, 0], 2));
    };
    let rest = text.get(8 * usize::from(i)..)?;
    Payload::new(rest.get(..8).unwrap_or(rest)).filter(|payload| !payload.is_empty())
}

/// Packages of a string, beginning with the header.
#[derive(Clone, Debug)]
pub struct StringPackages<'a> {
    text: &'a [u8],
    next: u16,
    profile: &'a Profile,
}

impl<'a> StringPackages<'a> {
    /// Creates the packages of `text`, which must be Latin-1 without NUL characters.
    pub const fn new(text: &'a [u8], profile: &'a Profile) -> Self {
        Self { text, next: 0, profile }
    }
}

impl Iterator for StringPackages<'_> {
    type Item = Payload;

    fn next(&mut self) -> Option<Payload> {
        let package = string_package(self.text, self.next, self.profile)?;
        self.next += 1;
        Some(package)
    }
}

/// Result of adding a package to the string in progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Assembled<'a> {
    /// The string is not complete; more packages follow.
    Partial,
    /// The string is complete. Trailing NULs of the string are removed.
    Complete(Latin1<'a>),
    /// The package is invalid, so the assembler drops the string. A header is invalid if it does not have 2 bytes or announces more
    /// packages than `string.max` characters need. A data package is invalid if it is empty or exceeds the buffer.
    Refused,
}

/// Assembles strings from packages, one string at a time. A receiver needs one assembler for each function of each board (D-14).
///
/// The assembler cannot detect a lost package: it continues to wait for packages. [`StringAssembler::expired`] returns `true` if no package
/// has arrived for 100 ms (`string.gap`). After this gap, the next package starts a new string.
#[derive(Clone, Debug)]
pub struct StringAssembler<const N: usize = 512> {
    text: [u8; N],
    len: usize,
    /// Number of packages of the string that are still missing; `None` until the header has arrived.
    open: Option<u16>,
    last_us: u64,
}

impl<const N: usize> Default for StringAssembler<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> StringAssembler<N> {
    /// Creates an assembler that waits for the header of a string.
    pub const fn new() -> Self {
        Self { text: [0; N], len: 0, open: None, last_us: 0 }
    }

    /// Drops the packages of a string that were received so far.
    pub const fn reset(&mut self) {
        self.open = None;
        self.len = 0;
    }

    /// Returns `true` if a string is in progress.
    pub const fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Returns `true` if a string is in progress and `string.gap` passed since its last package.
    pub const fn expired(&self, now_us: u64, profile: &Profile) -> bool {
        self.open.is_some() && now_us.saturating_sub(self.last_us) >= profile.string_gap_us()
    }

    /// Returns the number of packages of the string in progress that are still missing.
    pub const fn missing(&self) -> u16 {
        match self.open {
            Some(missing) => missing,
            None => 0,
        }
    }

    /// Handles a package of a string. The assembler first drops a string that has [expired](Self::expired).
    pub fn push(&mut self, now_us: u64, payload: &Payload, profile: &Profile) -> Assembled<'_> {
        if self.expired(now_us, profile) {
            self.reset();
        }
        self.last_us = now_us;
        let Some(open) = self.open else { return self.header(payload, profile) };
        let bytes = payload.bytes();
        let place = self.text.get_mut(self.len..self.len + bytes.len());
        let Some(place) = place.filter(|place| !place.is_empty()) else {
            self.reset();
            return Assembled::Refused;
        };
        place.copy_from_slice(bytes);
        self.len += bytes.len();
        self.open = Some(open - 1);
        if open > 1 { Assembled::Partial } else { self.complete(profile) }
    }

    fn header(&mut self, payload: &Payload, profile: &Profile) -> Assembled<'_> {
        let &[c0, c1] = payload.bytes() else { return Assembled::Refused };
        let including = u16::from(profile.string_count_includes_header);
        let most = profile.string_limit().min(N).div_ceil(8);
        let count = profile.endian.word([c0, c1]).checked_sub(including);
        let Some(count) = count.filter(|count| usize::from(*count) <= most) else {
            return Assembled::Refused;
        };
        self.len = 0;
        self.open = Some(count);
        if count > 0 { Assembled::Partial } else { self.complete(profile) }
    }

    fn complete(&mut self, profile: &Profile) -> Assembled<'_> {
        let len = self.len.min(profile.string_limit());
        self.reset();
        let text = self.text.get(..len).unwrap_or(&[]);
        let end = text.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
        Assembled::Complete(Latin1(text.get(..end).unwrap_or(&[])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::Endian;
    use proptest::prelude::*;
    use std::string::ToString;
    use std::vec::Vec;

    fn profiles() -> [Profile; 4] {
        let mut all = [Profile::default(); 4];
        for (i, profile) in all.iter_mut().enumerate() {
            profile.endian = if i & 1 == 0 { Endian::Little } else { Endian::Big };
            profile.string_count_includes_header = i & 2 != 0;
        }
        all
    }

    fn through(text: &[u8], profile: &Profile) -> Vec<u8> {
        let mut assembler = StringAssembler::<512>::new();
        let packages: Vec<_> = StringPackages::new(text, profile).collect();
        assert_eq!(packages.len(), 1 + text.len().div_ceil(8));
        let (last, before) = packages.split_last().unwrap();
        for package in before {
            assert_eq!(assembler.push(0, package, profile), Assembled::Partial);
        }
        match assembler.push(0, last, profile) {
            Assembled::Complete(text) => text.0.to_vec(),
            other => panic!("{other:?}"),
        }
    }

    /// C-4: strings of length 0, 1, 7, 8, 9, 16, 511 and 512, and strings with characters that are not ASCII, arrive
    /// unchanged. A trailing NUL is removed.
    #[test]
    fn d13_c4_strings_of_all_lengths() {
        for profile in profiles() {
            for len in [0, 1, 7, 8, 9, 16, 511, 512] {
                let text: Vec<u8> = (0..len).map(|i| b'!' + (i % 90) as u8).collect();
                assert_eq!(through(&text, &profile), text);
            }
            assert_eq!(through(b"ok\0", &profile), b"ok");
            assert_eq!(Latin1(&through(b"M\xE4rz", &profile)).to_string(), "März");
        }
    }

    #[test]
    fn d13_header_counts_the_packages_that_follow() {
        let [little, big, inclusive, _] = profiles();
        let header = |text: &[u8], profile| string_package(text, 0, profile).unwrap().bytes().to_vec();
        assert_eq!(header(b"UCoM2 head pan", &little), [2, 0]);
        assert_eq!(header(b"UCoM2 head pan", &big), [0, 2]);
        assert_eq!(header(b"UCoM2 head pan", &inclusive), [3, 0]);
        assert_eq!(header(b"", &little), [0, 0]);
        assert_eq!(string_package(b"", 1, &little), None);
        let long = [b'x'; 600];
        assert_eq!(StringPackages::new(&long, &little).count(), 65);
    }

    #[test]
    fn d13_headers_that_count_too_much_are_refused() {
        let [profile, ..] = profiles();
        let mut assembler = StringAssembler::<512>::new();
        for bad in [&[65, 0][..], &[0xFF, 0xFF], &[1], &[], &[1, 0, 0]] {
            let payload = Payload::new(bad).unwrap();
            assert_eq!(assembler.push(0, &payload, &profile), Assembled::Refused, "{bad:?}");
            assert!(!assembler.is_open());
        }
        let inclusive = Profile { string_count_includes_header: true, ..profile };
        assert_eq!(assembler.push(0, &Payload::new(&[0, 0]).unwrap(), &inclusive), Assembled::Refused);
    }

    #[test]
    fn d14_silence_ends_a_string() {
        let [profile, ..] = profiles();
        let mut assembler = StringAssembler::<512>::new();
        let header = Payload::new(&[2, 0]).unwrap();
        let data = Payload::new(b"12345678").unwrap();
        assert_eq!(assembler.push(0, &header, &profile), Assembled::Partial);
        assert_eq!(assembler.push(99_999, &data, &profile), Assembled::Partial);
        assert_eq!(assembler.missing(), 1);
        assert!(!assembler.expired(199_998, &profile));
        assert!(assembler.expired(199_999, &profile));
        // The time limit for the missing package has passed, and the board repeats its answer. The assembler takes
        // the header as the start of a new string, not as the missing package.
        assert_eq!(assembler.push(199_999, &header, &profile), Assembled::Partial);
        assert_eq!(assembler.missing(), 2);
    }

    /// D-13: the assembler drops a string if one of its data packages is empty or exceeds the buffer.
    #[test]
    fn d13_data_that_cannot_be_are_refused() {
        let [profile, ..] = profiles();
        let payload = |bytes| Payload::new(bytes).unwrap();
        let mut assembler = StringAssembler::<9>::new();
        assert_eq!(
            assembler.push(0, &payload(&[3, 0]), &profile),
            Assembled::Refused,
            "nine characters fill two"
        );
        for (first, second) in [(&b""[..], None), (b"12345678", Some(&b"90"[..]))] {
            assert_eq!(assembler.push(0, &payload(&[2, 0]), &profile), Assembled::Partial);
            if let Some(bad) = second {
                assert_eq!(assembler.push(0, &payload(first), &profile), Assembled::Partial);
                assert_eq!(assembler.push(0, &payload(bad), &profile), Assembled::Refused);
            } else {
                assert_eq!(assembler.push(0, &payload(first), &profile), Assembled::Refused);
            }
            assert!(!assembler.is_open());
        }
        assert_eq!(assembler.push(0, &payload(&[2, 0]), &profile), Assembled::Partial);
        assert_eq!(assembler.push(0, &payload(b"12345678"), &profile), Assembled::Partial);
        assert_eq!(assembler.push(0, &payload(b"9"), &profile), Assembled::Complete(Latin1(b"123456789")));
    }

    /// D-13: `string.max` truncates a text even in the middle of a package.
    #[test]
    fn d13_longest_string() {
        let profile = Profile { string_max: 12, ..Profile::default() };
        let mut assembler = StringAssembler::<512>::new();
        assert_eq!(assembler.push(0, &Payload::new(&[3, 0]).unwrap(), &profile), Assembled::Refused);
        assembler.push(0, &Payload::new(&[2, 0]).unwrap(), &profile);
        assembler.push(0, &Payload::new(b"12345678").unwrap(), &profile);
        let last = assembler.push(0, &Payload::new(b"9abcdefg").unwrap(), &profile);
        assert_eq!(last, Assembled::Complete(Latin1(b"123456789abc")));
    }

    proptest! {
        /// D-13: the assembler returns any text without trailing NULs exactly as it was sent.
        #[test]
        fn d13_round_trip(mut text in proptest::collection::vec(any::<u8>(), 0..=512), i in 0..4usize) {
            while text.last() == Some(&0) {
                text.pop();
            }
            prop_assert_eq!(through(&text, &profiles()[i]), text);
        }

        /// D-14: for any sequence of packages, no string is longer than the buffer, and the assembler never waits for
        /// more packages than fit into the buffer.
        #[test]
        fn d14_any_packages(packages in proptest::collection::vec((any::<[u8; 8]>(), 0..9usize), 0..200)) {
            let [profile, ..] = profiles();
            let mut assembler = StringAssembler::<64>::new();
            for (data, len) in packages {
                let data = [data[0] % 10, 0, data[2], data[3], data[4], data[5], data[6], data[7]];
                let payload = Payload::new(&data[..len]).unwrap();
                if let Assembled::Complete(text) = assembler.push(0, &payload, &profile) {
                    prop_assert!(text.0.len() <= 64);
                }
                prop_assert!(assembler.missing() <= 8);
            }
        }
    }
}
