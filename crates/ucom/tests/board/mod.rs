//! Tests of boards over the bus: the tests send raw frames and check the raw answers.

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
