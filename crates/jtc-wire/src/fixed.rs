//! Short command frames as constants.
use crate::command::ExecCommand;
use crate::crc::crc16_const;
use crate::extension::Name;
use crate::frame::{FrameType, HEADER};

const fn sealed<const N: usize>(frame_type: FrameType, body: &[u8]) -> [u8; N] {
    let mut bytes = [0; N];
    bytes[0] = HEADER;
    bytes[1] = frame_type as u8;
    bytes[2] = (N >> 8) as u8;
    bytes[3] = N as u8;
    let mut i = 0;
    while i < body.len() {
        bytes[4 + i] = body[i];
        i += 1;
    }
    let crc = crc16_const(bytes.split_at(N - 2).0);
    bytes[N - 2] = (crc >> 8) as u8;
    bytes[N - 1] = crc as u8;
    bytes
}

/// Returns a frame without a body.
pub const fn empty(frame_type: FrameType) -> [u8; 6] {
    sealed(frame_type, &[])
}

/// Returns a ClearCurrentErrors frame. The frame clears the errors of the nodes in `nodes` (bits 0..6) and, if
/// `jtc` is set, the errors of the controller.
pub const fn clear_current_errors(jtc: bool, nodes: u8) -> [u8; 10] {
    sealed(FrameType::ClearCurrentErrors, &[jtc as u8, nodes])
}

/// Returns a TrajSetExecStatus frame with this command.
pub const fn exec(command: ExecCommand) -> [u8; 7] {
    sealed(FrameType::TrajSetExecStatus, &[command as u8])
}

/// Returns a ResetCanDevices frame, which resets the nodes in `nodes` (bits 0..6).
pub const fn reset_can_devices(nodes: u8) -> [u8; 10] {
    sealed(FrameType::ResetCanDevices, &[nodes])
}

/// Returns a GripperControl frame, which switches the pump on or off.
pub const fn gripper_control(pump: bool) -> [u8; 10] {
    sealed(FrameType::GripperControl, &[pump as u8])
}

/// Returns a GetSettings frame, which requests the settings from number `first` on.
pub const fn get_settings(first: u16) -> [u8; 8] {
    sealed(FrameType::GetSettings, &first.to_be_bytes())
}

/// Returns a SetName frame, which sets the name of the arm.
pub const fn set_name(name: &Name) -> [u8; 38] {
    sealed(FrameType::SetName, name.as_bytes())
}

/// Returns a GetArm frame, which requests the arm image from byte `offset` on.
pub const fn get_arm(offset: u16) -> [u8; 8] {
    sealed(FrameType::GetArm, &offset.to_be_bytes())
}

/// Returns a GetLog frame, which requests block `block` of the log from byte `offset` on.
pub const fn get_log(block: u32, offset: u16) -> [u8; 12] {
    let ([a, b, c, d], [e, f]) = (block.to_be_bytes(), offset.to_be_bytes());
    sealed(FrameType::GetLog, &[a, b, c, d, e, f])
}

/// Returns a GetPoints frame, which requests the trajectory points from number `first` on.
pub const fn get_points(first: u16) -> [u8; 8] {
    sealed(FrameType::GetPoints, &first.to_be_bytes())
}

/// ClearOccurredErrors frame.
pub const CLEAR_OCCURRED_ERRORS: [u8; 6] = empty(FrameType::ClearOccurredErrors);
/// FrictionTableUseDefault frame.
pub const FRICTION_TABLE_USE_DEFAULT: [u8; 6] = empty(FrameType::FrictionTableUseDefault);
/// PidParamUseDefault frame.
pub const PID_PARAM_USE_DEFAULT: [u8; 6] = empty(FrameType::PidParamUseDefault);
/// ArmModelUseDefault frame.
pub const ARM_MODEL_USE_DEFAULT: [u8; 6] = empty(FrameType::ArmModelUseDefault);
/// TeachingModeEnable frame.
pub const TEACHING_MODE_ENABLE: [u8; 6] = empty(FrameType::TeachingModeEnable);
/// TeachingModeDisable frame.
pub const TEACHING_MODE_DISABLE: [u8; 6] = empty(FrameType::TeachingModeDisable);
/// FrictionPolynomialUseDefault frame.
pub const FRICTION_POLYNOMIAL_USE_DEFAULT: [u8; 6] = empty(FrameType::FrictionPolynomialUseDefault);
/// TrajSetExecStatus frame with the command Stop.
pub const STOP: [u8; 7] = exec(ExecCommand::Stop);
/// TrajSetExecStatus frame with the command Pause.
pub const PAUSE: [u8; 7] = exec(ExecCommand::Pause);
/// TrajSetExecStatus frame with the command Execute.
pub const EXECUTE: [u8; 7] = exec(ExecCommand::Execute);
/// GetInfo frame.
pub const GET_INFO: [u8; 6] = empty(FrameType::GetInfo);
/// StoreArm frame.
pub const STORE_ARM: [u8; 6] = empty(FrameType::StoreArm);
/// Disable frame.
pub const DISABLE: [u8; 6] = empty(FrameType::Disable);
/// ClearLog frame.
pub const CLEAR_LOG: [u8; 6] = empty(FrameType::ClearLog);
/// GripperControl frame that switches the pump on.
pub const PUMP_ON: [u8; 10] = gripper_control(true);
/// GripperControl frame that switches the pump off.
pub const PUMP_OFF: [u8; 10] = gripper_control(false);
