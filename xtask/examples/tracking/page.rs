//! Text and tables of the page docs/tracking.md.
use std::fmt::Write as _;

use jtc_bus::JOINTS;

use crate::run::Figures;
use crate::{Condition, Runs, paths};

/// Results of both controllers under one condition on one path.
pub(crate) struct Comparison {
    pub path: &'static str,
    pub condition: Condition,
    pub existing: Runs,
    pub ours: Runs,
    /// Errors of our control law with a better model, mrad. The page shows these errors if our control law missed the
    /// goal.
    pub bounds: Vec<(&'static str, [f64; JOINTS])>,
}

/// Goal for the error of our control law, mrad: a fifth of the error of the existing firmware, but not less than the
/// resolution of a 16-bit encoder.
const SHARE: f64 = 0.2;
const LEAST: f64 = 0.04;

/// Results of the original code of the existing firmware, compiled for a PC, on this plant. The first three results are for ideal
/// drives: commanded − measured position (mrad), commanded − true position (mrad), and the change of torque (N·m/ms). The fourth
/// result is commanded − measured position (mrad) with drives that deliver 1/1.3 of the torque.
const REFERENCE: [(&str, [f64; JOINTS]); 4] = [
    ("ideal drives, commanded − measured", [0.258, 0.416, 0.368, 0.121, 0.127, 0.136]),
    ("ideal drives, commanded − true", [1.07, 0.88, 1.14, 0.76, 0.65, 0.91]),
    ("ideal drives, roughness", [1.54, 1.50, 1.47, 1.02, 0.99, 1.07]),
    ("drives deliver 1/1.3, commanded − measured", [0.162, 0.154, 0.166, 0.092, 0.097, 0.112]),
];

const HEADER: &str = "| | j1 | j2 | j3 | j4 | j5 | j6 |\n|---|---|---|---|---|---|---|\n";

const INTRODUCTION: &str = "\
# Tracking

This page shows how accurately the arm follows its path. The page compares the control law of the existing firmware with the control law of
this project. Both control laws run on the same simulated arm, drives and bus, and with the same gains, model and friction. The command
`cargo xtask bench tracking` writes this page. The simulation uses virtual time, so each run of the command gives the same figures.

The *existing law* is the control law of the existing firmware. The file `xtask/examples/tracking/existing.rs` contains a copy of this control
law, which follows the firmware that was published in April 2022. The existing law:

- computes inverse dynamics, PID and friction, and multiplies their sum by 1.3;
- joins the points of a trajectory by straight lines;
- compares the measured position, which is two milliseconds old, with the present set position;
- changes the sign of the friction torque in one step.

“Ours” is the control law of this project. The comparison runs the controller itself.

The figures have these meanings:

- Each figure is an RMS value over the path, and the median of ten arms. The masses of these arms differ from the model of both controllers by
  up to ±10 %, and the friction by up to ±20 %, at random. Gravity acts in the same direction as on the existing arm, which hangs from above. The
  friction of the arm changes its sign within 0.01 rad/s, unless a section states another width. (The controller of this project changes the sign
  of its friction compensation within 0.02 rad/s.)
- *Commanded − true*, mrad: the set position of a tick minus the true position at the time when the torque of that tick begins to act.
- *Commanded − measured*, mrad: the position error that each control law uses. The controller of this project uses the set position of the time at
  which the measurement was taken (J-62).
- *Roughness*, N·m: the change of the torque at the joint from one millisecond to the next.
- *Goal*: the largest permitted commanded − true of the controller of this project. Only three conditions have a goal: ideal drives, drives that
  deliver 1/1.3, and sharper friction. The goal is a fifth of the value of the existing firmware, but at least 0.04 mrad. (A step of the encoder
  is 0.096 mrad. This step alone causes an error of 0.03 mrad RMS.)
- The *demo path* is the path of `jtc demo`. The *recorded path* was recorded with the existing arm (`TrajectoryInt.csv`). The recording lacks five
  points, after points 184, 358, 544, 726 and 906; the comparison adds these points.
";

impl Comparison {
    /// Returns the joints (from 0) that miss the goal, with our error and the goal in mrad.
    pub(crate) fn missed(&self) -> Vec<(usize, f64, f64)> {
        let (Some(existing), Some(ours)) = (self.existing.figures, self.ours.figures) else {
            return Vec::new();
        };
        let goals = goals(&existing);
        let all = (0..JOINTS).map(|j| (j, ours.true_error[j], goals[j]));
        all.filter(|(_, ours, goal)| self.condition.judged && rounded(*ours) > *goal).collect()
    }

    /// Returns the result of the comparison in one sentence.
    pub(crate) fn verdict(&self) -> String {
        if self.ours.finished < self.existing.finished {
            return format!(
                "The controller of this project stops in {} of {} runs: {}.",
                self.existing.finished - self.ours.finished,
                self.existing.finished,
                self.ours.errors.join("; ")
            );
        }
        if !self.condition.judged {
            return "The comparison sets no goal for this condition.".to_owned();
        }
        let missed = self.missed();
        if missed.is_empty() {
            return "Every joint meets the goal.".to_owned();
        }
        let joints = missed
            .iter()
            .map(|(j, ours, goal)| format!("joint {} ({ours:.3} mrad, goal {goal:.3} mrad)", j + 1));
        format!("These joints miss the goal: {}.", joints.collect::<Vec<_>>().join(", "))
    }

    fn section(&self, page: &mut String) {
        let _ = write!(
            page,
            "\n### {}: {}\n\n{}\n\n{HEADER}",
            self.path, self.condition.name, self.condition.what
        );
        let both = [("existing", self.existing.figures), ("ours", self.ours.figures)];
        let mut rows = |what: &str, digits: usize, of: fn(&Figures) -> &[f64; JOINTS]| {
            for (name, figures) in &both {
                if let Some(figures) = figures {
                    row(page, &format!("{name}, {what}"), of(figures), digits);
                }
            }
        };
        rows("commanded − true", 3, |figures| &figures.true_error);
        rows("commanded − measured", 3, |figures| &figures.own_error);
        rows("roughness", 2, |figures| &figures.roughness);
        if let (true, Some(existing)) = (self.condition.judged, &self.existing.figures) {
            row(page, "goal, commanded − true", &goals(existing), 3);
        }
        let _ = writeln!(page, "\n{}", self.verdict());
        if !self.bounds.is_empty() {
            let _ = write!(
                page,
                "\nThe next table shows what limits the accuracy of the controller of this project. The table has the commanded − true, mrad, of\n\
                 this controller if it has better values of this arm. If the friction value of a joint is wrong, the torque has an error that steps when the\n\
                 joint reverses. Only the integral part of the controller compensates this step. If the sign of the compensated friction changes over another\n\
                 speed range than the friction of the arm, the effect is the same.\n\n{HEADER}"
            );
            for (name, error) in &self.bounds {
                row(page, name, error, 3);
            }
        }
    }
}

/// Rounds a value to the number of digits that the page shows.
fn rounded(value: f64) -> f64 {
    (1e3 * value).round() / 1e3
}

/// Returns the goal for the error of each joint, mrad.
fn goals(existing: &Figures) -> [f64; JOINTS] {
    existing.true_error.map(|error| rounded((SHARE * rounded(error)).max(LEAST)))
}

fn row(page: &mut String, name: &str, values: &[f64; JOINTS], digits: usize) {
    let cells = values.map(|value| format!("{value:.digits$}")).join(" | ");
    let _ = writeln!(page, "| {name} | {cells} |");
}

/// Writes the table that compares our implementation of the existing control law with the original code of the existing
/// firmware.
fn reference(page: &mut String, all: &[Comparison]) {
    let figures = |name: &str| {
        let found = all.iter().find(|c| c.path == "demo path" && c.condition.name == name);
        found.and_then(|comparison| comparison.existing.figures)
    };
    let (Some(ideal), Some(weak)) = (figures("ideal drives"), figures("drives deliver 1/1.3")) else {
        return;
    };
    let here = [ideal.own_error, ideal.true_error, ideal.roughness, weak.own_error];
    let _ = write!(
        page,
        "\n## The existing law, and the existing firmware\n\nThe original code of the existing firmware, compiled for a PC, was run earlier \
         on the same simulated arm (demo path). The copy of this control law in `existing.rs` gives nearly the same figures:\n\n{HEADER}"
    );
    let mut most = 0.0f64;
    for ((name, reference), here) in REFERENCE.iter().zip(&here) {
        row(page, &format!("firmware, {name}"), reference, 3);
        row(page, &format!("here, {name}"), here, 3);
        most = here
            .iter()
            .zip(reference)
            .map(|(here, firmware)| (here / firmware - 1.0).abs())
            .fold(most, f64::max);
    }
    let _ = writeln!(page, "\nThe largest difference is {:.1} %.", 100.0 * most);
}

/// Returns the complete text of the page docs/tracking.md.
pub(crate) fn text(all: &[Comparison]) -> String {
    let mut page = INTRODUCTION.to_owned();
    reference(&mut page, all);
    let _ = writeln!(page, "\n## Comparison");
    if all.iter().all(|comparison| comparison.path != paths::RECORDED) {
        let _ = writeln!(page, "\nSkipped: the {} is not available.", paths::RECORDED);
    }
    for comparison in all {
        comparison.section(&mut page);
    }
    page
}
