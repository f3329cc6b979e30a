//! Measurement of properties in which boards differ from the defaults: by harmless questions only, unless more is allowed.
//!
//! The published description leaves much open. A live board shows most of it: the number of reports, the order of
//! bytes in a count that can be checked, its answer to a padded question. Properties that show only after PC_INIT or
//! in a running board are measured if the options allow it.

mod judge;
pub(crate) mod measure;
