//! ROS 2 message definitions that are written into an MCAP file.

/// Appends the definitions that every message with a header needs.
macro_rules! with_header {
    ($fields:literal) => {
        concat!(
            $fields,
            "\
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"
        )
    };
}

/// Name of the standard joint message.
pub(super) const JOINT_STATE: &str = "sensor_msgs/msg/JointState";
/// Definition of the joint message, with all definitions that this message needs.
pub(super) const JOINT_STATE_TEXT: &str = with_header!(
    "\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
"
);

/// Name of the message that contains a text: a robot description or a trajectory.
pub(super) const STRING: &str = "std_msgs/msg/String";
/// Definition of the message that contains a text.
pub(super) const STRING_TEXT: &str = "string data\n";

/// Name of the message that contains the bytes of a flight recorder log.
pub(super) const BYTES: &str = "std_msgs/msg/UInt8MultiArray";
/// Definition of the message with bytes, with all definitions that this message needs.
pub(super) const BYTES_TEXT: &str = "\
std_msgs/MultiArrayLayout layout
uint8[] data
================================================================================
MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
================================================================================
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
";

/// Name of the message with transforms between frames.
pub(super) const TRANSFORMS: &str = "tf2_msgs/msg/TFMessage";
/// Definition of the transform message, with all definitions that this message needs.
pub(super) const TRANSFORMS_TEXT: &str = with_header!(
    "\
geometry_msgs/TransformStamped[] transforms
================================================================================
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
================================================================================
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
"
);

/// Name of the message with the parts of the control law.
pub(super) const CONTROL: &str = "openjtc_msgs/msg/JointControl";
/// Definition of the control message, with values for each joint, base to wrist. A value is NaN if the source of the samples does not
/// supply the value.
pub(super) const CONTROL_TEXT: &str = with_header!(
    "\
std_msgs/Header header
# rad, commanded minus measured
float64[6] position_error
# rad/s^2
float64[6] set_acceleration
# N m
float64[6] torque_model
float64[6] torque_p
float64[6] torque_i
float64[6] torque_d
float64[6] torque_friction
float64[6] torque
# degrees Celsius, bearing
float64[6] temperature
"
);

/// Name of the state message.
pub(super) const STATE: &str = "openjtc_msgs/msg/ControllerState";
/// Definition of the state message, with states, error words and the point index.
pub(super) const STATE_TEXT: &str = with_header!(
    "\
uint8 STATE_START=0
uint8 STATE_INIT=1
uint8 STATE_HOLD_POS=2
uint8 STATE_OPERATE=3
uint8 STATE_TEACHING=4
uint8 STATE_ERROR=5
uint8 TES_NULL=0
uint8 TES_STOP=1
uint8 TES_PAUSE=2
uint8 TES_EXECUTE=3
uint8 TES_FINISH=4
std_msgs/Header header
uint8 state
uint8 trajectory_state
uint32 point
uint16 errors
uint32 can_current
uint8[6] joint_fsm
uint16[6] joint_internal
"
);
