//! Link to the controller. The link uses the port that the user has specified, or the only port of the computer. If an agent has opened the
//! port, the link uses this agent.
use cli_kit::{ErrorKind, Failure};
use jtc_agent::access::Tokens;
use jtc_client::agents::{Registered, is_same_port, owner_of, registered};
use jtc_client::{AgentPort, Options};
use jtc_host::port::{SerialPort, only_one};
use jtc_host::{Port, PortError, Session};

use crate::args::LinkArgs;

/// Serial port, or connection to an agent.
pub(crate) type LinkPort = Box<dyn Port>;

impl LinkArgs {
    /// Returns the name of the port.
    pub(crate) fn name(&self) -> Result<String, Failure> {
        match &self.port {
            Some(port) => Ok(port.clone()),
            None => Ok(only_one()?),
        }
    }

    /// Opens the port, or connects to the agent that has opened the port.
    pub(crate) fn open(&self) -> Result<LinkPort, Failure> {
        self.open_with(None)
    }

    /// Like [`Self::open`]. `policy` defines what the agent does with a motion when this program disconnects.
    pub(crate) fn open_with(&self, policy: Option<&'static str>) -> Result<LinkPort, Failure> {
        Ok(self.open_as(policy, true)??)
    }

    /// Opens the link for a Stop or a Pause. An agent on this computer accepts both without a token, and even with an
    /// unknown token. If no agent of this user has opened the serial port and the port cannot be opened, the inner
    /// error contains the reason.
    pub(crate) fn open_to_halt(&self) -> Result<Result<LinkPort, PortError>, Failure> {
        self.open_as(None, true).or_else(|error| match error.kind {
            // The agent does not answer, so a second attempt would only waste time.
            ErrorKind::NoLink => Err(error),
            _ => self.open_as(None, false).map_err(|_| error),
        })
    }

    fn open_as(
        &self,
        policy: Option<&'static str>,
        with_token: bool,
    ) -> Result<Result<LinkPort, PortError>, Failure> {
        let name = self.name()?;
        if is_agent(&name) {
            let agent = registered().into_iter().find(|agent| agent.url == name.trim_end_matches('/'));
            let options = self.options(agent.as_ref(), policy, with_token)?;
            return Ok(Ok(Box::new(AgentPort::open(&name, &options)?)));
        }
        let Some(agent) = owner_of(&name) else {
            if let Some(policy) = policy.filter(|policy| *policy != "continue") {
                let what = format!(
                    "--when-gone {policy} needs an agent: over {name} a motion continues without this program"
                );
                return Err(Failure::nothing_sent(Failure::usage(what))
                    .next(format!("start an agent: `jtc serve --port {name}`")));
            }
            return Ok(SerialPort::open(&name, self.baud).map(|port| Box::new(port) as LinkPort));
        };
        let port = AgentPort::open(&agent.url, &self.options(Some(&agent), policy, with_token)?)?;
        if !is_same_port(&port.hello().port, &name) {
            let what = format!("{}: this agent owns {}, not {name}", agent.url, port.hello().port);
            return Err(Failure::nothing_sent(Failure::usage(what))
                .next("give the address of the agent with --port http://…"));
        }
        Ok(Ok(Box::new(port)))
    }

    /// Returns the name and token that this program sends to an agent. The program sends the token only to agents of this user, or if
    /// the user has specified a token file.
    fn options(
        &self,
        agent: Option<&Registered>,
        policy: Option<&'static str>,
        with_token: bool,
    ) -> Result<Options, Failure> {
        let file = self.token_file.as_ref().or(agent.map(|agent| &agent.token_file));
        let file = file.filter(|_| with_token);
        let token = file.map(|file| Tokens::load(file)).transpose()?.map(|tokens| tokens.operator);
        let certificates = self.tls_ca.clone().or_else(|| agent?.certificate.clone());
        Ok(Options { name: who(), token, policy, certificates })
    }

    /// Opens a session with the controller over the link.
    pub(crate) fn session(&self) -> Result<Session<LinkPort>, Failure> {
        Ok(Session::new(self.open()?))
    }

    /// Opens the serial port directly, for the program that will own the port.
    pub(crate) fn own(&self) -> Result<SerialPort, Failure> {
        let name = self.name()?;
        if is_agent(&name) {
            let what = format!("{name} is the address of an agent, but a serial port is needed");
            return Err(Failure::usage(what).next("give a serial port; `jtc ports` lists the ports"));
        }
        if let Some(agent) = owner_of(&name) {
            return Err(Failure::from(PortError::Busy { path: name })
                .next(format!("an agent owns the port: use `--port {}`", agent.url)));
        }
        // Other programs stop the arm through the agent, so this port needs no socket for Stops.
        Ok(SerialPort::open_without_door(&name, self.baud)?)
    }
}

/// Returns the name that other clients see for this program. The name contains the command and the user.
pub(crate) fn who() -> String {
    let command = std::env::args().skip(1).find(|word| !word.starts_with('-')).unwrap_or_default();
    match std::env::var("USER").or_else(|_| std::env::var("LOGNAME")) {
        Ok(user) if !user.is_empty() => format!("{user}: jtc {command}"),
        _ => format!("jtc {command}"),
    }
}

/// Returns `true` for the address of an agent, and `false` for a port of this computer.
fn is_agent(name: &str) -> bool {
    name.starts_with("http://") || name.starts_with("https://")
}
