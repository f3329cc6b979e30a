//! Tokens of an agent, and the token file, which only the owner of the file can read.
use std::fs::{self, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;

/// Tokens of an agent, as stored in its token file.
#[derive(Clone, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tokens {
    /// Token that gives the role operator.
    pub operator: String,
    /// Token for read-only access and Stop.
    pub viewer: String,
}

/// Reason why the tokens cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum TokenError {
    /// Token file that cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Token file that other users can read.
    #[error("{path}: mode {mode:04o}: other users can read this token file", path = path.display())]
    Open {
        /// Path of the file.
        path: PathBuf,
        /// Mode of the file.
        mode: u32,
    },
    /// File that is not a token file.
    #[error("{path}: not a valid token file: {what}", path = path.display())]
    Contents {
        /// Path of the file.
        path: PathBuf,
        /// Problem in the contents of the token file.
        what: String,
    },
    /// The operating system provided no random numbers.
    #[error("the operating system provides no random numbers: {0}")]
    Random(getrandom::Error),
}

impl host_kit::Diagnose for TokenError {
    fn diagnosis(&self) -> host_kit::Diagnosis {
        let next = match self {
            Self::Open { path, .. } => format!("`chmod 600 {}`", path.display()),
            Self::Contents { path, .. } => {
                format!(
                    "remove {} to create new tokens, or select another file with --token-file",
                    path.display()
                )
            }
            Self::Io { .. } | Self::Random(_) => "select a file that you can write with --token-file".into(),
        };
        host_kit::Diagnosis::new(host_kit::ErrorKind::Usage, "token-file", next)
    }
}

/// Returns 32 random bytes as text.
///
/// # Errors
///
/// The operating system provides no random numbers.
pub fn random() -> Result<String, TokenError> {
    let mut bytes = [0; 32];
    getrandom::fill(&mut bytes).map_err(TokenError::Random)?;
    Ok(URL_SAFE_NO_PAD.encode(bytes))
}

impl Tokens {
    /// Loads the tokens from a file.
    ///
    /// # Errors
    ///
    /// Other users can read the token file, the file is not a token file, or it cannot be read.
    pub fn load(path: &Path) -> Result<Self, TokenError> {
        let contents = |what: String| TokenError::Contents { path: path.to_owned(), what };
        let text =
            fs::read_to_string(path).map_err(|source| TokenError::Io { path: path.to_owned(), source })?;
        check_mode(path)?;
        let tokens: Self = toml::from_str(&text).map_err(|e| contents(e.message().to_owned()))?;
        let short = [&tokens.operator, &tokens.viewer].into_iter().any(|token| token.len() < 20);
        if short || tokens.operator == tokens.viewer {
            let what = "`operator` and `viewer` must be two different tokens of at least 20 characters";
            return Err(contents(what.into()));
        }
        Ok(tokens)
    }

    /// Loads the tokens from a file. If the token file does not exist, creates it with new tokens; only the owner can
    /// read the new file. Returns the tokens, and `true` if they are new.
    ///
    /// # Errors
    ///
    /// Other users can read the token file, the file is not a token file, or it cannot be read or written.
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
                "# Token that allows commands.\noperator = \"{}\"\n# Token that allows reading and \
                stopping.\nviewer = \"{}\"\n",
                tokens.operator, tokens.viewer
            );
            private(path)?.write_all(text.as_bytes())
        };
        write().map_err(|source| TokenError::Io { path: path.to_owned(), source })?;
        Ok((tokens, true))
    }
}

impl Tokens {
    /// Returns the lines that announce the agent at `url` when it starts. The operator's token and the dashboard link
    /// with this token appear only on a terminal. Other outputs (the system journal, a file) are stored, and other
    /// users can read them. Browsers do not send the part of a URL after `#` to any server. The dashboard removes the
    /// part after `#` from its URL at once.
    pub fn announce(&self, url: &str, file: &Path, announced: Announced) -> Vec<String> {
        let Announced { are_new, link, on_terminal } = announced;
        let (operator, file) = (&self.operator, file.display());
        let mut lines = Vec::new();
        if are_new && on_terminal {
            lines.push(format!("new operator's token in {file}: {operator}"));
        } else if are_new {
            lines.push(format!("new operator's token in {file}: `cat {file}` shows it"));
        } else if link && !on_terminal {
            lines.push(format!("operator's token: printed only on a terminal; `cat {file}` shows it"));
        }
        lines.push(match on_terminal && (are_new || link) {
            true => format!("dashboard: {url}/#token={operator}"),
            false => format!("dashboard: {url}"),
        });
        lines
    }
}

/// Conditions that determine which tokens an agent announces.
#[derive(Clone, Copy, Debug)]
pub struct Announced {
    /// `true` if the tokens were generated at this start.
    pub are_new: bool,
    /// `true` if the user requested the dashboard link with the token.
    pub link: bool,
    /// `true` if the output is a terminal. A person reads the text on a terminal, and the text is not stored.
    pub on_terminal: bool,
}

/// Returns the default token file of this user.
pub fn default_token_file() -> Option<PathBuf> {
    token_file("tokens.toml")
}

/// Returns the path of a token file with the name `name` in the directory of this user's token files.
pub fn token_file(name: &str) -> Option<PathBuf> {
    let state = host_kit::user_folder("XDG_STATE_HOME", ".local/state")?;
    Some(state.join("openjtc").join(name))
}

/// Creates a file that only its owner can read.
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
