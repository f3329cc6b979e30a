//! Boards as seen from the bus: raw frames in, raw frames out.

mod acceptance;
mod application;
mod bus;
mod compatibility;
mod random;
mod states;
mod update;
