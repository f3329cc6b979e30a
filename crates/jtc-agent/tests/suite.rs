//! All tests of the crate in one program, which links as fast as a single one: each file here is a module of it.
mod board;
mod description;
mod fuzz_regressions;
mod line;
mod modbus;
mod modbus_page;
mod will;
