//! Measurement of properties in which boards may differ from the defaults. Only harmless queries are sent, unless the options allow more.
//!
//! The published description does not define many details. A board shows most of these details without a change, for example by the number
//! of its reports or its answer to a padded query. Some properties appear only after PC_INIT or in a running board. Such properties are
//! measured if the options allow this.

mod judge;
pub(crate) mod measure;
