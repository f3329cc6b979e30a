//! Output of arms as TOML and URDF files.

use std::fmt::Write as _;

use jtc_core::JOINTS;
use jtc_core::settings;
use jtc_dynamics::Origin;
use jtc_wire::Joint;

use super::toml_form::FORMAT;
use super::{Arm, Lacking, RULES, Rule};

fn list(values: &[f64]) -> String {
    // `{:?}` keeps the decimal point, because a TOML parser would read a number without a decimal point as an integer.
    let cells: Vec<String> = values.iter().map(|v| format!("{v:?}")).collect();
    format!("[{}]", cells.join(", "))
}

fn narrow(values: &[f32]) -> String {
    list(&values.iter().map(|v| f64::from(*v)).collect::<Vec<_>>())
}

/// Formats a text as a TOML string.
fn quoted(text: &str) -> String {
    let json = serde_json::to_string(text).expect("a string is JSON, and TOML has the same escapes");
    // TOML also escapes the character DEL.
    json.replace('\u{7f}', "\\u007F")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Returns the name of a frame of the robot description. Frame 0 is the base, frames 1 to 6 are the links that joints 1 to 6 carry, and
/// frame 7 is the flange.
pub(crate) fn frame_name(i: usize) -> String {
    if i > JOINTS { "flange".into() } else { format!("link_{i}") }
}

impl Arm {
    /// Writes the line `proposed = [...]`, which lists the proposed numbers of a joint or of the whole arm.
    fn write_marks(&self, out: &mut String, joint: Option<Joint>) {
        let marked = self.sources.marked(joint);
        if !marked.is_empty() {
            let names: Vec<String> = marked.into_iter().map(quoted).collect();
            let _ = writeln!(out, "proposed = [{}] # not measured and not looked up", names.join(", "));
        }
    }

    /// Returns the text of an arm file for this arm.
    pub fn to_toml(&self) -> String {
        let mut out = format!("format = {FORMAT}\nname = {}\n", quoted(&self.name));
        if let Some(g) = &self.gravity {
            let _ = writeln!(out, "gravity_m_s2 = {}", list(g));
        }
        self.write_marks(&mut out, None);
        if self.sources.proposed().next().is_some() {
            out += "\n# The values in `proposed` are starting values from these rules. Enter a value that was measured or looked up, and\n\
                    # remove its name from the list; `jtc arm check` lists the remaining names.\n";
            for Rule { name, rule } in RULES {
                if self.sources.proposed().any(|(_, key)| key == name) {
                    let _ = writeln!(out, "#   {name}: {rule}");
                }
            }
        }
        let config = self.config();
        for (i, origin) in self.model.joints.iter().enumerate() {
            let name = self.joint_names.get(i).unwrap_or(&self.flange_name);
            let _ = writeln!(out, "\n[[joint]]\nname = {}", quoted(name));
            let _ =
                writeln!(out, "origin_xyz_m = {}\norigin_rpy_rad = {}", list(&origin.xyz), list(&origin.rpy));
            let Some(joint) = Joint::from_index(i) else { continue };
            for row in settings::TABLE.iter().filter(|row| self.gives_joint(row, joint)) {
                let Some(value) = row.get(&config, joint.number()) else { continue };
                if row.name != "torque_gain" || value != 1.0 {
                    let _ = writeln!(out, "{} = {value:?}", row.name);
                }
            }
            if self.drive_torque_max[i] != jtc_bus::DRIVE_TORQUE_MAX[i] {
                let _ = writeln!(out, "drive_torque_max_nm = {:?}", self.drive_torque_max[i]);
            }
            if let Some(g) = self.pid.map(|p| p[i]) {
                let _ = writeln!(
                    out,
                    "pid = {{ kp = {:?}, ki = {:?}, kd = {:?}, int_min_rad_s = {:?}, int_max_rad_s = {:?} }}",
                    g.kp, g.ki, g.kd, g.int_min, g.int_max
                );
            }
            if let Some(c) = self.polynomial.map(|p| p[i]) {
                let _ = writeln!(out, "friction_polynomial = {} # c0..c5, ascending", list(&c));
            }
            if let [coulomb, viscous] = self.friction_unused[i]
                && coulomb + viscous > 0.0
            {
                let _ = writeln!(
                    out,
                    "# friction_polynomial = {} # friction and damping of the robot description, not used",
                    list(&[coulomb, viscous, 0.0, 0.0, 0.0, 0.0])
                );
            }
            self.write_marks(&mut out, Joint::from_index(i));
        }
        for (i, link) in self.model.links.iter().enumerate() {
            let _ = writeln!(out, "\n[[link]]\nname = {}", quoted(&self.link_names[i]));
            if self.lacking.contains(&Lacking::Mass(i)) {
                out += "# mass_kg is missing: enter the mass of this link\n";
            } else {
                let _ = writeln!(out, "mass_kg = {:?}", link.mass);
            }
            let _ = writeln!(
                out,
                "com_xyz_m = {}\ncom_rpy_rad = {}",
                list(&link.origin.xyz),
                list(&link.origin.rpy)
            );
            if self.lacking.contains(&Lacking::Inertia(i)) {
                out += "# inertia_kg_m2 is missing: enter [ixx, ixy, ixz, iyy, iyz, izz] about the centre of mass\n";
            } else {
                let _ =
                    writeln!(out, "inertia_kg_m2 = {} # ixx, ixy, ixz, iyy, iyz, izz", list(&link.inertia));
            }
        }
        if !self.others.is_empty() {
            out += "\n[settings]\n";
        }
        for value in &self.others {
            let Some(row) = settings::setting(value.setting) else { continue };
            let _ = match (row.whole, row.high == 1.0) {
                (true, true) => writeln!(out, "{} = {}", row.name, value.value != 0.0),
                (true, false) => writeln!(out, "{} = {:.0}", row.name, value.value),
                _ => writeln!(out, "{} = {:?}", row.name, value.value),
            };
        }
        if !self.poses.is_empty() {
            out += "\n[poses] # rad, base to wrist\n";
        }
        for (name, position) in &self.poses {
            let _ = writeln!(out, "{} = {}", super::poses::key(name), list(position));
        }
        let Some(tables) = &self.table else { return out };
        let one = tables.iter().all(|t| *t == tables[0]);
        for t in tables.iter().take(if one { 1 } else { JOINTS }) {
            let _ = writeln!(out, "\n[[friction_table]]\nvelocity_rad_s = {}", narrow(&t.velocity));
            let _ = writeln!(out, "temperature_c = {}\ntorque_nm = [", narrow(&t.temperature));
            for row in &t.torque {
                let _ = writeln!(out, "  {},", narrow(row));
            }
            out.push_str("]\n");
        }
        out
    }

    /// Returns the text of a robot description for this arm. A robot description can contain only kinematics, masses and limits.
    pub fn to_urdf(&self) -> String {
        let three = |v: &[f64; 3]| format!("{} {} {}", v[0], v[1], v[2]);
        let placed = |o: &Origin| format!("<origin xyz=\"{}\" rpy=\"{}\"/>", three(&o.xyz), three(&o.rpy));
        let mut out = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", escaped(&self.name));
        for (i, link) in self.model.links.iter().enumerate() {
            let [xx, xy, xz, yy, yz, zz] = link.inertia;
            let _ = writeln!(
                out,
                "  <link name=\"{}\">\n    <inertial>\n      {}\n      <mass value=\"{}\"/>\n      <inertia ixx=\"{xx}\" \
                 ixy=\"{xy}\" ixz=\"{xz}\" iyy=\"{yy}\" iyz=\"{yz}\" izz=\"{zz}\"/>\n    </inertial>\n  </link>",
                frame_name(i),
                placed(&link.origin),
                link.mass
            );
        }
        let _ = writeln!(out, "  <link name=\"{}\"/>", frame_name(JOINTS + 1));
        for (i, origin) in self.model.joints.iter().enumerate() {
            let (place, parent, child) = (placed(origin), frame_name(i), frame_name(i + 1));
            let (Some(name), Some(limit)) = (self.joint_names.get(i), self.joints.get(i)) else {
                let _ = writeln!(
                    out,
                    "  <joint name=\"flange_joint\" type=\"fixed\">\n    {place}\n    <parent link=\"{parent}\"/>\n    <child \
                     link=\"{child}\"/>\n  </joint>"
                );
                continue;
            };
            let _ = writeln!(
                out,
                "  <joint name=\"{}\" type=\"revolute\">\n    {place}\n    <parent link=\"{parent}\"/>\n    <child \
                 link=\"{child}\"/>\n    <axis xyz=\"0 0 1\"/>\n    <limit lower=\"{}\" upper=\"{}\" effort=\"{}\" \
                 velocity=\"{}\"/>\n  </joint>",
                escaped(name),
                limit.position_min,
                limit.position_max,
                limit.torque_max,
                limit.velocity_max
            );
        }
        out + "</robot>\n"
    }
}
