//! Pages about the codes that a controller, a drive or this library reports. Each page contains the meaning of a code, its usual cause, the
//! remedy and the next command.

mod check;
mod controller;
mod link;
mod nodes;
mod stops;

use jtc_wire::{Code, ControllerState, DataStatus, FrameStatus, NodeState, StopKind, TrajectoryState};

use crate::check::ProblemKind;
use crate::labels;

/// Declares the families of codes. Each family has a meaning, a name, a title and a key. The key is the text before
/// the colon, for example `can` in `can:0x100`.
macro_rules! families {
    ($($(#[$meaning:meta])* $name:ident $key:literal, $title:literal;)+) => {
        /// Family of the number that a page explains.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Family {
            $($(#[$meaning])* $name,)+
        }

        impl Family {
            /// All families, in the order in which a number without a family is looked up.
            pub const ALL: [Self; [$($key),+].len()] = [$(Self::$name),+];

            /// Returns the key of the family, which is the text before the colon in `can:0x100`.
            pub fn key(self) -> &'static str {
                match self {
                    $(Self::$name => $key,)+
                }
            }

            /// Returns the title of the family.
            pub fn title(self) -> &'static str {
                match self {
                    $(Self::$name => $title,)+
                }
            }
        }
    };
}

families! {
    /// Bits of the controller's error words.
    Jtc "jtc", "controller error word";
    /// Bits of a joint's internal error word.
    Joint "joint", "internal error word of a joint";
    /// CAN flags: a transmit timeout on the joint bus, and nodes that do not answer.
    Can "can", "CAN flags";
    /// Bits of a node's error byte.
    Node "node", "error byte of a node";
    /// Bits of a node's warning byte.
    Warning "warning", "warning byte of a node";
    /// Bits of the motor-control fault bytes.
    Motor "motor", "motor-control fault byte of a drive";
    /// Data status codes of a response.
    Data "data", "data status of a response";
    /// Frame status codes of a response.
    Frame "frame", "frame status of a response";
    /// States of the controller.
    State "state", "state of the controller";
    /// Trajectory execution states.
    Tes "tes", "trajectory execution state";
    /// States of a node.
    NodeState "node-state", "state of a node";
    /// Bits that mark the parameters that a controller has not received.
    Missing "missing", "word of missing parameters";
    /// Kinds of problems that the check of a trajectory finds.
    Check "check", "kind of a problem of a trajectory";
    /// Causes of a held stop.
    Stop "stop", "cause of a held stop";
}

impl Family {
    /// Returns `true` if the number is a set of bits, and `false` if it is a single code.
    pub fn is_bits(self) -> bool {
        matches!(
            self,
            Family::Jtc
                | Family::Joint
                | Family::Can
                | Family::Node
                | Family::Warning
                | Family::Motor
                | Family::Missing
        )
    }
}

/// Page about one code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Page {
    /// Family of the code.
    pub family: Family,
    /// Number of the bit, or the code.
    pub code: u32,
    /// Unique name of the page.
    pub name: &'static str,
    /// Meaning of the code.
    pub meaning: &'static str,
    /// Usual cause of the code.
    pub cause: &'static str,
    /// Remedy for the usual cause.
    pub remedy: &'static str,
    /// Next command for the user.
    pub command: &'static str,
}

impl Page {
    /// Returns the code of the page. If the page is about a bit, returns the mask of this bit.
    pub fn number(&self) -> u32 {
        if self.family.is_bits() { 1 << self.code } else { self.code }
    }

    /// Returns the text that commands print for the code. If commands do not print a text for the code, returns the name of the page.
    pub fn title(&self) -> String {
        own_words(self).unwrap_or_else(|| self.name.replace('-', " "))
    }
}

impl std::fmt::Display for Page {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let number = if self.family.is_bits() {
            format!("bit {} (0x{:02X}) of the {}", self.code, self.number(), self.family.title())
        } else {
            format!("{} of the {}", self.code, self.family.title())
        };
        writeln!(f, "{} - {number}", self.name)?;
        writeln!(f, "  meaning: {}", self.meaning)?;
        writeln!(f, "  cause:   {}", self.cause)?;
        writeln!(f, "  do:      {}", self.remedy)?;
        write!(f, "  next:    {}", self.command)
    }
}

/// Declares the pages of a family. Each page has a number, name, meaning, usual cause, remedy and next command.
macro_rules! entries {
    ($($family:ident { $($code:literal $name:literal: $($text:literal),+;)+ })+) => {
        pub(super) const PAGES: &[super::Page] =
            &[$($(super::page(super::Family::$family, $code, $name, [$($text),+]),)+)+];
    };
}
use entries;

const fn page(family: Family, code: u32, name: &'static str, texts: [&'static str; 4]) -> Page {
    let [meaning, cause, remedy, command] = texts;
    Page { family, code, name, meaning, cause, remedy, command }
}

/// Returns all pages.
pub fn pages() -> impl Iterator<Item = &'static Page> + Clone {
    let own = controller::PAGES.iter().chain(nodes::PAGES).chain(link::PAGES);
    own.chain(check::MISSING).chain(check::FOUND).chain(stops::HELD_STOP).chain(stops::CAUSES)
}

/// Returns the page named `name`.
pub fn named(name: &str) -> Option<&'static Page> {
    pages().find(|page| page.name == name)
}

/// Returns the names of the pages for the bits that are set in `word`.
pub fn names(family: Family, word: u32) -> Vec<&'static str> {
    let own = pages().filter(|page| page.family == family && word & page.number() != 0);
    own.map(|page| page.name).collect()
}

/// Returns the texts that commands print for the code of a page.
fn shown(page: &Page) -> Vec<String> {
    // A decoded frame is printed with the node numbers of the protocol instead of joint numbers. This text must also
    // find the page.
    let decoded = jtc_wire::words::CAN_FLAGS.get(page.code as usize).filter(|_| page.family == Family::Can);
    own_words(page).into_iter().chain(decoded.map(|name| (*name).to_owned())).collect()
}

fn own_words(page: &Page) -> Option<String> {
    use jtc_wire::words as w;
    let at = |names: &[&str]| names.get(page.code as usize).map(|name| (*name).to_owned());
    let code = u8::try_from(page.code).ok()?;
    match page.family {
        Family::Jtc => at(&w::JTC_ERRORS),
        Family::Joint => at(&w::JOINT_INTERNAL),
        Family::Motor => at(&w::MC_FAULTS),
        Family::Node => at(&w::NODE_ERRORS),
        Family::Warning => at(&w::NODE_WARNINGS),
        Family::State => Code::<ControllerState>::new(code).known().map(|state| state.name().to_owned()),
        Family::Tes => Code::<TrajectoryState>::new(code).known().map(|state| state.name().to_owned()),
        Family::NodeState => Some(NodeState::new(code).name().to_owned()),
        Family::Can => labels::can_flags(page.number()).pop(),
        Family::Data => DataStatus::from_byte(code).map(|code| labels::data_status(code).to_owned()),
        Family::Frame => FrameStatus::from_byte(code).map(|code| labels::frame_status(code).to_owned()),
        Family::Missing => at(&w::JTC_INIT),
        Family::Check => ProblemKind::ALL.get(page.code as usize).map(|kind| kind.words().to_owned()),
        Family::Stop => StopKind::from_byte(code).map(|kind| kind.name().to_owned()),
    }
}

/// Converts a text to lower case and keeps only letters and digits. A comparison of two converted texts ignores case, spaces and
/// punctuation.
fn letters(text: &str) -> String {
    text.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// Finds pages for a query. A query can be a name (`joint-position-error`), some words of a name, or a printed text (`HoldPos`,
/// `over-current`). A query can also be a number with a family (`can:0x100`, `data:7`) or without a family. Returns an empty list if no
/// page matches the query.
pub fn find(query: &str) -> Vec<&'static Page> {
    // In a printed list of errors, each error begins with the name of its joint. The search ignores this name.
    let query = match query.split_once(": ") {
        Some((node, rest)) if node.starts_with("joint ") || node == "gripper" => rest,
        _ => query,
    };
    let query = query.strip_suffix(" not given").unwrap_or(query);
    // If the query is the key of a family, the family is searched first, even if a printed text equals the key.
    if query.strip_suffix(':').is_some_and(|key| Family::ALL.into_iter().any(|family| family.key() == key)) {
        return by_name_or_number(query);
    }
    let as_shown = letters(query);
    let on_screen = |fits: fn(&str, &str) -> bool| -> Vec<&'static Page> {
        pages().filter(|p| shown(p).iter().any(|text| fits(&letters(text), &as_shown))).collect()
    };
    let exact = on_screen(|text, asked| text == asked);
    if !exact.is_empty() {
        return exact;
    }
    let by_name = by_name_or_number(query);
    // The query may be a part of a printed text, such as "does not answer".
    if by_name.is_empty() && as_shown.len() > 3 {
        on_screen(|text, asked| text.contains(asked))
    } else {
        by_name
    }
}

fn by_name_or_number(query: &str) -> Vec<&'static Page> {
    let query = query.trim().to_ascii_lowercase().replace([' ', '_'], "-");
    if let Some(page) = pages().find(|p| p.name == query) {
        return vec![page];
    }
    let (family, text) = match query.split_once(':') {
        Some((key, rest)) => match Family::ALL.into_iter().find(|f| f.key() == key) {
            Some(family) => (Some(family), rest.trim_matches('-').to_owned()),
            None => return Vec::new(),
        },
        None => (None, query),
    };
    let in_family = |p: &&Page| family.is_none_or(|f| p.family == f);
    if let Some(number) = number(&text) {
        let hit = |p: &&'static Page| {
            if p.family.is_bits() {
                number & p.number() != 0 && known_bits(p.family, number)
            } else {
                p.code == number
            }
        };
        return pages().filter(in_family).filter(hit).collect();
    }
    if text.is_empty() {
        return if family.is_some() { pages().filter(in_family).collect() } else { Vec::new() };
    }
    pages().filter(in_family).filter(|p| text.split('-').all(|word| p.name.contains(word))).collect()
}

/// Returns `true` if the family has a page for each set bit of `number`. Otherwise the number does not belong to this family.
fn known_bits(family: Family, number: u32) -> bool {
    let known = pages().filter(|p| p.family == family).fold(0, |m, p| m | p.number());
    number & !known == 0
}

fn number(text: &str) -> Option<u32> {
    match text.strip_prefix("0x") {
        Some(hex) => u32::from_str_radix(hex, 16).ok(),
        None => text.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_found_by_name_number_and_words() {
        assert_eq!(find("joint-position-error")[0].number(), 0x10);
        assert_eq!(find("Joint Position Error").len(), 1);
        let names: Vec<&str> = find("jtc:0x12").iter().map(|p| p.name).collect();
        assert_eq!(names, ["emergency-output", "internal-joint-error"]);
        assert!(find("0x12").iter().any(|p| p.family == Family::Joint));
        assert_eq!(find("data:8")[0].name, "start-position-mismatch");
        assert_eq!(find("can:0x0400").len(), 1);
        assert_eq!(find("node-state:255")[0].name, "node-fault");
        assert!(find("friction table").iter().any(|p| p.family == Family::Joint));
        assert!(find("tes:").len() >= 5);
        assert_eq!(find("stop:").len(), 1 + StopKind::ALL.len());
        assert_eq!([find("held-stop"), find("held stop")].map(|found| found.len()), [1, 1]);
        assert_eq!(find("encoder-jumped"), find("encoder jump"));
        assert_eq!(find("stop:9")[0].name, "encoder-jumped");
        assert!(find("no-such-thing").is_empty() && find("").is_empty() && find("bogus:1").is_empty());
    }

    /// For each text that commands print, a search finds the page of its code.
    #[test]
    fn every_word_on_a_screen_finds_its_page() {
        use jtc_wire::words as w;
        let states = ControllerState::ALL.iter().map(|state| state.name()).collect::<Vec<_>>();
        let trajectory = TrajectoryState::ALL.iter().map(|state| state.name()).collect::<Vec<_>>();
        let lists: [(Family, &[&str]); 7] = [
            (Family::State, &states),
            (Family::Tes, &trajectory),
            (Family::Jtc, &w::JTC_ERRORS),
            (Family::Joint, &w::JOINT_INTERNAL),
            (Family::Motor, &w::MC_FAULTS),
            (Family::Node, &w::NODE_ERRORS),
            (Family::Warning, &w::NODE_WARNINGS),
        ];
        let has = |word: &str, family, code: usize| {
            let found = find(word);
            assert!(found.iter().any(|p| p.family == family && p.code as usize == code), "{word}: {found:?}");
        };
        for (family, names) in lists {
            for (code, name) in names.iter().enumerate() {
                has(name, family, code);
                has(&format!("joint 3: {name}"), family, code);
            }
        }
        for kind in ProblemKind::ALL {
            has(kind.words(), Family::Check, kind as usize);
            // `key` is the name of the kind in JSON.
            let key = serde_json::to_value(kind).unwrap().as_str().unwrap().to_owned();
            has(&key, Family::Check, kind as usize);
        }
        for kind in StopKind::ALL {
            has(kind.name(), Family::Stop, kind as usize);
        }
        for (bit, name) in w::JTC_INIT.iter().enumerate() {
            has(name, Family::Missing, bit);
            has(&format!("{name} not given"), Family::Missing, bit);
        }
        for (bit, name) in w::CAN_FLAGS.iter().enumerate().filter(|(_, name)| !name.is_empty()) {
            has(name, Family::Can, bit);
        }
        has(NodeState::new(99).name(), Family::NodeState, 9);
        for code in [0, 1, 2, 3, 10, 254, 255] {
            has(NodeState::new(code).name(), Family::NodeState, code.into());
        }
        has("joint 3 does not answer", Family::Can, 10);
        has("gripper does not answer", Family::Can, 14);
        has("no acknowledge on the joint bus", Family::Can, 0);
        has("does not answer", Family::Can, 8);
        has("not allowed in this state", Family::Data, 7);
        assert_eq!(find("HoldPos").len(), 1);
    }

    /// Each set bit of a word has exactly one name, in the order of the printed texts. A search for a name finds only
    /// the page with this name in its family.
    #[test]
    fn the_bits_of_a_word_have_the_names_of_their_pages() {
        for (family, word, words) in [
            (Family::Jtc, 0x92, labels::errors(0x92)),
            (Family::Joint, 0x31, labels::joint_errors(0x31)),
            (Family::Jtc, 0, Vec::new()),
        ] {
            let found: Vec<&Page> = names(family, word).into_iter().filter_map(named).collect();
            assert_eq!(found.iter().map(|page| page.title()).collect::<Vec<_>>(), words);
        }
        assert_eq!(named("position error over limit"), None);
        assert!(pages().all(|page| !page.title().is_empty() && named(page.name) == Some(page)));
    }

    /// Every bit and every code has exactly one page.
    #[test]
    fn every_code_has_one_page() {
        use jtc_wire::words as w;
        let count = |family| pages().filter(|p| p.family == family).count();
        assert_eq!(count(Family::Jtc), w::JTC_ERRORS.len());
        assert_eq!(count(Family::Joint), w::JOINT_INTERNAL.len());
        assert_eq!(count(Family::Motor), w::MC_FAULTS.len());
        assert_eq!(count(Family::Node), w::NODE_ERRORS.len());
        assert_eq!(count(Family::Warning), w::NODE_WARNINGS.len());
        assert_eq!(count(Family::Can), w::CAN_FLAGS.iter().filter(|n| !n.is_empty()).count());
        assert_eq!(count(Family::State), ControllerState::ALL.len());
        assert_eq!(count(Family::Tes), TrajectoryState::ALL.len());
        assert_eq!(count(Family::Missing), w::JTC_INIT.len());
        assert_eq!(count(Family::Check), ProblemKind::ALL.len());
        // The family of held stops has one more page, which is about held stops in general.
        assert_eq!(count(Family::Stop), 1 + StopKind::ALL.len());
        assert_eq!((count(Family::Data), count(Family::Frame)), (9, 6));
        for (i, p) in pages().enumerate() {
            assert!(
                pages().take(i).all(|q| q.name != p.name && (q.family, q.code) != (p.family, p.code)),
                "{}",
                p.name
            );
            // The search for the name of a page may also find a page of another family, if that page has the same
            // printed text.
            let found = find(p.name);
            assert!(
                found.contains(&p) && found.iter().all(|q| q.family != p.family || q == &p),
                "{}: {found:?}",
                p.name
            );
            assert!(
                !p.command.is_empty()
                    && p.meaning.ends_with('.')
                    && p.cause.ends_with('.')
                    && p.remedy.ends_with('.')
            );
        }
    }
}
