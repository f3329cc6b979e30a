//! A session on a bus: a master connected to the bus in wall-clock time, and the procedures that commands need.
//!
//! - [`Link`]: an open bus with its clock; [`Prompt`]: a bus with a short receive timeout; [`pump`]: frames between it and the master, in
//!   the order that keeps times correct.
//! - [`Driver`]: procedures from start to end, with an [`Operator`] who may stop them and reads notes.
//! - [`Examination`]: diagnosis of a bus; [`Watch`]: live view of a bus.
//! - [`CleanupList`]: work that would be left undone if the process ended now.
//! - [`Cache`], [`History`]: knowledge of boards that is kept between sessions.
//! - [`Known`], [`Word`], [`Prepared`], [`ParameterFile`]: values by name as words of boards, checked before anything is sent.
//! - [`FlashRecords`]: images that this tool wrote to boards, for [`Driver::update`].
//! - [`Recorder`], [`replay()`]: frames of the bus to a recording and back.
//! - [`Followed`]: the boards of a run under supervision.
//! - [`Session`], [`Held`]: started boards and knowledge of them, for the owner of a bus that others use.
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
