//! `jtc payload`: shows and sets the payload at the flange (J-60).

use cli_kit::{Failure, Output};
use jtc_core::Payload;
use serde_json::{Value, json};

use crate::args::{LinkArgs, PayloadCommand};

/// Runs a `jtc payload` command.
pub(super) fn payload(command: &PayloadCommand, out: &Output) -> Result<(), Failure> {
    match command {
        PayloadCommand::Set { body, link } => set(&body.payload(), link, out),
        PayloadCommand::Clear { link } => set(&Payload::NONE, link, out),
        PayloadCommand::Show { link } => {
            let payload = link.session()?.payload()?;
            out.result(&as_json(&payload), || as_text(&payload));
            Ok(())
        }
    }
}

fn set(payload: &Payload, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    // An invalid payload is rejected before the command searches for a port.
    payload.check().map_err(|e| Failure::usage(format!("{e}; nothing was sent")))?;
    let mut session = link.session()?;
    let before = session.payload()?;
    session.set_payload(payload)?;
    let mut value = as_json(payload);
    value["before"] = as_json(&before);
    out.result(&value, || {
        if before == *payload {
            return format!("{}\nunchanged", as_text(payload));
        }
        format!("{}\nbefore: {}\nthe controller adds its torque over 0.5 s", as_text(payload), words(&before))
    });
    Ok(())
}

/// Describes a payload in a few words.
pub(super) fn words(payload: &Payload) -> String {
    let [x, y, z] = payload.com;
    if payload.is_there() { format!("{} kg at ({x}, {y}, {z}) m", payload.mass) } else { "none".into() }
}

fn as_text(payload: &Payload) -> String {
    let [xx, xy, xz, yy, yz, zz] = payload.inertia;
    let inertia = match payload.inertia {
        _ if !payload.is_there() => String::new(),
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0] => ", a point mass".into(),
        _ => format!(", inertia {xx}, {yy}, {zz} kg·m², products {xy}, {xz}, {yz}"),
    };
    format!("payload: {}{inertia}", words(payload))
}

/// Returns a payload as JSON.
pub(super) fn as_json(payload: &Payload) -> Value {
    let [xx, xy, xz, yy, yz, zz] = payload.inertia;
    json!({
        "mass_kg": payload.mass,
        "com_m": payload.com,
        "inertia_kg_m2": { "ixx": xx, "iyy": yy, "izz": zz, "ixy": xy, "ixz": xz, "iyz": yz },
    })
}
