//! docs/settings.md contains the table of settings (J-53). `UPDATE_DOCS=1 cargo test -p jtc-core --test suite settings_page::` writes this
//! page.
use std::fmt::Write as _;
use std::path::Path;

use jtc_core::settings::{self, Live, Setting};
use jtc_core::{Config, JOINTS};

fn page() -> String {
    let mut page = String::from(
        "# Settings of the controller\n\n\
         A host can read and change these settings (J-53), with [SetSettings](protocol-jtc.md#11-extensions) or in an arm file. Friction, gains\n\
         and arm model are not settings. A test writes this page from the table of the controller. The defaults are those of the built-in arm.\n\n\
         Most settings are a part of the arm. Such settings change only in Init or Error, are stored with the arm, and change its hash. Settings\n\
         that are *live*, or marked *not a part of the arm*, are not.\n\n\
         | number | name | range | default | meaning |\n|---|---|---|---|---|\n",
    );
    let config = Config::avena();
    for row in &settings::TABLE {
        let Setting { number, name, unit, low, high, live, meaning, .. } = row;
        let joints: Vec<f64> = if row.of_joint() {
            (1..=JOINTS as u8).filter_map(|joint| row.get(&config, joint)).collect()
        } else {
            row.get(&config, 0).into_iter().collect()
        };
        let same = joints.iter().all(|value| *value == joints[0]);
        let default = match same {
            true => format!("{}", joints[0]),
            false => joints.iter().map(f64::to_string).collect::<Vec<_>>().join(", "),
        };
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let kind = match (row.of_joint(), live) {
            (true, Live::Unpowered) => "; one per joint; not a part of the arm",
            (true, _) => "; one per joint",
            (false, Live::Always) => "; *live*: changes in every state, also in motion",
            (false, Live::Standing) => "; *live*: also changes in HoldPos, Teaching and Pause",
            (false, Live::No | Live::Unpowered) => "",
        };
        let _ =
            writeln!(page, "| {number} | `{name}` | {low} to {high}{unit} | {default} | {meaning}{kind} |");
    }
    page
}

#[test]
fn j53_the_page_of_settings_says_what_the_table_does() {
    let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/settings.md"));
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(file, page()).expect("docs/settings.md can be written");
    }
    let now = std::fs::read_to_string(file).unwrap_or_default();
    assert!(
        now == page(),
        "docs/settings.md is old: UPDATE_DOCS=1 cargo test -p jtc-core --test suite settings_page::"
    );
}
