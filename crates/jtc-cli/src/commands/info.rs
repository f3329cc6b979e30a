//! `jtc info` prints the identity of the controller. `jtc disable` switches the torque off while the arm is at rest.

use std::time::Duration;

use cli_kit::{Failure, Output};
use jtc_host::held_stop::{Reacting, age};
use jtc_host::labels;
use jtc_wire::{ControllerState, Info, Joint, LogState, Status, StoreState};
use serde_json::{Value, json};

use crate::args::LinkArgs;
use crate::ask::confirm;

/// Longest time that the drives need to change their state.
const DISABLED: Duration = Duration::from_secs(5);

/// Prints the identity of the controller.
pub(super) fn info(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut session = link.session()?;
    let info = session.info()?;
    let status = session.fresh_status()?;
    match info {
        Some(info) => {
            let payload = session.payload()?;
            let mut value = as_json(&info);
            let reacting = Reacting::of(&info);
            value["reactions"] = json!(reacting);
            let absent = session.absent()?;
            value["payload"] = super::payload::as_json(&payload);
            value["absent"] = super::bench::as_json(&absent)["absent"].take();
            out.result(&value, || {
                let (payload, absent) = (super::payload::words(&payload), super::bench::words(&absent));
                let reacting = reacting.as_ref().map(reacting_words).unwrap_or_default();
                format!("{}\npayload:   {payload}\nabsent:    {absent}{reacting}", as_text(&info))
            });
        }
        None => out.result(&without_extensions_json(&status), || without_extensions(&status)),
    }
    Ok(())
}

/// Formats a hash in the form that the outputs of all commands use.
pub(super) fn hash(hash: u64) -> String {
    format!("{hash:016x}")
}

fn as_json(info: &Info) -> Value {
    json!({
        "extension": info.version,
        "firmware": info.firmware(),
        "revision": info.revision(),
        "board": info.board.as_str(),
        "arm": info.arm.as_str(),
        "hash": hash(info.hash),
        "missing": labels::missing_parameters(info.missing),
        "nodes_missing": labels::node_names(info.nodes_missing),
        "boots": info.boots,
        "boot_cause": info.boot_cause.name(),
        "uptime_s": info.uptime_ms as f64 / 1000.0,
        "lost_records": info.lost_records,
        "defaults": if info.defaults_stored { "stored" } else { "built-in" },
        "memory": info.store.name(),
        "flight_recorder": info.log.name(),
        "program": info.program.map(|program| json!({ "bytes": program.bytes, "crc32": format!("{:08x}", program.crc32) })),
        "stored_number": (info.store == StoreState::Stored).then_some(info.sequence),
    })
}

fn as_text(info: &Info) -> String {
    let list = |names: Vec<String>| if names.is_empty() { "nothing".into() } else { names.join(", ") };
    let missing = labels::missing_parameters(info.missing).into_iter().map(str::to_owned).collect();
    let memory = match info.store {
        StoreState::Stored => format!("{}, number {}", info.store, info.sequence),
        state => state.to_string(),
    };
    let defaults = if info.defaults_stored { "the stored arm" } else { "the built-in arm" };
    format!(
        "arm:       {}, hash {}\n\
         missing:   {}; nodes: {}\n\
         defaults:  {defaults}; memory: {memory}\n\
         firmware:  {} on {}, extensions {}\n\
         started:   {}, the last by {}, {} ago\n\
         records:   {} lost\n\
         recorder:  {}{}",
        info.arm,
        hash(info.hash),
        list(missing),
        list(labels::node_names(info.nodes_missing)),
        info.firmware_and_revision(),
        info.board,
        info.version,
        if info.boots == 1 { "once".into() } else { format!("{} times", info.boots) },
        info.boot_cause,
        age(info.uptime_ms as f64 * 1e-3),
        info.lost_records,
        recorder(info.log),
        info.program.map_or(String::new(), |program| format!("\nin flash:  {program}")),
    )
}

/// Describes the state of the flight recorder, and the next step if the recorder has stopped.
fn recorder(state: LogState) -> String {
    match state {
        LogState::Error | LogState::Reset => {
            format!("{state}: jtc log fetch reads the log, jtc log clear restarts the recorder")
        }
        state => state.to_string(),
    }
}

/// Describes the last held stop and the present reactions to errors. Each line of the text begins with a line break.
fn reacting_words(reacting: &Reacting) -> String {
    let mut lines = Vec::new();
    let joints = |joints: &[u8]| {
        let joints: Vec<Joint> = joints.iter().filter_map(|n| Joint::from_number((*n).into())).collect();
        labels::joints(&joints)
    };
    if let Some(stop) = &reacting.last_held_stop {
        lines.push(format!("held stop: {}", stop.line()));
    }
    if !reacting.yields.is_empty() {
        lines.push(format!("yields:    {}", joints(&reacting.yields)));
    }
    if !reacting.encoder_jumped.is_empty() {
        lines.push(format!("jumped:    the encoder of {}", joints(&reacting.encoder_jumped)));
    }
    if reacting.held_back_s > 0.0 {
        lines.push(format!(
            "held back: {:.1} s of this run, because a torque was at its limit",
            reacting.held_back_s
        ));
    }
    lines.iter().map(|line| format!("\n{line}")).collect()
}

fn without_extensions_json(s: &Status) -> Value {
    json!({
        "extension": null,
        "firmware": null,
        "revision": null,
        "board": null,
        "arm": null,
        "hash": null,
        "missing": labels::missing_parameters(s.jtc_init),
        "nodes_missing": labels::node_names(s.node_init),
        "boots": null,
        "boot_cause": null,
        "uptime_s": null,
        "lost_records": null,
    })
}

fn without_extensions(s: &Status) -> String {
    let missing = labels::missing_parameters(s.jtc_init);
    let missing = if missing.is_empty() { "nothing".into() } else { missing.join(", ") };
    format!(
        "a controller without extensions: it does not report its firmware, its arm or its limits\n\
         state:     {}\n\
         missing:   {missing}\n\
         next: jtc status; the limits, gravity and rotor inertia are built into the controller",
        s.state
    )
}

/// Switches off the torque of an arm that the controller holds at rest.
pub(super) fn disable(yes: bool, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut session = link.session()?;
    if !yes {
        confirm("the arm loses its torque: an arm without holding brakes falls", "--yes")?;
    }
    session.disable()?;
    let status = session.wait_for("Init without torque", DISABLED, |s| {
        let limp = s.joints.iter().all(|joint| joint.state != jtc_wire::NodeState::ENABLED);
        s.state == ControllerState::Error || (s.state == ControllerState::Init && limp)
    })?;
    out.result(&json!({ "disabled": true, "status": super::status::as_json(&status) }), || {
        format!("torque off; state {}\nnext: jtc recover --arm FILE", status.state)
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use jtc_wire::{Reactions, StopCause, StopKind};

    use super::*;

    #[test]
    fn j69_the_last_held_stop_and_what_goes_on_are_shown() {
        assert_eq!(reacting_words(&Reacting::default()), "");
        let cause = StopCause { kind: StopKind::Push, joint: 2, value: 61.5, limit: 54.0 };
        let reactions = Reactions {
            stop: Some((cause, 12_300)),
            yields: 0b10,
            jumped: 0b101,
            rate: 0.5,
            held_back_ms: 1500,
        };
        let lines = format!(
            "\nheld stop: {cause}; 12 s ago\nyields:    joint 2\njumped:    the encoder of joint 1, joint 3\n\
             held back: 1.5 s of this run, because a torque was at its limit"
        );
        assert_eq!(reacting_words(&Reacting::from(&reactions)), lines);
    }
}
