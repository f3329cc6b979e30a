//! Sensor outputs of one period, reassembled from their packages (D-33).
use ucom::BufferPackage;

/// All sensor outputs of one period.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Snapshot {
    /// Time of the last package of the snapshot, µs.
    pub time_us: u64,
    /// Values of the sensor outputs in the order of the buffer.
    pub words: Vec<u16>,
    /// Number of incomplete snapshots since the previous complete snapshot.
    pub incomplete_before: u64,
}

/// Reassembles snapshots of the sensor outputs, from the package with offset 0 to the package with the last word. The assembler counts and
/// discards incomplete snapshots.
#[derive(Clone, Debug, Default)]
pub struct SnapshotAssembler {
    words: Vec<u16>,
    /// Offset of the next expected package; `None` if a package with offset 0 is expected.
    next: Option<u16>,
    incomplete_now: u64,
    /// Number of incomplete snapshots.
    pub incomplete: u64,
    /// Number of complete snapshots.
    pub complete: u64,
    /// Number of packages that start at or beyond the end of the buffer.
    pub beyond: u64,
}

impl SnapshotAssembler {
    /// Creates an assembler for a buffer of `dimension` words.
    pub fn new(dimension: u16) -> Self {
        Self { words: vec![0; dimension.into()], ..Default::default() }
    }

    /// Returns the number of words in the buffer.
    pub fn dimension(&self) -> usize {
        self.words.len()
    }

    /// Handles a package of sensor outputs. The function returns the snapshot if the package completes it.
    pub fn push(&mut self, now: u64, package: &BufferPackage) -> Option<Snapshot> {
        if usize::from(package.offset) >= self.words.len() {
            self.beyond += 1;
            return None;
        }
        if package.offset == 0 {
            if self.next.is_some() {
                self.gap();
            }
            self.next = Some(0);
        } else if self.next != Some(package.offset) {
            if self.next.take().is_some() {
                self.gap();
            }
            return None;
        }
        package.apply(&mut self.words).ok()?;
        if package.covers_last(self.words.len()) {
            self.next = None;
            self.complete += 1;
            let incomplete_before = core::mem::take(&mut self.incomplete_now);
            return Some(Snapshot { time_us: now, words: self.words.clone(), incomplete_before });
        }
        if package.count < 3 {
            // Only the last package may have fewer than three words, so this snapshot is incomplete.
            self.next = None;
            self.gap();
            return None;
        }
        self.next = package.offset.checked_add(3);
        None
    }

    fn gap(&mut self) {
        self.incomplete += 1;
        self.incomplete_now += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ucom::Packages;

    fn packages(start: u16) -> Vec<BufferPackage> {
        let words: Vec<u16> = (start..start + 8).collect();
        Packages::new(&words).collect()
    }

    /// D-33: the assembler does not report incomplete snapshots. The next complete snapshot contains the number of incomplete snapshots
    /// before it.
    #[test]
    fn d33_gaps_are_counted_and_never_shown() {
        for lost in 0..3 {
            let mut assembler = SnapshotAssembler::new(8);
            let broken: Vec<_> =
                packages(100).iter().enumerate().filter(|(i, _)| *i != lost).map(|(_, p)| *p).collect();
            assert!(broken.iter().all(|p| assembler.push(0, p).is_none()), "package {lost} lost");
            let whole: Vec<_> = packages(200).iter().filter_map(|p| assembler.push(5, p)).collect();
            assert_eq!(whole.len(), 1);
            assert_eq!(whole[0].words, (200..208).collect::<Vec<u16>>());
            // Without the first package, the assembler cannot know that a snapshot has begun, so it does not count
            // this snapshot as incomplete.
            assert_eq!(whole[0].incomplete_before, u64::from(lost > 0));
        }
    }

    #[test]
    fn d33_swapped_and_doubled_packages_make_no_snapshot() {
        for order in [[0, 2, 1], [1, 0, 2], [0, 0, 2]] {
            let mut assembler = SnapshotAssembler::new(8);
            let all = packages(0);
            assert!(order.iter().all(|i| assembler.push(0, &all[*i]).is_none()), "{order:?}");
        }
        let beyond = BufferPackage { offset: 8, count: 3, words: [0; 3] };
        let mut assembler = SnapshotAssembler::new(8);
        assert_eq!(assembler.push(0, &beyond), None);
        assert_eq!(assembler.beyond, 1);
    }
}
