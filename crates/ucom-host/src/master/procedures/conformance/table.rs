//! Which tests there are, and what each needs to be allowed.

/// What a test needs to be allowed.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    Ask,
    Init,
    Run,
    Program,
    /// It cannot be done from here; why.
    Elsewhere(&'static str),
}

/// Name, level and expectation of every test; the numbers are those of the acceptance tests.
pub(super) const TESTS: [(&str, Level, &str); 21] = [
    (
        "D-T1",
        Level::Init,
        "PC_RESET: one report of each board within 500 ms and its delay, under the identifier of its flash id",
    ),
    ("D-T2", Level::Ask, "PC_REPORT twice: the same reports, and nothing is forgotten"),
    ("D-T3", Level::Init, "boards without a number answer nothing but reset, report and PC_INIT"),
    (
        "D-T4",
        Level::Init,
        "numbers follow the init wire: the next board is silent until the pin before it is raised",
    ),
    ("D-T5", Level::Ask, "PC_INIT with its own number: acknowledged again, by this board alone"),
    ("D-T6", Level::Init, "PC_SETSTATUS 0040 sets ASTART (the formula, literally), 4000 clears it"),
    ("D-T7", Level::Init, "PC_SETSTATUS of IPINIT, EXLRUN, MCARUN changes nothing: they mirror reality"),
    (
        "D-T8",
        Level::Run,
        "status walk: PC_XRESET 1F, PC_START 8B, MCA_PC_START AB, run = 0 8B, MSTART = 0 1B (pins as they are)",
    ),
    (
        "D-T9",
        Level::Run,
        "PC_START: MCA_DSP_READY within 2 s and EXLRUN = 0; without an application error 11",
    ),
    (
        "D-T10",
        Level::Ask,
        "IO description: dimensions, then exactly 1 + CI + SO + PAR strings; with one byte of data no answer",
    ),
    ("D-T11", Level::Ask, "MCA_DUMP_CI: packages at 0, 3, 6 …, surplus words 0"),
    ("D-T12", Level::Run, "CI at the dimension: error 5; surplus words behind the last one are ignored"),
    (
        "D-T13",
        Level::Run,
        "no heartbeat of the PC: loop ends after 1.5 s, flags 0, no outputs; a heartbeat does not restart it, MCA_PC_START does",
    ),
    ("D-T14", Level::Run, "heartbeats for 60 s: runs; one missing: runs; three missing: safe"),
    ("D-T15", Level::Run, "flags 02000000: ignored; flags of three bytes: error 7"),
    ("D-T16", Level::Init, "PC_XRESET within 300 ms of PC_INIT prevents the autostart"),
    (
        "D-T17",
        Level::Program,
        "update by frames: DSP_READY after each block, then DSP_PROGFINISHED; PC_INFO shows Program ID and date",
    ),
    (
        "D-T18",
        Level::Program,
        "a wrong length, a pause, a bad header, another board's, beyond the memory, other cycle 2: errors 7 10 5 2 2 10, once each, and the application stays",
    ),
    (
        "D-T19",
        Level::Elsewhere(
            "would program several boards at once: `ucom update --group` does, and shows what each took",
        ),
        "broadcast program data: boards with PROG = 1 take them, the others are silent",
    ),
    (
        "D-T20",
        Level::Elsewhere("needs a bus that holds the acknowledge back: the simulator's fault ack-held does"),
        "PC_INIT before the last DSP_INITACK has left: error 9",
    ),
    (
        "D-T21",
        Level::Elsewhere("needs two boards with one flash id: `ucom sim --flash-ids 0x21,0x21` has them"),
        "two boards with one flash id: one report is seen, and the PC reports that there are more boards than reports",
    ),
];

/// Names of all tests, for a command line.
pub fn test_names() -> impl Iterator<Item = &'static str> {
    TESTS.iter().map(|(id, ..)| *id)
}
