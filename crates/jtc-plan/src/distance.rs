//! Distance between two sets of joint positions.
use jtc_wire::Joint;

use crate::JointVec;

/// Returns the joint whose position differs most between `a` and `b`, and the difference, rad. If the difference of a
/// joint is NaN, returns this joint.
pub fn furthest_joint(a: &JointVec, b: &JointVec) -> (Joint, f64) {
    let apart = |joint: Joint| (joint, (b[joint.index()] - a[joint.index()]).abs());
    let [first, others @ ..] = Joint::ALL;
    others
        .into_iter()
        .map(apart)
        .fold(apart(first), |most, next| if next.1.total_cmp(&most.1).is_ge() { next } else { most })
}

/// Returns the distance that the joint with the largest movement covers, rad.
pub(crate) fn distance(a: &JointVec, b: &JointVec) -> f64 {
    a.iter().zip(b).map(|(a, b)| (b - a).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_furthest_joint_is_the_one_whose_position_differs_most() {
        for (j, joint) in Joint::ALL.into_iter().enumerate() {
            for by in [-0.5, 0.5, f64::NAN, f64::INFINITY] {
                let a = [0.3, -0.2, 0.1, 0.0, 1.0, 2.0];
                let mut b = a.map(|q| q + 0.25);
                b[j] = a[j] + by;
                for (furthest, far) in [furthest_joint(&a, &b), furthest_joint(&b, &a)] {
                    assert_eq!(furthest, joint, "{by}");
                    assert!((far.is_nan() && by.is_nan()) || far >= 0.5 - 1e-12, "{by}: {far}");
                }
            }
        }
    }
}
