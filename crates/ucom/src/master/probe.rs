//! Measures what boards read otherwise.

use super::link::Link;
use super::{Error, Outcome};

/// How to probe.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProbeOptions {}

/// What a probe found.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeReport {}

pub(crate) async fn probe(_link: Link, _options: ProbeOptions) -> Result<Outcome, Error> {
    Ok(Outcome::Probe(ProbeReport {}))
}
