//! `jtc example`: writes example files.

use cli_kit::{Failure, Output, table};
use jtc_host::example::{EXAMPLES, Example};
use serde_json::json;

use super::job::typed;
use crate::args::ExampleArgs;
use cli_kit::OutputFile;

/// Writes an example file, or lists the examples.
pub(super) fn example(args: &ExampleArgs, out: &Output) -> Result<(), Failure> {
    let name = args.name.as_deref().unwrap_or("list");
    if name.eq_ignore_ascii_case("list") {
        list(out);
        return Ok(());
    }
    let Some(example) = Example::named(name) else {
        let names: Vec<&str> = EXAMPLES.iter().map(|e| e.name).collect();
        return Err(Failure::usage(format!(
            "example \"{name}\" does not exist; the examples are {}",
            names.join(", ")
        ))
        .next("`jtc example` describes the examples"));
    };
    let dir = args.dir.as_deref().unwrap_or(".".as_ref());
    std::fs::create_dir_all(dir).map_err(|e| Failure::usage(format!("{}: {e}", dir.display())))?;
    // Without a directory argument, the suggested command contains only the name of the example file.
    let path = if args.dir.is_some() { dir.join(example.file) } else { example.file.into() };
    OutputFile::open(&path, args.overwrite.overwrite, &[])?.write(example.text())?;
    let next = example.next.replace("{}", &typed(&path));
    let value = json!({ "file": path, "what": example.what, "next": next });
    out.result(&value, || format!("{}: {}\ntry: {next}", path.display(), example.what));
    Ok(())
}

fn list(out: &Output) {
    let value = |e: &Example| json!({ "name": e.name, "file": e.file, "what": e.what });
    out.result(&json!({ "examples": EXAMPLES.iter().map(value).collect::<Vec<_>>() }), || {
        let rows: Vec<Vec<String>> =
            EXAMPLES.iter().map(|e| [e.name, e.file, e.what].map(str::to_owned).to_vec()).collect();
        format!(
            "{}\njtc example NAME writes an example; jtc help files describes the file formats",
            table(&["name", "file", "what"], &rows)
        )
    });
}
