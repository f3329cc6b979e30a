//! What the API sends: one type for each object, from which its description is made.
mod board;
mod bus;
mod job;
mod values;

pub use board::{AnswerObject, BoardObject, FoundObject};
pub use bus::{LeaseObject, StatusObject};
pub use job::JobObject;
pub use values::{ValueObject, ValuesObject};
