//! Selection of the destination of a received frame (filters, dedicated buffers, FIFOs).
use can_link::CanFrame;

use super::ram::{ELEMENT_SIZES, Target};
use super::{Fdcan, ir};

impl Fdcan {
    pub(super) fn receive(&mut self, frame: &CanFrame) {
        let id = frame.id();
        let ndat = self.ndat;
        let busy = |b: u32| ndat[b as usize / 32] >> (b % 32) & 1 == 1;
        let remote = if id.is_extended() { self.gfc & 1 } else { self.gfc >> 1 & 1 };
        let target = if frame.is_remote() && remote == 1 {
            Target::Reject
        } else if id.is_extended() {
            self.ram.extended(id.value(), self.xidfc, self.xidam, self.gfc, busy)
        } else {
            self.ram.standard(id.value(), self.sidfc, self.gfc, busy)
        };
        self.psr |= u32::from(frame.is_fd()) << 13 | u32::from(frame.is_brs()) << 12;
        match target {
            Target::Reject => self.rejected += 1,
            Target::Buffer(buffer, filter) => {
                let room = ELEMENT_SIZES[(self.rxesc >> 8 & 7) as usize];
                let start = (self.rxbc & 0xFFFC) + buffer * (room + 8);
                self.ram.store(start, room, frame, Some(filter), 0);
                self.ndat[buffer as usize / 32] |= 1 << (buffer % 32);
                self.ir |= ir::DRX;
                self.stored += 1;
            }
            Target::Fifo(n, filter) => self.receive_fifo(n, filter, frame),
        }
    }

    fn receive_fifo(&mut self, n: usize, filter: Option<u32>, frame: &CanFrame) {
        let room = ELEMENT_SIZES[(self.rxesc >> (4 * n) & 7) as usize];
        let flags = 4 * n;
        let fifo = &mut self.fifos[n];
        let size = (fifo.config >> 16 & 0x7F).min(64);
        if fifo.fill >= size {
            let overwrite = fifo.config >> 31 == 1 && size > 0;
            fifo.lost = true;
            self.lost += 1;
            self.ir |= ir::RF0L << flags;
            if !overwrite {
                return;
            }
            fifo.get = (fifo.get + 1) % size;
            fifo.fill -= 1;
        }
        let start = (fifo.config & 0xFFFC) + fifo.put * (room + 8);
        fifo.put = (fifo.put + 1) % size;
        fifo.fill += 1;
        self.ir |= ir::RF0N << flags;
        if fifo.fill == size {
            self.ir |= ir::RF0F << flags;
        }
        self.stored += 1;
        self.ram.store(start, room, frame, filter, 0);
    }
}
