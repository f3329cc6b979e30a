//! The way to the controller: the port named, or the only one found.

use cli_kit::Failure;
use jtc_host::Session;
use jtc_host::port::{SerialPort, only_one};

use crate::args::LinkArgs;

impl LinkArgs {
    /// The port's name.
    pub fn name(&self) -> Result<String, Failure> {
        match &self.port {
            Some(port) => Ok(port.clone()),
            None => Ok(only_one()?),
        }
    }

    /// Opens the port.
    pub fn open(&self) -> Result<SerialPort, Failure> {
        Ok(SerialPort::open(&self.name()?, self.baud)?)
    }

    /// A conversation over it.
    pub fn session(&self) -> Result<Session<SerialPort>, Failure> {
        Ok(Session::new(self.open()?))
    }
}
