//! Text form of bus frames.

use core::fmt::{Display, Formatter, Result};

use crate::{Answer, Bits, Frame, GRIPPER, GripperReport, Joint, JointReport, Request, Scale, Target};
use crate::{config, error, id, motor_control, warning};

/// Text form of a decoded bus frame. If a frame cannot be decoded, the text contains the reason and the bytes
/// of the frame.
///
/// ```
/// use jtc_bus::{Decoded, Request, Scale};
/// let frame = Request::ResetAll.emit();
/// assert_eq!(Decoded { frame: &frame, scale: Scale::default() }.to_string(), "0A0 ResetAll");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Decoded<'a> {
    /// Frame to display.
    pub frame: &'a Frame,
    /// Scale of the velocities in the frame.
    pub scale: Scale,
}

impl Display for Decoded<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "{:03X} ", self.frame.id)?;
        let error = match (Request::parse(self.frame), Answer::parse(self.frame, self.scale)) {
            (Ok(request), _) => return request.fmt(f),
            (_, Ok(answer)) => return answer.fmt(f),
            (Err(error), _) if self.frame.id & id::RESPONSE == 0 => error,
            (_, Err(error)) => error,
        };
        write!(f, "{error}: {}", Hex(self.frame.data()))
    }
}

impl Display for Frame {
    /// Shows the frame like [`Decoded`] with the default scale.
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        Decoded { frame: self, scale: Scale::default() }.fmt(f)
    }
}

struct Hex<'a>(&'a [u8]);

impl Display for Hex<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        if self.0.is_empty() {
            return f.write_str("no bytes");
        }
        for (i, byte) in self.0.iter().enumerate() {
            write!(f, "{}{byte:02X}", if i == 0 { "" } else { " " })?;
        }
        Ok(())
    }
}

impl Display for Target {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        f.pad(match self {
            Self::NoChange => "-",
            Self::Init => "init",
            Self::Ready => "ready",
            Self::Enable => "enable",
        })
    }
}

const fn on(value: bool) -> &'static str {
    if value { "on" } else { "off" }
}

impl Display for Request {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Move { torque, pump } => {
                f.write_str("Move")?;
                for torque in torque {
                    write!(f, " {torque:.1}")?;
                }
                write!(f, " N·m, pump {}", on(*pump))
            }
            Self::ChangeFsm { target } => {
                f.write_str("ChangeFsm")?;
                for target in target {
                    write!(f, " {target}")?;
                }
                Ok(())
            }
            Self::ChangeMode { mode, config, gripper } => {
                f.write_str("ChangeMode")?;
                for (mode, bits) in mode.iter().zip(config) {
                    match mode {
                        0 => f.write_str(" none")?,
                        1 => f.write_str(" torque")?,
                        2 => f.write_str(" speed")?,
                        other => write!(f, " mode-{other}")?,
                    }
                    write!(f, "/{bits:02X}")?;
                }
                write!(f, ", gripper {gripper:02X} ({})", Bits((*gripper).into(), &config::NAMES))
            }
            Self::ResetAll => f.write_str("ResetAll"),
            Self::Reset(node) => write!(f, "Reset {}", Node(*node)),
        }
    }
}

/// Number of a node on the bus, for display.
struct Node(u8);

impl Display for Node {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match Joint::from_index(self.0.into()) {
            Some(joint) => joint.fmt(f),
            None if usize::from(self.0) == GRIPPER => f.write_str("gripper"),
            None => write!(f, "node {}", self.0),
        }
    }
}

impl Display for Answer {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Joint { node, report } => write!(f, "{} {report}", Node(*node)),
            Self::Gripper(report) => write!(f, "gripper {report}"),
            Self::State { node, state } => write!(f, "{} state: {}", Node(*node), state.description()),
            Self::Mode { node, accepted: true } => write!(f, "{} configuration accepted", Node(*node)),
            Self::Mode { node, accepted: false } => write!(f, "{} configuration refused", Node(*node)),
        }
    }
}

/// Writes the names of the set bits. If no bit is set, the function writes nothing.
fn report_bits(f: &mut Formatter<'_>, title: &str, bits: u8, names: &[&str]) -> Result {
    if bits == 0 {
        return Ok(());
    }
    write!(f, ", {title}: {}", Bits(bits.into(), names))
}

impl Display for JointReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "{:.4} rad, {:.4} rad/s, {:.1} N·m, ", self.position, self.velocity, self.torque)?;
        write!(f, "{} °C", self.temperature)?;
        if let Some(motor) = self.motor_temperature {
            write!(f, ", motor {motor} °C")?;
        }
        write!(f, ", {}", self.state.description())?;
        report_bits(f, "motor control", self.mc_current, &motor_control::NAMES)?;
        report_bits(f, "motor control before", self.mc_occurred & !self.mc_current, &motor_control::NAMES)?;
        report_bits(f, "errors", self.errors, &error::NAMES)?;
        report_bits(f, "warnings", self.warnings, &warning::NAMES)
    }
}

impl Display for GripperReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "pump {}, ", on(self.pump))?;
        let level = |reached| if reached { "reached" } else { "not reached" };
        write!(f, "level 1 {}, level 2 {}, ", level(self.pressure1), level(self.pressure2))?;
        f.write_str(self.state.description())?;
        report_bits(f, "errors", self.errors, &error::NAMES)?;
        report_bits(f, "warnings", self.warnings, &warning::NAMES)
    }
}
