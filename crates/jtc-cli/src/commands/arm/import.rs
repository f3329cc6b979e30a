//! `jtc arm import`: creates an arm file from a robot description.

use std::collections::BTreeMap;

use cli_kit::{Failure, Output, OutputFile, table};
use jtc_host::arm::{Arm, ArmChoice, ArmValue, Change, RULES, Source, Warning};
use jtc_wire::Joint;
use serde_json::json;

use super::show::number;
use crate::args::ImportArgs;

pub(super) fn import(args: &ImportArgs, out: &Output) -> Result<(), Failure> {
    let choice = ArmChoice { joints: args.joints.clone(), tip: args.tip.clone(), friction: args.friction };
    let arm = Arm::import(&args.urdf, &choice)?;
    let file = OutputFile::open(&args.out, args.overwrite.overwrite, &[&args.urdf])?;
    let name = file.name();
    file.write(arm.to_toml())?;
    let proposed: Vec<ArmValue> = arm.values().into_iter().filter(|v| v.from == Source::Proposed).collect();
    let rules: Vec<_> =
        RULES.iter().filter(|rule| arm.sources.proposed().any(|(_, key)| key == rule.name)).collect();
    let mut missing: Vec<String> = arm.parameter_set().missing().iter().map(ToString::to_string).collect();
    missing
        .extend(arm.lacking_by_key().iter().map(|(key, owners)| format!("{key} of {}", owners.join(", "))));
    let value = json!({
        "file": name, "arm": arm.name, "joints": arm.joint_names, "links": arm.link_names, "flange": arm.flange_name,
        "warnings": arm.warnings, "proposed": proposed, "rules": rules, "missing": missing,
    });
    out.result(&value, || {
        let numbered =
            Joint::ALL.iter().zip(&arm.joint_names).map(|(j, name)| format!("{} {name}", j.number()));
        let joints: Vec<String> = numbered.collect();
        let mut text = format!("{name}: arm {}\njoints: {}\n", arm.name, joints.join(", "));
        text += &format!("base: link {}; flange: {}\n", arm.link_names[0], arm.flange_name);
        text += &changes(&arm.warnings);
        text += "proposed: starting values that a URDF does not contain, computed by rule and marked in the \
                file\n";
        text += &indented(&as_table(&proposed));
        for rule in rules {
            text += &format!("  {}: {}\n", rule.name, rule.rule);
        }
        if arm.lacking.is_empty() {
            text + &format!("next: jtc arm check {name}, then jtc arm show {name}")
        } else {
            text + "next: add the missing values to the robot description and import it again; jtc arm check lists them"
        }
    });
    Ok(())
}

/// Lists the changes of the import, grouped by kind. If several joints have the same change, one line lists all of these
/// joints.
fn changes(warnings: &[Warning]) -> String {
    let mut kinds: BTreeMap<Change, Vec<(&str, Vec<&str>)>> = BTreeMap::new();
    for w in warnings {
        let lines = kinds.entry(w.change).or_default();
        match lines.iter_mut().find(|(problem, _)| *problem == w.problem) {
            Some((_, places)) => places.push(&w.place),
            None => lines.push((&w.problem, vec![&w.place])),
        }
    }
    let mut text = String::new();
    for (change, lines) in kinds {
        text += &format!("{}\n", change.heading());
        for (problem, places) in lines {
            // After the first place, the word "joint" is removed, so that the list reads "joint a, b, c".
            let rest = |place: &&str| place.strip_prefix("joint ").unwrap_or(place).to_owned();
            let more: Vec<String> = places[1..].iter().map(rest).collect();
            let all = [vec![places[0].to_owned()], more].concat();
            text += &format!("  {}: {}\n", all.join(", "), problem.replace('`', ""));
        }
    }
    text
}

/// Formats the proposed values as a table, with a row for each value and a column for each joint.
fn as_table(values: &[ArmValue]) -> String {
    let mut rows: Vec<(&ArmValue, [String; 6])> = Vec::new();
    for v in values {
        let Some(joint) = v.joint else { continue };
        if v.name.starts_with("friction_polynomial")
            && all_zero(values, v.name)
            && v.name != "friction_polynomial.c0"
        {
            continue;
        }
        let cell = v.value.map_or("-".into(), number);
        match rows.iter_mut().find(|(first, _)| first.name == v.name) {
            Some((_, cells)) => cells[joint.index()] = cell,
            None => {
                let mut cells = [const { String::new() }; 6];
                cells[joint.index()] = cell;
                rows.push((v, cells));
            }
        }
    }
    let rows: Vec<Vec<String>> = rows
        .into_iter()
        .map(|(v, cells)| [vec![v.name.to_owned()], cells.to_vec(), vec![v.unit.to_owned()]].concat())
        .collect();
    table(&["", ">1", ">2", ">3", ">4", ">5", ">6", "unit"], &rows)
}

fn all_zero(values: &[ArmValue], name: &str) -> bool {
    values.iter().filter(|v| v.name == name).all(|v| v.value == Some(0.0))
}

fn indented(text: &str) -> String {
    text.lines().map(|line| format!("  {line}\n")).collect()
}
