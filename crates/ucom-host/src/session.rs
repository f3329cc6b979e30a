//! A session on a bus: a master that is connected to the bus in real time, and the procedures that commands need.
//!
//! - [`Link`]: an open bus with its clock; [`Prompt`]: a bus with a short receive timeout; [`pump`]: moves frames between the bus and the
//!   master, in the order that keeps times correct.
//! - [`Driver`]: runs procedures from start to end, with an [`Operator`] who can end the procedures and who receives notes.
//! - [`Examination`]: diagnosis of a bus; [`Watch`]: live view of a bus.
//! - [`CleanupList`]: work that would remain undone if the process ended now, and the next commands for this work.
//! - [`Cache`], [`History`]: data about boards that are stored between sessions.
//! - [`Known`], [`Word`], [`Prepared`], [`ParameterFile`]: conversion of named values to words of boards, with checks before anything is
//!   sent.
//! - [`FlashRecords`]: records of the images that this tool wrote to boards, for [`Driver::update`].
//! - [`Recorder`], [`replay()`]: recording of the frames on a bus, and replay of a recording.
//! - [`Followed`]: supervision of the boards of a run.
//! - [`Session`], [`Held`]: started boards and data about them, for a program that owns a bus and shares the bus with other programs.
pub mod bus_off;
mod cache;
mod changes;
mod cleanup;
mod driver;
mod error;
mod examine;
mod flash_records;
mod followed;
mod held;
mod history;
mod known;
mod link;
mod named;
mod parameters;
mod plans;
mod prompt;
pub mod pump;
mod recorder;
mod replay;
mod selection;
mod values;
mod watch;

pub use cache::Cache;
pub use changes::{Numbered, Stopped};
pub use cleanup::CleanupList;
pub use driver::{Driver, Operator, event_text, nothing_shared};
pub use error::{SessionError, ValuesError};
pub use examine::Examination;
pub use flash_records::FlashRecords;
pub use followed::{Change, Followed, Notice};
pub use held::{Held, Session};
pub use history::{History, Written};
pub use known::Known;
pub use link::{Link, from_wire, protocol_frame, recorded, replayed, to_wire};
pub use parameters::{
    FileWords, ParameterFile, Parameters, arrived, become_master, inventory, name_of, write,
};
pub use plans::{plans, remember};
pub use prompt::Prompt;
pub use recorder::Recorder;
pub use replay::{ReplayPlan, Unsent, is_intrusive, replay};
pub use selection::{Assignment, Boards, for_board, only};
pub use values::{Prepared, Word, note_rounded, with_names, words};
pub use watch::{CompetingMaster, HISTORY, LOG, Picture, Problems, Watch};
