//! Measures properties in which boards may differ from the defaults. The probe sends only harmless queries, unless the options allow more.
//!
//! The published description of the protocol does not define many details. A board reveals most of these details in answers to queries, for
//! example by the number of its reports or by its answer to a padded query. Some properties of a board appear only after PC_INIT or while
//! its control loop runs. The probe measures such properties if the options allow this.

mod judge;
pub(crate) mod measure;
