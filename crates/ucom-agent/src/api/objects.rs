//! Objects that the API sends. The agent generates the API description from the types of these
//! objects.
mod board;
mod bus;
mod job;
mod values;

pub(super) use board::{AnswerObject, BoardObject, FoundObject};
pub(super) use bus::{LeaseObject, StatusObject};
pub(super) use job::JobObject;
pub(super) use values::{ValueObject, ValuesObject};
