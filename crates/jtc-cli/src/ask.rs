//! Confirmation of a command by the user at the terminal. The user can also confirm in advance with an option.

use cli_kit::{ErrorKind, Failure};
use std::io::{BufRead, IsTerminal, Write};

/// Asks `question` and continues only if the answer is `yes`. Rejects the command if no terminal is
/// present. The hint then suggests `option`: the user can confirm in advance using this option.
pub(crate) fn confirm(question: &str, option: &str) -> Result<(), Failure> {
    let refused = |message: String| {
        Failure::new(ErrorKind::Refused, "not-confirmed-by-person", message)
            .next(format!("nothing was sent; use {option} to confirm without a question"))
    };
    if !std::io::stdin().is_terminal() || !std::io::stderr().is_terminal() {
        return Err(refused(format!("{question}: confirmation needs a terminal")));
    }
    let mut stderr = std::io::stderr();
    write!(stderr, "{question}: type yes to continue: ")?;
    stderr.flush()?;
    let mut answer = String::new();
    std::io::stdin().lock().read_line(&mut answer)?;
    if answer.trim() == "yes" { Ok(()) } else { Err(refused(format!("{question}: not confirmed"))) }
}
