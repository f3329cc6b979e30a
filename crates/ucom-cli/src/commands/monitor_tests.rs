use cli_kit::Key;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ucom::Profile;
use ucom_host::master::{Event, Master, Request};

use super::*;

/// Terminal sizes for the tests, smallest first.
const SIZES: [(u16, u16); 6] = [(40, 12), (50, 15), (60, 20), (80, 24), (120, 40), (200, 60)];

/// Returns the master of a chain of ten boards that have answered an identity request, and the present time, µs.
fn ten() -> (Master, u64) {
    chain(None)
}

/// Like [`ten`]. If `started` is a board number, the application of this board is started.
fn chain(started: Option<u8>) -> (Master, u64) {
    let (mut master, mut now) = (Master::new(Profile::default()), 0);
    for number in 1..=10_u8 {
        master.start(now, Request::Info { board: number }).unwrap();
        'asked: loop {
            while let Some(frame) = master.poll(now) {
                if frame.to_string() == format!("{:03X}#", 0x200 + u16::from(number)) {
                    let id = 0x140 + u16::from(number);
                    let head = {
                        let status = if started == Some(number) { 0x8B } else { 0x1B };
                        format!("{id:03X}#{:02X}00{number:02X}{status:02X}CD{number:02X}6E38", 0x20 + number)
                    };
                    for text in
                        [head, format!("{id:03X}#0100"), format!("{id:03X}#6A6F696E74{:02X}", 0x40 + number)]
                    {
                        now += 200;
                        master.handle(now, Ok(text.parse().unwrap()));
                    }
                }
            }
            now += 1_000;
            while let Some(event) = master.take_event() {
                if let Event::Done { result, .. } = event {
                    result.unwrap();
                    break 'asked;
                }
            }
        }
    }
    (master, now)
}

/// Returns the master of a chain in which board 3 has sent heartbeats and then stopped, and the present time, µs.
fn one_lost() -> (Master, u64) {
    let (mut master, now) = chain(Some(3));
    master.watch(3, Some(3), true);
    master.handle(now, Ok("683#".parse().unwrap()));
    let later = now + 10_000_000;
    while master.poll(later).is_some() {}
    (master, later)
}

fn picture_of(
    master: &Master,
    now: u64,
    watch: &Watch,
    scroll: &mut Scroll,
    size: (u16, u16),
) -> Vec<String> {
    let (boards, statistics) = (master.boards(), master.statistics());
    let shared: Vec<String> = master.shared_numbers().iter().map(ToString::to_string).collect();
    let picture =
        Picture { boards: &boards, statistics: &statistics, shared: &shared, controller: None, now, watch };
    let mut terminal = Terminal::new(TestBackend::new(size.0, size.1)).unwrap();
    terminal.draw(|frame| draw(frame, &picture, scroll)).unwrap();
    let buffer = terminal.backend().buffer().clone();
    let cells = buffer.content().chunks(usize::from(size.0));
    cells.map(|row| row.iter().map(|cell| cell.symbol()).collect()).collect()
}

fn watch() -> Watch {
    Watch::new("socketcand:127.0.0.1:29536/can0".into(), false, Profile::default())
}

/// Returns all rows that the view shows while the test scrolls to the end of the list.
fn scrolled((master, now): &(Master, u64), watch: &Watch, size: (u16, u16)) -> Vec<String> {
    let mut scroll = Scroll::default();
    let mut all = picture_of(master, *now, watch, &mut scroll, size);
    loop {
        let before = scroll;
        scroll.key(Key::Down);
        if scroll == before {
            return all;
        }
        all.extend(picture_of(master, *now, watch, &mut scroll, size));
    }
}

fn line_of<'a>(lines: &'a [String], part: &str) -> &'a str {
    lines
        .iter()
        .find(|line| line.contains(part))
        .unwrap_or_else(|| panic!("no {part} in\n{}", lines.join("\n")))
}

#[test]
fn eighty_columns_have_flash_number_program_and_status_bits() {
    let (master, now) = ten();
    let lines = picture_of(&master, now, &watch(), &mut Scroll::default(), (80, 24));
    for number in 1..=10_u8 {
        let line = line_of(&lines, &format!("0x00{:02X}", 0x20 + number));
        assert!(line.contains(&format!("0x{number:02X}CD")), "{line}");
        assert!(line.contains("···XI·oi") && line.contains(" exloader ") && line.contains("joint"), "{line}");
    }
    let wide = picture_of(&master, now, &watch(), &mut Scroll::default(), (160, 30));
    assert!(line_of(&wide, "0x0021").contains("init out-pin in-pin"), "{}", wide.join("\n"));
}

/// Every board can be displayed on every terminal, and the line of keys shows how to scroll to it.
#[test]
fn no_board_vanishes() {
    let chain = ten();
    for size in SIZES {
        let first = picture_of(&chain.0, chain.1, &watch(), &mut Scroll::default(), size);
        let (place, keys) = (first.join("\n"), first.last().unwrap());
        assert!(keys.contains("s stops") && keys.contains("q ends"), "{size:?}: {keys}");
        let all = scrolled(&chain, &watch(), size);
        for number in 1..=10 {
            let row = |line: &String| {
                line.contains(&format!("{number} ")) && line.contains("···XI·oi") || size.0 > 130
            };
            assert!(all.iter().any(row), "{size:?}: board {number}\n{place}");
        }
        // The view omits a fact or a column that does not fit, instead of cutting it off.
        assert!(size.0 >= 60 || !place.contains("socketcand"), "{place}");
        assert!(!place.contains("descriptio ") && !place.contains("descriptio│"), "{place}");
        assert!(size.1 > 12 || keys.contains("↑↓ 1-"), "{size:?}: {keys}");
    }
}

/// The view lists a lost board first, with the next command and without old values.
#[test]
fn d51_a_lost_board_looks_dead() {
    let chain = one_lost();
    for size in SIZES {
        let lines = picture_of(&chain.0, chain.1, &watch(), &mut Scroll::default(), size);
        let text = lines.join("\n");
        let place = |part: &str| {
            lines.iter().position(|line| line.contains(part)).unwrap_or_else(|| panic!("{part}\n{text}"))
        };
        assert!(place("board 3 gives no heartbeat") <= 1, "{text}");
        assert!(
            place("board 3 gives") < place("next: ucom info 3") && place("next:") < place("load"),
            "{text}"
        );
        let all = scrolled(&chain, &watch(), size);
        let row = all.iter().find(|line| line.contains(" lost ") && !line.contains("board")).expect("a row");
        assert!(row.contains('?') && !row.contains("XI") && !row.contains("init out"), "{row}");
        assert!(all.iter().any(|line| line.contains(" exloader ")), "the others are as before");
    }
}

#[test]
fn a_terminal_that_is_too_small_shows_the_size_that_is_needed() {
    let (master, now) = ten();
    for size in [(39, 12), (40, 8), (20, 6)] {
        let lines = picture_of(&master, now, &watch(), &mut Scroll::default(), size);
        let text = lines.iter().flat_map(|line| line.split_whitespace()).collect::<Vec<_>>().join(" ");
        assert!(text.starts_with("s stops q ends: this view needs 40 columns and 12 rows"), "{text}");
    }
}

/// If no board answers, the view shows the next command for the user.
#[test]
fn an_empty_bus_is_reported() {
    let master = Master::new(Profile::default());
    for size in SIZES {
        let text = picture_of(&master, 3_000_000, &watch(), &mut Scroll::default(), size).join("\n");
        assert!(text.contains("no board answers") && text.contains("next: ucom doctor"), "{text}");
    }
}

/// The view does not cut off long event texts.
#[test]
fn events_go_on_in_the_next_line() {
    let (master, now) = ten();
    let mut watch = watch();
    let text = "board 2 (UCoM id 0x42) has rebooted and lost its number and this goes on until the line is full: `ucom init`";
    watch.log.push_back((1.0, text.into()));
    let lines = picture_of(&master, now, &watch, &mut Scroll::default(), (80, 24));
    let words = lines
        .iter()
        .flat_map(|line| line.split_whitespace())
        .filter(|w| *w != "│")
        .collect::<Vec<_>>()
        .join(" ");
    assert!(words.contains(&text.replace('`', "")), "{words}");
}
