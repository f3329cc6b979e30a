//! `cargo xtask bench tracking`: compares our control law with the control law of the existing firmware, and writes
//! docs/tracking.md.
use std::process::ExitCode;

use anyhow::Result;

use crate::shell::{cargo, nothing_left, root, run};

/// Compares the control laws in virtual time and writes the page.
pub(super) fn main(arguments: &[String]) -> Result<ExitCode> {
    nothing_left(arguments)?;
    let mut example = cargo(&["run", "--quiet", "--package", "xtask", "--example", "tracking", "--"]);
    run(example.arg(root().join("docs/tracking.md")))?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of a section of the page, each with a name and six numbers.
    type Rows = Vec<(String, [f64; 6])>;

    fn page() -> String {
        std::fs::read_to_string(root().join("docs/tracking.md")).expect("docs/tracking.md is there")
    }

    /// Returns heading, rows and text of each section of the page. Panics if a row does not consist of a name and six
    /// numbers.
    fn sections(page: &str) -> Vec<(String, Rows, String)> {
        let mut sections = Vec::new();
        for section in page.split("\n##").skip(1) {
            let (heading, body) = section.split_once('\n').expect("a heading and text");
            let lines = body.lines().filter(|line| {
                line.starts_with('|') && !line.starts_with("| | j1 |") && !line.starts_with("|---")
            });
            let rows = lines.map(|line| {
                let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
                let [name, figures @ ..] = cells.as_slice() else { panic!("an empty row in {heading}") };
                let figures: Vec<f64> = figures.iter().map(|cell| cell.parse().expect("a number")).collect();
                ((*name).to_owned(), figures.try_into().expect("six joints"))
            });
            sections.push((heading.trim_matches(['#', ' ']).to_owned(), rows.collect(), body.to_owned()));
        }
        sections
    }

    fn of(rows: &Rows, name: &str) -> Option<[f64; 6]> {
        rows.iter().find(|(row, _)| row == name).map(|(_, figures)| *figures)
    }

    /// The page says that a goal is met only if the figures on the page meet the goal. If joints miss the goal, the page
    /// lists these joints, with the quantity that limits each joint.
    #[test]
    fn j62_the_page_of_tracking_judges_its_own_figures() {
        let (page, sections) = (page(), sections(&page()));
        let judged: Vec<_> =
            sections.iter().filter(|(_, rows, _)| of(rows, "goal, commanded − true").is_some()).collect();
        for path in ["demo path", "recorded path"] {
            if page.contains(&format!("Skipped: the {path} is not available.")) {
                println!("skipped: {path}");
                continue;
            }
            for condition in ["ideal drives", "drives deliver 1/1.3", "sharper friction"] {
                let heading = format!("{path}: {condition}");
                assert!(judged.iter().any(|(name, ..)| *name == heading), "{heading} is judged");
            }
        }
        for (heading, rows, text) in judged {
            let row = |name: &str| of(rows, name).unwrap_or_else(|| panic!("{heading} without {name}"));
            let (existing, ours, goal) = (
                row("existing, commanded − true"),
                row("ours, commanded − true"),
                row("goal, commanded − true"),
            );
            let mut missed = false;
            for j in 0..6 {
                assert!((goal[j] - (0.2 * existing[j]).max(0.04)).abs() < 6e-4, "{heading}, joint {}", j + 1);
                let misses = ours[j] > goal[j];
                assert_eq!(
                    text.contains(&format!("joint {} (", j + 1)),
                    misses,
                    "{heading}, joint {}",
                    j + 1
                );
                missed |= misses;
            }
            assert_eq!(text.contains("Every joint meets the goal."), !missed, "{heading}");
            assert_eq!(text.contains("The next table shows what limits the accuracy"), missed, "{heading}");
        }
    }

    /// Our implementation of the existing control law agrees with each known result of the existing firmware within 10
    /// %.
    #[test]
    fn j62_the_existing_law_of_the_page_is_that_of_the_existing_firmware() {
        let sections = sections(&page());
        let (_, rows, _) =
            sections.iter().find(|(heading, ..)| heading.contains("existing firmware")).expect("it is there");
        let firmware: Vec<_> =
            rows.iter().filter_map(|(name, f)| Some((name.strip_prefix("firmware, ")?, f))).collect();
        assert_eq!(firmware.len(), 4);
        for (name, firmware) in firmware {
            let here = of(rows, &format!("here, {name}")).expect("a row beside it");
            for (here, firmware) in here.iter().zip(firmware) {
                assert!((here / firmware - 1.0).abs() < 0.1, "{name}: {here} for {firmware}");
            }
        }
    }
}
