//! `jtc serve`: the agent.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
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
    /// Print the link of the dashboard with the operator's token, which is otherwise printed once, when it is made
    #[arg(id = "link_with_token", long = "link")]
    pub link_with_token: bool,
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
    /// Directory for recordings: one of each motion, whoever commanded it
    #[arg(long, env = "JTC_RECORD", value_name = "DIR")]
    pub record: Option<PathBuf>,
    /// Room that recordings take at most: the oldest of this directory's agents are removed first
    #[arg(long, env = "JTC_RECORD_LIMIT", value_name = "SIZE", default_value = "2GB", value_parser = size)]
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

/// Least room for recordings: some minutes.
const SIZE_MIN: u64 = 10_000_000;

/// Bytes, as `500MB`, `2 GB`, `1GiB` or a plain number.
fn size(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let factor: f64 = match unit.trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        "kib" => 1024.0,
        "mib" => 1024_f64.powi(2),
        "gib" => 1024_f64.powi(3),
        "tib" => 1024_f64.powi(4),
        unit => {
            return Err(format!("{unit:?} is no unit of a size: B, kB, MB, GB, TB, KiB, MiB, GiB or TiB"));
        }
    };
    let number: f64 = number.parse().map_err(|_| "a size is a number and its unit, as 500MB".to_owned())?;
    let bytes = (number * factor) as u64;
    if bytes < SIZE_MIN { Err("recordings need 10MB at least".into()) } else { Ok(bytes) }
}

#[cfg(test)]
mod tests {
    use super::size;

    #[test]
    fn sizes_are_read_with_their_units() {
        for (text, bytes) in [
            ("2GB", 2_000_000_000),
            ("1.5 gb", 1_500_000_000),
            ("64MiB", 64 << 20),
            ("10000000", 10_000_000),
            ("50000kB", 50_000_000),
        ] {
            assert_eq!(size(text), Ok(bytes), "{text}");
        }
        for text in ["", "GB", "2 parsec", "-1GB", "9MB", "1e9", "NaN"] {
            assert!(size(text).is_err(), "{text}");
        }
    }
}
