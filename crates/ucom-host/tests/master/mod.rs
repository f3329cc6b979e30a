//! Tests of the master on a bus in memory, in virtual time. In some tests, the master runs against tables of frames (rows P-1 to P-21 of
//! the acceptance tests). In other tests, the master runs against the boards of the crate `ucom`, with faults on every single frame.

mod answering;
mod bench;
mod chain;
mod competing_master;
mod conformance;
mod conformance_ends;
mod exit;
mod faults;
mod kept;
mod loader;
mod losses;
mod overload;
mod probing;
mod repairing;
mod robust;
mod running;
mod script;
mod scripted;
mod shared_numbers;
mod starting;
mod stopping;
mod update;
mod update_ends;
mod update_group;
mod update_known;
mod update_plans;
