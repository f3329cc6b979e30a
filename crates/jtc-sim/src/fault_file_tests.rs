//! Fault files: what is read, and what mistakes are told.
use proptest::prelude::*;

use super::*;

#[test]
fn the_documented_example_is_read() {
    let lines = FAULT_FILE_HELP.lines().skip_while(|l| *l != "```toml").skip(1);
    let text: Vec<_> = lines.take_while(|l| *l != "```").collect();
    let plan = FaultPlan::from_toml(&text.join("\n")).unwrap();
    let expected = [
        Fault { kind: FaultKind::NodeSilent { node: 2 }, trigger: Trigger::At(3500), duration_ms: Some(50) },
        Fault {
            kind: FaultKind::EncoderJump { joint: 1, rad: 0.3 },
            trigger: Trigger::InState(State::Operate, 1000),
            duration_ms: None,
        },
        Fault {
            kind: FaultKind::FramesLost { probability: 0.01 },
            trigger: Trigger::AtPoint(4000),
            duration_ms: Some(2000),
        },
    ];
    assert_eq!(plan.faults, expected);
}

#[test]
fn every_kind_is_read_by_its_own_name() {
    for kind in KINDS {
        let keys = "node = 1\njoint = 1\nbits = 4\nrad = 0.1\nfactor = 2\ncelsius = 30\nprobability = 0.5\n";
        // Take away what is too much until it fits: the messages name the keys.
        let mut keys: Vec<&str> = keys.lines().collect();
        let fault = loop {
            let text = format!("[[fault]]\nkind = \"{kind}\"\nat_s = 1\n{}", keys.join("\n"));
            match FaultPlan::from_toml(&text) {
                Ok(plan) => break plan.faults[0],
                Err(FaultFileError::Superfluous { key, .. }) => keys.retain(|line| !line.starts_with(key)),
                Err(error) => panic!("{error}"),
            }
        };
        assert_eq!(fault.kind.name(), kind);
    }
}

#[test]
fn mistakes_are_named() {
    let message = |text: &str| FaultPlan::from_toml(text).unwrap_err().to_string();
    for (text, part) in [
        ("[[fault]]\nkind = \"node-quiet\"\nat_s = 1", "there is no kind `node-quiet`"),
        ("[[fault]]\nkind = \"node-silent\"\nat_s = 1", "needs the key `node`"),
        ("[[fault]]\nkind = \"bus-off\"\nnode = 1\nat_s = 1", "`node` means nothing for `bus-off`"),
        ("[[fault]]\nkind = \"bus-off\"", "exactly one of at_s, in_state, at_point"),
        ("[[fault]]\nkind = \"bus-off\"\nat_s = 1\nat_point = 2", "exactly one of"),
        ("[[fault]]\nkind = \"bus-off\"\nin_state = \"holding\"", "there is no state `holding`"),
        ("[[fault]]\nkind = \"bus-off\"\nat_s = 1\nafter_s = 2", "`after_s` means nothing"),
        ("[[fault]]\nkind = \"frames-lost\"\nprobability = 2\nat_s = 1", "probability = 2 is outside 0..1"),
        ("[[fault]]\nkind = \"node-silent\"\nnode = 7\nat_s = 1", "node = 7 is outside 0..6"),
        ("[[fault]]\nkind = \"node-silent\"\nnode = 1.5\nat_s = 1", "node = 1.5 is not a whole number"),
        ("[[fault]]\nkind = \"bus-off\"\nat_s = nan", "at_s = NaN is outside"),
        ("[[fault]]\nkind = \"bus-off\"\nwhen = 3", "unknown field `when`"),
        ("fault = 3", "invalid type"),
    ] {
        let message = message(text);
        assert!(message.contains(part), "{text}\n→ {message}");
    }
    assert_eq!(FaultPlan::from_toml("").unwrap(), FaultPlan::default());
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(text in "(\\[\\[fault\\]\\]|kind = \"[a-z-]*\"|[a-z_]+ = -?[0-9.e]+|\\PC|\n){0,40}") {
        let _ = FaultPlan::from_toml(&text);
    }
}
