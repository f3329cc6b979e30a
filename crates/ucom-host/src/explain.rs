//! Explanations of the words that the tools display: meaning and next step of status bits, states, heartbeats, events, outcomes and errors.

use ucom::ErrorCode;

/// A displayed word.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Word {
    /// Family of the word.
    pub family: &'static str,
    /// Displayed forms. The first one is the name.
    pub shown: Vec<String>,
    /// Meaning.
    pub meaning: String,
    /// Next command or action.
    pub next: String,
}

/// Family, displayed forms, meaning, next step.
type Fixed = (&'static str, &'static [&'static str], &'static str, &'static str);

const BIT: &str = "status bit";
const STATE: &str = "state of a board";
const HEARTBEAT: &str = "heartbeat of a board";
const EVENT: &str = "event of ucom run";
const OUTCOME: &str = "outcome of ucom update";

/// The status bits come first, beginning with bit 7.
const WORDS: [Fixed; 38] = [
    (BIT, &["MSTART", "M"], "The application has been started by the exloader.", "ucom stop N ends it"),
    (
        BIT,
        &["ASTART", "A", "autostart"],
        "The application starts by itself after power-up; kept over power loss.",
        "ucom status N --clear ASTART",
    ),
    (BIT, &["MCARUN", "R"], "The control loop runs: outputs can move.", "ucom stop N"),
    (BIT, &["EXLRUN", "X"], "The exloader runs; always the opposite of MSTART.", "ucom start N"),
    (BIT, &["INIT", "I"], "The board has a number.", "where it is missing: ucom init"),
    (BIT, &["PROG", "P", "prog"], "The board accepts program data.", "ucom reset N ends that"),
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
    (STATE, &["started"], "The application runs, its control loop does not: nothing moves.", "ucom run N"),
    (STATE, &["running"], "The control loop runs: outputs can move.", "ucom stop N"),
    (
        STATE,
        &["rebooted"],
        "The board has rebooted and lost its number: power, watchdog or a crash.",
        "ucom init",
    ),
    (HEARTBEAT, &["alive"], "Heartbeats come in time.", "nothing"),
    (HEARTBEAT, &["late"], "A heartbeat is missing: bus load, or frames get lost.", "ucom doctor"),
    (
        HEARTBEAT,
        &["lost", "no heartbeat", "gives no heartbeat"],
        "Three heartbeats are missing: the board lost power or the bus. What was received before is not shown.",
        "ucom doctor; cable and power of this board",
    ),
    (
        EVENT,
        &["back"],
        "Heartbeats of a board that was late or lost come again; it does not move by itself.",
        "ucom status N",
    ),
    (
        EVENT,
        &["left-loop"],
        "A board has left its control loop by itself; its values are stale.",
        "ucom doctor",
    ),
    (EVENT, &["in-loop"], "A board is in its control loop again.", "nothing"),
    (
        EVENT,
        &["stopped-by-policy"],
        "A board was stopped because another one was lost (on_lost).",
        "ucom doctor",
    ),
    (EVENT, &["stale"], "The value is old, or of a board that is in doubt: not to be used.", "ucom status N"),
    (EVENT, &["stopped"], "All boards were stopped at the end.", "nothing"),
    (
        EVENT,
        &["not_stopped", "not stopped for certain"],
        "These boards did not confirm the stop.",
        "ucom stop all",
    ),
    (OUTCOME, &["not-started"], "The board was not touched.", "the error beside it names the cause"),
    (OUTCOME, &["cancelled"], "Ended by a person before anything was erased.", "ucom update again"),
    (
        OUTCOME,
        &["up-to-date"],
        "Same Program ID and date, and by the inventory this image was written to this address; nothing was sent.",
        "nothing",
    ),
    (
        OUTCOME,
        &["program-up-to-date"],
        "Same Program ID, but nothing shows content, load address and other memories; nothing was sent.",
        "ucom update --rewrite writes it, --unverified accepts it",
    ),
    (
        OUTCOME,
        &["incomplete"],
        "Something was erased and the image is not whole: there is no valid application.",
        "ucom update again",
    ),
    (OUTCOME, &["unknown"], "What the board holds is not known.", "ucom info N"),
    (
        OUTCOME,
        &["written"],
        "The image was written; the profile leaves nothing to verify it by.",
        "ucom info N",
    ),
    (OUTCOME, &["verified"], "The image was written and confirmed by the board.", "ucom start N"),
    (
        "bus",
        &["bus load"],
        "Share of the time that frames take on the bus.",
        "above 70 %: longer so.period or ci.period",
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
        "Another PC sends what only one may; here nothing is asked.",
        "end the other program",
    ),
    ("bus", &["only listens"], "Nothing is sent, except a stop.", "nothing"),
    (
        "bus",
        &["bus-off"],
        "The CAN adapter has left the bus: too many of its frames failed.",
        "check bit rate and cable, then ucom doctor",
    ),
    (
        "bus",
        &["passive", "error passive"],
        "The CAN adapter has seen many errors: no acknowledge, reflections, or another bit rate.",
        "ucom doctor",
    ),
    (
        "bus",
        &["no valid application", "none"],
        "The board was never programmed, or an update was cut off.",
        "ucom update N IMAGE",
    ),
];

/// Returns all words.
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

/// Returns the words that match exactly. Otherwise returns the words that match without regard to letter case and punctuation. If this also
/// finds nothing and the query has at least 3 letters, returns the words that contain the query.
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

    /// The displayed status bits, states, heartbeats and errors are all explained.
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
