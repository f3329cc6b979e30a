//! Identifiers of the bus: `R U cccc nnnn` (J-11).
//!
//! Bit 9 marks a response and bit 8 a unicast frame. Bits 7..4 are the command, and bits 3..0 the node. A node answers with the identifier
//! of the request, its own number, and bit 9 set.

/// Bit 9: a node's response.
pub const RESPONSE: u16 = 0x200;
/// Bit 8: addressed to one node.
pub const UNICAST: u16 = 0x100;

/// Torques and pump, broadcast.
pub const MOVE: u16 = 0x000;
/// Requested states, broadcast.
pub const CHANGE_FSM: u16 = 0x010;
/// Reset of every node, broadcast, without an answer.
pub const RESET_ALL: u16 = 0x0A0;
/// Working mode and configuration bits, broadcast.
pub const CHANGE_MODE: u16 = 0x0F0;
/// Reset of node 0. The identifiers of the other nodes follow. There is no answer.
pub const RESET: u16 = RESET_ALL | UNICAST;

/// Answer of node 0 to Move. The identifiers of the other nodes follow.
pub const MOVE_ANSWER: u16 = answer(MOVE, 0);
/// Answer of node 0 to ChangeFsm. The identifiers of the other nodes follow.
pub const FSM_ANSWER: u16 = answer(CHANGE_FSM, 0);
/// Answer of node 0 to ChangeMode. The identifiers of the other nodes follow.
pub const MODE_ANSWER: u16 = answer(CHANGE_MODE, 0);

/// Returns the id of the answer of `node` (0..6) to a request.
pub const fn answer(request: u16, node: u8) -> u16 {
    request | on_wire(node) | RESPONSE
}

/// Returns the identifier without its node: `R U cccc 0000`.
pub const fn command(id: u16) -> u16 {
    id & !0x00F
}

/// Returns the node number, 0..15.
pub const fn node(id: u16) -> u8 {
    (id & 0x00F) as u8
}

/// Returns the node bits for a node number. A number that does not exist becomes 15, which is not used by any node, so that it never
/// becomes the number of another node.
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
