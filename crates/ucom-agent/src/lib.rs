#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod api;
mod event;
mod jobs;
mod owner;
mod snapshot;

pub use event::{ChainEvent, Policy};
pub use owner::{Config, Owner};
