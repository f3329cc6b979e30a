//! Test program that contains all tests of the crate. Each test file is a module of the test program. Linking the single program takes
//! as long as linking a program for one test file.
mod board;
mod description;
mod fuzz_regressions;
mod line;
mod modbus;
mod modbus_page;
mod will;
