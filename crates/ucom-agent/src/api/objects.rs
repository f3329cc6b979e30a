//! Objects that the API sends. The API description is generated from these types.
mod board;
mod bus;
mod job;
mod values;

pub(super) use board::{AnswerObject, BoardObject, FoundObject};
pub(super) use bus::{LeaseObject, StatusObject};
pub(super) use job::JobObject;
pub(super) use values::{ValueObject, ValuesObject};
