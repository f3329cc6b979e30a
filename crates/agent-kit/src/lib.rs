#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod access;
pub mod api;
mod cut;
pub mod events;
mod finding;
pub mod gate;
pub mod halt;
pub mod journal;
pub mod lease;
pub mod log;
pub mod openapi;
pub mod pages;
mod problem;
pub mod serve;
pub mod socket;
pub mod tls;
