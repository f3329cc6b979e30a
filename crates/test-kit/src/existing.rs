//! Data of an existing arm, which is not part of this project. The environment variable `OPENJTC_DATA`
//! contains the directory of the data. If the data is missing, tests that need the data are skipped.

use std::path::{Path, PathBuf};

/// Returns the path of a data file. If the file is missing, prints a line and returns `None`.
pub fn file(name: &str) -> Option<PathBuf> {
    let directory = std::env::var("OPENJTC_DATA")
        .unwrap_or_else(|_| concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/avena").to_owned());
    let path = Path::new(&directory).join(name);
    let there = path.exists();
    if !there {
        println!("skipped: {} is not there; OPENJTC_DATA names the directory", path.display());
    }
    there.then_some(path)
}

/// Returns the positions, velocities and accelerations of a trajectory file. The function returns the
/// raw values that the host sends to the controller. A trajectory file has 19 integers per line; the
/// first integer is the time.
///
/// # Panics
/// Panics if the file does not have this format.
pub fn points(name: &str) -> Option<Vec<[[i16; 6]; 3]>> {
    let text = std::fs::read_to_string(file(name)?).expect("it can be read");
    let point = |line: &str| {
        let n: Vec<i16> = line.split(',').skip(1).map(|x| x.trim().parse().expect("int16")).collect();
        [0, 6, 12].map(|at| std::array::from_fn(|j| n[at + j]))
    };
    Some(text.lines().filter(|line| !line.trim().is_empty()).map(point).collect())
}
