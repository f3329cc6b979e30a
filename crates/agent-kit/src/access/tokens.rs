//! The tokens of an agent, and the file that only its owner can read.
use std::fs::{self, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;

/// The tokens of an agent, as its token file has them.
#[derive(Clone, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tokens {
    /// Lets its bearer command.
    pub operator: String,
    /// Lets its bearer look and stop.
    pub viewer: String,
}

/// Why there are no tokens.
#[derive(Debug, thiserror::Error)]
pub enum TokenError {
    /// It cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// Others can read it.
    #[error("{path}: mode {mode:04o}: other users can read this token file", path = path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Its mode.
        mode: u32,
    },
    /// It has other contents.
    #[error("{path}: no token file: {what}", path = path.display())]
    Contents {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// The system has no random numbers.
    #[error("no random numbers from this system: {0}")]
    Random(getrandom::Error),
}

impl host_kit::Diagnose for TokenError {
    fn diagnosis(&self) -> host_kit::Diagnosis {
        let next = match self {
            Self::Open { path, .. } => format!("`chmod 600 {}`", path.display()),
            Self::Contents { path, .. } => {
                format!(
                    "remove {}, and new tokens are made; or name another with --token-file",
                    path.display()
                )
            }
            Self::Io { .. } | Self::Random(_) => "name a file that you may write with --token-file".into(),
        };
        host_kit::Diagnosis::new(host_kit::ErrorKind::Usage, "token-file", next)
    }
}

/// 32 random bytes as text.
///
/// # Errors
///
/// The system has no random numbers.
pub fn random() -> Result<String, TokenError> {
    let mut bytes = [0; 32];
    getrandom::fill(&mut bytes).map_err(TokenError::Random)?;
    Ok(URL_SAFE_NO_PAD.encode(bytes))
}

impl Tokens {
    /// Those of a file.
    ///
    /// # Errors
    ///
    /// The file can be read by others, is none, or cannot be read.
    pub fn load(path: &Path) -> Result<Self, TokenError> {
        let contents = |what: String| TokenError::Contents { path: path.to_owned(), what };
        let text =
            fs::read_to_string(path).map_err(|source| TokenError::Io { path: path.to_owned(), source })?;
        check_mode(path)?;
        let tokens: Self = toml::from_str(&text).map_err(|e| contents(e.message().to_owned()))?;
        let short = [&tokens.operator, &tokens.viewer].into_iter().any(|token| token.len() < 20);
        if short || tokens.operator == tokens.viewer {
            let what = "`operator` and `viewer` are two different tokens of 20 characters or more";
            return Err(contents(what.into()));
        }
        Ok(tokens)
    }

    /// Those of the file, or new ones in a new file that only its owner can read. True: they are new.
    ///
    /// # Errors
    ///
    /// The file can be read by others, is none, or cannot be read or written.
    pub fn load_or_make(path: &Path) -> Result<(Self, bool), TokenError> {
        match Self::load(path) {
            Err(TokenError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => {}
            loaded => return Ok((loaded?, false)),
        }
        let tokens = Self { operator: random()?, viewer: random()? };
        let write = || {
            if let Some(parent) = path.parent() {
                fs::create_dir_all(parent)?;
            }
            let text = format!(
                "# Lets its bearer command.\noperator = \"{}\"\n# Lets its bearer look and stop.\nviewer = \"{}\"\n",
                tokens.operator, tokens.viewer
            );
            private(path)?.write_all(text.as_bytes())
        };
        write().map_err(|source| TokenError::Io { path: path.to_owned(), source })?;
        Ok((tokens, true))
    }
}

impl Tokens {
    /// What people are told about the agent at `url` when it begins: the operator's token and the link of the dashboard with it on a terminal alone,
    /// for what is written elsewhere (the journal of the system, a file) is kept and read by others. What stands behind `#` is not sent to any
    /// server, and the page takes it out of the address at once.
    pub fn announce(&self, url: &str, file: &Path, announced: Announced) -> Vec<String> {
        let Announced { are_new, link, on_terminal } = announced;
        let (operator, file) = (&self.operator, file.display());
        let mut lines = Vec::new();
        if are_new && on_terminal {
            lines.push(format!("operator's token, new in {file}: {operator}"));
        } else if are_new {
            lines.push(format!("operator's token, new in {file}: `cat {file}` shows it"));
        } else if link && !on_terminal {
            lines.push(format!("operator's token: printed on a terminal alone; `cat {file}` shows it"));
        }
        lines.push(match on_terminal && (are_new || link) {
            true => format!("dashboard: {url}/#token={operator}"),
            false => format!("dashboard: {url}"),
        });
        lines
    }
}

/// To whom tokens are announced, and why.
#[derive(Clone, Copy, Debug)]
pub struct Announced {
    /// They were made just now.
    pub are_new: bool,
    /// The link with the token is asked for.
    pub link: bool,
    /// A person reads it, and nothing keeps it.
    pub on_terminal: bool,
}

/// The token file of this user, where none is named.
pub fn default_token_file() -> Option<PathBuf> {
    token_file("tokens.toml")
}

/// The file of this name where this user's token files are.
pub fn token_file(name: &str) -> Option<PathBuf> {
    let state = host_kit::user_folder("XDG_STATE_HOME", ".local/state")?;
    Some(state.join("openjtc").join(name))
}

/// A new file that only its owner can read.
fn private(path: &Path) -> io::Result<fs::File> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(path)
}

#[cfg(unix)]
fn check_mode(path: &Path) -> Result<(), TokenError> {
    use std::os::unix::fs::PermissionsExt as _;
    let metadata = fs::metadata(path).map_err(|source| TokenError::Io { path: path.to_owned(), source })?;
    let mode = metadata.permissions().mode() & 0o777;
    if mode & 0o077 == 0 { Ok(()) } else { Err(TokenError::Open { path: path.to_owned(), mode }) }
}

#[cfg(not(unix))]
fn check_mode(_: &Path) -> Result<(), TokenError> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_token_is_printed_on_a_terminal_alone() {
        let tokens = Tokens { operator: "o".repeat(43), viewer: "v".repeat(43) };
        let file = Path::new("/home/anna/tokens.toml");
        for are_new in [false, true] {
            for link in [false, true] {
                for on_terminal in [false, true] {
                    let announced = Announced { are_new, link, on_terminal };
                    let text = tokens.announce("http://127.0.0.1:8780", file, announced).join("\n");
                    assert!(text.contains("dashboard: http://127.0.0.1:8780"), "{text}");
                    assert!(!text.contains(&tokens.viewer), "{text}");
                    let shown = on_terminal && (are_new || link);
                    assert_eq!(text.contains(&tokens.operator), shown, "{announced:?}: {text}");
                    assert_eq!(text.contains("#token="), shown, "{announced:?}: {text}");
                    let told = !on_terminal && (are_new || link);
                    assert_eq!(
                        text.contains("`cat /home/anna/tokens.toml` shows it"),
                        told,
                        "{announced:?}: {text}"
                    );
                }
            }
        }
    }
}
