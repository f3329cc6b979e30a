//! All tests of the crate in one program, with each file as a module. The program links as fast as a single test would.
mod board;
mod description;
mod fuzz_regressions;
mod line;
mod modbus;
mod modbus_page;
mod will;
