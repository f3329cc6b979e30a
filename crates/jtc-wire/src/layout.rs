//! Lengths of the parts of extension frames (J-50).

/// Maximum length of a frame that answers an extension request, bytes (J-56).
pub const ANSWER_MAX: usize = 256;
/// Length of a [`SettingValue`](crate::SettingValue), bytes.
pub const VALUE_LEN: usize = 10;
/// Maximum number of values in a SetSettings frame.
pub const SET_VALUES_MAX: usize = 256;
/// Length of the head of a Settings, Arm or Points body. The head contains the number of the first item or byte, and
/// the total number.
pub(crate) const PAGE_HEAD_LEN: usize = 4;
/// Length of the head of a Log body.
pub(crate) const LOG_HEAD_LEN: usize = 17;
/// Minimum length of an [`Info`](crate::Info) body. In later versions the body is longer.
pub(crate) const INFO_LEN: usize = 136;
