//! Files of the PC side: images, recordings, inventories, meanings of words, parameters, signal databases.

pub mod dbc;
pub mod edges;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
pub mod image;
pub mod inventory;
pub mod params;
pub mod recording;
mod text;

pub use dbc::{DbcBoard, DbcEdge, dbc};
pub use edges::{BoardEdges, Edge, EdgeTable, EdgeType, Given};
pub use image::{Image, ImageError, ImageOptions};
pub use inventory::{Inventory, InventoryBoard, InventoryError};
pub use params::{ParamsError, ParamsFile};
pub use recording::{Recording, RecordingError};
pub use text::{TextError, write_text};
