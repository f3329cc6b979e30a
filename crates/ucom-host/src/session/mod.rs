//! A session on a bus: a master with the frames that carry it, in wall-clock time, and what commands make of it.
//!
//! - [`Link`]: an open bus with its clock; [`Prompt`]: one that is never waited for long; [`pump`]: frames between it and the master, in the order that keeps times honest.
//! - [`Driver`]: procedures from start to end, with an [`Operator`] who may stop them and reads notes.
//! - [`Examination`]: what is wrong with a bus; [`Watch`]: a bus as it is looked at live.
//! - [`CleanupList`]: what would be left undone if the process ended now.
//! - [`Cache`], [`History`]: what is remembered of boards from session to session.
//! - [`Known`], [`Word`], [`Prepared`], [`ParameterFile`]: values by name as words of boards, checked before anything is sent.
//! - [`FlashRecords`]: what this tool wrote to boards, for [`Driver::update`].
//! - [`Recorder`], [`replay()`]: frames of the bus to a recording and back.
//! - [`Followed`]: the boards of a run under supervision.
//! - [`Session`], [`Held`]: what has been started and is known, for who owns a bus for others.
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
pub use replay::{is_intrusive, replay};
pub use selection::{Assignment, Boards, for_board, only};
pub use values::{Prepared, Word, note_rounded, with_names, words};
pub use watch::{CompetingMaster, HISTORY, LOG, Picture, Problems, Watch};
