//! Generates the constants of the default arm from `arms/avena.toml`, so that each default value is defined in one place.
use std::fmt::Write;
use std::{env, fs, path::PathBuf};

use toml::{Table, Value};

fn main() {
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("../..");
    let file = root.join("arms/avena.toml");
    println!("cargo::rerun-if-changed={}", file.display());
    let text = fs::read_to_string(&file).unwrap_or_else(|e| panic!("cannot read {}: {e}", file.display()));
    let arm: Table = text.parse().unwrap_or_else(|e| panic!("{} is not TOML: {e}", file.display()));
    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets it")).join("default_arm.rs");
    fs::write(&out, generate(&arm)).unwrap_or_else(|e| panic!("cannot write {}: {e}", out.display()));
}

/// Returns the value under `key`. If the key is missing, the panic message contains the key.
fn get<'a>(table: &'a Table, key: &str) -> &'a Value {
    table.get(key).unwrap_or_else(|| panic!("arms/avena.toml: `{key}` is missing"))
}

fn number(value: &Value) -> f64 {
    value
        .as_float()
        .or_else(|| value.as_integer().map(|i| i as f64))
        .expect("arms/avena.toml: a number is expected")
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("arms/avena.toml: a list is expected").iter().map(number).collect()
}

fn tables<'a>(arm: &'a Table, key: &str, count: &[usize]) -> Vec<&'a Table> {
    let list: Vec<_> = get(arm, key)
        .as_array()
        .expect("a list of tables")
        .iter()
        .map(|v| v.as_table().expect("a table"))
        .collect();
    assert!(
        count.contains(&list.len()),
        "arms/avena.toml: {} times [[{key}]], {count:?} are possible",
        list.len()
    );
    list
}

fn generate(arm: &Table) -> String {
    let mut s = String::new();
    let joints = tables(arm, "joint", &[7]);
    let links = tables(arm, "link", &[7]);
    let friction = tables(arm, "friction_table", &[1, 6]);
    let name = get(arm, "name").as_str().expect("arms/avena.toml: the name is a text");
    let _ = writeln!(s, "/// Name of the arm.\npub(crate) const NAME: &str = {name:?};");
    let _ = writeln!(
        s,
        "/// Acceleration of gravity in the base frame, m/s².\npub(crate) const GRAVITY: [f64; 3] = {:?};",
        numbers(get(arm, "gravity_m_s2"))
    );

    let _ = writeln!(
        s,
        "/// Limits and rotor inertia per joint.\npub(crate) const JOINT_CONFIG: [JointConfig; 6] = ["
    );
    for j in &joints[..6] {
        let n = |key: &str| number(get(j, key));
        let rotor = j.get("rotor_inertia_kg_m2").map_or(0.0, number);
        let gain = j.get("torque_gain").map_or(1.0, number);
        let damping = n("teach_damping_nm_s_rad");
        let _ = writeln!(
            s,
            "JointConfig {{ position_min: {:?}, position_max: {:?}, velocity_max: {:?}, acceleration_max: {:?}, torque_max: {:?}, position_error_max: {:?}, rotor_inertia: {rotor:?}, torque_gain: {gain:?}, teach_damping: {damping:?} }},",
            n("position_min_rad"),
            n("position_max_rad"),
            n("velocity_max_rad_s"),
            n("acceleration_max_rad_s2"),
            n("torque_max_nm"),
            n("position_error_max_rad"),
        );
    }
    let _ = writeln!(s, "];\n/// Gains per joint.\npub(crate) const PID: [PidGains; 6] = [");
    for j in &joints[..6] {
        let pid = get(j, "pid").as_table().expect("pid is a table");
        let n = |key: &str| number(get(pid, key));
        let _ = writeln!(
            s,
            "PidGains {{ kp: {:?}, ki: {:?}, kd: {:?}, int_min: {:?}, int_max: {:?} }},",
            n("kp"),
            n("ki"),
            n("kd"),
            n("int_min_rad_s"),
            n("int_max_rad_s"),
        );
    }
    let polynomials: Vec<_> = joints[..6].iter().map(|j| numbers(get(j, "friction_polynomial"))).collect();
    let _ = writeln!(
        s,
        "];\n/// Friction polynomial c0..c5 per joint.\npub(crate) const POLYNOMIAL: [[f64; 6]; 6] = {polynomials:?};"
    );

    let origin = |t: &Table, xyz: &str, rpy: &str| {
        format!("Origin {{ xyz: {:?}, rpy: {:?} }}", numbers(get(t, xyz)), numbers(get(t, rpy)))
    };
    let _ =
        writeln!(s, "/// Kinematics and masses.\npub(crate) const MODEL: ArmModel = ArmModel {{ joints: [");
    for j in &joints {
        let _ = writeln!(s, "{},", origin(j, "origin_xyz_m", "origin_rpy_rad"));
    }
    let _ = writeln!(s, "], links: [");
    for l in &links {
        let _ = writeln!(
            s,
            "Link {{ origin: {}, inertia: {:?}, mass: {:?} }},",
            origin(l, "com_xyz_m", "com_rpy_rad"),
            numbers(get(l, "inertia_kg_m2")),
            number(get(l, "mass_kg")),
        );
    }
    let _ = writeln!(
        s,
        "] }};\n/// Friction tables: one for all joints, or one each.\npub(crate) static TABLES: [TableOf<f32>; {}] = [",
        friction.len()
    );
    for t in &friction {
        let rows: Vec<_> = get(t, "torque_nm").as_array().expect("rows").iter().map(numbers).collect();
        let _ = writeln!(
            s,
            "TableOf {{ velocity: {:?}, temperature: {:?}, torque: {rows:?} }},",
            numbers(get(t, "velocity_rad_s")),
            numbers(get(t, "temperature_c")),
        );
    }
    s.push_str("];\n");
    s
}
