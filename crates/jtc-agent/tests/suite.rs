//! Test program with all tests of the crate. Each file is a module. Linking this program takes as long as linking the program of a single
//! test.
mod board;
mod description;
mod fuzz_regressions;
mod line;
mod modbus;
mod modbus_page;
mod will;
