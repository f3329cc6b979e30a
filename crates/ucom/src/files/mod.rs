//! Files of the PC side: images, recordings, inventories, signal databases.

pub mod dbc;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
pub mod image;
pub mod inventory;
pub mod recording;

pub use dbc::{DbcBoard, dbc};
pub use image::{Image, ImageError, ImageOptions};
pub use inventory::{Inventory, InventoryBoard, InventoryError};
pub use recording::{Recording, RecordingError};
