//! `jtc serve`: options of the agent.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
use cli_kit::size;
use cli_kit::variables::on_off;
use jtc_agent::modbus::Network;

use super::LinkArgs;

/// Options of `jtc serve`.
#[derive(Args, Debug)]
pub(crate) struct ServeArgs {
    /// Use a simulated controller instead of a port
    #[arg(long, env = "JTC_SIM", value_parser = on_off, conflicts_with = "port")]
    pub sim: bool,
    /// Use this arm, TOML or URDF (default: the built-in arm).
    ///
    /// With --sim, the agent simulates this arm. If the file contains all parameters, the simulated controller also has
    /// this arm as its stored arm. Without --sim, the agent uses this arm only if the controller cannot report its arm
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Listen at this address.
    ///
    /// Clients on other computers always need a token
    #[arg(long, env = "JTC_LISTEN", value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8780")]
    pub listen: SocketAddr,
    /// Accept this host name in addition to the address.
    ///
    /// Clients can then use this host name in the address of the agent. For several names, repeat the option, or write
    /// commas between the names
    #[arg(long = "name", env = "JTC_AGENT_NAMES", value_name = "HOST", value_delimiter = ',')]
    pub names: Vec<String>,
    /// Allowed origins.
    #[arg(
        long = "allow-origin",
        help = "Give web pages of this origin read-only access",
        long_help = "Give web pages of this origin read-only access.\n\n\
            Examples are https://app.foxglove.dev, and file:// for desktop applications. For several \
            origins, repeat the option, or write commas between the origins",
        env = "JTC_ALLOW_ORIGINS",
        value_name = "ORIGIN",
        value_delimiter = ',',
        value_parser = jtc_agent::access::origin
    )]
    pub allow_origins: Vec<String>,
    /// Print the dashboard link with the operator's token.
    ///
    /// The command prints this link only on a terminal. Without this option, it prints the link once, when it creates the
    /// token
    #[arg(id = "link_with_token", long = "link")]
    pub link_with_token: bool,
    /// Append each command to this file.
    ///
    /// Each line of the file contains the client, the command, the time and the result
    #[arg(long, env = "JTC_COMMAND_LOG", value_name = "FILE")]
    pub command_log: Option<PathBuf>,
    /// Limit the size of the command log.
    ///
    /// When the log reaches half of this size, the agent renames the log to FILE.1, and starts a new log
    #[arg(long, env = "JTC_COMMAND_LOG_LIMIT", value_name = "SIZE", default_value = "100MB", value_parser = log_size)]
    pub command_log_limit: u64,
    /// Store the trajectories of clients in this directory.
    ///
    /// Each file name contains the number of the trajectory, for example 7-pick.csv. Without this option, the agent
    /// keeps trajectories only while it runs
    #[arg(long, env = "JTC_TRAJECTORIES", value_name = "DIR")]
    pub trajectories: Option<PathBuf>,
    /// Use TLS with the certificate chain in this PEM file
    #[arg(long, env = "JTC_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    pub tls_cert: Option<PathBuf>,
    /// Use the private key in this PEM file for the certificate.
    ///
    /// Only the owner and the group may have access to the file
    #[arg(long, env = "JTC_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    pub tls_key: Option<PathBuf>,
    /// Record each motion of every client to this directory
    #[arg(long, env = "JTC_RECORD", value_name = "DIR")]
    pub record: Option<PathBuf>,
    /// Limit the size of the recordings.
    ///
    /// When the recordings reach this size, the agent deletes the oldest recordings. The agent deletes only
    /// recordings of agents
    #[arg(long, env = "JTC_RECORD_LIMIT", value_name = "SIZE", default_value = "2GB", value_parser = record_size)]
    pub record_limit: u64,
    /// Let a PLC control the arm by Modbus TCP at this address.
    ///
    /// Modbus does not use tokens. Without --modbus-allow, only programs on this computer can connect
    #[arg(long, env = "JTC_MODBUS", value_name = "ADDRESS:PORT")]
    pub modbus: Option<SocketAddr>,
    /// Allow Modbus only from this address or network.
    ///
    /// An example of a network is 192.168.0.0/24. For several networks, repeat the option, or write commas between the
    /// networks
    #[arg(long, env = "JTC_MODBUS_ALLOW", value_name = "CIDR", value_delimiter = ',', requires = "modbus")]
    pub modbus_allow: Vec<Network>,
    #[command(flatten)]
    pub link: LinkArgs,
}

/// Parses the size limit of the recordings. The limit must be sufficient for some minutes of recording.
fn record_size(text: &str) -> Result<u64, String> {
    size(text, 10_000_000)
}

/// Parses the size limit of the command log. The limit must be sufficient for some thousand lines.
fn log_size(text: &str) -> Result<u64, String> {
    size(text, 1_000_000)
}
