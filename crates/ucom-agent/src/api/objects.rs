//! Objects that the API sends. The API description is made from these types.
mod board;
mod bus;
mod job;
mod values;

pub use board::{AnswerObject, BoardObject, FoundObject};
pub use bus::{LeaseObject, StatusObject};
pub use job::JobObject;
pub use values::{ValueObject, ValuesObject};
