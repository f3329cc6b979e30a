//! Command `ucom explain`: prints the meaning of a word that `ucom` displays, and the next step for
//! the user.

use cli_kit::{Failure, Output, table};
use serde_json::{Value, json};
use ucom_host::explain::{Word, find, words};

use crate::args::ExplainArgs;

/// Prints the meanings of the requested words, or the list of all words.
pub(super) fn explain(args: &ExplainArgs, out: &Output) -> Result<(), Failure> {
    let (query, all) = (args.word.join(" "), words());
    let found = if query.is_empty() { all.iter().collect() } else { find(&all, &query) };
    if found.is_empty() {
        return Err(Failure::usage(format!("unknown word or number: \"{query}\""))
            .next("ucom explain lists all words; a number is the number of a board error"));
    }
    let value = |w: &&Word| -> Value {
        json!({ "name": w.shown[0], "family": w.family, "shown": w.shown, "meaning": w.meaning, "next": w.next })
    };
    out.result(&json!({ "pages": found.iter().map(value).collect::<Vec<_>>() }), || {
        if query.is_empty() {
            let rows: Vec<Vec<String>> =
                found.iter().map(|w| vec![w.shown.join(", "), w.family.to_owned()]).collect();
            return format!(
                "{}\nucom explain WORD shows what it means and what to do",
                table(&["word", "of"], &rows)
            );
        }
        let page = |w: &&Word| {
            format!(
                "{} - {}\n  meaning: {}\n  next:    {}\n",
                w.shown.join(", "),
                w.family,
                w.meaning,
                w.next
            )
        };
        found.iter().map(page).collect::<Vec<_>>().join("\n")
    });
    Ok(())
}
