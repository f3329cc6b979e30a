//! `jtc arm show`: prints all parameters of an arm.

use cli_kit::{Failure, Output, table};
use jtc_host::arm::{Arm, ArmValue, Source};
use jtc_wire::Joint;
use serde_json::json;

/// Number of degrees in a radian.
const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// Prints the parameters of the arm. `name` is the file or the controller from which the arm was read.
pub(super) fn show(arm: &Arm, name: &str, deg: bool, out: &Output) -> Result<(), Failure> {
    let mut values = arm.values();
    if deg {
        values.iter_mut().for_each(in_degrees);
    }
    let value = json!({
        "file": name, "arm": arm.name, "joints": arm.joint_names, "links": arm.link_names,
        "flange": arm.flange_name, "poses_rad": arm.poses, "friction_table": arm.table.is_some(), "warnings": arm.warnings, "values": values,
    });
    out.result(&value, || {
        let numbered =
            Joint::ALL.iter().zip(&arm.joint_names).map(|(j, name)| format!("{} {name}", j.number()));
        let joints: Vec<String> = numbered.collect();
        let mut text = format!("{name}: arm {}\njoints: {}\n", arm.name, joints.join(", "));
        text += &gravity(&values);
        text += &format!("\n{}", by_joint(&values));
        let marks = [
            (Source::Proposed, "* proposed: not measured, and not from a data sheet"),
            (Source::Default, "d default: the file does not give this value"),
        ];
        for (source, words) in marks {
            if values.iter().any(|v| v.joint.is_some() && v.from == source) {
                text += &format!("{words}\n");
            }
        }
        if arm.table.is_some() {
            text += "the file also has friction tables; the polynomial is used unless --friction table \
                    selects the tables\n";
        }
        let unit = |name: &str| values.iter().find(|v| v.name == name).map_or("", |v| v.unit);
        text += &format!("\n{}", frames(&values, arm, unit("origin_rpy_rad.roll")));
        text += &format!("\n{}", links(&values, arm, unit("com_rpy_rad.roll")));
        if !arm.poses.is_empty() {
            text += &format!("\n{}", poses(arm, deg));
        }
        text + &format!(
            "\nsettings of the controller; an arm file can set them in [settings]\n{}",
            of_controller(&values)
        )
    });
    Ok(())
}

/// Converts a value to degrees if the value is an angle or an angular rate.
fn in_degrees(v: &mut ArmValue) {
    let unit = match v.unit {
        "rad" => "°",
        "rad/s" => "°/s",
        "rad/s²" => "°/s²",
        _ => return,
    };
    v.unit = unit;
    for number in [&mut v.value, &mut v.min, &mut v.max, &mut v.default].into_iter().flatten() {
        *number *= DEGREES;
    }
}

/// Formats a number with five significant digits, without trailing zeros.
pub(super) fn number(value: f64) -> String {
    // Values from rotated frames contain rounding errors, so values below 1e-11 are shown as 0.
    if value.abs() < 1e-11 {
        return "0".into();
    }
    let magnitude = value.abs().log10().floor();
    if !(-4.0..7.0).contains(&magnitude) {
        return format!("{value:.3e}");
    }
    let digits = (4 - magnitude as i32).clamp(0, 8) as usize;
    let text = format!("{value:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.to_owned() }
}

fn opt(value: Option<f64>) -> String {
    value.map_or("-".into(), number)
}

fn range(v: &ArmValue) -> String {
    match (v.min, v.max) {
        (Some(a), Some(b)) if a == -b => format!("±{}", number(b)),
        (Some(a), Some(b)) => format!("{}..{}", number(a), number(b)),
        (Some(a), None) => format!("{}..", number(a)),
        _ => "any".into(),
    }
}

fn gravity(values: &[ArmValue]) -> String {
    let all: Vec<&ArmValue> = values.iter().filter(|v| v.name.starts_with("gravity")).collect();
    let numbers =
        |get: fn(&ArmValue) -> Option<f64>| all.iter().map(|v| opt(get(v))).collect::<Vec<_>>().join(" ");
    let from = all.first().map_or("", |v| v.from.name());
    let (own, default) = (numbers(|v| v.value), numbers(|v| v.default));
    format!("gravity: {own} m/s² in the frame of the base, default {default}, from: {from}\n")
}

/// Formats each joint parameter of the arm as a table row.
fn by_joint(values: &[ArmValue]) -> String {
    let of_joints = |v: &&ArmValue| v.joint.is_some() && v.link.is_none();
    let mut names: Vec<&str> = Vec::new();
    values.iter().filter(of_joints).for_each(|v| {
        if !names.contains(&v.name) {
            names.push(v.name);
        }
    });
    let row = |name: &&str| {
        let all: Vec<&ArmValue> = values.iter().filter(of_joints).filter(|v| v.name == *name).collect();
        let mark = |v: &ArmValue| match v.from {
            Source::Proposed => "*",
            Source::Default => "d",
            _ => " ",
        };
        let mut cells = vec![(*name).to_owned()];
        cells.extend(all.iter().map(|v| format!("{}{}", opt(v.value), mark(v))));
        cells.extend([all[0].unit.to_owned(), range(all[0]), opt(all[0].default), source(&all)]);
        cells
    };
    let rows: Vec<Vec<String>> = names.iter().map(row).collect();
    table(&["", ">1 ", ">2 ", ">3 ", ">4 ", ">5 ", ">6 ", "unit", "range", ">default", "from"], &rows)
}

/// Returns the source of the values in a table row.
fn source(all: &[&ArmValue]) -> String {
    let mut sources: Vec<&str> = all.iter().map(|v| v.from.name()).collect();
    sources.dedup();
    sources.sort_unstable();
    sources.dedup();
    sources.join(", ")
}

/// Formats the settings of the controller that do not belong to a joint.
fn of_controller(values: &[ArmValue]) -> String {
    let own = |v: &&ArmValue| v.joint.is_none() && v.link.is_none() && !v.name.starts_with("gravity");
    let row = |v: &ArmValue| {
        vec![
            v.name.to_owned(),
            opt(v.value),
            v.unit.to_owned(),
            range(v),
            opt(v.default),
            v.from.name().to_owned(),
        ]
    };
    let rows: Vec<Vec<String>> = values.iter().filter(own).map(row).collect();
    table(&["", ">value", "unit", "range", ">default", "from"], &rows)
}

/// Formats each pose of the arm as a table row.
pub(crate) fn poses(arm: &Arm, deg: bool) -> String {
    let row = |(name, position): (&String, &[f64; 6])| {
        let cells = position.iter().map(|v| number(if deg { v * DEGREES } else { *v }));
        std::iter::once(name.clone()).chain(cells).collect()
    };
    let rows: Vec<Vec<String>> = arm.poses.iter().map(row).collect();
    table(&[if deg { "pose, °" } else { "pose, rad" }, ">1", ">2", ">3", ">4", ">5", ">6"], &rows)
}

fn frames(values: &[ArmValue], arm: &Arm, angle: &str) -> String {
    let row = |i: usize| {
        let (number, name) = match arm.joint_names.get(i) {
            Some(name) => ((i + 1).to_string(), name),
            None => ("flange".to_owned(), &arm.flange_name),
        };
        let cells = values.iter().filter(|v| v.name.starts_with("origin_") && v.link == Some(i + 1));
        [vec![format!("{number} {name}")], cells.map(|v| opt(v.value)).collect()].concat()
    };
    let rows: Vec<Vec<String>> = (0..7).map(row).collect();
    let angles = ["roll", "pitch", "yaw"].map(|name| format!(">{name} {angle}"));
    let [roll, pitch, yaw] = &angles;
    table(&["frame of joint", ">x m", ">y m", ">z m", roll, pitch, yaw], &rows)
}

fn links(values: &[ArmValue], arm: &Arm, angle: &str) -> String {
    let cells = |i: usize, parts: [&str; 2]| -> Vec<String> {
        let of = |v: &&ArmValue| v.link == Some(i) && parts.iter().any(|part| v.name.starts_with(part));
        values.iter().filter(of).map(|v| opt(v.value)).collect()
    };
    let rows = |parts: [&str; 2]| -> Vec<Vec<String>> {
        let named = arm.link_names.iter().enumerate();
        named.map(|(i, name)| [vec![format!("{i} {name}")], cells(i, parts)].concat()).collect()
    };
    let angles = ["roll", "pitch", "yaw"].map(|name| format!(">{name} {angle}"));
    let [roll, pitch, yaw] = &angles;
    let masses = table(
        &["link, centre of mass", ">kg", ">x m", ">y m", ">z m", roll, pitch, yaw],
        &rows(["mass_kg", "com_"]),
    );
    let inertia = table(
        &["link, inertia kg·m²", ">ixx", ">ixy", ">ixz", ">iyy", ">iyz", ">izz"],
        &rows(["inertia_", "inertia_"]),
    );
    format!("{masses}\n{inertia}")
}
