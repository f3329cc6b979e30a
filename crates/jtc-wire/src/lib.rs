//! Host link of the controller: frames both ways, CRC, stream parser. No I/O.
#![no_std]
#![forbid(unsafe_code)]

/// First byte of every frame.
pub const HEADER: u8 = 0x9B;
/// Longest frame (J-02).
pub const FRAME_MAX: usize = 60_000;
/// Length of JtcStatus.
pub const STATUS_LEN: usize = 175;
/// Joints of the arm.
pub const JOINTS: usize = 6;

/// CRC-16/XMODEM.
pub fn crc16(_bytes: &[u8]) -> u16 {
    unimplemented!()
}

/// Frame types (J-06 table).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum FrameType {
    ClearCurrentErrors = 0x01,
    ClearOccurredErrors = 0x02,
    JtcStatus = 0x03,
    Trajectory = 0x04,
    FrictionTable = 0x05,
    FrictionTableUseDefault = 0x06,
    PidParam = 0x07,
    PidParamUseDefault = 0x08,
    ArmModel = 0x09,
    ArmModelUseDefault = 0x0A,
    TrajSetExecStatus = 0x0B,
    TeachingModeEnable = 0x0C,
    TeachingModeDisable = 0x0D,
    FrictionPolynomial = 0x0E,
    FrictionPolynomialUseDefault = 0x0F,
    ResetCanDevices = 0x10,
    GripperControl = 0x11,
}

/// Status code of a received frame (J-05).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum FrameStatus {
    #[default]
    Idle = 0,
    NoError = 1,
    IncorrectHeader = 2,
    IncorrectFrameType = 3,
    IncorrectCrc = 4,
    DiscontinuousFrame = 5,
}

/// Data status code of a received frame (J-06).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum DataStatus {
    #[default]
    Idle = 0,
    NoError = 1,
    TooManyPoints = 2,
    TooManySegments = 3,
    IncorrectSegmentOrder = 4,
    IncorrectStepTime = 5,
    IncorrectValue = 6,
    NotAllowed = 7,
    StartPositionMismatch = 8,
}

/// A response record (J-04).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
pub struct Response {
    /// Type byte as received, 0 where unknown.
    pub frame_type: u8,
    /// How the frame arrived.
    pub status: FrameStatus,
    /// What became of its data; Idle unless `status` is NoError.
    pub data: DataStatus,
    /// Bytes received, 0 where unknown.
    pub length: u16,
}

/// A complete frame whose CRC is right and whose length its type can have. Bodies are not yet checked.
#[derive(Clone, Copy, Debug)]
pub struct FrameRef<'a> {
    /// Type.
    pub frame_type: FrameType,
    /// All bytes, header and CRC included.
    pub bytes: &'a [u8],
}

impl<'a> FrameRef<'a> {
    /// Bytes between the length and the CRC.
    pub fn body(&self) -> &'a [u8] {
        unimplemented!()
    }
}

/// What the parser found.
#[derive(Clone, Copy, Debug)]
pub enum LinkEvent<'a> {
    /// A good frame.
    Frame(FrameRef<'a>),
    /// A bad frame or a run of bytes that is no frame.
    Bad(Response),
}

/// Stream parser of rule J-03 over a buffer of at least `FRAME_MAX` bytes.
pub struct Receiver<B> {
    _buffer: B,
}

impl<B: AsRef<[u8]> + AsMut<[u8]>> Receiver<B> {
    /// `gap_us`: a gap within a frame that ends it (5000).
    pub fn new(_buffer: B, _gap_us: u32) -> Self {
        unimplemented!()
    }
    /// Take bytes that were received until `now_us`; returns how many were taken (fewer when the buffer is full: offer the rest
    /// again after `release`).
    pub fn push(&mut self, _now_us: u64, _bytes: &[u8]) -> usize {
        unimplemented!()
    }
    /// Look for the next event with bounded work; true when `event` has one. Call it after `push` and at least each
    /// millisecond so that gaps are seen.
    pub fn poll(&mut self, _now_us: u64) -> bool {
        unimplemented!()
    }
    /// The event found, until it is released.
    pub fn event(&self) -> Option<LinkEvent<'_>> {
        unimplemented!()
    }
    /// Done with the event.
    pub fn release(&mut self) {
        unimplemented!()
    }
    /// Bytes are held that may become a frame.
    pub fn mid_frame(&self) -> bool {
        unimplemented!()
    }
}

/// One trajectory point as the wire carries it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[repr(C)]
pub struct RawPoint {
    /// Full scale 3.141592 rad.
    pub position: [i16; JOINTS],
    /// Full scale 6.283185 rad/s.
    pub velocity: [i16; JOINTS],
    /// Full scale 12.566370 rad/s².
    pub acceleration: [i16; JOINTS],
}

/// rad at 32767 in a trajectory point.
pub const POSITION_SCALE: f64 = 3.141592;
/// rad/s at 32767 in a trajectory point.
pub const VELOCITY_SCALE: f64 = 6.283185;
/// rad/s² at 32767 in a trajectory point.
pub const ACCELERATION_SCALE: f64 = 12.566370;

/// Borrowed view of a Trajectory body.
#[derive(Clone, Copy, Debug)]
pub struct Segment<'a> {
    /// Trajectory number.
    pub trajectory: u16,
    /// Number of this segment, from 0.
    pub segment: u16,
    /// Number of segments of the trajectory.
    pub segments: u16,
    /// ms between points.
    pub step_time: u16,
    points: &'a [u8],
}

impl Segment<'_> {
    /// Number of points.
    pub fn len(&self) -> usize {
        unimplemented!()
    }
    /// No point at all.
    pub fn is_empty(&self) -> bool {
        unimplemented!()
    }
    /// Point `i`; `None` past the end.
    pub fn point(&self, _i: usize) -> Option<RawPoint> {
        unimplemented!()
    }
}

/// What TrajSetExecStatus asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum ExecCommand {
    Stop = 1,
    Pause = 2,
    Execute = 3,
}

/// A list of big-endian f32 in a body.
#[derive(Clone, Copy, Debug)]
pub struct Floats<'a>(&'a [u8]);

impl Floats<'_> {
    /// Number of floats.
    pub fn len(&self) -> usize {
        unimplemented!()
    }
    /// No float at all.
    pub fn is_empty(&self) -> bool {
        unimplemented!()
    }
    /// Float `i`; `None` past the end.
    pub fn get(&self, _i: usize) -> Option<f32> {
        unimplemented!()
    }
}

/// A command's meaning, borrowed from the frame. Lengths are right; numbers in `Floats` are not yet checked.
#[derive(Clone, Copy, Debug)]
pub enum Command<'a> {
    /// Bit 0 of `jtc`; `nodes`: bits 0..6. The old 6-byte form reads as everything.
    ClearCurrentErrors {
        /// Clear the controller's own errors.
        jtc: bool,
        /// Mask of nodes.
        nodes: u8,
    },
    /// Clear current and occurred errors.
    ClearOccurredErrors,
    /// One segment.
    Trajectory(Segment<'a>),
    /// 6 × (20 velocities, 20 temperatures, 400 torques).
    FrictionTable(Floats<'a>),
    /// Use the default table.
    FrictionTableUseDefault,
    /// 6 × (Kp, Ki, Kd, IntMin, IntMax).
    PidParam(Floats<'a>),
    /// Use the default gains.
    PidParamUseDefault,
    /// 7 × 6 joint origins, 7 × 13 links.
    ArmModel(Floats<'a>),
    /// Use the default model.
    ArmModelUseDefault,
    /// Trajectory execution.
    TrajSetExecStatus(ExecCommand),
    /// Teaching on.
    TeachingModeEnable,
    /// Teaching off.
    TeachingModeDisable,
    /// 6 × 4 or 6 × 6 coefficients, highest index first.
    FrictionPolynomial(Floats<'a>),
    /// Use the default polynomial (also type 0x0E with 6 bytes).
    FrictionPolynomialUseDefault,
    /// Mask of nodes.
    ResetCanDevices {
        /// Bits 0..6.
        nodes: u8,
    },
    /// Pump.
    GripperControl {
        /// On.
        pump: bool,
    },
}

impl<'a> Command<'a> {
    /// Device side. Errors: `IncorrectValue` for a command or pump byte that is none of those listed, `NotAllowed` for a JtcStatus.
    pub fn parse(_frame: FrameRef<'a>) -> Result<Self, DataStatus> {
        unimplemented!()
    }
}

/// JtcStatus (section 2), both ways: `emit` for the device, `parse` for the host (165, 173 and 175 bytes, J-08).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[allow(missing_docs)]
pub struct Status {
    pub response: Response,
    pub fsm: u8,
    pub errors: u16,
    pub occurred: u16,
    pub jtc_init: u8,
    pub node_init: u8,
    pub tes: u8,
    pub point: u32,
    pub friction_type: u8,
    pub can_error: u8,
    pub can_current: u32,
    pub can_occurred: u32,
    pub joints: [JointStatus; JOINTS],
    /// `None` in the 165-byte layout.
    pub gripper: Option<GripperStatus>,
}

/// One joint in JtcStatus.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[allow(missing_docs)]
pub struct JointStatus {
    pub fsm: u8,
    pub mc_current: u8,
    pub mc_occurred: u8,
    pub errors: u8,
    pub warnings: u8,
    pub internal: u16,
    pub internal_occurred: u16,
    pub position: f32,
    pub velocity: f32,
    pub torque: f32,
    pub temperature: u8,
}

/// The gripper in JtcStatus.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[allow(missing_docs)]
pub struct GripperStatus {
    pub fsm: u8,
    pub pump: u8,
    pub pressure1: u8,
    pub pressure2: u8,
    pub errors: u8,
    pub warnings: u8,
}

impl Status {
    /// The 175-byte frame with CRC (a missing gripper is emitted as zeros).
    pub fn emit(&self) -> [u8; STATUS_LEN] {
        unimplemented!()
    }
    /// From a whole frame of 165, 173 or 175 bytes; `None` when type, length or CRC is wrong.
    pub fn parse(_bytes: &[u8]) -> Option<Status> {
        unimplemented!()
    }
}
