//! Requests, in the form in which nodes receive them. Unlike requests of the controller, which use only four state
//! bytes, such a request can contain any state byte.
use jtc_bus::{Frame, NODES, NodeState, Request, id};

/// A request that has reached a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NodeRequest {
    /// ChangeFsm request, with the state byte of each node as transmitted.
    ChangeFsm([NodeState; NODES]),
    /// A request other than ChangeFsm.
    Other(Request),
}

impl NodeRequest {
    /// Returns the request in a frame. Returns `None` for answers and for frames that are not requests to nodes.
    pub fn parse(frame: &Frame) -> Option<Self> {
        if frame.id == id::CHANGE_FSM {
            // Missing bytes of a short frame count as 0, which does not request a change.
            let state = |n| NodeState::new(frame.data().get(n).copied().unwrap_or(0));
            return Some(Self::ChangeFsm(core::array::from_fn(state)));
        }
        Request::parse(frame).ok().map(Self::Other)
    }
}

impl From<Request> for NodeRequest {
    fn from(request: Request) -> Self {
        match request {
            Request::ChangeFsm { target } => {
                Self::ChangeFsm(target.map(|target| NodeState::new(target as u8)))
            }
            other => Self::Other(other),
        }
    }
}
