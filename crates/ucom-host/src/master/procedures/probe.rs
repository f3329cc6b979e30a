//! Measurement of properties in which boards may differ from the defaults. Only harmless questions are sent, unless more is allowed.
//!
//! The published description leaves many points open. A board shows most of them without a change: the number of its reports, the byte
//! order of a count that can be checked, its answer to a padded question. Some properties appear only after PC_INIT or in a running board.
//! These properties are measured if the options allow it.

mod judge;
pub(crate) mod measure;
