//! Options of the agent, `ucom serve`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
use cli_kit::size;
use cli_kit::variables::on_off;

use super::CacheArgs;

/// Options of `ucom serve`.
#[derive(Args, Debug)]
pub(crate) struct ServeArgs {
    /// Use a simulated chain instead of a bus
    #[arg(long, env = "UCOM_SIM", value_parser = on_off)]
    pub sim: bool,
    /// Simulate this number of boards (0 to 31).
    ///
    /// Default: the ten boards of the built-in head
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=31))]
    pub boards: Option<u8>,
    /// Listen at this address.
    ///
    /// Clients on other computers always need a token
    #[arg(long, env = "UCOM_AGENT_LISTEN", value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8781")]
    pub listen: SocketAddr,
    /// Keep the tokens of the agent in this TOML file.
    ///
    /// If the file does not exist, the agent creates it. Default: openjtc/ucom-tokens.toml in $XDG_STATE_HOME or
    /// ~/.local/state
    #[arg(long, env = "UCOM_TOKEN_FILE", value_name = "FILE")]
    pub token_file: Option<PathBuf>,
    /// Accept this host name in addition to the address.
    ///
    /// Clients can then use this host name in the address of the agent. For several names, repeat the option, or write
    /// commas between the names
    #[arg(long = "name", env = "UCOM_AGENT_NAMES", value_name = "HOST", value_delimiter = ',')]
    pub names: Vec<String>,
    /// Print the dashboard link with the operator's token.
    ///
    /// The command prints this link only on a terminal. Without this option, it prints the link once, when it creates the
    /// token
    #[arg(id = "link_with_token", long = "link")]
    pub link_with_token: bool,
    /// Append each command to this file.
    ///
    /// Each line of the file contains the client, the command, the time and the result
    #[arg(long, env = "UCOM_COMMAND_LOG", value_name = "FILE")]
    pub command_log: Option<PathBuf>,
    /// Read the flash numbers from this inventory file.
    ///
    /// `ucom init` writes this file. Each update records the written image in the file
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    /// Limit the size of the command log.
    ///
    /// When the log reaches half of this size, the agent renames the log to FILE.1, and starts a new log
    #[arg(long, env = "UCOM_COMMAND_LOG_LIMIT", value_name = "SIZE", default_value = "100MB", value_parser = log_size)]
    pub command_log_limit: u64,
    /// Use TLS with the certificate chain in this PEM file
    #[arg(long, env = "UCOM_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    pub tls_cert: Option<PathBuf>,
    /// Use the private key in this PEM file for the certificate.
    ///
    /// Only the owner and the group may have access to the file
    #[arg(long, env = "UCOM_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    pub tls_key: Option<PathBuf>,
    #[command(flatten)]
    pub cache: CacheArgs,
}

/// Parses the maximum size of the command log. The minimum of 1 MB is enough for some thousand lines.
fn log_size(text: &str) -> Result<u64, String> {
    size(text, 1_000_000)
}
