//! `cargo xtask docs`: updates the generated parts of docs/.
use std::process::ExitCode;

use anyhow::{Context, Result};

use crate::book;
use crate::shell::{self, Scratch, cargo, root, run};

/// Runs `cargo xtask docs`, which has no arguments.
pub(crate) fn main(arguments: &[String]) -> Result<ExitCode> {
    shell::nothing_left(arguments)?;
    let scratch = Scratch::new("docs")?;
    run(cargo(&["run", "--release", "--", "demo", "--speed", "max", "--out"]).arg(scratch.path()))?;
    std::fs::copy(scratch.path().join("picture.svg"), root().join("docs/demo.svg"))
        .context("docs/demo.svg")?;
    println!("wrote docs/demo.svg");
    let mut matrix =
        cargo(&["test", "--release", "--package", "jtc-sim", "--test", "suite", "fault_matrix::"]);
    run(matrix.env("UPDATE_DOCS", "1"))?;
    println!("wrote the fault matrix of docs/safety.md");
    let mut reactions =
        cargo(&["test", "--release", "--package", "jtc-core", "--test", "suite", "reactions::"]);
    run(reactions.env("UPDATE_DOCS", "1"))?;
    println!("wrote the table of reactions of docs/safety.md");
    // The tests that this command runs write to the same page, so they run one after the other.
    let drawn =
        ["test", "--release", "--package", "jtc-core", "--lib", "--", "the_diagram_is", "--test-threads=1"];
    let mut drawn = cargo(&drawn);
    run(drawn.env("UPDATE_DOCS", "1"))?;
    println!("wrote the diagrams of docs/protocol-jtc.md");
    for (package, part) in [("jtc-cli", "jtc"), ("ucom-cli", "ucom")] {
        let mut troubles =
            cargo(&["test", "--release", "--package", package, "--test", "suite", "troubles::"]);
        run(troubles.env("UPDATE_DOCS", "1"))?;
        println!("wrote the part of docs/troubles.md about {part}");
    }
    let mut cycle = cargo(&["test", "--release", "--package", "jtc-cli", "--test", "suite", "cycle::"]);
    run(cycle.env("UPDATE_DOCS", "1"))?;
    println!("wrote what the commands of docs/from-two-poses-to-a-cycle.md print");
    for package in ["jtc-host", "ucom-host"] {
        let mut codes =
            cargo(&["test", "--release", "--package", package, "--test", "suite", "codes_page::"]);
        run(codes.env("UPDATE_DOCS", "1"))?;
        println!("wrote the part of docs/codes.md of {package}");
    }
    for package in ["jtc-cli", "ucom-cli"] {
        let page = ["test", "--release", "--package", package, "--bins", "--", "the_page_of_the_commands"];
        run(cargo(&page).env("UPDATE_DOCS", "1"))?;
        let mut pages = cargo(&["test", "--release", "--package", package, "--test", "suite", "pages::"]);
        run(pages.env("UPDATE_DOCS", "1"))?;
        println!("wrote what the commands of {package} are and print on the pages that show it");
    }
    book::make(&shell::target().join("book"))?;
    Ok(ExitCode::SUCCESS)
}
