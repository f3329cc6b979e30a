//! Identifiers of the bus, with the bits `R U cccc nnnn` (J-11).
//!
//! Bit 9 marks a response and bit 8 a unicast frame. Bits 7..4 are the command, and bits 3..0 are the node number. The identifier of an
//! answer is the identifier of the request with bit 9 set and the number of the node.

/// Bit 9, which is set in the response of a node.
pub const RESPONSE: u16 = 0x200;
/// Bit 8, which is set if the frame is addressed to one node.
pub const UNICAST: u16 = 0x100;

/// Broadcast with the torques and the state of the pump.
pub const MOVE: u16 = 0x000;
/// Requested states, broadcast.
pub const CHANGE_FSM: u16 = 0x010;
/// Broadcast that resets every node. Nodes do not answer.
pub const RESET_ALL: u16 = 0x0A0;
/// Broadcast with the working mode and configuration bits.
pub const CHANGE_MODE: u16 = 0x0F0;
/// Reset of node 0. The identifiers for nodes 1..6 are the numbers that follow. The node does not answer.
pub const RESET: u16 = RESET_ALL | UNICAST;

/// Answer of node 0 to Move. The identifiers of nodes 1..6 are the numbers that follow.
pub const MOVE_ANSWER: u16 = answer(MOVE, 0);
/// Answer of node 0 to ChangeFsm. The identifiers of nodes 1..6 are the numbers that follow.
pub const FSM_ANSWER: u16 = answer(CHANGE_FSM, 0);
/// Answer of node 0 to ChangeMode. The identifiers of nodes 1..6 are the numbers that follow.
pub const MODE_ANSWER: u16 = answer(CHANGE_MODE, 0);

/// Returns the id of the answer of `node` (0..6) to a request.
pub const fn answer(request: u16, node: u8) -> u16 {
    request | on_wire(node) | RESPONSE
}

/// Returns the identifier without the node number (`R U cccc 0000`).
pub const fn command(id: u16) -> u16 {
    id & !0x00F
}

/// Returns the node number, 0..15.
pub const fn node(id: u16) -> u8 {
    (id & 0x00F) as u8
}

/// Returns the node bits of the identifier for a node number. For an invalid number, the function returns 15. No node has number 15, so
/// the frame does not reach a wrong node.
pub(crate) const fn on_wire(node: u8) -> u16 {
    if (node as usize) < crate::NODES { node as u16 } else { 0x00F }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j11_ids_are_those_of_the_table() {
        assert_eq!((MOVE, CHANGE_FSM, CHANGE_MODE), (0x000, 0x010, 0x0F0));
        assert_eq!((RESET_ALL, RESET), (0x0A0, 0x1A0));
        assert_eq!((MOVE_ANSWER, FSM_ANSWER, MODE_ANSWER), (0x200, 0x210, 0x2F0));
    }

    #[test]
    fn j11_an_answer_has_the_requests_id_the_node_and_bit_9() {
        for request in [MOVE, CHANGE_FSM, CHANGE_MODE] {
            for n in 0..crate::NODES as u8 {
                let id = answer(request, n);
                assert_eq!(id, request + 0x200 + u16::from(n));
                assert_eq!(command(id), request | RESPONSE);
                assert_eq!(node(id), n);
            }
        }
    }
}
