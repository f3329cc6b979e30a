//! Runs other programs. The module prints each command before running it. If a command fails, the error contains the
//! command.
use std::cell::Cell;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

/// Returns the root folder of the workspace.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."))
}

/// Returns the target folder of cargo.
pub(crate) fn target() -> PathBuf {
    match std::env::var_os("CARGO_TARGET_DIR") {
        Some(directory) => root().join(directory),
        None => root().join("target"),
    }
}

/// Returns a command that runs `program` in the root folder of the workspace.
pub(crate) fn command(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(root());
    // The command must not inherit the environment variables that cargo sets for the package of xtask. Some build
    // scripts, such as that of the crate ring, read these variables. Such scripts would run again whenever the user
    // changes between xtask and cargo without xtask.
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        if text.starts_with("CARGO_PKG_") || text.starts_with("CARGO_MANIFEST_") {
            command.env_remove(&name);
        }
    }
    command
}

/// Returns a command that runs cargo of the pinned toolchain.
pub(crate) fn cargo(arguments: &[&str]) -> Command {
    let mut cargo = command(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(arguments);
    cargo
}

/// Configures cargo to compile the packages of the workspace with Clippy, which is the compiler with more warnings. A single build then
/// creates the programs and reports the warnings of `cargo clippy`. A separate `cargo clippy` would compile all dependencies a second
/// time.
pub(crate) fn lint(cargo: &mut Command) -> Result<&mut Command> {
    let sysroot = read(command("rustc").args(["--print", "sysroot"]))?;
    let clippy = Path::new(sysroot.trim()).join("bin/clippy-driver");
    if !clippy.exists() {
        bail!("{} is missing; install it: rustup component add clippy", clippy.display());
    }
    Ok(cargo.env("RUSTC_WORKSPACE_WRAPPER", clippy).env("CLIPPY_ARGS", ""))
}

/// Returns the processor time of all programs that have ended so far, with their child processes. Returns `None` if the system has no
/// `/proc`.
///
/// The result includes programs of [`in_background`] that have ended.
pub(crate) fn processor_seconds() -> Option<f64> {
    // According to proc_pid_stat(5), the name of the program in parentheses is followed by the third and later fields.
    // cutime and cstime are fields 16 and 17, in 1/100 s.
    let line = std::fs::read_to_string("/proc/self/stat").ok()?;
    let mut fields = line.rsplit(") ").next()?.split(' ').skip(13);
    let ticks = fields.next()?.parse::<f64>().ok()? + fields.next()?.parse::<f64>().ok()?;
    Some(ticks / 100.0)
}

fn shown(command: &Command) -> String {
    let program = Path::new(command.get_program()).file_name().unwrap_or(command.get_program());
    let mut line = program.to_string_lossy().into_owned();
    for argument in command.get_args() {
        line.push(' ');
        line.push_str(&argument.to_string_lossy());
    }
    line
}

fn announce(command: &Command) {
    println!("$ {}", shown(command));
    let _ = std::io::stdout().flush();
}

thread_local! {
    /// `true` if programs of this thread run in the background, at the lowest priority and without output.
    static IN_BACKGROUND: Cell<bool> = const { Cell::new(false) };
}

/// Runs the closure `body`. Programs that `body` starts with [`run`] or [`read`] run at the lowest priority and without
/// output.
pub(crate) fn in_background<T>(body: impl FnOnce() -> T) -> T {
    IN_BACKGROUND.set(true);
    let done = body();
    IN_BACKGROUND.set(false);
    done
}

/// Returns the command with a lower priority. The lowest priority is `by` = 19.
pub(crate) fn nice(command: &Command, by: u8) -> Command {
    let mut nice = Command::new("nice");
    nice.args(["-n", &by.to_string()]).arg(command.get_program()).args(command.get_args());
    if let Some(directory) = command.get_current_dir() {
        nice.current_dir(directory);
    }
    for (name, value) in command.get_envs() {
        match value {
            Some(value) => nice.env(name, value),
            None => nice.env_remove(name),
        };
    }
    nice
}

/// Runs a command whose output appears on the terminal. Returns an error if the exit code is not 0.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let background = IN_BACKGROUND.get();
    if !background {
        announce(command);
    }
    let silent = |mut command: Command| {
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status()
    };
    let status = if background { silent(nice(command, 19)) } else { command.status() };
    let status = status.with_context(|| format!("cannot start `{}`", shown(command)))?;
    if !status.success() {
        bail!("`{}` ended with {status}", shown(command));
    }
    Ok(())
}

/// Runs a command. Prints each line of its standard output immediately, and also passes each line to `line`.
pub(crate) fn run_lines(command: &mut Command, mut line: impl FnMut(&str)) -> Result<()> {
    read_lines(command, |text| {
        println!("{text}");
        line(text);
    })
}

/// Runs a command and passes each line of its standard output to `line` immediately.
pub(crate) fn read_lines(command: &mut Command, mut line: impl FnMut(&str)) -> Result<()> {
    announce(command);
    let mut child = command
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| format!("cannot start `{}`", shown(command)))?;
    if let Some(output) = child.stdout.take() {
        for text in BufReader::new(output).split(b'\n') {
            let text = String::from_utf8_lossy(&text?).into_owned();
            line(&text);
        }
    }
    let status = child.wait()?;
    if !status.success() {
        bail!("`{}` ended with {status}", shown(command));
    }
    Ok(())
}

/// Runs a command and returns its standard output. Progress and errors of the command appear on the terminal.
pub(crate) fn read(command: &mut Command) -> Result<String> {
    let background = IN_BACKGROUND.get();
    let output = command
        .stderr(if background { Stdio::null() } else { Stdio::inherit() })
        .output()
        .with_context(|| format!("cannot start `{}`", shown(command)))?;
    if !output.status.success() {
        bail!(
            "`{}` ended with {}\n{}",
            shown(command),
            output.status,
            String::from_utf8_lossy(&output.stdout).trim_end()
        );
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Returns `true` if a program can be started and its exit code is 0. Discards the output of the program.
pub(crate) fn works(command: &mut Command) -> bool {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Installs Debian packages. The function needs root privileges.
pub(crate) fn apt_install(packages: &[&str]) -> Result<()> {
    let hint = format!("install it by hand: sudo apt-get install {}", packages.join(" "));
    if !works(command("id").arg("-u")) || read(command("id").arg("-u"))?.trim() != "0" {
        bail!("the package {} is missing; {hint}", packages.join(" "));
    }
    let install = || {
        let mut apt = command("apt-get");
        apt.args(["install", "-y", "-q", "--no-install-recommends"]).args(packages);
        apt.env("DEBIAN_FRONTEND", "noninteractive").stdout(Stdio::null());
        apt
    };
    if run(&mut install()).is_err() {
        run(command("apt-get").args(["update", "-q"]).stdout(Stdio::null())).context(hint.clone())?;
        run(&mut install()).context(hint)?;
    }
    Ok(())
}

/// Separate folder in the temporary folder of the system. The folder is removed when this value is dropped.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    /// Creates a new folder; `name` describes its purpose.
    pub(crate) fn new(name: &str) -> Result<Self> {
        let path = std::env::temp_dir().join(format!("openjtc-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).with_context(|| format!("cannot create {}", path.display()))?;
        Ok(Self(path))
    }

    /// Returns the path of the folder.
    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Returns the sorted files below `directory` with one of these extensions. The result does not contain build output,
/// installed packages and hidden folders.
pub(crate) fn files(directory: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut waiting = vec![directory.to_owned()];
    while let Some(directory) = waiting.pop() {
        let Ok(entries) = std::fs::read_dir(&directory) else { continue };
        for entry in entries.flatten() {
            let path = entry.path();
            let name = entry.file_name();
            let name = name.to_string_lossy();
            if path.is_dir() {
                if name != "target" && name != "node_modules" && !name.starts_with('.') {
                    waiting.push(path);
                }
            } else if path.extension().is_some_and(|e| extensions.iter().any(|wanted| e == *wanted)) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// Removes `--name value` or `--name=value` from `arguments` and returns the value.
pub(crate) fn option(arguments: &mut Vec<String>, name: &str) -> Result<Option<String>> {
    let prefix = format!("{name}=");
    if let Some(at) = arguments.iter().position(|a| a.starts_with(&prefix)) {
        return Ok(Some(arguments.remove(at)[prefix.len()..].to_owned()));
    }
    let Some(at) = arguments.iter().position(|a| a == name) else { return Ok(None) };
    if at + 1 >= arguments.len() {
        bail!("{name} needs a value");
    }
    arguments.remove(at);
    Ok(Some(arguments.remove(at)))
}

/// Removes `--name` from `arguments`. Returns `true` if `arguments` contained this flag.
pub(crate) fn flag(arguments: &mut Vec<String>, name: &str) -> bool {
    let before = arguments.len();
    arguments.retain(|a| a != name);
    arguments.len() != before
}

/// Returns an error if `arguments` still contains unknown arguments.
pub(crate) fn nothing_left(arguments: &[String]) -> Result<()> {
    match arguments.first() {
        Some(argument) => bail!("unknown argument `{argument}`; see `cargo xtask help`"),
        None => Ok(()),
    }
}
