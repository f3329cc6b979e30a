//! Tests of inventories: accepted files, refused files, and flash records.
use proptest::prelude::*;

use super::*;

fn board(number: u8, flash_number: u16) -> InventoryBoard {
    InventoryBoard { number, flash_number, ..Default::default() }
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = |text: &str| Inventory::parse(text).unwrap_err().to_string();
    assert!(refused("[[board]]\nnumber = 32\nflash_number = 1").contains("above 31"));
    let twice = "[[board]]\nnumber = 1\nflash_number = 1\n[[board]]\nnumber = 1\nflash_number = 2";
    assert!(refused(twice).contains("board 1 has two entries"));
    let same = "[[board]]\nnumber = 1\nflash_number = 7\n[[board]]\nnumber = 2\nflash_number = 7";
    assert!(refused(same).contains("0x0007") && refused(same).contains("boards 1 and 2"));
    assert!(refused("[[board]]\nnumber = 1\nflash_number = 1\nposition = 2").contains("position"));
    assert!(refused("[[bord]]").contains("line 1"));
}

#[test]
fn names_stay_with_their_board() {
    let mut old = Inventory::default();
    old.insert(InventoryBoard { name: "head pan".into(), ..board(1, 0x21) }).unwrap();
    let mut new = Inventory::default();
    new.insert(board(1, 0x42)).unwrap();
    new.insert(board(2, 0x21)).unwrap();
    new.keep(&old);
    assert_eq!(new.get(2).unwrap().name, "head pan");
    assert_eq!(new.get(1).unwrap().name, "");
}

fn record(flash_number: u16) -> FlashRecord {
    FlashRecord { flash_number, sha256: [0xA5; 32], address: 0x200, program_id: 0x4B3F, date: 0x3AC1 }
}

/// D-62: a flash record is set and removed in the text of the file, and nothing else in the file changes.
#[test]
fn d62_a_record_changes_one_key_of_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("inventory.toml");
    let texts = [
        "# left arm, cabinet 3\n[[board]] # first\nnumber = 1\nflash_number = 0x21 # new since May\n\n[[board]]\nflash_number = 0x42\nnumber = 2\nname = 'pan'\n",
        "[[board]]\nnumber = 1\nflash_number = 33\n# after it\n",
        "board = [\n  { number = 1, flash_number = 0x0021 }, # in line\n  { number = 2, flash_number = 0x42 },\n]\n",
    ];
    for text in texts {
        std::fs::write(&path, text).unwrap();
        Inventory::set_record(&path, 0x21, Some(record(0x21))).unwrap();
        let read = Inventory::read(&path).unwrap();
        assert_eq!(read.get(1).unwrap().record(), Some(record(0x21)));
        assert!(read.get(2).is_none_or(|board| board.record().is_none()));
        // The flash record is set again, and an init does not remove this record.
        Inventory::set_record(&path, 0x21, Some(FlashRecord { address: 0, ..record(0x21) })).unwrap();
        let again = Inventory::read(&path).unwrap();
        assert_eq!(again.get(1).unwrap().record().map(|r| r.address), Some(0));
        assert_eq!(Inventory::parse(&again.to_toml()).unwrap(), again);
        let mut made = Inventory::default();
        made.insert(board(7, 0x21)).unwrap();
        made.keep(&again);
        assert!(made.get(7).unwrap().record().is_some());
        assert!(made.without_records().get(7).unwrap().record().is_none());
        // The flash record is removed. A second removal of the record has no effect.
        for _ in 0..2 {
            Inventory::set_record(&path, 0x21, None).unwrap();
            let left = std::fs::read_to_string(&path).unwrap();
            let plain = |text: &str| text.replace([' ', '\n'], "");
            assert_eq!(plain(&left), plain(text));
        }
        // No flash record is stored for a board that the file does not list.
        Inventory::set_record(&path, 0x77, Some(record(0x77))).unwrap();
        assert!(!std::fs::read_to_string(&path).unwrap().contains("sha256"));
    }
    assert!(Inventory::set_record(&dir.path().join("nowhere"), 0x21, None).is_err());
}

/// D-62: a flash record that was copied to another board is not used, and a damaged record is refused.
#[test]
fn d62_a_record_belongs_to_one_board() {
    let with = |record: &str| format!("[[board]]\nnumber = 1\nflash_number = 0x42\nprogram = {record}\n");
    let of = |flash_number| with(&record(flash_number).to_toml());
    assert_eq!(Inventory::parse(&of(0x42)).unwrap().get(1).unwrap().record(), Some(record(0x42)));
    assert_eq!(Inventory::parse(&of(0x21)).unwrap().get(1).unwrap().record(), None);
    let good = record(0x42).to_toml();
    let damaged = [
        good.replace("a5a5", "a5"),
        good.replacen("a5", "xy", 1),
        good.replacen("a5", "+5", 1),
        good.replace("a5a5", "a5a5a5"),
        good.replace("sha256", "sha1"),
        good.replace("0x200", "-1"),
        good.replace("0x200", "0x100000000"),
        good.replace("0x4B3F", "0x14B3F"),
        good.replace("date", "day"),
        "7".into(),
    ];
    for damaged in damaged {
        assert!(Inventory::parse(&with(&damaged)).is_err(), "{damaged}");
    }
}

/// Returns an inventory of boards with these numbers and flash numbers.
fn chain(boards: &[(u8, u16)]) -> Inventory {
    let mut inventory = Inventory::default();
    for (number, flash_number) in boards {
        inventory.insert(board(*number, *flash_number)).unwrap();
    }
    inventory
}

/// A file that already contains the inventory is not written. In other files only the values that differ are changed.
#[test]
fn an_init_keeps_the_comments_of_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("inventory.toml");
    let text = "# left arm, cabinet 3\n\n# the shoulder\n[[board]] # first\nnumber = 1 # new since May\nflash_number = 33\n\n\
                [[board]]\nflash_number = 0x0042 # spare\nnumber = 2\nname = 'pan'\n# the end\n";
    let mut same = chain(&[(1, 0x21)]);
    same.insert(InventoryBoard { name: "pan".into(), ..board(2, 0x42) }).unwrap();
    for text in [text.to_owned(), text.replace('\n', "\r\n"), format!("\u{feff}{text}")] {
        std::fs::write(&path, &text).unwrap();
        assert!(!same.write(&path).unwrap());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        // The boards have changed places, and a third board was added.
        let mut new = chain(&[(2, 0x21), (3, 0x63)]);
        let described =
            InventoryBoard { description: "UCoM2 \"pan\"".into(), name: "pan".into(), ..board(1, 0x42) };
        new.insert(described).unwrap();
        assert!(new.write(&path).unwrap());
        let after = std::fs::read_to_string(&path).unwrap();
        assert_eq!(Inventory::read(&path).unwrap(), new, "{after}");
        assert_eq!(after.contains("\r\n"), text.contains("\r\n"));
        assert_eq!(after.starts_with('\u{feff}'), text.starts_with('\u{feff}'));
        for comment in
            ["# left arm, cabinet 3", "# the shoulder", "# first", "# new since May", "# spare", "# the end"]
        {
            assert_eq!(after.matches(comment).count(), 1, "{comment}: {after}");
        }
        let places: Vec<usize> = ["0x0042", "33", "0x0063"].iter().map(|f| after.find(f).unwrap()).collect();
        assert!(places.is_sorted(), "{after}");
        // Board 1 was replaced, and board 3 was removed. A replaced board has no name.
        let fewer = chain(&[(1, 0x77), (2, 0x21)]);
        assert!(fewer.write(&path).unwrap());
        let after = std::fs::read_to_string(&path).unwrap();
        assert_eq!(Inventory::read(&path).unwrap(), fewer, "{after}");
        assert!(
            after.contains("# new since May") && after.contains("# left arm") && !after.contains("pan"),
            "{after}"
        );
    }
    for odd in [
        "",
        "\n",
        "# only a comment\n",
        "board = [ { number = 1, flash_number = 0x42 } ] # in line\n",
        "board = []\n",
    ] {
        std::fs::write(&path, odd).unwrap();
        assert!(same.write(&path).unwrap());
        assert_eq!(Inventory::read(&path).unwrap(), same, "{odd}");
    }
    assert!(std::fs::read_to_string(&path).is_ok_and(|text| !text.contains("board = []")));
    std::fs::write(&path, "[[board]]\nnumber = 1\nflash_number = 1\nspare = true\n").unwrap();
    assert!(same.write(&path).is_err());
}

proptest! {
    /// An edit results in the new inventory, whatever the file contains. A second edit does not write the file.
    #[test]
    fn an_edit_leads_to_the_inventory(
        old in prop::collection::btree_map(0_u8..8, (0_u16..12, ".{0,4}"), 0..8),
        new in prop::collection::btree_map(0_u8..8, (0_u16..12, ".{0,4}"), 0..8),
    ) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("inventory.toml");
        let of = |boards: &std::collections::BTreeMap<u8, (u16, String)>| {
            let mut inventory = Inventory::default();
            for (number, (flash, text)) in boards {
                // A flash number that is already in the chain is left out.
                let named = InventoryBoard { name: text.clone(), description: text.clone(), ..board(*number, *flash) };
                let _ = inventory.insert(named);
            }
            inventory
        };
        let (old, new) = (of(&old), of(&new));
        old.write(&path).unwrap();
        new.write(&path).unwrap();
        prop_assert_eq!(&Inventory::read(&path).unwrap(), &new);
        prop_assert!(!new.write(&path).unwrap());
    }

    #[test]
    fn round_trip(boards in prop::collection::btree_map(0_u8..32, (any::<u16>(), any::<String>()), 0..32)) {
        let mut inventory = Inventory::default();
        for (number, (flash, text)) in boards {
            let flash = flash & 0xFFE0 | u16::from(number);
            inventory.insert(InventoryBoard { description: text, ..board(number, flash) }).unwrap();
        }
        prop_assert_eq!(Inventory::parse(&inventory.to_toml()).unwrap(), inventory);
    }
}
