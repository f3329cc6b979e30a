//! Files for the cases in docs/troubles.md, each with one error.

use std::fmt::Write as _;
use std::path::Path;

/// Writes all files of the cases.
pub(super) fn write(dir: &Path) {
    let save = |name: &str, text: &str| std::fs::write(dir.join(name), text).unwrap();
    // Trajectory in which all joints move forward and back to the start, in 60 steps of `step_s` seconds.
    let motion = |scale: f64, step_s: f64, offset: f64| {
        let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
        for i in 0..=60 {
            let s = (std::f64::consts::PI * f64::from(i) / 60.0).sin().powi(4);
            let q = [0.8, 0.4, -0.6, 0.8, 0.6, -1.0].map(|a| a * s * scale);
            let row: Vec<String> = q.iter().map(|q| format!("{:.6}", q + offset)).collect();
            let _ = writeln!(text, "{:.3},{}", f64::from(i) * step_s, row.join(","));
        }
        text
    };
    let good = motion(1.0, 0.1, 0.0);
    save("motion.csv", &good);
    save("degrees.csv", &motion(1f64.to_degrees(), 0.1, 0.0));
    save("fast.csv", &motion(1.0, 0.03, 0.0));
    save("outside.csv", &motion(3.8, 0.5, 0.0));
    save("elsewhere.csv", &motion(0.5, 0.1, 0.3));
    save("commas.csv", &good.replace(',', ";").replace('.', ","));
    save("no-header.csv", good.split_once('\n').unwrap().1);
    let short = good.lines().map(|line| line.rsplit_once(',').unwrap().0).collect::<Vec<_>>().join("\n");
    save("column.csv", &short);
    save("step.csv", "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n0.01,0.5,0,0,0,0,0\n");
    save("old-faults.toml", "[[fault]]\nkind = \"node-silent\"\nnode = 2\nat_s = 1.0\n");
    let arm = jtc_host::arm::AVENA_TOML;
    save("old.toml", &arm.replace("format = 2\n", "format = 1\n"));
    save("slower.toml", &arm.replacen("velocity_max_rad_s = 1.5", "velocity_max_rad_s = 1.2", 1));
    save(
        "wrong.toml",
        &arm.replacen("mass_kg = 7.5", "mass_kg = -7.5", 1).replacen("= 1.5\n", "= 3.15\n", 1),
    );
    save("weak.toml", &arm.replacen("torque_max_nm = 180.0", "torque_max_nm = 120.0", 1));
    save("word.urdf", &urdf(6, "revolute", "").replacen("effort=\"50\"", "effort=\"strong\"", 1));
    save("seven.urdf", &urdf(7, "revolute", ""));
    save("continuous.urdf", &urdf(6, "continuous", ""));
    let gripper = "<link name=\"finger\"/><joint name=\"grip\" type=\"prismatic\"><parent link=\"link6\"/><child \
                   link=\"finger\"/><axis xyz=\"1 0 0\"/><limit lower=\"0\" upper=\"0.1\" effort=\"5\" velocity=\"1\"/></joint>";
    save("gripper.urdf", &urdf(6, "revolute", gripper));
}

/// Returns a robot description with `joints` equal links in a vertical chain.
fn urdf(joints: usize, kind: &str, more: &str) -> String {
    let inertia = "<inertial><mass value=\"1\"/><inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial>";
    let mut text = format!("<robot name=\"robot\"><link name=\"link0\">{inertia}</link>\n");
    for i in 1..=joints {
        let range = if kind == "continuous" { "" } else { "lower=\"-1\" upper=\"1\" " };
        let _ = writeln!(
            text,
            "<link name=\"link{i}\">{inertia}</link><joint name=\"joint{i}\" type=\"{kind}\"><parent link=\"link{}\"/><child \
             link=\"link{i}\"/><origin xyz=\"0 0 0.3\"/><axis xyz=\"0 0 1\"/><limit {range}effort=\"50\" velocity=\"1\"/></joint>",
            i - 1
        );
    }
    text + more + "</robot>\n"
}
