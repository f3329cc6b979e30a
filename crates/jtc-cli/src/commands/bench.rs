//! `jtc bench`: declares joints that are absent on a bench (J-53).

use cli_kit::{Failure, Output};
use jtc_core::JOINTS;
use jtc_host::{Error, LinkError};
use jtc_wire::{DataStatus, Joint};
use serde_json::{Value, json};

use crate::args::{BenchCommand, LinkArgs};

/// Runs a `jtc bench` command.
pub(super) fn bench(command: &BenchCommand, out: &Output) -> Result<(), Failure> {
    match command {
        BenchCommand::Absent { joints, deg, link } => {
            let mut absent = [None; JOINTS];
            for &(joint, angle) in joints {
                if absent[joint.index()].is_some() {
                    return Err(Failure::usage(format!("{joint} is listed twice; nothing was sent")));
                }
                absent[joint.index()] = Some(if *deg { angle.to_radians() } else { angle });
            }
            set(&absent, link, out)
        }
        BenchCommand::Present { link } => set(&[None; JOINTS], link, out),
        BenchCommand::Show { link } => {
            let absent = link.session()?.absent()?;
            out.result(&as_json(&absent), || as_text(&absent));
            Ok(())
        }
    }
}

fn set(absent: &[Option<f64>; JOINTS], link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut session = link.session()?;
    session.set_absent(absent).map_err(refused)?;
    out.result(&as_json(absent), || {
        format!("{}\nnext: jtc recover; jtc doctor shows the problems", as_text(absent))
    });
    Ok(())
}

fn refused(error: Error) -> Failure {
    let failure = Failure::of(&error);
    match error {
        Error::Link(LinkError::Refused { code: DataStatus::NotAllowed, .. }) => failure.next(
            "joints can be set absent only without torque: `jtc disable` (an arm without brakes falls), then \
             try again; nothing was changed",
        ),
        Error::Link(LinkError::Refused { code: DataStatus::IncorrectValue, .. }) => {
            failure.next("give angles in rad, -6.2832 to 6.2832 (`--deg` for degrees); nothing was changed")
        }
        _ => failure,
    }
}

/// Describes the absent joints and their angles as text.
pub(super) fn words(absent: &[Option<f64>; JOINTS]) -> String {
    let all = Joint::ALL.iter().zip(absent);
    let all: Vec<String> =
        all.filter_map(|(joint, at)| at.map(|at| format!("{joint} at {at} rad"))).collect();
    if all.is_empty() { "none".into() } else { all.join(", ") }
}

fn as_text(absent: &[Option<f64>; JOINTS]) -> String {
    format!("absent: {}", words(absent))
}

/// Returns the absent joints as JSON.
pub(super) fn as_json(absent: &[Option<f64>; JOINTS]) -> Value {
    let all = Joint::ALL.iter().zip(absent);
    let all: Vec<Value> = all
        .filter_map(|(joint, at)| at.map(|at| json!({ "joint": joint.number(), "position_rad": at })))
        .collect();
    json!({ "absent": all })
}
