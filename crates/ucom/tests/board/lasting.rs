//! Tests of how often a board writes its non-volatile memory.

use ucom::Frame;
use ucom::node::{Node, NodeConfig, Store};
use ucom_sim::memory::{MemoryFlash, WirePins};

use super::bus::application;

/// Non-volatile memory that stores ASTART and counts the writes.
#[derive(Default)]
struct Counted {
    autostart: bool,
    writes: u32,
}

impl Store for Counted {
    fn autostart(&self) -> bool {
        self.autostart
    }

    fn set_autostart(&mut self, on: bool) {
        self.autostart = on;
        self.writes += 1;
    }

    fn description(&self) -> &[u8] {
        b""
    }
}

/// D-22 and the contract of [`Store::set_autostart`]: the board writes non-volatile memory only if the value of ASTART changes, because
/// each write causes wear.
#[test]
fn d22_autostart_is_kept_on_changes_only() {
    let pins = WirePins::chain(1).remove(0);
    let config = NodeConfig::new(0x21);
    let mut board = Node::new(config, MemoryFlash::default(), pins, Counted::default(), application(), 0);
    let now = config.boot_us;
    board.receive(now, &"281#".parse::<Frame>().unwrap());
    let ack = board.poll(now).unwrap();
    board.sent(now, &ack);
    for (text, autostart, writes) in [
        ("1C1#0202", false, 0),
        ("1C1#4000", false, 0),
        ("1C1#0040", true, 1),
        ("1C1#4040", true, 1),
        ("1C1#0200", true, 1),
        ("1C1#4000", false, 2),
        ("1C1#4000", false, 2),
        // This PC_SETSTATUS clears INIT (mask 0x08) and sets ASTART (value 0x40). The board stores ASTART although it
        // loses its number.
        ("1C1#0840", true, 3),
    ] {
        board.receive(now, &text.parse::<Frame>().unwrap());
        assert_eq!((board.store.autostart, board.store.writes), (autostart, writes), "{text}");
    }
}
