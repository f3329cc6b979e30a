//! Removal of waypoints that are not needed for the path.
use crate::JointVec;
use crate::distance::distance;

/// Maximum distance between consecutive dropped waypoints, as a share of the blend. With this distance, every point of
/// a line between two dropped waypoints is within the blend of one of the two waypoints.
const GAP_SHARE: f64 = 0.9;
/// Maximum number of consecutive dropped waypoints.
const ROW_MAX: usize = 256;

/// Returns the indices of the kept positions in ascending order. The function keeps both ends, the positions that
/// `stays` marks, and as many other positions as necessary. Every dropped position is within `share` of the blend from
/// the straight line between its kept neighbours. The dropped positions are in order along this line.
pub(crate) fn kept(positions: &[JointVec], stays: &[bool], blend: f64, share: f64) -> Vec<usize> {
    let last = positions.len() - 1;
    let dense = |i: usize| distance(&positions[i - 1], &positions[i]) <= GAP_SHARE * blend;
    let mut kept = vec![0];
    let mut from = 0;
    while from < last {
        let mut to = from + 1;
        while to < last
            && to - from < ROW_MAX
            && !stays[to]
            && dense(to)
            && dense(to + 1)
            && follows(positions, from, to + 1, share * blend)
        {
            to += 1;
        }
        kept.push(to);
        from = to;
    }
    kept
}

/// Returns `true` if the positions between the indices `from` and `to` are at most `most` away from the straight line
/// between the positions at these two indices. The positions must also be in order along this line.
fn follows(positions: &[JointVec], from: usize, to: usize, most: f64) -> bool {
    let (a, b) = (&positions[from], &positions[to]);
    let mut before = 0.0;
    positions[from + 1..to].iter().all(|q| {
        let u = along(a, b, q);
        let on_line: JointVec = std::array::from_fn(|j| a[j] + u * (b[j] - a[j]));
        let in_order = u >= before && u < 1.0;
        before = u;
        in_order && u > 0.0 && distance(&on_line, q) <= most
    })
}

/// Returns the fraction of the line from `a` (0) to `b` (1) at which the line is nearest to `q`.
pub(crate) fn along(a: &JointVec, b: &JointVec, q: &JointVec) -> f64 {
    let (mut product, mut square) = (0.0, 0.0);
    for ((a, b), q) in a.iter().zip(b).zip(q) {
        product += (b - a) * (q - a);
        square += (b - a) * (b - a);
    }
    if square > 0.0 { (product / square).clamp(0.0, 1.0) } else { 0.0 }
}
