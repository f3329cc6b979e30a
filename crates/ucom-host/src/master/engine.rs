//! Parts that all procedures of the master use: the clock, the queued frames, the mailboxes, the last known states of
//! the boards, and the supervision of the boards.
//!
//! Each file imports only files that come before it in this list: times, statistics, boards, holders, event, mailbox,
//! shared, inputs, supervise, link.
mod boards;
mod event;
mod holders;
mod inputs;
mod link;
mod mailbox;
mod shared;
mod statistics;
mod supervise;
mod times;

pub use boards::{Board, Boards, Life, state_name};
pub use event::{Event, Supervision};
pub(crate) use holders::{Open, head};
pub(crate) use link::{Link, lock};
pub(crate) use mailbox::{Forget, Mailbox, Received};
pub(crate) use shared::{Core, Session};
pub use statistics::{Rate, Statistics, WINDOW_US};
pub(crate) use times::{MS, Times};
