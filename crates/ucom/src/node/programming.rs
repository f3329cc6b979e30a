//! Programming of a new application: reception of blocks, the two cycles, checks and flash operations (D-40 to D-46).

use super::transfer::{Cycle, Work};
use super::{Application, Area, Flash, FlashError, FlashState, Node, Pins, RECORD_LEN, Record, Store};
use crate::error_code::ErrorCode;
use crate::header::{BLOCK_LEN, Header, Memory};
use crate::profile::{HeaderForm, Plan};
use crate::program::{Checksum, Digest};

/// Number of bytes that the board reads back from flash in one step. The limit ensures that a verification step is short.
const VERIFY_STEP: usize = 1024;

impl<F: Flash, P: Pins, S: Store, A: Application> Node<F, P, S, A> {
    /// Returns `true` if the flash contains a valid application.
    pub fn has_application(&self) -> bool {
        self.record.is_some()
    }

    /// Aborts the transfer: sends one error, and ignores program data until PC_XRESET arrives or PROG changes from 0 to 1 (D-43).
    pub(super) fn abort(&mut self, code: ErrorCode) {
        self.programming.cancel(&self.config.profile);
        self.programming.discard = true;
        self.outbox.forget_transfer();
        self.error(code);
    }

    /// Handles PC_PROG, which carries 8 bytes of a block.
    pub(super) fn program(&mut self, data: [u8; 8], is_broadcast: bool) {
        if self.programming.discard {
            return;
        }
        if !self.prog {
            // Program data that arrive by broadcast are for a group of boards (D-46). A board whose bit PROG is 0
            // does not belong to this group, and ignores the data without an error.
            if !is_broadcast {
                self.abort(ErrorCode::MemProtected);
            }
            return;
        }
        let now = self.now_us;
        let programming = &mut self.programming;
        if programming.work != Work::None {
            return self.abort(ErrorCode::Overrun);
        }
        let place = programming.block.get_mut(programming.filled..programming.filled + 8);
        if let Some(place) = place {
            place.copy_from_slice(&data);
        }
        programming.filled += 8;
        programming.last_frame_us = now;
        if programming.filled >= BLOCK_LEN {
            programming.filled = 0;
            programming.work = Work::Block(now.saturating_add(self.config.block_us));
        }
    }

    /// Checks if the pause between two frames of program data is too long, and performs one step of the work in progress.
    pub(super) fn program_timers(&mut self) {
        let programming = &self.programming;
        let pause = u64::from(self.config.profile.prog_frame_timeout) * 1000;
        if programming.filled > 0 && self.now_us.saturating_sub(programming.last_frame_us) > pause {
            return self.abort(ErrorCode::ExloadCycle);
        }
        if let Err(code) = self.program_work() {
            self.abort(code);
        }
    }

    fn program_work(&mut self) -> Result<(), ErrorCode> {
        let now = self.now_us;
        match self.programming.work {
            Work::None | Work::Answer => return Ok(()),
            Work::Block(at) if at > now => return Ok(()),
            Work::Block(_) => return self.take_block(),
            _ => {}
        }
        // The board starts no flash operation while the flash is busy.
        let state = self.flash.state(now);
        if state == FlashState::Busy {
            return Ok(());
        }
        let waited = !matches!(self.programming.work, Work::ClearRecord | Work::Verify(_));
        if waited && state == FlashState::Failed {
            return Err(ErrorCode::Flash);
        }
        let cycle = self.programming.cycle.as_ref().ok_or(ErrorCode::ExloadCycle)?;
        let (memory, area) = (cycle.memory, cycle.area);
        let flash = |result: Result<(), FlashError>| result.map_err(|_| ErrorCode::Flash);
        self.programming.work = match self.programming.work {
            Work::ClearRecord => {
                self.record = None;
                flash(self.flash.erase_record(now))?;
                Work::Erase
            }
            Work::Erase => {
                flash(self.flash.erase(now, memory, area))?;
                Work::AwaitErase
            }
            Work::AwaitErase if self.config.profile.prog_header == HeaderForm::None => {
                return self.take_data();
            }
            Work::AwaitErase => return self.block_taken(),
            Work::AwaitWrite => return self.after_data(),
            Work::Verify(done) => return self.verify(done),
            Work::WriteRecord => {
                let record = self.new_record().ok_or(ErrorCode::ExloadCycle)?;
                flash(self.flash.write_record(now, &record.build()))?;
                Work::AwaitRecord
            }
            Work::AwaitRecord => return self.finish(),
            other => other,
        };
        Ok(())
    }

    fn take_block(&mut self) -> Result<(), ErrorCode> {
        match (&self.programming.cycle, self.config.profile.prog_header) {
            (Some(_), _) => self.take_data(),
            (None, HeaderForm::V1) => self.take_header(),
            (None, HeaderForm::None) => {
                let header = self.header_by_itself().ok_or(ErrorCode::MemProtected)?;
                self.begin_cycle(header)?;
                if self.programming.work == Work::ClearRecord { Ok(()) } else { self.take_data() }
            }
        }
    }

    /// Parses the header of a cycle (D-41). The function rejects headers that this board cannot accept.
    fn take_header(&mut self) -> Result<(), ErrorCode> {
        let endian = self.config.profile.prog_endian;
        let header = Header::parse(&self.programming.block, endian).map_err(|_| ErrorCode::Data)?;
        if header.cycle != self.programming.number {
            return Err(ErrorCode::ExloadCycle);
        }
        if header.target != Header::ANY_BOARD && header.target != self.config.flash_number {
            return Err(ErrorCode::MemProtected);
        }
        if header.length == 0 {
            return Err(ErrorCode::Data);
        }
        self.begin_cycle(header)?;
        if self.programming.work == Work::ClearRecord { Ok(()) } else { self.block_taken() }
    }

    /// Returns the header for a board whose images have no header block. The length of the image is the configured length, but at most the
    /// length of the application area.
    fn header_by_itself(&self) -> Option<Header> {
        let cycle = self.programming.number;
        let memory = match (self.config.profile.prog_plan, cycle) {
            (Plan::ExloaderApp, 1) => Memory::Ram,
            (Plan::PmemXmem, 2) => Memory::Data,
            _ => Memory::Program,
        };
        let area = self.flash.area(memory)?;
        let length = match self.config.headerless_words {
            0 => area.words,
            words => words.min(area.words),
        };
        // The second header preliminarily gets the Program ID of the first cycle. If the second cycle contains
        // another image, the Program ID of that image replaces this value later.
        let program_id = self.programming.first.map_or(0, |first| first.program_id);
        let (address, target) = (area.start, Header::ANY_BOARD);
        Some(Header { cycle, memory: memory.number(), address, length, program_id, date: 0, target })
    }

    fn begin_cycle(&mut self, header: Header) -> Result<(), ErrorCode> {
        let profile = &self.config.profile;
        let memory = Memory::from_number(header.memory).ok_or(ErrorCode::MemProtected)?;
        let area = Area { start: header.address, words: header.length };
        if !self.flash.area(memory).is_some_and(|allowed| allowed.holds(area)) {
            return Err(ErrorCode::MemProtected);
        }
        let second = self.programming.number == 2;
        let (fits, writes) = match profile.prog_plan {
            Plan::VerifyWrite | Plan::Raw => (memory != Memory::Ram, second),
            Plan::ExloaderApp => ((memory == Memory::Ram) != second, true),
            Plan::PmemXmem => (memory == if second { Memory::Data } else { Memory::Program }, true),
        };
        if !fits {
            return Err(ErrorCode::MemProtected);
        }
        if let (Plan::VerifyWrite, Some(first)) = (profile.prog_plan, self.programming.first)
            && (first.memory, first.address, first.length, first.program_id)
                != (header.memory, header.address, header.length, header.program_id)
        {
            return Err(ErrorCode::ExloadCycle);
        }
        let digest = Digest::new(profile.prog_checksum, profile.prog_endian);
        self.programming.cycle = Some(Cycle { header, area, memory, writes, done: 0, digest });
        // A cycle that writes to RAM erases nothing, and the application in flash remains valid.
        if writes && memory != Memory::Ram {
            self.programming.work = Work::ClearRecord;
        }
        Ok(())
    }

    fn take_data(&mut self) -> Result<(), ErrorCode> {
        let cycle = self.programming.cycle.as_mut().ok_or(ErrorCode::ExloadCycle)?;
        let len = (cycle.bytes().saturating_sub(cycle.done) as usize).min(BLOCK_LEN);
        let data = self.programming.block.get(..len).unwrap_or(&[]);
        cycle.digest.update(data);
        let address = cycle.area.start.saturating_add(cycle.done / 2);
        cycle.done = cycle.done.saturating_add(len as u32);
        if !cycle.writes {
            return self.after_data();
        }
        // The board writes the bytes in the order in which it received them. The checksum uses the same order of bytes.
        self.flash.write(self.now_us, cycle.memory, address, data).map_err(|_| ErrorCode::Flash)?;
        self.programming.work = Work::AwaitWrite;
        Ok(())
    }

    /// Continues the cycle after a block was stored. After the last block, the function ends the cycle.
    fn after_data(&mut self) -> Result<(), ErrorCode> {
        let profile = self.config.profile;
        let headerless = profile.prog_header == HeaderForm::None;
        let second = self.programming.number == 2;
        let cycle = self.programming.cycle.as_mut().ok_or(ErrorCode::ExloadCycle)?;
        if cycle.done < cycle.bytes() {
            return self.block_taken();
        }
        let came = cycle.digest.finish();
        let known = !headerless || (second && profile.prog_plan == Plan::VerifyWrite);
        if !known {
            cycle.header.program_id = came;
        } else if profile.prog_checksum != Checksum::None && came != cycle.header.program_id {
            return Err(ErrorCode::Checksum);
        }
        if cycle.writes {
            cycle.digest = Digest::new(profile.prog_checksum, profile.prog_endian);
            self.programming.work = Work::Verify(0);
            Ok(())
        } else {
            self.end_first_cycle()
        }
    }

    /// Reads a part of the image back from flash. The checksum of the image must match the Program ID (D-44).
    fn verify(&mut self, done: u32) -> Result<(), ErrorCode> {
        let checksum = self.config.profile.prog_checksum;
        let cycle = self.programming.cycle.as_mut().ok_or(ErrorCode::ExloadCycle)?;
        let mut done = done;
        let end = cycle.bytes().min(done.saturating_add(VERIFY_STEP as u32));
        while done < end {
            let mut buffer = [0; BLOCK_LEN];
            let len = ((end - done) as usize).min(BLOCK_LEN);
            let Some(piece) = buffer.get_mut(..len) else { break };
            let address = cycle.area.start.saturating_add(done / 2);
            self.flash.read(cycle.memory, address, piece).map_err(|_| ErrorCode::Flash)?;
            cycle.digest.update(piece);
            done += len as u32;
        }
        if done < cycle.bytes() {
            self.programming.work = Work::Verify(done);
            return Ok(());
        }
        if checksum != Checksum::None && cycle.digest.finish() != cycle.header.program_id {
            return Err(ErrorCode::Checksum);
        }
        if self.programming.number == 1 {
            return self.end_first_cycle();
        }
        self.programming.work = Work::WriteRecord;
        Ok(())
    }

    fn end_first_cycle(&mut self) -> Result<(), ErrorCode> {
        self.programming.first = self.programming.cycle.take().map(|cycle| cycle.header);
        self.programming.number = 2;
        self.block_taken()
    }

    fn block_taken(&mut self) -> Result<(), ErrorCode> {
        self.programming.work = Work::Answer;
        self.outbox.block_taken = true;
        Ok(())
    }

    /// Returns the validity record of the new application. If an update writes program and data memory, the record
    /// describes the program memory, although the data memory is written last.
    fn new_record(&self) -> Option<Record> {
        let header = match self.config.profile.prog_plan {
            Plan::PmemXmem => self.programming.first?,
            _ => self.programming.cycle.as_ref()?.header,
        };
        let Header { program_id, date, address, length, .. } = header;
        Some(Record { program_id, date, address, words: length })
    }

    fn finish(&mut self) -> Result<(), ErrorCode> {
        let stored: [u8; RECORD_LEN] = self.flash.record();
        let record = Record::parse(&stored).filter(|record| Some(*record) == self.new_record());
        self.record = Some(record.ok_or(ErrorCode::Flash)?);
        self.prog = false;
        self.programming.cancel(&self.config.profile);
        self.outbox.finished = true;
        Ok(())
    }
}
