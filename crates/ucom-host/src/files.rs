//! File formats of the PC tools: images, recordings, inventories, signal tables, parameters, DBC files.

pub mod dbc;
mod flash_record;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
pub mod image;
pub mod inventory;
pub mod params;
pub mod recording;
pub mod signals;
mod text;

pub use dbc::{DbcBoard, NamedSignal, dbc};
pub use flash_record::FlashRecord;
pub use image::{Image, ImageError, ImageOptions};
pub use inventory::{IdentifyError, Inventory, InventoryBoard, InventoryError};
pub use params::{ParamsError, ParamsFile};
pub use recording::{Recording, RecordingError};
pub use signals::{BoardSignals, Signal, SignalTable, SignalType, SignalValue};
pub use text::{TextError, write_text};
