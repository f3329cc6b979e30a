//! All tests of the crate are in one program, so that only one program is linked. Each file in this folder is a module
//! of this program.
mod bring_up;
mod by_hand;
mod determinism;
mod elastic;
mod falling;
mod fault_matrix;
mod free_fall;
mod obstacles;
mod own_controller;
mod recorder;
mod soak;
mod stiction;
mod stop;
mod stop_under_load;
mod stories;
mod tracking;
mod violent;
mod walls;
