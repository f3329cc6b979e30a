//! Poses: named joint positions of an arm, in the `[poses]` table of the arm file.
//!
//! A pose consists of a name and six joint positions (rad, base to wrist). Poses are not sent to a controller and are not part of the arm's
//! hash. [`save_pose`] and [`remove_pose`] change only the `[poses]` table. The other text of the file, including comments, stays the same.

mod error;

use std::collections::BTreeMap;
use std::path::Path;

use host_kit::{nearest, write_atomically};
use jtc_core::JOINTS;
use jtc_wire::Joint;
use toml_edit::{Array, DocumentMut, Item, Table, Value};

pub use error::PoseError;

use super::{Arm, is_xml, toml_form};
use crate::file::{FileError, Place, read_text, short};

/// Named joint positions, rad.
pub type Poses = BTreeMap<String, [f64; JOINTS]>;

/// Maximum length of a pose's name, in characters.
const NAME_MAX: usize = 64;
/// Least similarity, 0 to 1, at which a known name is suggested instead of a misspelled name.
const ALIKE: f64 = 0.7;
/// Number of steps per radian in saved positions. A step of 1e-6 rad moves the end of an arm of one metre by one micrometre. The resolution
/// of the encoders is not finer.
const DECIMALS: f64 = 1e6;

impl Arm {
    /// Returns the positions of a named pose, rad.
    ///
    /// # Errors
    ///
    /// Returns [`PoseError::Unknown`] with the most similar name, or [`PoseError::Outside`] if the pose is outside the arm's
    /// limits.
    pub fn pose(&self, name: &str) -> Result<[f64; JOINTS], PoseError> {
        let Some(position) = self.poses.get(name) else {
            let known: Vec<String> = self.poses.keys().cloned().collect();
            return Err(PoseError::Unknown {
                name: short(name),
                arm: self.name.clone(),
                like: nearest(name, known.iter().map(String::as_str), ALIKE).map(str::to_owned),
                known,
            });
        };
        self.at_pose(name, position).map(|()| *position)
    }

    /// Checks that a position (rad) is within the arm's limits. If the position is outside, the error contains
    /// `name`.
    ///
    /// # Errors
    ///
    /// Returns [`PoseError::Outside`] with the first joint outside its limits.
    pub fn at_pose(&self, name: &str, position: &[f64; JOINTS]) -> Result<(), PoseError> {
        match self.outside(position) {
            None => Ok(()),
            Some((joint, min, max)) => {
                Err(PoseError::Outside { name: name.into(), joint, value: position[joint.index()], min, max })
            }
        }
    }

    /// Returns the first joint whose value in `position` is outside its position range, with the lower and upper
    /// limit of this range (rad).
    pub(crate) fn outside(&self, position: &[f64; JOINTS]) -> Option<(Joint, f64, f64)> {
        let config = self.config();
        Joint::ALL.into_iter().find_map(|joint| {
            let (min, max) = config.position_range(joint.index());
            (!(min..=max).contains(&position[joint.index()])).then_some((joint, min, max))
        })
    }
}

/// Returns `true` for a valid name of a pose. A valid name is never a number, so it cannot be mistaken for a position
/// in a waypoint file or in an option.
pub fn is_pose_name(name: &str) -> bool {
    name.chars().count() <= NAME_MAX
        && name.starts_with(char::is_alphabetic)
        && name.chars().all(|c| c.is_alphanumeric() || "_-.".contains(c))
        && name.parse::<f64>().is_err()
}

/// Reads the poses from the `[poses]` table of an arm file.
pub(super) fn read(given: &BTreeMap<String, Vec<f64>>) -> Result<Poses, FileError> {
    let pose = |(name, values): (&String, &Vec<f64>)| {
        let wrong = |problem: String| FileError::at(Place::name(format!("poses, {}", short(name))), problem);
        if !is_pose_name(name) {
            return Err(wrong(PoseError::Name { name: short(name) }.to_string()));
        }
        let count = values.len();
        let position = <[f64; JOINTS]>::try_from(&values[..])
            .map_err(|_| wrong(format!("{count} numbers, expected 6 (rad, base to wrist)")))?;
        match position.iter().find(|v| !v.is_finite()) {
            Some(v) => Err(wrong(format!("{v} is not a finite number"))),
            None => Ok((name.clone(), position)),
        }
    };
    given.iter().map(pose).collect()
}

/// Formats a name as a table key for a TOML file.
pub(super) fn key(name: &str) -> String {
    toml_edit::Key::new(name).display_repr().into_owned()
}

/// Saves a pose (rad) in an arm file, rounded to a millionth of a radian.
///
/// # Errors
///
/// Returns an error if the name is invalid, or if the pose exists and `force` is `false`. Also returns an error if the file is not a TOML
/// arm file or cannot be written. After an error the file is unchanged.
pub fn save_pose(path: &Path, name: &str, position: &[f64; JOINTS], force: bool) -> Result<(), PoseError> {
    if !is_pose_name(name) {
        return Err(PoseError::Name { name: short(name) });
    }
    let rounded = position.map(|v| (v * DECIMALS).round() / DECIMALS + 0.0);
    edit(path, |table, arm| {
        if arm.poses.contains_key(name) && !force {
            return Err(PoseError::Exists { path: path.to_owned(), name: name.into() });
        }
        match table.get_mut(name).and_then(Item::as_value_mut) {
            // The spaces and comments before and after the value stay the same.
            Some(value) => {
                let around = value.decor().clone();
                *value = Value::Array(Array::from_iter(rounded));
                *value.decor_mut() = around;
            }
            None => drop(table.insert(name, Item::Value(Value::Array(Array::from_iter(rounded))))),
        }
        arm.poses.insert(name.into(), rounded);
        Ok(())
    })
}

/// Removes a pose from an arm file.
///
/// # Errors
///
/// Returns an error if the pose does not exist, if the file is not a TOML arm file, or if the file cannot be written. After an error the
/// file is unchanged.
pub fn remove_pose(path: &Path, name: &str) -> Result<(), PoseError> {
    edit(path, |table, arm| {
        if arm.poses.remove(name).is_none() {
            // The error for an unknown pose lists the names of the existing poses.
            return arm.pose(name).map(drop);
        }
        table.remove(name);
        Ok(())
    })
}

/// Applies one change to the `[poses]` table of a file and to the arm that was read from this file. Afterwards the
/// table and the arm must contain the same poses.
fn edit(
    path: &Path,
    change: impl FnOnce(&mut dyn toml_edit::TableLike, &mut Arm) -> Result<(), PoseError>,
) -> Result<(), PoseError> {
    let text = read_text(path)?;
    if is_xml(&text) {
        return Err(PoseError::Description { path: path.to_owned() });
    }
    let in_file = |e: FileError| PoseError::File(e.in_file(path));
    let mut arm = toml_form::read(&text).map_err(in_file)?;
    let mut document =
        text.parse::<DocumentMut>().map_err(|e| in_file(FileError::form(e.message().to_owned())))?;
    let poses = document.entry("poses").or_insert_with(|| Item::Table(Table::new()));
    let table = poses.as_table_like_mut().ok_or_else(|| in_file(FileError::form("poses is not a table")))?;
    change(table, &mut arm)?;
    let written = as_it_was(&document.to_string(), &text);
    if !toml_form::read(&written).is_ok_and(|read| read == arm) {
        return Err(in_file(FileError::form(
            "this program cannot change the poses of this file: change them by hand",
        )));
    }
    write_atomically(path, written.as_bytes())
        .map_err(|source| FileError::Io { path: path.to_owned(), source })?;
    Ok(())
}

/// Restores the byte order mark and the line endings of the old text, because the TOML library does not keep them. Lines before and after
/// the changed part keep their line endings. The lines of the changed part get the line ending of the first line of the file.
fn as_it_was(changed: &str, before: &str) -> String {
    const MARK: char = '\u{feff}';
    let (lines, old): (Vec<&str>, Vec<&str>) = (
        changed.trim_start_matches(MARK).split_inclusive('\n').collect(),
        before.trim_start_matches(MARK).split_inclusive('\n').collect(),
    );
    let content = |line: &str| line.trim_end_matches(['\r', '\n']).to_owned();
    let same = |pair: &(&&str, &&str)| content(pair.0) == content(pair.1);
    let head = lines.iter().zip(&old).take_while(same).count();
    let most = lines.len().min(old.len()) - head;
    let tail = lines.iter().rev().zip(old.iter().rev()).take(most).take_while(same).count();
    let returns = old.first().is_some_and(|line| line.ends_with("\r\n"));
    let fresh = |line: &&str| match line.strip_suffix('\n') {
        Some(text) if returns && !text.ends_with('\r') => format!("{text}\r\n"),
        _ => (*line).to_owned(),
    };
    let mark = before.starts_with(MARK).then(|| MARK.to_string());
    // If the last old line has no line ending, the new line is used, because it may have one.
    let kept = |(new, old): (&&str, &&str)| if old.ends_with('\n') { (*old).to_owned() } else { fresh(new) };
    let (first, last) = (lines.iter().zip(&old).take(head).map(kept), old.len() - tail);
    let between = lines[head..lines.len() - tail].iter().map(fresh);
    let rest = old[last..].iter().map(|line| (*line).to_owned());
    mark.into_iter().chain(first).chain(between).chain(rest).collect()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use host_kit::Diagnose;
    use proptest::prelude::*;

    use super::*;
    use crate::arm::AVENA_TOML;

    const HOME: [f64; JOINTS] = [0.0, 0.5, -1.0, 0.25, 0.0, 1.5];

    fn file(text: &str) -> (tempfile::TempDir, PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("arm.toml");
        std::fs::write(&path, text).unwrap();
        (dir, path)
    }

    /// The first saved pose adds the `[poses]` table at the end of the file, and each later pose changes one line.
    /// After all poses are removed, the arm is the same as before.
    #[test]
    fn the_rest_of_the_file_stays_as_it_is() {
        let (_dir, path) = file(AVENA_TOML);
        save_pose(&path, "home", &HOME, false).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with(AVENA_TOML.trim_end()), "only the end is new");
        let commented =
            text.replace("[poses]\n", "[poses] # taught on Monday\n# the rest position\n") + "# the end\n";
        std::fs::write(&path, &commented).unwrap();
        save_pose(&path, "above-table", &[0.1; 6], false).unwrap();
        save_pose(&path, "home", &[0.2; 6], true).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        for line in commented.lines().filter(|line| !line.starts_with("home")) {
            assert!(text.lines().any(|l| l == line), "lost: {line}\n{text}");
        }
        assert_eq!(text.lines().count(), commented.lines().count() + 1);
        let arm = Arm::load(&path).unwrap();
        assert_eq!((arm.pose("home").unwrap(), arm.pose("above-table").unwrap()), ([0.2; 6], [0.1; 6]));
        assert_eq!(Arm { poses: Poses::new(), ..arm }, Arm::avena());
        for name in ["home", "above-table"] {
            remove_pose(&path, name).unwrap();
        }
        assert_eq!(Arm::load(&path).unwrap(), Arm::avena());
    }

    /// The byte order mark and the line endings stay the same, even if the file contains mixed line endings. After the saved pose is
    /// removed, the file has its original bytes.
    #[test]
    fn every_byte_of_the_rest_stays() {
        let with_home = format!("{AVENA_TOML}\n[poses]\nhome = [0, 0, 0, 0, 0, 0]\n# the end\n");
        let every_third: String = with_home
            .split_inclusive('\n')
            .enumerate()
            .map(|(i, line)| if i % 3 == 1 { line.replace('\n', "\r\n") } else { line.to_owned() })
            .collect();
        let no_end = with_home.trim_end().to_owned();
        for text in [with_home.replace('\n', "\r\n"), format!("\u{feff}{with_home}"), every_third, no_end] {
            let (_dir, path) = file(&text);
            save_pose(&path, "up", &[0.25; 6], false).unwrap();
            let saved = std::fs::read_to_string(&path).unwrap();
            if !text.replace("\r\n", "").contains('\n') {
                assert!(!saved.replace("\r\n", "").contains('\n'), "the new line ends as the others do");
            }
            save_pose(&path, "up", &[0.5; 6], true).unwrap();
            assert_eq!(Arm::load(&path).unwrap().poses["up"], [0.5; 6]);
            remove_pose(&path, "up").unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
            save_pose(&path, "home", &[0.5; 6], true).unwrap();
            let changed = std::fs::read_to_string(&path).unwrap();
            let differs =
                text.split_inclusive('\n').zip(changed.split_inclusive('\n')).filter(|(a, b)| a != b);
            assert_eq!(differs.count(), 1);
        }
    }

    #[test]
    fn poses_are_no_part_of_what_a_controller_is_given() {
        let plain = Arm::avena();
        let with = Arm { poses: Poses::from([("home".into(), HOME)]), ..Arm::avena() };
        assert_eq!(with.hash().unwrap(), plain.hash().unwrap());
        assert!(with.differences(&plain).is_empty());
        // The poses stay the same after the arm is written to a file and read again.
        assert_eq!(Arm::parse(&with.to_toml()).unwrap().poses, with.poses);
    }

    #[test]
    fn what_is_refused_leaves_the_file_alone() {
        let (_dir, path) = file(AVENA_TOML);
        save_pose(&path, "home", &HOME, false).unwrap();
        let before = std::fs::read_to_string(&path).unwrap();
        let message = |done: Result<(), PoseError>| {
            let error = done.unwrap_err();
            format!("{error} | {}", error.diagnosis().next)
        };
        assert!(
            message(save_pose(&path, "home", &[0.0; 6], false))
                .contains("\"home\" exists already | choose another")
        );
        for name in ["", "1", "1e3", "nan", "NaN", "inf", "Infinity", "a b", "a,b", "-x", "ä\n"] {
            assert!(
                message(save_pose(&path, name, &HOME, false)).contains("is not a valid name of a pose"),
                "{name:?}"
            );
        }
        let unknown = message(remove_pose(&path, "hone"));
        assert!(
            unknown.contains("avena has no pose \"hone\"; the arm has home | did you mean \"home\"?"),
            "{unknown}"
        );
        assert_eq!(std::fs::read_to_string(&path).unwrap(), before);
        let (_dir, urdf) = file(&Arm::avena().to_urdf());
        assert!(message(save_pose(&urdf, "home", &HOME, false)).contains("jtc arm import"));
    }

    #[test]
    fn a_table_that_is_wrong_names_the_pose() {
        for (line, problem) in [
            ("home = [0, 0, 0]", "poses, home: 3 numbers, expected 6"),
            ("home = [0, 0, 0, 0, 0, nan]", "poses, home: NaN is not a finite number"),
            ("\"a b\" = [0, 0, 0, 0, 0, 0]", "poses, a b: \"a b\" is not a valid name"),
            ("home = \"here\"", "line"),
        ] {
            let error = Arm::parse(&format!("{AVENA_TOML}\n[poses]\n{line}\n")).unwrap_err().to_string();
            assert!(error.contains(problem), "{line}: {error}");
        }
        // If a pose is outside the limits, the check reports it, and the pose cannot be used.
        let arm = Arm::parse(&format!("{AVENA_TOML}\n[poses]\nfar = [0, 2, 0, 0, 0, 0]\n")).unwrap();
        assert_eq!(
            arm.pose("far").unwrap_err().to_string(),
            "pose \"far\", joint 2: 2 rad is outside -1.57..1.57 rad"
        );
        assert!(
            arm.check().findings.iter().any(|f| f.code == "pose" && f.joint.map(Joint::number) == Some(2))
        );
        assert!(!arm.check().is_refused());
    }

    proptest! {
        /// For any name and numbers, the pose read from the file equals the saved pose.
        #[test]
        fn what_was_saved_is_read(name in "[a-zA-Zäλ][a-zA-Z0-9_.ö-]{0,20}".prop_filter("a number", |name| name.parse::<f64>().is_err()), q in prop::array::uniform6(-3.0..3.0f64)) {
            let (_dir, path) = file(AVENA_TOML);
            save_pose(&path, &name, &q, false).unwrap();
            let read = Arm::load(&path).unwrap().poses[&name];
            for j in 0..JOINTS {
                prop_assert!((read[j] - q[j]).abs() <= 0.5e-6 + 1e-12);
            }
        }
    }
}
