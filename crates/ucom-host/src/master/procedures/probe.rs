//! Measures properties in which boards can differ from the defaults. The probe sends only harmless queries, unless
//! the options allow more.
//!
//! The published description of the protocol does not define many details. A board reveals most of these details in
//! its answers, for example by the number of its reports, or by its answer to a query with additional bytes. Other
//! properties appear only after PC_INIT, or while a control loop runs. The probe measures them only if the options
//! allow this.

mod judge;
pub(crate) mod measure;
