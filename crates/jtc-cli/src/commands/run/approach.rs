//! Path from the position of the arm to the first point of a trajectory.

use cli_kit::{ErrorKind, Failure, Output, error_object};
use jtc_host::CheckError;
use jtc_host::plan::{ApproachError, MoveSpeed};
use serde_json::json;

use super::Course;

/// Prints the duration and the speed of an approach.
pub(super) fn note(duration_s: f64, course: &Course, speed: MoveSpeed, out: &Output) {
    let of_speed = speed.note(course.speed_option).map_or(String::new(), |words| format!(", {words}"));
    out.note(format!("approach: {duration_s:.1} s to the first point{of_speed}"));
}

/// Returns the failure of a run if its approach is not possible. With `--json`, prints the verdict on the approach.
pub(super) fn not_possible(error: ApproachError, course: &Course, out: &Output) -> Failure {
    let verdict = match error {
        ApproachError::Plan(e) => return refused(&e.to_string(), &course.words),
        ApproachError::Check(CheckError::Refused(verdict)) => verdict,
        ApproachError::Check(e) => return e.into(),
    };
    let failure = refused(&verdict.to_string(), &course.words);
    if !out.is_json() {
        return failure;
    }
    let error = error_object(&failure);
    let value = json!({ "outcome": "refused", "phase": "approach", "verdict": verdict, "error": error });
    out.result(&value, String::new);
    out.note(format!("jtc: {}\n     {}", failure.message, failure.next));
    Failure::shown(failure.kind)
}

/// Returns the failure if the check rejects the path to the first point. In this case, the trajectory itself is valid.
fn refused(why: &str, file: &str) -> Failure {
    let message = format!("the straight path from the arm to the first point of {file} is refused: {why}");
    let hint = format!(
        "nothing moved, and {file} itself passed its check: bring the arm nearer to the first point (`jtc \
         traj info {file}` shows it), by hand with `jtc teach on` and `jtc teach off`, or with a trajectory \
         around the obstacle"
    );
    Failure::new(ErrorKind::Refused, "approach", message).next(hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If only the path to the first point fails the check, the hint must not tell the user to correct the trajectory
    /// file.
    #[test]
    fn a_refused_approach_does_not_send_people_to_correct_their_file() {
        let failure = refused("joint 2: no stop in time", "'my motion.csv'");
        assert_eq!((failure.kind, failure.code), (ErrorKind::Refused, "approach"));
        assert!(failure.message.contains("first point of 'my motion.csv' is refused: joint 2"));
        assert!(
            failure.next.to_string().contains("jtc traj info 'my motion.csv'")
                && failure.next.to_string().contains("jtc teach on")
        );
        assert!(
            !failure.next.to_string().contains("FILE") && !failure.next.to_string().contains("traj check"),
            "{}",
            failure.next
        );
    }
}
