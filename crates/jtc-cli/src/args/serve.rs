//! `jtc serve`: the agent.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
use clap::builder::FalseyValueParser;

use super::LinkArgs;

/// Options of `jtc serve`.
#[derive(Args, Debug)]
pub struct ServeArgs {
    /// A simulated controller instead of a port
    #[arg(long, env = "JTC_SIM", value_parser = FalseyValueParser::new(), conflicts_with = "port")]
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
    /// File to which each command is appended: who, what, when, result
    #[arg(long, env = "JTC_COMMAND_LOG", value_name = "FILE")]
    pub command_log: Option<PathBuf>,
    /// Directory that keeps trajectories by number, as files like 7-pick.csv; without it they are kept as long as the agent runs
    #[arg(long, env = "JTC_TRAJECTORIES", value_name = "DIR")]
    pub trajectories: Option<PathBuf>,
    /// Certificate chain, PEM: the agent speaks TLS
    #[arg(long, env = "JTC_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    pub tls_cert: Option<PathBuf>,
    /// Private key of that certificate, PEM; no other user may read it
    #[arg(long, env = "JTC_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    pub tls_key: Option<PathBuf>,
    #[command(flatten)]
    pub link: LinkArgs,
}
