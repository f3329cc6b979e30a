//! Points of the trajectory, for logs (J-56).
use jtc_wire::{Answer, PAGE_POINTS, POINT_LEN, Points, RawPoint};

use crate::controller::Controller;

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Answers with the points in the memory of the trajectory, including points of a discarded trajectory (J-56).
    pub(super) fn get_points(&mut self, line: usize, first: u16) {
        let held = self.store.held_points(first.into());
        let mut bytes = [[0; POINT_LEN]; PAGE_POINTS];
        let count = held.len().min(PAGE_POINTS);
        for (slot, point) in bytes.iter_mut().zip(held) {
            *slot = point.emit();
        }
        let page = bytes.get(..count).unwrap_or(&[]);
        if let Some(points) = Points::parse(page.as_flattened()) {
            let (_, total) = self.store.points_hash();
            self.extensions.answers.put(line, &Answer::Points { first, total: total as u16, points });
        }
    }
}
