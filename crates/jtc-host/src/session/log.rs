//! Download of a device's flight recorder log, page by page, with the device data that a replay needs (J-56).

use jtc_core::recorder::BLOCK_BYTES;
use jtc_wire::{Answer, LOG_NO_BLOCK, LogState, RawPoint, fixed};

use super::Session;
use crate::error::{Error, LinkError};
use crate::log::{FlightLog, blocks_of};
use crate::port::Port;

/// State of a flight recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogStatus {
    /// Activity of the recorder, or the reason why it has stopped.
    pub state: LogState,
    /// Number of the newest block of the log, plus 1.
    pub end: u32,
}

/// A page of a log.
struct Page {
    status: LogStatus,
    block: u32,
    offset: u16,
    points: u16,
    points_hash: u32,
    bytes: Vec<u8>,
}

impl<P: Port> Session<P> {
    /// Returns the state of the flight recorder. The recorder continues to record.
    ///
    /// # Errors
    ///
    /// Returns [`LinkError::NoExtension`] if the device has no extensions. Returns [`LinkError::Refused`] if the device has no recorder.
    /// Also returns communication errors.
    pub fn log_status(&mut self) -> Result<LogStatus, LinkError> {
        self.log_page(LOG_NO_BLOCK, 0).map(|page| page.status)
    }

    /// Deletes the log of the device, and starts a new log.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::log_status`].
    pub fn clear_log(&mut self) -> Result<(), LinkError> {
        self.extension(&fixed::CLEAR_LOG)
    }

    fn log_page(&mut self, block: u32, offset: u16) -> Result<Page, LinkError> {
        self.ask(&fixed::get_log(block, offset), |answer| match answer {
            Answer::Log(page) => Some(Page {
                status: LogStatus { state: page.state, end: page.end },
                block: page.block,
                offset: page.offset,
                points: page.points,
                points_hash: page.points_hash,
                bytes: page.bytes.to_vec(),
            }),
            _ => None,
        })
    }

    /// Reads the complete log, the active arm, and the trajectory points that a replay of the log needs. The recorder pauses during the
    /// transfer. The arm may move during the transfer. Calls `done` after each part with the number of bytes received and the total number
    /// of bytes.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::log_status`] and [`Session::arm_image`].
    pub fn fetch_log(&mut self, done: impl FnMut(usize, usize)) -> Result<FlightLog, Error> {
        self.fetch_log_until(|| false, done)
    }

    /// Like [`Session::fetch_log`], but stops once `ended` returns `true`.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::fetch_log`], and [`Error::Cancelled`] if the caller cancels.
    pub fn fetch_log_until(
        &mut self,
        ended: impl Fn() -> bool,
        mut done: impl FnMut(usize, usize),
    ) -> Result<FlightLog, Error> {
        let mut log = FlightLog::default();
        let mut bytes = Vec::new();
        let mut first = None;
        let points = loop {
            if ended() {
                return Err(Error::Cancelled);
            }
            // The first answer contains the number of the first block of the log.
            let (block, offset) =
                (first.unwrap_or(0) + (bytes.len() / BLOCK_BYTES) as u32, bytes.len() % BLOCK_BYTES);
            let page = self.log_page(block, offset as u16)?;
            (log.state, log.points_hash) = (page.status.state, page.points_hash);
            if page.block != block || first.is_none() || usize::from(page.offset) != offset {
                // If the requested block no longer exists, for example because the log was cleared, the device sends
                // its oldest block instead. The download then starts again from this block.
                bytes.clear();
                first = Some(page.block);
            }
            let begin = first.unwrap_or(0);
            done(bytes.len(), (page.status.end.saturating_sub(begin) as usize) * BLOCK_BYTES);
            if page.bytes.is_empty() || page.block >= page.status.end {
                break usize::from(page.points);
            }
            bytes.extend(page.bytes);
        };
        log.blocks = blocks_of(&bytes);
        log.device = match self.info()? {
            Some(info) => format!("{}, firmware {}", info.board, info.firmware_and_revision()),
            None => String::new(),
        };
        log.arm = self.arm_image()?;
        if let Some((first, count)) = log.needed_points(log.points_hash, points) {
            log.first_point = first;
            log.points = self.log_points(first, count)?;
        }
        Ok(log)
    }

    /// Returns points of the trajectory in the device's memory. The points begin at index `first`. The function returns `count` points, or
    /// fewer points if the trajectory ends earlier.
    fn log_points(&mut self, first: usize, count: usize) -> Result<Vec<RawPoint>, LinkError> {
        let mut all = Vec::new();
        while all.len() < count {
            let from = (first + all.len()) as u16;
            let page: Vec<RawPoint> = self.ask(&fixed::get_points(from), |answer| match answer {
                Answer::Points { first, points, .. } if first == from => Some(points.iter().collect()),
                _ => None,
            })?;
            if page.is_empty() {
                break;
            }
            all.extend(page);
        }
        all.truncate(count);
        Ok(all)
    }
}
