//! Edge tables: what the words of a program's inputs, outputs and parameters mean (D-11). A file beside the tool, as no
//! board tells more than a text.

mod edge;
mod form;
mod given;
mod table;
mod value_error;

use crate::master::io::{IoDescription, Kind};
pub use edge::{Edge, EdgeType};
pub use given::{Given, GivenError};
pub use table::{EDGE_HELP, EdgeTable, EdgeTableError, ProgramEdges};
use ucom::Profile;
pub use value_error::ValueError;

/// The edges of one board, each with its meaning.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoardEdges {
    ci: Vec<Edge>,
    so: Vec<Edge>,
    par: Vec<Edge>,
}

impl BoardEdges {
    /// Those of a description; what the table does not know is a bare word.
    pub fn new(description: &IoDescription, program: Option<&ProgramEdges>, profile: &Profile) -> Self {
        let of = |kind: Kind| {
            let names = description.names(kind).iter().enumerate();
            let edge = |(i, name): (usize, &String)| {
                let known = program.and_then(|p| p.edge(kind, i, name));
                known.cloned().unwrap_or_else(|| Edge::bare(profile))
            };
            names.map(edge).collect()
        };
        Self { ci: of(Kind::Ci), so: of(Kind::So), par: of(Kind::Par) }
    }

    /// For a program that the given table does not know: only words themselves can be given, as numbers may be meant in
    /// units that nobody here knows.
    pub fn raw_only(mut self) -> Self {
        for edge in self.ci.iter_mut().chain(&mut self.so).chain(&mut self.par) {
            edge.raw_only = true;
        }
        self
    }

    /// All of one kind, in the order of the buffer.
    pub fn all(&self, kind: Kind) -> &[Edge] {
        match kind {
            Kind::Ci => &self.ci,
            Kind::So => &self.so,
            Kind::Par => &self.par,
        }
    }

    /// One edge; `None` beyond the dimension.
    pub fn get(&self, kind: Kind, index: usize) -> Option<&Edge> {
        self.all(kind).get(index)
    }

    #[cfg(test)]
    pub(crate) fn replace_par(&mut self, edge: Edge) {
        self.par.fill(edge);
    }
}
