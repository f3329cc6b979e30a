//! Explanations of the words that the tools display: the meaning and the next step for status bits, states, heartbeats, events, outcomes
//! and errors.

use ucom::ErrorCode;

/// A word that the tools display, with its explanation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Word {
    /// Group to which the displayed word belongs.
    pub family: &'static str,
    /// Forms in which the word is displayed. The first of these forms is the name of the word.
    pub shown: Vec<String>,
    /// Meaning of the displayed word.
    pub meaning: String,
    /// Next command or action that helps the user.
    pub next: String,
}

/// Group, displayed forms, meaning and next step of a word.
type Fixed = (&'static str, &'static [&'static str], &'static str, &'static str);

const BIT: &str = "status bit";
const STATE: &str = "state of a board";
const HEARTBEAT: &str = "heartbeat of a board";
const EVENT: &str = "event of ucom run";
const OUTCOME: &str = "outcome of ucom update";

/// Words that the tools display; the status bits come first, beginning with bit 7.
const WORDS: [Fixed; 38] = [
    (BIT, &["MSTART", "M"], "The exloader has started the application.", "ucom stop N ends the application"),
    (
        BIT,
        &["ASTART", "A", "autostart"],
        "The application starts by itself after power-up. The board keeps this bit without power.",
        "ucom status N --clear ASTART",
    ),
    (BIT, &["MCARUN", "R"], "The control loop runs: outputs can move.", "ucom stop N"),
    (BIT, &["EXLRUN", "X"], "The exloader runs. This bit is always the opposite of MSTART.", "ucom start N"),
    (BIT, &["INIT", "I"], "The board has a number.", "without a number: ucom init"),
    (BIT, &["PROG", "P", "prog"], "The board accepts program data.", "ucom reset N ends programming"),
    (
        BIT,
        &["OPINIT", "o", "out-pin"],
        "Level of the outgoing init pin: the next board can take a number.",
        "ucom doctor",
    ),
    (
        BIT,
        &["IPINIT", "i", "in-pin"],
        "Level of the incoming init pin: this board can take a number.",
        "ucom doctor",
    ),
    (STATE, &["exloader"], "No application runs; the board can be started or programmed.", "ucom start N"),
    (STATE, &["programming"], "The exloader accepts program data.", "ucom update N IMAGE, or ucom reset N"),
    (
        STATE,
        &["started"],
        "The application runs, but its control loop does not: nothing moves.",
        "ucom run N",
    ),
    (STATE, &["running"], "The control loop runs: outputs can move.", "ucom stop N"),
    (
        STATE,
        &["rebooted"],
        "The board has rebooted and lost its number, after a loss of power, a watchdog reset or a crash.",
        "ucom init",
    ),
    (HEARTBEAT, &["alive"], "Heartbeats arrive in time.", "no action is needed"),
    (
        HEARTBEAT,
        &["late"],
        "A heartbeat is missing, because the bus load is high or frames are lost.",
        "ucom doctor",
    ),
    (
        HEARTBEAT,
        &["lost", "no heartbeat", "gives no heartbeat"],
        "Three heartbeats are missing: the board lost power or its connection to the bus. Its old values are \
         not shown.",
        "ucom doctor; check cable and power of this board",
    ),
    (
        EVENT,
        &["back"],
        "Heartbeats of a late or lost board arrive again. The board does not move by itself.",
        "ucom status N",
    ),
    (
        EVENT,
        &["left-loop"],
        "A board has left its control loop by itself; its values are stale.",
        "ucom doctor",
    ),
    (EVENT, &["in-loop"], "A board is in its control loop again.", "no action is needed"),
    (
        EVENT,
        &["stopped-by-policy"],
        "A board was stopped because another one was lost (on_lost).",
        "ucom doctor",
    ),
    (
        EVENT,
        &["stale"],
        "The value is old, or the state of its board is not certain. Do not use the value.",
        "ucom status N",
    ),
    (EVENT, &["stopped"], "All boards were stopped at the end.", "no action is needed"),
    (
        EVENT,
        &["not_stopped", "not stopped for certain"],
        "These boards did not confirm the stop.",
        "ucom stop all",
    ),
    (
        OUTCOME,
        &["not-started"],
        "The update of this board did not start. Its memory is unchanged.",
        "read the error of this board: it names the cause",
    ),
    (
        OUTCOME,
        &["cancelled"],
        "A person ended the update before anything was erased.",
        "run ucom update again",
    ),
    (
        OUTCOME,
        &["up-to-date"],
        "The board has the same Program ID and date, and the inventory shows that this image was written to \
         this address. The command sent nothing.",
        "no action is needed",
    ),
    (
        OUTCOME,
        &["program-up-to-date"],
        "The board has the same Program ID, but its content, load address and other memories are not known. \
         The command sent nothing.",
        "ucom update --rewrite writes the image, --unverified accepts the board",
    ),
    (
        OUTCOME,
        &["incomplete"],
        "Something was erased and the image is not complete: the board has no valid application.",
        "run ucom update again",
    ),
    (OUTCOME, &["unknown"], "The content of the board is not known.", "ucom info N"),
    (
        OUTCOME,
        &["written"],
        "The image was written, but the profile leaves no means to verify it.",
        "ucom info N",
    ),
    (OUTCOME, &["verified"], "The image was written, and the board confirmed it.", "ucom start N"),
    (
        "bus",
        &["bus load"],
        "Share of the time in which frames occupy the bus.",
        "above 70 %: set a longer so.period or ci.period",
    ),
    (
        "bus",
        &["foreign frames", "frames of another protocol are on the bus"],
        "Frames that are not of this protocol.",
        "ucom doctor",
    ),
    (
        "bus",
        &["another PC is master"],
        "Another PC sends frames that only one PC may send. This PC sends no requests.",
        "end the other program",
    ),
    ("bus", &["only listens"], "This program sends nothing except a stop.", "no action is needed"),
    (
        "bus",
        &["bus-off"],
        "The CAN adapter has left the bus: too many of its frames failed.",
        "check bit rate and cable, then ucom doctor",
    ),
    (
        "bus",
        &["passive", "error passive"],
        "The CAN adapter has detected many errors: missing acknowledges, reflections, or another bit rate.",
        "ucom doctor",
    ),
    (
        "bus",
        &["no valid application", "none"],
        "The board was never programmed, or an update was interrupted.",
        "ucom update N IMAGE",
    ),
];

/// Returns all words that the tools display.
pub fn words() -> Vec<Word> {
    let fixed = WORDS.iter().map(|(family, shown, meaning, next)| Word {
        family,
        shown: shown.iter().map(|s| (*s).to_owned()).collect(),
        meaning: (*meaning).to_owned(),
        next: (*next).to_owned(),
    });
    let errors = ErrorCode::ALL.into_iter().chain([ErrorCode::Unknown(0)]).map(|code| Word {
        family: "error of a board",
        shown: match code {
            ErrorCode::Unknown(_) => vec![code.name().to_owned()],
            _ => vec![code.name().to_owned(), code.to_string(), code.number().to_string()],
        },
        meaning: code.meaning().to_owned(),
        next: code.reaction().replace('`', ""),
    });
    fixed.chain(errors).collect()
}

/// Returns the words that match the query. The function tries three kinds of matches in this order, and returns the
/// words of the first kind that occurs:
///
/// - The word is equal to the query.
/// - The word is equal to the query without regard to letter case and punctuation.
/// - The word contains the query, which must have at least 3 letters.
pub fn find<'a>(all: &'a [Word], query: &str) -> Vec<&'a Word> {
    let any = |fits: &dyn Fn(&str) -> bool| -> Vec<&'a Word> {
        all.iter().filter(|word| word.shown.iter().any(|shown| fits(shown))).collect()
    };
    let letters = |text: &str| -> String {
        text.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
    };
    let asked = letters(query);
    let exact = any(&|shown| shown == query);
    if !exact.is_empty() || asked.is_empty() {
        return exact;
    }
    let same = any(&|shown| letters(shown) == asked);
    if !same.is_empty() || asked.len() < 3 {
        return same;
    }
    any(&|shown| letters(shown).contains(&asked))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::master::{Board, Life, state_name};
    use ucom::Status;

    fn has(all: &[Word], word: &str, family: &str) {
        assert!(find(all, word).iter().any(|w| w.family == family), "{word}");
    }

    /// All displayed status bits, states, heartbeats and errors have an explanation.
    #[test]
    fn every_word_on_a_screen_is_explained() {
        let all = words();
        for (name, _) in Status::NAMES {
            has(&all, name, BIT);
        }
        for byte in 0..=255 {
            has(&all, state_name(Status(byte)), STATE);
        }
        for (life_of, rebooted) in
            [(Life::Alive, false), (Life::Late, false), (Life::Lost, false), (Life::Unarmed, true)]
        {
            let mut board = Board::default();
            (board.life, board.rebooted) = (life_of, rebooted);
            assert!(board.life.name() == "-" || !find(&all, board.life.name()).is_empty());
            assert!(
                board.state_name(0) == "?" || !find(&all, board.state_name(0)).is_empty(),
                "{}",
                board.state_name(0)
            );
        }
        for code in ErrorCode::ALL {
            has(&all, code.name(), "error of a board");
            has(&all, &code.to_string(), "error of a board");
            has(&all, &code.number().to_string(), "error of a board");
        }
        has(&all, ErrorCode::Unknown(42).name(), "error of a board");
        assert!(find(&all, "no such thing").is_empty() && find(&all, "").is_empty());
    }
}
