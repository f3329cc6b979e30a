//! Measurement of properties in which boards differ from the defaults: only harmless questions, unless more is allowed.
//!
//! The published description leaves many points open. A running board shows most of them: the number of reports, the byte order of a
//! count that can be checked, its answer to a padded question. Properties that appear only after PC_INIT or in a running board are
//! measured if the options allow it.

mod judge;
pub(crate) mod measure;
