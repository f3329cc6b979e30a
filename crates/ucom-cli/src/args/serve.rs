//! `ucom serve`: the agent.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
use cli_kit::size;
use cli_kit::variables::on_off;

use super::CacheArgs;

/// Options of `ucom serve`.
#[derive(Args, Debug)]
pub struct ServeArgs {
    /// A simulated chain instead of a bus
    #[arg(long, env = "UCOM_SIM", value_parser = on_off)]
    pub sim: bool,
    /// Number of simulated boards, 0..31; default: the ten of the built-in head
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=31))]
    pub boards: Option<u8>,
    /// Address to listen at; beyond this computer everyone needs a token
    #[arg(long, env = "UCOM_AGENT_LISTEN", value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8781")]
    pub listen: SocketAddr,
    /// Tokens of the agent, TOML, made where there are none; default: openjtc/ucom-tokens.toml in $XDG_STATE_HOME or ~/.local/state
    #[arg(long, env = "UCOM_TOKEN_FILE", value_name = "FILE")]
    pub token_file: Option<PathBuf>,
    /// Name by which others ask for this agent, beside its address; more than once, or with commas, for several
    #[arg(long = "name", env = "UCOM_AGENT_NAMES", value_name = "HOST", value_delimiter = ',')]
    pub names: Vec<String>,
    /// Print the link of the dashboard with the operator's token, on a terminal; otherwise it is printed once, when it is made
    #[arg(id = "link_with_token", long = "link")]
    pub link_with_token: bool,
    /// File to which each command is appended: who, what, when, result
    #[arg(long, env = "UCOM_COMMAND_LOG", value_name = "FILE")]
    pub command_log: Option<PathBuf>,
    /// Flash numbers of the boards, as `ucom init` wrote them; updates keep there what they wrote
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    /// Room that the log takes at most: it is put aside as FILE.1 when it has half of it
    #[arg(long, env = "UCOM_COMMAND_LOG_LIMIT", value_name = "SIZE", default_value = "100MB", value_parser = log_size)]
    pub command_log_limit: u64,
    /// Certificate chain, PEM: the agent speaks TLS
    #[arg(long, env = "UCOM_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    pub tls_cert: Option<PathBuf>,
    /// Private key of that certificate, PEM; not every user may read it
    #[arg(long, env = "UCOM_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    pub tls_key: Option<PathBuf>,
    #[command(flatten)]
    pub cache: CacheArgs,
}

/// Room for the log of commands: some thousand lines at least.
fn log_size(text: &str) -> Result<u64, String> {
    size(text, 1_000_000)
}
