//! Measures what boards read otherwise than the defaults: by harmless questions only, unless more is allowed.
//!
//! The published description leaves much open. A live board gives most of it away: the number of reports, the order of
//! bytes in a count that can be checked, whether a padded question is answered. What shows only after PC_INIT or in a
//! running board is measured when the options allow it.

mod judge;
pub(crate) mod measure;
