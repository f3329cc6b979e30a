//! `jtc ports`: lists the available ports, with the reason if a port cannot be used.

use cli_kit::{Diagnose, Failure, Output};
use jtc_host::port::{PortKind, list};
use serde_json::json;

/// Lists the serial ports.
pub(super) fn ports(out: &Output) -> Result<(), Failure> {
    let ports = list()?;
    let rows: Vec<_> = ports
        .iter()
        .map(|p| {
            json!({
                "port": p.path,
                "kind": p.kind,
                "usable": p.usable(),
                "problem": p.problem.as_ref().map(ToString::to_string),
                "hint": p.problem.as_ref().map(|e| e.hint()),
            })
        })
        .collect();
    out.result(&json!({ "ports": rows }), || {
        if ports.is_empty() {
            return "no serial port found\nconnect the adapter, or start a simulated controller: jtc sim \
                   --serial /tmp/jtc"
                .into();
        }
        let mut text = String::new();
        for p in &ports {
            let kind = match &p.kind {
                PortKind::Usb { vendor, product, description, .. } => {
                    format!("USB {vendor:04x}:{product:04x} {description}")
                }
                PortKind::Pci => "built in".into(),
                PortKind::Bluetooth => "Bluetooth".into(),
                PortKind::Unknown => String::new(),
            };
            text += &format!("{}  {}\n", p.path, kind);
            match &p.problem {
                None => text += "    can be used\n",
                Some(e) => text += &format!("    {e}\n    {}\n", e.hint()),
            }
        }
        text
    });
    Ok(())
}
