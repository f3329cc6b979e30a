//! Boards as seen from the bus: raw frames in, raw frames out.

mod acceptance;
mod acceptance_update;
mod application;
mod bus;
mod compatibility;
mod golden;
mod random;
mod shared_ids;
mod states;
mod update;
