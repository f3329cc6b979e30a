//! `jtc serve`: the agent.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
use cli_kit::size;
use cli_kit::variables::on_off;
use jtc_agent::modbus::Network;

use super::LinkArgs;

/// Options of `jtc serve`.
#[derive(Args, Debug)]
pub struct ServeArgs {
    /// A simulated controller instead of a port
    #[arg(long, env = "JTC_SIM", value_parser = on_off, conflicts_with = "port")]
    pub sim: bool,
    /// Arm, TOML or URDF: the one to simulate with --sim, which the controller has stored where the file is complete, and that of a
    /// controller that cannot be asked for its own; default: the built-in one
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Address to listen at; beyond this computer everyone needs a token
    #[arg(long, env = "JTC_LISTEN", value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8780")]
    pub listen: SocketAddr,
    /// Name by which others ask for this agent, beside its address; more than once, or with commas, for several
    #[arg(long = "name", env = "JTC_AGENT_NAMES", value_name = "HOST", value_delimiter = ',')]
    pub names: Vec<String>,
    /// Origins whose pages may look
    #[arg(
        long = "allow-origin",
        help = "Origin whose pages may look, as https://app.foxglove.dev, or file:// for desktop applications; more than once, or with \
                commas, for several",
        env = "JTC_ALLOW_ORIGINS",
        value_name = "ORIGIN",
        value_delimiter = ',',
        value_parser = jtc_agent::access::origin
    )]
    pub allow_origins: Vec<String>,
    /// Print the link of the dashboard with the operator's token, on a terminal; otherwise it is printed once, when it is made
    #[arg(id = "link_with_token", long = "link")]
    pub link_with_token: bool,
    /// File to which each command is appended: who, what, when, result
    #[arg(long, env = "JTC_COMMAND_LOG", value_name = "FILE")]
    pub command_log: Option<PathBuf>,
    /// Room that the log takes at most: it is put aside as FILE.1 when it has half of it
    #[arg(long, env = "JTC_COMMAND_LOG_LIMIT", value_name = "SIZE", default_value = "100MB", value_parser = log_size)]
    pub command_log_limit: u64,
    /// Directory that keeps trajectories by number, as files like 7-pick.csv; without it they are kept as long as the agent runs
    #[arg(long, env = "JTC_TRAJECTORIES", value_name = "DIR")]
    pub trajectories: Option<PathBuf>,
    /// Certificate chain, PEM: the agent speaks TLS
    #[arg(long, env = "JTC_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    pub tls_cert: Option<PathBuf>,
    /// Private key of that certificate, PEM; no other user may read it
    #[arg(long, env = "JTC_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    pub tls_key: Option<PathBuf>,
    /// Directory for recordings: one of each motion, whoever commanded it
    #[arg(long, env = "JTC_RECORD", value_name = "DIR")]
    pub record: Option<PathBuf>,
    /// Room that recordings take at most: the oldest of this directory's agents are removed first
    #[arg(long, env = "JTC_RECORD_LIMIT", value_name = "SIZE", default_value = "2GB", value_parser = record_size)]
    pub record_limit: u64,
    /// Address at which a PLC drives the arm by Modbus TCP, which knows no tokens; by default only from this computer
    #[arg(long, env = "JTC_MODBUS", value_name = "ADDRESS:PORT")]
    pub modbus: Option<SocketAddr>,
    /// Address or network (192.168.0.0/24) that alone may connect by Modbus; more than once, or with commas, for several
    #[arg(long, env = "JTC_MODBUS_ALLOW", value_name = "CIDR", value_delimiter = ',', requires = "modbus")]
    pub modbus_allow: Vec<Network>,
    #[command(flatten)]
    pub link: LinkArgs,
}

/// Room for recordings: some minutes at least.
fn record_size(text: &str) -> Result<u64, String> {
    size(text, 10_000_000)
}

/// Room for the log of commands: some thousand lines at least.
fn log_size(text: &str) -> Result<u64, String> {
    size(text, 1_000_000)
}
