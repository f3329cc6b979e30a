//! Sets linker script, build id and baud rate of the firmware. Rejects builds that would compile but not work on the
//! board.
use std::path::PathBuf;
use std::process::Command;
use std::{env, fs};

/// Default baud rate according to rule J-01.
const BAUD_DEFAULT: u32 = 115_200;
const BAUD_MAX: u32 = 15_000_000;

const BOARDS: [&str; 3] = ["nucleo-h745zi-q", "nucleo-h745zi-q-ldo", "nucleo-h743zi2"];

fn main() {
    let chosen = |board: &&str| {
        let feature = board.to_uppercase().replace('-', "_");
        env::var_os(format!("CARGO_FEATURE_{feature}")).is_some()
    };
    let boards = BOARDS.iter().filter(|board| chosen(board)).count();
    if boards != 1 {
        panic!(
            "{boards} boards: choose one by --no-default-features --features BOARD, where BOARD is one of {BOARDS:?}"
        );
    }

    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets it"));
    fs::copy("memory.x", out.join("memory.x")).expect("memory.x is beside this file");
    println!("cargo::rustc-link-search={}", out.display());
    println!("cargo::rerun-if-changed=memory.x");

    println!("cargo::rerun-if-env-changed=OPENJTC_BAUD");
    let baud = env::var("OPENJTC_BAUD").unwrap_or_else(|_| BAUD_DEFAULT.to_string());
    match baud.parse::<u32>() {
        Ok(rate @ 9_600..=BAUD_MAX) => println!("cargo::rustc-env=OPENJTC_BAUD={rate}"),
        _ => panic!(
            "OPENJTC_BAUD={baud}: a whole number from 9600 to {BAUD_MAX} is needed, for example 921600"
        ),
    }
    println!("cargo::rustc-env=OPENJTC_BUILD={}", build_id());

    let flags = env::var("CARGO_ENCODED_RUSTFLAGS").unwrap_or_default();
    if env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("none") && !flags.contains("target-cpu=cortex-m7") {
        panic!(
            "target-cpu=cortex-m7 is missing: without it the control law is computed in software and takes 60 times \
             as long. Build inside firmware/, where .cargo/config.toml sets it, and do not set RUSTFLAGS."
        );
    }
}

/// Returns the commit that is built, followed by `+` if files were changed after the commit. The text always has
/// thirteen characters, so logging it takes the same time in every build, and measurements of different builds are
/// comparable.
fn build_id() -> String {
    let git = |args: &[&str]| {
        let out = Command::new("git").args(args).output().ok()?;
        out.status.success().then(|| String::from_utf8_lossy(&out.stdout).trim().to_owned())
    };
    if let Some(head) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo::rerun-if-changed={head}");
    }
    match (
        git(&["rev-parse", "--short=13", "HEAD"]),
        git(&["status", "--porcelain", "--", "..", ":!../docs"]),
    ) {
        (Some(hash), Some(changes)) if changes.is_empty() => hash,
        (Some(hash), Some(_)) => format!("{}+", &hash[..12]),
        _ => "not-in-a-repo".to_owned(),
    }
}
