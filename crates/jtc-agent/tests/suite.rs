//! Test program that contains all tests of the crate. Each test file is a module of this program. Linking one program
//! is faster than linking one program per test file.
mod board;
mod description;
mod fuzz_regressions;
mod line;
mod modbus;
mod modbus_page;
mod will;
