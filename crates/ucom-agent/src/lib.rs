#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod api;
mod happening;
mod jobs;
mod owner;
mod picture;

pub use happening::{Happening, Policy};
pub use owner::{Config, Owner};
