//! The board side.
