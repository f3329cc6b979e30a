//! jtc-host
