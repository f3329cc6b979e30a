//! `jtc params`: sends friction, gains and arm model from files to the controller.

use std::path::PathBuf;

use cli_kit::{Failure, Output, table};
use jtc_host::arm::{Arm, FrictionChoice, NOT_CARRIED, ParameterFile, ParameterSet};
use jtc_host::{Session, labels};
use jtc_wire::Joint;
use serde_json::json;

use crate::args::{AcceptArgs, FrictionKind, LinkArgs, ParamsCommand};
use crate::limits;
use crate::link::LinkPort;
use crate::progress::Progress;

/// Runs a `jtc params` command.
pub(super) fn params(command: &ParamsCommand, out: &Output) -> Result<(), Failure> {
    match command {
        ParamsCommand::Push { files, friction, accept, link } => {
            push(files, (*friction).into(), *accept, link, out)
        }
        ParamsCommand::UseDefaults(link) => use_defaults(link, out),
        ParamsCommand::Show { files, port, baud } => {
            let link = port.as_ref().map(|p| LinkArgs {
                port: Some(p.clone()),
                token_file: None,
                tls_ca: None,
                baud: *baud,
            });
            show(files, link.as_ref(), out)
        }
    }
}

fn push(
    files: &[PathBuf],
    choice: FrictionChoice,
    accept: AcceptArgs,
    link: &LinkArgs,
    out: &Output,
) -> Result<(), Failure> {
    let progress = Progress::begin(out)?;
    let read = load(files, out)?;
    let set = read.parameter_set(choice);
    let mut session = link.session()?;
    check_gains(&read, &set, &mut session)?;
    let differences = match &read.arm {
        Some(arm) => limits::accept(arm, &session.device_config()?, accept.accept_device_limits, out)?,
        None => Vec::new(),
    };
    progress.watch(&mut session);
    let mut pushed = Vec::new();
    let done = session.push(&set, |p| {
        out.note(format!(
            "{}: {} bytes, {}confirmed",
            p.parameter.name(),
            p.bytes,
            if p.times > 1 { "twice " } else { "" }
        ));
        progress.event("parameter", json!(p));
        pushed.push(*p);
    });
    done?;
    let tried = set.pid.is_some() && await_trial(&mut session, out)?;
    let status = session.fresh_status()?;
    let missing = labels::missing_parameters(status.jtc_init);
    // The command did not send these parameters. The controller has values for them from an earlier, unknown source.
    let kept: Vec<&str> = if missing.is_empty() { set.missing() } else { Vec::new() };
    let not_given = read.arm.as_ref().map_or(Vec::new(), Arm::settings_not_given);
    let value = json!({
        "pushed": pushed, "gains_tried": tried, "kept": kept, "differences": differences, "not_given": not_given,
        "state": status.state.name(), "missing_parameters": missing,
    });
    out.result(&value, || {
        let sent: Vec<&str> = pushed.iter().map(|p| p.parameter.name()).collect();
        let mut text = format!("sent: {}\n", sent.join(", "));
        if tried {
            text += "the new gains held the arm for 2 s and stay in use\n";
        }
        if !kept.is_empty() {
            text += &format!("not sent, kept from before: {}\n", kept.join(", "));
        }
        if read.arm.is_some() {
            let whose = if differences.is_empty() {
                "which are equal to the file"
            } else {
                "which differ, as listed above"
            };
            text += &format!(
                "not part of the protocol: {NOT_CARRIED}; the controller uses its own values, {whose}\n"
            );
            if !not_given.is_empty() {
                text += &format!("not in the file, so not compared: {}\n", not_given.join(", "));
            }
        }
        text += &if missing.is_empty() {
            format!("the controller has all parameters; {}", labels::waiting_for(&status))
        } else {
            format!("still missing: {}", missing.join(", "))
        };
        text
    });
    Ok(())
}

/// Waits for the result of the test of new gains, which the controller makes if the arm has torque. Returns `true` if
/// the controller has tested the gains.
pub(super) fn await_trial(session: &mut Session<LinkPort>, out: &Output) -> Result<bool, Failure> {
    Ok(session.await_trial(|| out.note("the controller tries the gains for 2 s"))?)
}

/// Rejects gains that would make the arm unstable. The check uses the arm in the files. If the files contain no arm, the check
/// uses the arm of the controller.
fn check_gains(
    read: &ParameterFile,
    set: &ParameterSet,
    session: &mut Session<LinkPort>,
) -> Result<(), Failure> {
    let Some(pid) = set.pid else { return Ok(()) };
    let arm = match &read.arm {
        Some(arm) => Some(arm.clone()),
        // If the controller cannot report its arm yet, the gains are not checked. In this state, the drives do not
        // produce torque.
        None if session.info()?.is_some() => session.device_arm().ok(),
        None => None,
    };
    let Some(arm) = arm else { return Ok(()) };
    let model = set.model.unwrap_or(arm.model);
    Ok(Arm { pid: Some(pid), model, ..arm }.check_gains()?)
}

fn use_defaults(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut session = link.session()?;
    session.use_defaults()?;
    let status = session.fresh_status()?;
    let missing = labels::missing_parameters(status.jtc_init);
    out.result(&json!({ "state": status.state.name(), "missing_parameters": missing }), || {
        format!("the controller uses its defaults; {}", labels::waiting_for(&status))
    });
    Ok(())
}

fn show(files: &[PathBuf], link: Option<&LinkArgs>, out: &Output) -> Result<(), Failure> {
    let (arm, set) = if files.is_empty() {
        let arm = Arm::avena();
        let set = arm.parameter_set();
        (Some(arm), set)
    } else {
        (None, load(files, out)?.parameter_set(FrictionChoice::default()))
    };
    let status = link.map(|l| l.session()?.fresh_status().map_err(Failure::from)).transpose()?;
    let friction = set.friction.as_ref().map(|f| match f {
        jtc_core::Friction::Polynomial(c) => json!({ "kind": "polynomial", "coefficients": c }),
        jtc_core::Friction::Table(t) => json!({ "kind": "table", "tables": t.len() }),
    });
    let pid = set.pid.map(|gains| {
        gains.map(|g| {
            json!({ "kp_nm_rad": g.kp, "ki_nm_rad_s": g.ki, "kd_nm_s_rad": g.kd,
                    "integral_min_rad_s": g.int_min, "integral_max_rad_s": g.int_max })
        })
    });
    let masses = set.model.map(|m| m.links.map(|l| l.mass));
    let value = json!({
        "arm": arm.as_ref().map(|a| &a.name),
        "friction": friction,
        "pid": pid,
        "link_mass_kg": masses,
        "controller": status.as_ref().map(|s| json!({
            "state": s.state.name(), "missing_parameters": labels::missing_parameters(s.jtc_init),
            "friction": if s.friction_type == 0 { "polynomial" } else { "table" },
        })),
    });
    out.result(&value, || {
        let mut text = arm.as_ref().map_or(String::new(), |a| format!("arm {}\n", a.name));
        text += &as_text(&set);
        if let Some(s) = &status {
            text += &format!("controller: {}\n", labels::waiting_for(s));
        }
        text
    });
    Ok(())
}

fn as_text(set: &ParameterSet) -> String {
    let mut text = String::new();
    if let Some(pid) = &set.pid {
        let row = |(joint, g): (Joint, &jtc_core::PidGains)| {
            let numbers = [g.kp, g.ki, g.kd, g.int_min, g.int_max].map(|v| format!("{v}"));
            [vec![joint.to_string()], numbers.to_vec()].concat()
        };
        let rows: Vec<_> = Joint::ALL.into_iter().zip(pid).map(row).collect();
        text += &table(
            &["gains", ">Kp N·m/rad", ">Ki N·m/(rad·s)", ">Kd N·m·s/rad", ">∫min rad·s", ">∫max rad·s"],
            &rows,
        );
    }
    match &set.friction {
        Some(jtc_core::Friction::Polynomial(c)) => {
            let row = |(joint, c): (Joint, &[f64; 6])| {
                [vec![joint.to_string()], c.map(|v| format!("{v:.4}")).to_vec()].concat()
            };
            let rows: Vec<_> = Joint::ALL.into_iter().zip(c).map(row).collect();
            text += &table(&["friction", ">c0", ">c1", ">c2", ">c3", ">c4 1/K", ">c5 °C"], &rows);
        }
        Some(jtc_core::Friction::Table(tables)) => {
            let row = |(joint, t): (Joint, &jtc_core::TableOf<f32>)| {
                let range = |a: &[f32; 20]| format!("{:.2} .. {:.2}", a[0], a[19]);
                vec![joint.to_string(), range(&t.velocity), range(&t.temperature)]
            };
            let rows: Vec<_> = Joint::ALL.into_iter().zip(tables.iter()).map(row).collect();
            text += &table(&["friction table", ">rad/s", ">°C"], &rows);
        }
        None => {}
    }
    if let Some(model) = &set.model {
        let row = |(i, l): (usize, &jtc_dynamics::Link)| vec![format!("link {i}"), format!("{:.3}", l.mass)];
        let rows: Vec<_> = model.links.iter().enumerate().map(row).collect();
        text += &table(&["masses", ">kg"], &rows);
    }
    text
}

/// Loads the parameter files. Values of later files replace values of earlier files. Prints warnings on stderr.
fn load(files: &[PathBuf], out: &Output) -> Result<ParameterFile, Failure> {
    let read = ParameterFile::load_all(files)?;
    for warning in &read.warnings {
        out.note(format!("note: {warning}"));
    }
    for (path, what) in &read.sources {
        out.note(format!("{what} from {}", path.display()));
    }
    Ok(read)
}

impl From<FrictionKind> for FrictionChoice {
    fn from(kind: FrictionKind) -> Self {
        match kind {
            FrictionKind::Polynomial => FrictionChoice::Polynomial,
            FrictionKind::Table => FrictionChoice::Table,
        }
    }
}
