//! jtc-sim
