//! can-link
