//! Boards as seen from the bus: raw frames in, raw frames out.

mod acceptance;
mod acceptance_update;
mod application;
mod bus;
mod compatibility;
mod golden;
mod lasting;
mod random;
mod shared_ids;
mod states;
mod times;
mod update;
mod update_profiles;
