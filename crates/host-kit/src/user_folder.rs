//! Folder in which a program stores the files of the user.
use std::ffi::OsString;
use std::path::PathBuf;

/// Returns the folder that a variable of the XDG Base Directory Specification names, such as `XDG_CACHE_HOME`. If the
/// variable is not set, returns the subfolder `in_home` of the home folder `HOME`. Returns `None` if `HOME` is not set
/// either. An empty variable is treated as not set.
pub fn user_folder(variable: &str, in_home: &str) -> Option<PathBuf> {
    folder(|name| std::env::var_os(name), variable, in_home)
}

fn folder(value: impl Fn(&str) -> Option<OsString>, variable: &str, in_home: &str) -> Option<PathBuf> {
    let named = |name| value(name).filter(|folder| !folder.is_empty()).map(PathBuf::from);
    named(variable).or_else(|| Some(named("HOME")?.join(in_home)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variable_counts_before_the_home_and_an_empty_one_does_not() {
        let of = |state: Option<&str>, home: Option<&str>| {
            let value = |name: &str| match name {
                "XDG_STATE_HOME" => state.map(OsString::from),
                "HOME" => home.map(OsString::from),
                other => panic!("{other}"),
            };
            folder(value, "XDG_STATE_HOME", ".local/state")
        };
        assert_eq!(of(Some("/state"), Some("/home")), Some("/state".into()));
        for state in [None, Some("")] {
            assert_eq!(of(state, Some("/home")), Some("/home/.local/state".into()));
            assert_eq!((of(state, None), of(state, Some(""))), (None, None));
        }
    }
}
