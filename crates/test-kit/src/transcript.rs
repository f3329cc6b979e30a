//! Pages with commands that a test runs. The test types the commands in the way in which a reader of the page types them, and compares
//! their output with the page.
//!
//! The test executes a page from top to bottom in a separate folder. A comment on the page selects the program whose tests run the
//! fenced blocks of the page, for example `<!-- commands: jtc -->`. The blocks are of the kind `console` (commands after `$ `, output
//! below) and `sh` (commands without output). Each command must succeed, unless the next command is `echo $?`, and must print the
//! output on the page. A line `...` on the page stands for any number of output lines. A comment directly above a block contains
//! options, separated by semicolons:
//!
//! - `not run: REASON`: the test skips the block and counts it with its reason.
//! - `numbers vary`: the test does not compare numbers, except numbers of joints and boards.
//! - `terminal: NAME`: the test types the block in a separate terminal; the last command of the block keeps running. If the block shows
//!   no command, the test waits until the terminal has printed the lines of the block. With `Ctrl-C`, the test first interrupts the
//!   program in this terminal.
//! - `in tests: WORDS`: the test adds these options to the last command, so that it takes no longer than necessary.
//! - `typed: NAME`: the test types the lines of a `text` block into the program that runs in the terminal `NAME`.
//! - `program: NAME`: the tests of the program `NAME` run the block, instead of the tests of the program of the page.
//!
//! The test maps `/tmp/jtc` and other paths in `/tmp` to the folder of the page. If `in tests` specifies a port for a program
//! (`127.0.0.1:0`), this port replaces the port on the page. `UPDATE_DOCS=1` updates the page if the output of its commands has
//! changed.

mod blocks;
mod compare;
mod terminal;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

pub use blocks::{Block, Kind, Step, blocks};
use compare::same;
use terminal::Terminal;

/// Result of running the commands of a page.
#[derive(Debug, Default)]
pub struct Followed {
    /// Number of commands that were run.
    pub commands: usize,
    /// Reasons why the test did not run blocks.
    pub left_out: Vec<String>,
    /// Differences between the documentation page and the output of the commands.
    pub wrong: Vec<String>,
}

/// Runs every page with blocks of this program, in parallel: README.md and the pages of docs/. `programs` is the folder that contains
/// the program.
///
/// # Panics
/// Panics if a page differs from the output of its commands, or if no page has such blocks. The message contains the first lines that
/// differ of each block.
pub fn follow_all(program: &str, programs: &Path) {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let docs = std::fs::read_dir(root.join("docs")).expect("docs/");
    let mut pages: Vec<PathBuf> = docs.map(|entry| entry.expect("an entry").path()).collect();
    pages.push(root.join("README.md"));
    pages.retain(|page| page.extension().is_some_and(|ending| ending == "md"));
    pages.sort();
    let about = |page: &PathBuf| {
        let text = std::fs::read_to_string(page).expect("a page");
        blocks(&text).iter().any(|block| block.program() == Some(program))
    };
    pages.retain(about);
    assert!(!pages.is_empty(), "no page is about {program}");
    let followed: Vec<(PathBuf, Followed)> = std::thread::scope(|scope| {
        let start = |page: PathBuf| scope.spawn(move || (page.clone(), follow(&page, program, programs)));
        let threads: Vec<_> = pages.into_iter().map(start).collect();
        threads.into_iter().map(|thread| thread.join().expect("it is followed to its end")).collect()
    });
    let mut wrong = Vec::new();
    for (page, done) in followed {
        let name = page.file_name().unwrap_or_default().to_string_lossy().into_owned();
        println!("{name}: {} commands run, {} blocks not", done.commands, done.left_out.len());
        done.left_out.iter().for_each(|reason| println!("  not run: {reason}"));
        wrong.extend(done.wrong.into_iter().map(|text| format!("{name}, {text}")));
    }
    assert!(
        wrong.is_empty(),
        "pages do not say what their commands print; look at the difference, then write it again with UPDATE_DOCS=1\n\n{}",
        wrong.join("\n\n")
    );
}

/// Runs the commands of one page, and updates the page if `UPDATE_DOCS` is set.
pub fn follow(page: &Path, program: &str, programs: &Path) -> Followed {
    let text = std::fs::read_to_string(page).expect("a page");
    let mut run = Run::new(programs, page);
    let mut new = text.clone();
    // The function replaces the blocks from the end to the beginning, so that earlier positions remain valid.
    let mut changed = Vec::new();
    for block in blocks(&text).iter().filter(|block| block.program() == Some(program)) {
        if let Some(reason) = block.note("not run") {
            run.done.left_out.push(format!("line {}: {reason}", block.line));
        } else if let Some(steps) = run.block(block) {
            changed.push((block.body.clone(), blocks::written(&steps)));
        }
    }
    if std::env::var_os("UPDATE_DOCS").is_some() {
        for (place, text) in changed.into_iter().rev() {
            new.replace_range(place, &text);
        }
        if new != text {
            std::fs::write(page, new).expect("the page can be written");
        }
        // The page now contains the real output, so only commands with a wrong exit code remain as errors.
        run.done.wrong.retain(|text| text.contains("exit code"));
    }
    std::mem::take(&mut run.done)
}

/// Page whose commands are being run.
struct Run {
    folder: PathBuf,
    programs: PathBuf,
    terminals: BTreeMap<String, Terminal>,
    /// Names of the terminals in which a program has replaced the shell.
    taken: BTreeSet<String>,
    /// Texts on the page, and the real texts that replace them.
    places: Vec<(String, String)>,
    done: Followed,
}

/// Name of the default terminal, for blocks without the option `terminal`.
const OWN: &str = "";

impl Run {
    fn new(programs: &Path, page: &Path) -> Self {
        let name = page.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        static PAGES: AtomicUsize = AtomicUsize::new(0);
        let number = PAGES.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("page-{name}-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let folder = folder.canonicalize().expect("a folder");
        let places = vec![("/tmp/".to_owned(), format!("{}/", folder.display()))];
        let (terminals, taken, done) = (BTreeMap::new(), BTreeSet::new(), Followed::default());
        Self { folder, programs: programs.to_owned(), terminals, taken, places, done }
    }

    fn terminal(&mut self, name: &str) -> &mut Terminal {
        let new = || Terminal::new(&self.folder, &self.programs, &["JTC_", "UCOM_"]);
        self.terminals.entry(name.to_owned()).or_insert_with(new)
    }

    /// Returns the command that the test types for a command on the page.
    fn real(&self, shown: &str) -> String {
        self.places.iter().fold(shown.to_owned(), |text, (page, real)| text.replace(page, real))
    }

    /// Returns a printed line as the page shows it.
    fn on_page(&self, line: &str) -> String {
        let line =
            self.places.iter().rev().fold(line.to_owned(), |text, (page, real)| text.replace(real, page));
        line.trim_end().to_owned()
    }

    /// Runs a block. If the real output differs from the page, returns the steps of the block with the real output.
    fn block(&mut self, block: &Block) -> Option<Vec<Step>> {
        if let Some(name) = block.note("typed") {
            for step in block.steps() {
                let line = self.real(&step.command);
                self.terminal(name).type_line(&line);
            }
            return None;
        }
        let mut steps = block.steps();
        if steps.is_empty() {
            // A block without lines does not have its output on the page yet. Such a block is handled as one step
            // without a command.
            steps.push(Step { command: String::new(), shown: Vec::new() });
        }
        let name = block.note("terminal").unwrap_or(OWN).to_owned();
        let mut changed = false;
        for n in 0..steps.len() {
            let next = steps.get(n + 1).map(|step| step.command.clone());
            let step = &mut steps[n];
            let goes_on = name != OWN && next.is_none();
            let printed = if step.command.is_empty() || (goes_on && !step.command.starts_with("export ")) {
                self.go_on(block, &name, step)
            } else {
                let (printed, code) = {
                    let command = self.real(&step.command);
                    self.terminal(&name).run(&command)
                };
                self.done.commands += 1;
                let looked_at = next.is_some_and(|next| next.starts_with("echo $?"));
                if code != 0 && !looked_at {
                    let text = format!(
                        "line {}: `{}`: exit code {code}\n{}",
                        block.line,
                        step.command,
                        printed.join("\n")
                    );
                    self.done.wrong.push(text);
                }
                printed.iter().map(|line| self.on_page(line)).collect()
            };
            if block.kind == Kind::Console && !same(&step.shown, &printed, block.says("numbers vary")) {
                self.done.wrong.push(difference(block, step, &printed));
                step.shown = printed;
                changed = true;
            }
        }
        changed.then_some(steps)
    }

    /// Starts a program that keeps running, or waits for later output of a running program. Returns the lines that were printed so far.
    fn go_on(&mut self, block: &Block, name: &str, step: &Step) -> Vec<String> {
        let (varying, shown) = (block.says("numbers vary"), step.shown.clone());
        let starts = !step.command.is_empty();
        if starts {
            // If a program still runs in this terminal, the test first ends that program.
            if !self.taken.insert(name.to_owned()) {
                self.terminals.remove(name);
            }
            let extra = block.note("in tests").map_or(String::new(), |words| format!(" {words}"));
            let command = format!("{}{extra}", self.real(&step.command));
            self.terminal(name).start(&command);
            self.done.commands += 1;
        } else if block.says("Ctrl-C") {
            self.terminal(name).interrupt();
        }
        let Some(last) = shown.iter().rfind(|line| !line.is_empty()).cloned() else {
            // If the page does not show the output yet, all lines are accepted until no line arrives for 6 s.
            let mut printed = Vec::new();
            while std::env::var_os("UPDATE_DOCS").is_some()
                && let Some(line) = self.terminal(name).line(Duration::from_secs(6))
            {
                printed.push(self.on_page(&line));
            }
            return printed;
        };
        let places = std::cell::RefCell::new(self.places.clone());
        let is_last = |line: &str| {
            // If the program uses another port than the page shows, the test stores both ports.
            if let (Some(port), Some(real)) = (port(&shown.join("\n")), port(line))
                && starts
                && port != real
            {
                places.borrow_mut().push((port, real));
            }
            let places = places.borrow();
            let line =
                places.iter().rev().fold(line.to_owned(), |text, (page, real)| text.replace(real, page));
            same(std::slice::from_ref(&last), &[line], varying)
        };
        let printed = self.terminal(name).lines_until(is_last);
        self.places = places.into_inner();
        let printed: Vec<String> = printed.iter().map(|line| self.on_page(line)).collect();
        if starts {
            return printed;
        }
        // Output before the first line that the page shows is ignored.
        let from = printed.iter().position(|line| same(&shown[..1], std::slice::from_ref(line), varying));
        printed[from.unwrap_or(0)..].to_vec()
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        self.terminals.clear();
        std::fs::remove_dir_all(&self.folder).ok();
    }
}

/// Returns the first port of this computer in a text, including the colon.
fn port(text: &str) -> Option<String> {
    let (_, rest) = text.split_once("127.0.0.1:")?;
    let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
    (digits > 0).then(|| format!(":{}", &rest[..digits]))
}

fn difference(block: &Block, step: &Step, printed: &[String]) -> String {
    format!(
        "line {}: `{}`\n--- the page shows\n{}\n--- it prints\n{}",
        block.line,
        step.command,
        step.shown.join("\n"),
        printed.join("\n")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs a page that the test stores in a separate file.
    fn followed(name: &str, text: &str) -> Followed {
        let page = std::env::temp_dir().join(format!("{name}-{}.md", std::process::id()));
        std::fs::write(&page, text).expect("a file");
        let done = follow(&page, "sh", Path::new("/bin"));
        std::fs::remove_file(&page).ok();
        done
    }

    #[test]
    fn commands_are_run_in_order_and_in_one_folder() {
        let page = "<!-- commands: sh -->\n```sh\nexport WORD=there\necho $WORD > /tmp/a\n```\n```console\n$ cat a\nthere\n$ false\n$ echo $?\n1\n```\n\
                    <!-- not run: it would never end -->\n```sh\nsleep 1000000\n```\n";
        let done = followed("in-order", page);
        assert!(done.wrong.is_empty(), "{:?}", done.wrong);
        assert_eq!((done.commands, done.left_out.len()), (5, 1));
    }

    #[test]
    fn a_page_that_is_wrong_is_found() {
        let wrong = |text: &str| followed("wrong", &format!("<!-- commands: sh -->\n{text}")).wrong;
        assert_eq!(wrong("```console\n$ echo a\nb\n```\n").len(), 1);
        assert_eq!(wrong("```console\n$ false\n```\n").len(), 1);
        assert_eq!(wrong("```console\n$ echo joint 1\njoint 2\n```\n").len(), 1);
        assert_eq!(wrong("```sh\nno-such-command\n```\n").len(), 1);
        assert_eq!(wrong("<!-- numbers vary -->\n```console\n$ echo 1.5 s\n7 s\n```\n").len(), 0);
    }

    #[test]
    fn what_goes_on_is_typed_to_and_ended() {
        let page = "<!-- commands: sh -->\n<!-- terminal: other -->\n```console\n$ sed -u s/a/b/\n```\n<!-- typed: other -->\n```text\ncat\n```\n\
                    <!-- terminal: other -->\n```console\ncbt\n```\n";
        let done = followed("goes-on", page);
        assert!(done.wrong.is_empty(), "{:?}", done.wrong);
    }

    #[test]
    fn another_port_takes_the_place_of_the_pages() {
        assert_eq!(port("ready: http://127.0.0.1:8780 (SIMULATED)").as_deref(), Some(":8780"));
        assert_eq!(port("ready: 127.0.0.1:"), None);
    }
}
