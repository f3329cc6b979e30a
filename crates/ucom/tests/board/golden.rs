//! Tests that compare the frames of boards with the golden bytes of the protocol document, frame by frame.

use ucom::Profile;

use super::bus::{Bus, MS, frames};

/// Checks the frames that reset a chain of three boards and assign numbers to the boards.
#[test]
fn golden_chain_of_three() {
    let mut bus = Bus::new(&[0x21, 0x42, 0x63], Profile::default());
    assert_eq!(bus.ask("000#", 500), frames("441#21 482#42 4C3#63"));
    assert_eq!(bus.ask("281#", 20), frames("0C1#01"));
    let description = "141#0200 141#55436F4D32206865 141#61642070616E";
    assert_eq!(bus.ask("201#", 20), frames(&format!("141#2100011934126E38 {description}")));
    bus.send("1C1#0202");
    assert_eq!(bus.ask("201#", 20), frames(&format!("141#2100011B34126E38 {description}")));
    assert_eq!(bus.ask("282#", 20), frames("0C2#02"));
    assert_eq!(bus.ask("202#", 20)[0], frames("142#4200021934126E38")[0]);
    bus.send("1C2#0202");
    assert_eq!(bus.ask("202#", 20)[0], frames("142#4200021B34126E38")[0]);
    assert_eq!(bus.ask("283#", 20), frames("0C3#03"));
    assert_eq!(bus.ask("203#", 20)[0], frames("143#6300031934126E38")[0]);
    bus.send("1C3#0202");
    for _ in 0..3 {
        assert_eq!(bus.ask("284#", 100), []);
        assert_eq!(bus.ask("204#", 100), []);
    }
}

/// Checks the frames that start an application and its control loop.
#[test]
fn golden_start_and_run() {
    let mut bus = Bus::initialised();
    bus.send("680#");
    assert_eq!(bus.ask("301#", 50), frames("501# 681# 601#00000000"));
    assert_eq!(bus.ask("5C1#", 20), frames("6C1#0000000000000000"));
    bus.send("3C1#0000780005000100");
    bus.send("341#0000000000000000");
    bus.boards[0].application.so = vec![100, 101, 102, 103];
    bus.send("680#");
    bus.received.clear();
    bus.send("541#");
    let start = bus.now;
    bus.run(25);
    let received: Vec<_> =
        bus.received.iter().map(|(at, frame)| ((at - start) / (10 * MS), *frame)).collect();
    let outputs = frames("381#0000640065006600 381#0300670000000000");
    let expected =
        [(0, frames("601#01000000")[0]), (1, outputs[0]), (1, outputs[1]), (2, outputs[0]), (2, outputs[1])];
    assert_eq!(received, expected);
    bus.take();
    bus.send("601#01010000");
    bus.send("341#0000DC05ECFF0000");
    bus.run(4);
    assert!(bus.take().contains(&frames("601#01010000")[0]));
    assert_eq!(bus.boards[0].application.par, [120, 5, 1]);
    assert_eq!(bus.boards[0].application.latched_ci, [1500, 0xFFEC]);
    bus.run(1600);
    assert_eq!(bus.take().iter().filter(|frame| **frame == frames("601#00000000")[0]).count(), 1);
}
