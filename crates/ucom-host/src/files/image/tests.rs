//! Tests with the published examples of the file formats, and with encoders in this file that follow the rules of the
//! formats.

use proptest::prelude::*;
use std::panic;

use super::*;

fn parse(text: &str) -> Result<Image, ImageError> {
    Image::parse(text.as_bytes(), &ImageOptions::default())
}

fn problem(text: &str) -> (usize, usize, LineProblem) {
    let read = parse(text).map_err(|error| match error {
        ImageError::OtherUnit { error, .. } => *error,
        error => error,
    });
    match read {
        Err(ImageError::Line { line, column, problem }) => (line, column, problem),
        other => panic!("{other:?}"),
    }
}

fn hex_line(address: u16, kind: u8, data: &[u8]) -> String {
    let mut bytes = vec![data.len() as u8, (address >> 8) as u8, address as u8, kind];
    bytes.extend(data);
    let sum = bytes.iter().map(|b| u32::from(*b)).sum::<u32>();
    bytes.push((256 - sum % 256) as u8);
    format!(":{}\n", bytes.iter().map(|b| format!("{b:02X}")).collect::<String>())
}

fn s_line(kind: u8, width: usize, address: u32, data: &[u8]) -> String {
    let mut bytes = vec![(width + data.len() + 1) as u8];
    bytes.extend(&address.to_be_bytes()[4 - width..]);
    bytes.extend(data);
    let sum = bytes.iter().map(|b| u32::from(*b)).sum::<u32>();
    bytes.push(255 - (sum % 256) as u8);
    format!("S{kind}{}\n", bytes.iter().map(|b| format!("{b:02X}")).collect::<String>())
}

#[test]
fn intel_hex_as_published() {
    // The text is the example on the format's Wikipedia page. The addresses in this example count bytes.
    let text = ":10010000214601360121470136007EFE09D2190140\n\
                :100110002146017E17C20001FF5F16002148011928\n\
                :10012000194E79234623965778239EDA3F01B2CAA7\n\
                :100130003F0156702B5E712B722B732146013421C7\n\
                :00000001FF\n";
    let image = parse(text).unwrap();
    assert_eq!((image.format(), image.address_words(), image.length_words()), (Format::IntelHex, 0x80, 32));
    assert_eq!(image.bytes()[..4], [0x21, 0x46, 0x01, 0x36]);
    assert!(image.notes().is_empty());
}

#[test]
fn s_records_as_published_count_words_here() {
    // The text is the completed example on the format's manual page. The records of the example have no gap if their addresses count bytes,
    // and one gap if they count words.
    let text = "S00F000068656C6C6F202020202000003C\n\
                S11F00007C0802A6900100049421FFF07C6C1B787C8C23783C6000003863000026\n\
                S11F001C4BFFFFE5398000007D83637880010014382100107C0803A64E800020E9\n\
                S111003848656C6C6F20776F726C642E0A0042\n\
                S5030003F9\n\
                S9030000FC\n";
    let words = ImageOptions { address_unit: Some(AddressUnit::Word), ..Default::default() };
    let gap = Image::parse(text.as_bytes(), &words);
    assert!(matches!(gap, Err(ImageError::Gap { address_words: 14, bytes: 28 })));
    let options = ImageOptions { address_unit: Some(AddressUnit::Byte), ..Default::default() };
    let image = Image::parse(text.as_bytes(), &options).unwrap();
    assert_eq!(image.bytes().len(), 70);
    assert!(image.bytes().ends_with(b"Hello world.\n\0"));
    assert_eq!(
        problem(&text.replace("S5030003F9", "S5030002FA")).2,
        LineProblem::Count { declared: 2, has: 3 }
    );
}

/// Records show the unit of their addresses if they follow one another without gaps in only one of the two units. A
/// file with only one or two records does not show the unit.
#[test]
fn the_unit_of_addresses_is_taken_from_the_records() {
    let bytes: Vec<u8> = (0..64).map(|i| i * 3 + 1).collect();
    let file = |count: usize, length: usize, step: u32| {
        let lines = bytes.chunks(length).take(count).zip(0..);
        lines.map(|(data, i)| s_line(1, 2, 0x100 + i * step, data)).collect::<String>()
            + &s_line(9, 2, 0, &[])
    };
    let read = |text: &str| {
        let image = parse(text)?;
        let unit = image.address_unit(&ImageOptions::default());
        Ok::<_, ImageError>((image.address_words(), image.bytes().to_vec(), unit, image.notes().to_vec()))
    };
    let in_words = read(&file(4, 16, 8)).unwrap();
    assert_eq!(in_words, (0x100, bytes.clone(), Some(AddressUnit::Word), vec![]));
    let in_bytes = read(&file(4, 16, 16)).unwrap();
    let note = ImageNote::AddressesCount(AddressUnit::Byte);
    assert_eq!(in_bytes, (0x80, bytes.clone(), Some(AddressUnit::Byte), vec![note]));
    // The gap between the records may be intended, or the addresses may have another unit. The reader does not guess.
    let other = |text: &str| match read(text) {
        Err(ImageError::OtherUnit { error, unit: AddressUnit::Byte }) => error.to_string(),
        other => panic!("{other:?}"),
    };
    assert_eq!(other(&file(2, 16, 16)), "no record contains the 16 bytes at word address 0x108");
    // The file is a table of interrupt vectors: two words, then a gap of two words.
    assert_eq!(other(&file(16, 4, 4)), "no record contains the 4 bytes at word address 0x102");
    // The addresses of this Intel HEX file count words. If the reader interprets these addresses as byte addresses, the data overlap.
    let lines = bytes.chunks(16).zip(0..).map(|(data, i)| hex_line(0x100 + i * 8, 0, data));
    let hex = lines.collect::<String>() + ":00000001FF\n";
    let note = ImageNote::AddressesCount(AddressUnit::Word);
    assert_eq!(read(&hex).unwrap(), (0x100, bytes.clone(), Some(AddressUnit::Word), vec![note]));
}

#[test]
fn what_is_wrong_is_named_with_line_and_column() {
    let good = hex_line(0, 0, &[1, 2, 3, 4]) + ":00000001FF\n";
    assert!(parse(&good).is_ok());
    assert_eq!(problem(&good.replace("0102", "0103")).2, LineProblem::Checksum { has: 0xF2, should: 0xF1 });
    assert_eq!(problem(&good.replace(":00000001FF", "nonsense")).0, 2);
    assert_eq!(problem(&good.replace(":00000001FF", ":000000G1FF")), (2, 8, LineProblem::Digit));
    assert_eq!(problem(&good.replace(":04", ":05")), (1, 2, LineProblem::Length { declared: 5, has: 4 }));
    let twice = hex_line(0, 0, &[1, 2]) + &hex_line(1, 0, &[9, 2]) + ":00000001FF\n";
    assert_eq!(problem(&twice), (2, 1, LineProblem::Overlap { address: 1 }));
    assert!(matches!(parse(&hex_line(0, 0, &[1, 2])), Err(ImageError::NoEnd { lines: 1, .. })));
    let far =
        hex_line(0, 0, &[1, 2]) + &hex_line(0, 4, &[0x12, 0]) + &hex_line(0, 0, &[1, 2]) + ":00000001FF";
    assert!(matches!(problem(&far).2, LineProblem::TooLarge { limit: MAX_BYTES, from: 0, .. }));
    assert!(matches!(Image::parse(b"", &Default::default()), Err(ImageError::Empty)));
    assert!(matches!(Image::parse(b"\x7fELF..", &Default::default()), Err(ImageError::Elf)));
    let options = ImageOptions { max_bytes: 3, ..Default::default() };
    let large = Image::parse(&[0; 4], &options);
    assert!(matches!(large, Err(ImageError::TooLarge { bytes: 4, limit: 3 })));
}

#[test]
fn gaps_are_refused_or_filled_with_a_word() {
    let text = hex_line(0x10, 0, &[1, 2]) + &hex_line(0x16, 0, &[3, 4]) + ":00000001FF\n";
    assert!(matches!(parse(&text), Err(ImageError::Gap { address_words: 9, bytes: 4 })));
    let fill = |with, text: &str| {
        let options = ImageOptions { gaps: Gaps::Fill(with), ..Default::default() };
        Image::parse(text.as_bytes(), &options).unwrap()
    };
    for with in [0xFF, 0x00, 0x3E] {
        let image = fill(with, &text);
        assert_eq!(image.bytes(), [1, 2, with, with, with, with, 3, 4]);
        assert_eq!(image.notes(), [ImageNote::GapFilled { address_words: 9, bytes: 4, with }]);
    }
    // Records that follow each other in bytes, but not in words: with one real gap, the unit is not clear.
    let far =
        [0, 0x10, 0x20, 0x80, 0x90].map(|at| s_line(1, 2, at, &[7; 16])).concat() + &s_line(9, 2, 0, &[]);
    let options = ImageOptions { gaps: Gaps::Fill(0xFF), ..Default::default() };
    let refused = Image::parse(far.as_bytes(), &options);
    assert!(matches!(refused, Err(ImageError::OtherUnit { unit: AddressUnit::Byte, .. })), "{refused:?}");
    let bytes = ImageOptions { address_unit: Some(AddressUnit::Byte), ..options };
    assert_eq!(Image::parse(far.as_bytes(), &bytes).unwrap().bytes().len(), 160);
    // Half a word can be missing before the first record and after the last record.
    let odd = hex_line(0x11, 0, &[1, 2]) + ":00000001FF\n";
    assert_eq!(parse(&odd).unwrap_err().to_string(), "no record contains the 1 byte at word address 0x8");
    let image = fill(0xAA, &odd);
    assert_eq!((image.bytes(), image.address_words()), (&[0xAA, 1, 2, 0xAA][..], 8));
    let notes = [
        ImageNote::GapFilled { address_words: 8, bytes: 1, with: 0xAA },
        ImageNote::LastWordPadded { with: 0xAA },
    ];
    assert_eq!(image.notes(), notes);
}

/// DOS tools end a file with ^Z, and some programmers fill a file with NUL. These characters are ignored only after the end of the
/// records.
#[test]
fn padding_after_the_end_record_is_ignored() {
    let hex = hex_line(0, 0, &[1, 2]) + ":00000001FF";
    let srec = s_line(1, 2, 0, &[1, 2]) + &s_line(9, 2, 0, &[]);
    let counted = s_line(1, 2, 0, &[1, 2]) + &s_line(5, 2, 1, &[]);
    for text in [&hex, &srec, &counted] {
        for end in ["\x1a", "\r\n\x1a", "\0\0\0", "\n\0\0\x1a\r\n\0 "] {
            assert_eq!(parse(&format!("{text}{end}")).unwrap().bytes(), [1, 2], "{text:?} {end:?}");
        }
        for end in ["\n\x1aEND", "\n\0\0:\n", "\nmade by hand\x1a"] {
            assert!(matches!(parse(&format!("{text}{end}")), Err(ImageError::Line { .. })), "{end:?}");
        }
    }
    for cut in [hex_line(0, 0, &[1, 2]) + "\0\0", s_line(1, 2, 0, &[1, 2]) + "\x1a"] {
        assert!(matches!(parse(&cut), Err(ImageError::NoEnd { lines: 1, .. })), "{cut:?}");
    }
    let inside = hex_line(0, 0, &[1, 2]) + "\x1a\n:00000001FF";
    assert_eq!(problem(&inside), (2, 1, LineProblem::Start { expected: ':' }));
}

/// A line ends with LF, CR LF or CR. Errors contain the right line in each case.
#[test]
fn a_carriage_return_ends_a_line() {
    for end in ["\n", "\r\n", "\r"] {
        let text = (hex_line(0, 0, &[1, 2]) + &hex_line(2, 0, &[3, 4]) + ":00000001FF\n").replace('\n', end);
        assert_eq!(parse(&text).unwrap().bytes(), [1, 2, 3, 4], "{end:?}");
        let text = (s_line(1, 2, 0, &[1, 2]) + &s_line(9, 2, 0, &[])).replace('\n', end);
        assert_eq!(parse(&text).unwrap().bytes(), [1, 2], "{end:?}");
        let wrong = (hex_line(0, 0, &[1, 2]) + "\n" + &hex_line(2, 0, &[3, 4]) + "x\n").replace('\n', end);
        assert_eq!(problem(&wrong), (4, 1, LineProblem::Start { expected: ':' }), "{end:?}");
    }
}

#[test]
fn raw_bytes_are_whole_words() {
    let image = Image::parse(&[1, 2, 3], &Default::default()).unwrap();
    assert_eq!(
        (image.bytes(), image.notes()),
        (&[1, 2, 3, 0xFF][..], &[ImageNote::LastWordPadded { with: 0xFF }][..])
    );
    let options = ImageOptions { swap_bytes: true, load_address_words: Some(7), ..Default::default() };
    let image = Image::parse(&[1, 2, 3, 4], &options).unwrap();
    assert_eq!((image.bytes(), image.address_words()), (&[2, 1, 4, 3][..], 7));
    let options = ImageOptions { load_address_words: Some(u32::MAX), ..Default::default() };
    assert!(matches!(Image::parse(&[1, 2], &options), Err(ImageError::AddressRange { .. })));
    // The reader does not read records as raw bytes, even on request.
    let forced = ImageOptions { format: Some(Format::Bin), ..Default::default() };
    assert!(matches!(Image::parse(b":00000001FF\n", &forced), Err(ImageError::WasRecords { .. })));
}

/// Without a format option, the reader refuses a text in a file with any name. An error in a record contains the position of the record.
#[test]
fn a_text_is_no_image() {
    let hex = hex_line(0, 0, &[1, 2, 3, 4]) + ":00000001FF\n";
    let srec = s_line(1, 2, 0, &[1, 2, 3, 4]) + &s_line(9, 2, 0, &[]);
    let dir = tempfile::tempdir().unwrap();
    let read = |name: &str, content: &[u8]| {
        let path = dir.path().join(name);
        std::fs::write(&path, content).unwrap();
        Image::read(&path, &ImageOptions::default())
    };
    for name in ["a.hex", "a.s19", "a.bin", "a.txt", "a"] {
        assert_eq!(read(name, hex.as_bytes()).unwrap().format(), Format::IntelHex, "{name}: by content");
        assert_eq!(read(name, srec.as_bytes()).unwrap().format(), Format::SRecord, "{name}: by content");
        for comment in ["; made by a linker\n", "# x\n", "// x\n"] {
            let wrong = read(name, (comment.to_owned() + &hex).as_bytes());
            let place = ImageError::line(1, 1, LineProblem::Start { expected: ':' });
            assert_eq!(wrong.unwrap_err().to_string(), place.to_string(), "{name} {comment}");
            let wrong = read(name, (srec.clone() + comment).as_bytes()).unwrap_err().to_string();
            assert!(wrong.starts_with("line 3, column 1: "), "{name} {comment}: {wrong}");
        }
        for mark in [&b"\xEF\xBB\xBF"[..], b"\xFF\xFE"] {
            let wrong = read(name, &[mark, hex.as_bytes()].concat());
            assert!(matches!(wrong, Err(ImageError::ByteOrderMark { .. })), "{name}: {wrong:?}");
        }
        let texts: [&[u8]; 5] = [
            b"dear reader, this is no firmware\n",
            b"par.kp = 3\n",
            "Gr\u{fc}\u{df}e aus der Werkstatt\n".as_bytes(),
            b"h\0a\0l\0l\0o\0 \0w\0e\0l\0t\0",
            b"U",
        ];
        for text in texts {
            assert!(read(name, text).is_err(), "{name}: {text:?}");
        }
    }
    // The file name belongs to an S-record file, so the reader reports the first error in the records.
    assert!(matches!(read("a.s19", b"S1zz\n"), Err(ImageError::Line { line: 1, .. })));
    assert!(matches!(read("a.hex", &[0, 1, 2, 3]), Err(ImageError::Line { line: 1, .. })));
    let bytes: Vec<u8> = (0..=255).collect();
    assert_eq!(read("a.bin", &bytes).unwrap().bytes(), bytes);
    for name in ["a", "a.img", "a.txt"] {
        assert!(matches!(read(name, &bytes), Err(ImageError::NotBin { .. })), "{name}");
    }
}

/// A count record ends a file of S-records if its number of data records is correct and no record follows it.
#[test]
fn a_count_record_ends_a_file() {
    let data: Vec<String> = (0..4).map(|i| s_line(1, 2, i * 8, &[i as u8 + 1; 16])).collect();
    let whole = data.concat();
    let count = |kind: u8, records: u32| s_line(kind, if kind == 5 { 2 } else { 3 }, records, &[]);
    for kind in [5, 6] {
        let image = parse(&(s_line(0, 2, 0, b"name") + &whole + &count(kind, 4))).unwrap();
        assert_eq!((image.bytes().len(), image.notes()), (64, &[ImageNote::EndedByCount { records: 4 }][..]));
        // If the file has an end record, the reader adds no note about the count record.
        let image = parse(&(whole.clone() + &count(kind, 4) + &s_line(9, 2, 0, &[]))).unwrap();
        assert!(image.notes().is_empty());
        for wrong in [0, 1, 3, 5, 0x104] {
            let problem = problem(&(whole.clone() + &count(kind, wrong))).2;
            assert_eq!(problem, LineProblem::Count { declared: wrong, has: 4 });
        }
        // If a record follows the count record and the end record is missing, the file is not complete.
        for more in [s_line(1, 2, 32, &[9; 16]), s_line(0, 2, 0, b"name")] {
            let cut = parse(&(whole.clone() + &count(kind, 4) + &more));
            assert!(matches!(cut, Err(ImageError::NoEnd { lines: 6, .. })), "{cut:?}");
        }
    }
    assert!(matches!(parse(&whole), Err(ImageError::NoEnd { lines: 4, .. })));
}

/// The reader refuses damaged Intel HEX and S-record files because of their content, with any file name, and with and
/// without the option for raw bytes. The error never recommends an option that bypasses a check.
#[test]
fn characters_of_records_are_never_an_image() {
    let data: Vec<u8> = (0..128_u32).map(|i| (i * 37 + 11) as u8).collect();
    let hex =
        data.chunks(16).zip(0..).map(|(d, i)| hex_line(i * 16, 0, d)).collect::<String>() + ":00000001FF\n";
    let srec =
        data.chunks(16).zip(0..).map(|(d, i)| s_line(1, 2, i * 8, d)).collect::<String>() + "S9030000FC\n";
    let wide = |text: &str, big: bool| {
        text.encode_utf16()
            .flat_map(|c| if big { c.to_be_bytes() } else { c.to_le_bytes() })
            .collect::<Vec<u8>>()
    };
    let dir = tempfile::tempdir().unwrap();
    for (text, kind) in [(hex, ':'), (srec, 'S')] {
        let bytes = text.clone().into_bytes();
        let with = |change: fn(&mut Vec<u8>)| {
            let mut copy = bytes.clone();
            change(&mut copy);
            copy
        };
        let lines: Vec<&str> = text.lines().collect();
        let variants: Vec<(&str, Vec<u8>)> = vec![
            ("checksum", with(|b| b[20] = if b[20] == b'0' { b'1' } else { b'0' })),
            ("cut between lines", text.as_bytes()[..text.len() / 2].to_vec()),
            ("no end record", lines[..lines.len() - 1].join("\n").into_bytes()),
            ("^Z in the middle", with(|b| b.insert(60, 0x1A))),
            ("^Z and text", with(|b| b.extend(b"\x1Atext"))),
            ("NULs in the middle", with(|b| b.splice(60..60, [0; 4]).for_each(drop))),
            ("more NULs than text", with(|b| b[60..].fill(0))),
            ("no mark", text.replace(kind, "").into_bytes()),
            ("one mark is missing", text.replacen(kind, "", 2).into_bytes()),
            ("odd digits", with(|b| b.splice(9..10, []).for_each(drop))),
            ("UTF-8 mark", [b"\xEF\xBB\xBF", bytes.as_slice()].concat()),
            ("UTF-16", wide(&text, false)),
            ("UTF-16 with a mark", [b"\xFE\xFF".to_vec(), wide(&text, true)].concat()),
            (
                "other types",
                text.replacen(
                    if kind == ':' { ":1000" } else { "S113" },
                    if kind == ':' { ":1010" } else { "S913" },
                    1,
                )
                .into_bytes(),
            ),
            ("text after the end", with(|b| b.extend(b"made by hand\n"))),
            ("text before the start", [b"made by hand\n", bytes.as_slice()].concat()),
            ("quoted", text.lines().map(|l| format!("> {l}\n")).collect::<String>().into_bytes()),
            ("letters for digits", text.replace('0', "O").replace('1', "l").into_bytes()),
        ];
        for (what, content) in &variants {
            for name in ["a.hex", "a.s19", "a.bin", "a.txt", "a"] {
                let path = dir.path().join(name);
                std::fs::write(&path, content).unwrap();
                for format in [None, Some(Format::Bin)] {
                    let options = ImageOptions { format, ..Default::default() };
                    let read = Image::read(&path, &options);
                    let Err(error) = read else { panic!("{kind} {what} {name} {format:?}: {read:?}") };
                    assert_eq!(
                        error.advice(),
                        ImageAdvice::MakeAgain,
                        "{kind} {what} {name} {format:?}: {error}"
                    );
                    let read = Image::parse(content, &options);
                    assert!(read.is_err(), "{kind} {what} without a name: {read:?}");
                }
            }
        }
    }
}

/// With the option for raw bytes, the reader reads a file with any name as raw bytes, except Intel HEX and S-record
/// files. The reader still accepts a text only from a `.bin` file.
#[test]
fn raw_bytes_on_request_are_looked_at() {
    let dir = tempfile::tempdir().unwrap();
    let raw = ImageOptions { format: Some(Format::Bin), ..Default::default() };
    let read = |name: &str, content: &[u8]| {
        let path = dir.path().join(name);
        std::fs::write(&path, content).unwrap();
        Image::read(&path, &raw)
    };
    let bytes: Vec<u8> = (0..=255).collect();
    for name in ["a", "a.img", "a.bin", "a.BIN", "a.dat"] {
        assert_eq!(read(name, &bytes).unwrap().bytes(), bytes, "{name}");
    }
    for name in ["a.hex", "a.HEX", "a.ihex", "a.s19", "a.srec", "a.mot"] {
        let error = read(name, &bytes).unwrap_err();
        assert_eq!(error.advice(), ImageAdvice::Rename, "{name}: {error}");
    }
    let texts: [&[u8]; 5] = [
        b"dear reader, this is no firmware\n",
        b"par.kp = 3\n",
        "Gr\u{fc}\u{df}e aus der Werkstatt\n".as_bytes(),
        b"h\0a\0l\0l\0o\0 \0w\0e\0l\0t\0",
        b"U",
    ];
    for text in texts {
        for name in ["a", "a.img", "a.txt", "a.hex"] {
            let error = read(name, text).unwrap_err();
            assert_eq!(error.advice(), ImageAdvice::MakeAgain, "{name}: {error}");
        }
        assert!(Image::parse(text, &raw).is_err());
        assert!(read("a.bin", text).is_ok(), "two deliberate steps");
    }
    assert!(matches!(read("a.bin", b"\x7fELF.."), Err(ImageError::Elf)));
}

proptest! {
    /// Files of the three formats that contain the same bytes give the same image, for records of any size and order.
    #[test]
    fn three_forms_are_one_image(
        words in prop::collection::vec(any::<[u8; 2]>(), 1..300),
        base in 0_u32..0x8000,
        step in 1_usize..120,
        seed in any::<u64>(),
    ) {
        let bytes = words.concat();
        let mut hex = Vec::new();
        let mut srec = Vec::new();
        for (i, chunk) in bytes.chunks(step * 2).enumerate() {
            let word = base + (i * step) as u32;
            let byte = word * 2;
            hex.push(hex_line(0, 4, &((byte >> 16) as u16).to_be_bytes()) + &hex_line(byte as u16, 0, chunk));
            srec.push(s_line(3, 4, word, chunk));
        }
        let mut order: Vec<usize> = (0..hex.len()).collect();
        order.sort_by_key(|i| (*i as u64 + 1).wrapping_mul(seed | 1));
        let pick = |lines: &[String]| order.iter().map(|i| lines[*i].as_str()).collect::<String>();
        let from_hex = parse(&(pick(&hex) + ":00000001FF\r\n")).unwrap();
        let from_srec = parse(&(pick(&srec) + &s_line(7, 4, 0, &[]))).unwrap();
        prop_assert_eq!(from_hex.bytes(), &bytes[..]);
        prop_assert_eq!(from_srec.bytes(), &bytes[..]);
        prop_assert_eq!((from_hex.address_words(), from_srec.address_words()), (base, base));
    }

    /// Random bytes, and records with a damaged byte, result in an image or a specific error, never in a panic.
    #[test]
    fn anything_is_an_image_or_an_error(
        data in prop::collection::vec(any::<u8>(), 0..300),
        form in 0_u8..4, at in any::<prop::sample::Index>(), with in any::<u8>(),
    ) {
        let format = [None, Some(Format::Bin), Some(Format::IntelHex), Some(Format::SRecord)][usize::from(form)];
        let options = ImageOptions { format, gaps: Gaps::Fill(with), ..Default::default() };
        let _ = Image::parse(&data, &options);
        let mut text = (hex_line(0x20, 0, &[1, 2, 3, 4]) + ":00000001FF\n").into_bytes();
        let i = at.index(text.len());
        text[i] = with;
        if let Ok(image) = Image::parse(&text, &options) {
            prop_assert!(image.bytes().len().is_multiple_of(2) && !image.bytes().is_empty());
        }
    }
}
