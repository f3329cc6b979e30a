//! List of the serial ports of this computer. If a port cannot be used, the list contains the reason.

use serialport::SerialPortType;

use super::{PortError, SerialPort};

/// Hardware type of a port.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PortKind {
    /// Adapter or board on USB.
    Usb {
        /// Vendor number.
        vendor: u16,
        /// Product number.
        product: u16,
        /// Serial number, if the device has a serial number.
        serial: Option<String>,
        /// Description that the device reports.
        description: String,
    },
    /// Plug-in card in the computer.
    Pci,
    /// Paired Bluetooth link.
    Bluetooth,
    /// The operating system does not report the type.
    Unknown,
}

/// Serial port of this computer.
#[derive(Debug)]
pub struct PortInfo {
    /// Name used to open the port.
    pub path: String,
    /// Hardware type.
    pub kind: PortKind,
    /// Reason why a program cannot use the port. `None` if the port can be used.
    pub problem: Option<PortError>,
}

impl PortInfo {
    /// Returns `true` if the port can be opened.
    pub fn usable(&self) -> bool {
        self.problem.is_none()
    }
}

/// Returns all ports, sorted by name. Opens each port briefly to check that the port can be used.
///
/// # Errors
///
/// Returns an error if the operating system does not list the ports.
pub fn list() -> Result<Vec<PortInfo>, PortError> {
    let found = serialport::available_ports().map_err(|e| PortError::io("list of ports", e.into()))?;
    let mut ports: Vec<PortInfo> = found
        .into_iter()
        .map(|p| PortInfo {
            problem: SerialPort::open_without_door(&p.port_name, 115_200).err(),
            kind: kind(p.port_type),
            path: p.port_name,
        })
        .collect();
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(ports)
}

/// Returns the names of the ports of USB adapters and boards, without opening the ports.
pub fn usb_names() -> Vec<String> {
    let found = serialport::available_ports().unwrap_or_default();
    let is_usb = |kind: &SerialPortType| matches!(kind, SerialPortType::UsbPort(_));
    let mut names: Vec<String> =
        found.into_iter().filter(|port| is_usb(&port.port_type)).map(|port| port.port_name).collect();
    names.sort();
    names
}

/// Returns the name of the only usable port.
///
/// # Errors
///
/// Returns an error if no port or more than one port can be used. The error contains the names of the ports.
pub fn only_one() -> Result<String, PortError> {
    let ports = list()?;
    let mut usable: Vec<String> = ports.iter().filter(|p| p.usable()).map(|p| p.path.clone()).collect();
    match usable.len() {
        1 => Ok(usable.remove(0)),
        // If a connected board cannot be opened, the error of that board is more helpful than "none found".
        0 => Err(ports
            .into_iter()
            .filter(|p| matches!(p.kind, PortKind::Usb { .. }))
            .find_map(|p| p.problem)
            .unwrap_or(PortError::NoneFound)),
        _ => Err(PortError::Several { paths: usable }),
    }
}

fn kind(kind: SerialPortType) -> PortKind {
    match kind {
        SerialPortType::UsbPort(usb) => PortKind::Usb {
            vendor: usb.vid,
            product: usb.pid,
            serial: usb.serial_number,
            description: [usb.manufacturer, usb.product].into_iter().flatten().collect::<Vec<_>>().join(" "),
        },
        SerialPortType::PciPort => PortKind::Pci,
        SerialPortType::BluetoothPort => PortKind::Bluetooth,
        SerialPortType::Unknown => PortKind::Unknown,
    }
}
