//! All tests of the crate are in one program, so that only one program is linked. Each file in this folder is a module of the
//! test program.
mod bus_off;
mod chain;
mod common;
mod conformance;
mod endings;
mod hangup;
mod images;
mod leaving;
mod monitor;
mod offline;
mod overwrite;
mod pages;
mod params;
mod repair;
mod replay;
mod serve;
mod shared_numbers;
mod silence;
mod troubles;
mod update;
mod update_known;
mod variables;
