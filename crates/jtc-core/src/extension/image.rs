//! Image of the arm that the controller uses. The controller uses the image to read back, hash and store the arm (J-52, J-54).
use jtc_wire::field::image as field;
use jtc_wire::{ArmImage, Hash, IMAGE_MAX, NAME_LEN, Name, VALUE_LEN};

use crate::config::Config;
use crate::host_parameters::HostParameters;
use crate::settings;

/// Settings, parameters and name from which the image is assembled.
pub(crate) struct ImageSource<'a> {
    pub config: &'a Config,
    pub parameters: &'a HostParameters,
    pub name: &'a Name,
}

impl ImageSource<'_> {
    /// Returns the offset of the settings in the image.
    fn settings(&self) -> usize {
        let table = self.parameters.friction_is_table;
        field::FRICTION + if table { field::TABLE_LEN } else { field::POLYNOMIAL_LEN }
    }

    /// Returns the offset of the name in the image. Only the bytes of the image before the name affect the motion of the arm.
    fn name(&self) -> usize {
        self.settings() + VALUE_LEN * settings::count(true)
    }

    /// Returns the number of bytes of the image.
    pub(crate) fn len(&self) -> usize {
        self.name() + NAME_LEN
    }

    /// Reads bytes of the image into `out`, starting at byte `offset`. Returns the number of bytes that were copied.
    pub(crate) fn read(&self, offset: usize, out: &mut [u8]) -> usize {
        let (settings, name) = (self.settings(), self.name());
        let mut at = offset;
        let mut values = settings::values(self.config, at.saturating_sub(settings) / VALUE_LEN, true);
        let mut put = Output { out, filled: 0 };
        while put.wants_more() && at < name {
            at += if at < field::PID.start {
                put.part(&self.head(), at)
            } else if at < settings {
                let first = at - field::PID.start;
                put.part(&self.float(first / 4).to_be_bytes(), first % 4)
            } else {
                let Some(value) = values.next() else { break };
                put.part(&value.emit(), (at - settings) % VALUE_LEN)
            };
        }
        if at >= name {
            put.part(self.name.as_bytes(), at - name);
        }
        put.filled
    }

    fn head(&self) -> [u8; 8] {
        let [a, b, c, d] = field::MAGIC;
        let [high, low] = (settings::count(true) as u16).to_be_bytes();
        [a, b, c, d, field::VERSION, self.parameters.friction_is_table.into(), high, low]
    }

    /// Returns value `i` of the list of gains, model and friction.
    fn float(&self, i: usize) -> f32 {
        const MODEL: usize = (field::MODEL.start - field::PID.start) / 4;
        const FRICTION: usize = (field::FRICTION - field::PID.start) / 4;
        match i {
            0..MODEL => self.parameters.pid_float(i) as f32,
            MODEL..FRICTION => self.parameters.model_float(i - MODEL) as f32,
            _ => self.parameters.friction_float(i - FRICTION),
        }
    }

    /// Adds up to `count` bytes of the image to the hash, starting at byte `offset`. Returns the next offset and the new hash.
    pub(crate) fn hash(&self, offset: usize, hash: Hash, count: usize) -> (usize, Hash) {
        let mut bytes = [0; 256];
        let count = count.min(self.name().saturating_sub(offset));
        let slice = bytes.get_mut(..count).unwrap_or(&mut []);
        let read = self.read(offset, slice);
        (offset + read, hash.update(slice.get(..read).unwrap_or(&[])))
    }

    /// Returns `true` if `offset` is after the hashed bytes, which are all bytes before the name.
    pub(crate) fn hashed(&self, offset: usize) -> bool {
        offset >= self.name()
    }
}

/// Buffer that receives bytes of the image, with its fill level.
struct Output<'a> {
    out: &'a mut [u8],
    filled: usize,
}

impl Output<'_> {
    fn wants_more(&self) -> bool {
        self.filled < self.out.len()
    }

    /// Writes the bytes of `bytes` from index `from` into the remaining space of the buffer. Returns the number of bytes that were copied
    /// to the buffer.
    fn part(&mut self, bytes: &[u8], from: usize) -> usize {
        let room = self.out.get_mut(self.filled..).unwrap_or(&mut []);
        let rest = bytes.get(from..).unwrap_or(&[]);
        let count = room.len().min(rest.len());
        for (to, byte) in room.iter_mut().zip(rest) {
            *to = *byte;
        }
        self.filled += count;
        count
    }
}

/// Image of the arm to which the UseDefault frames refer, if an arm other than the built-in arm is stored.
#[derive(Clone, Debug)]
pub(crate) struct StoredArm {
    bytes: [u8; IMAGE_MAX],
    len: usize,
}

impl StoredArm {
    pub(crate) const fn new() -> Self {
        Self { bytes: [0; IMAGE_MAX], len: 0 }
    }

    /// Returns the bytes of the stored image.
    pub(crate) fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or(&[])
    }

    /// Returns the parts of the stored arm.
    pub(crate) fn arm(&self) -> Option<ArmImage<'_>> {
        ArmImage::parse(self.bytes())
    }

    /// Returns `true` if an arm is stored.
    pub(crate) fn is_there(&self) -> bool {
        self.len > 0
    }

    /// Removes the stored arm.
    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    /// Replaces the stored image by `image`. If the image is too long, no arm is stored after the call.
    pub(crate) fn set(&mut self, image: &[u8]) {
        self.len = match self.bytes.get_mut(..image.len()) {
            Some(place) => {
                place.copy_from_slice(image);
                image.len()
            }
            None => 0,
        };
    }

    /// Stores a part of the arm that the controller uses. Returns the offset of the next part. Until all parts are stored,
    /// [`Self::is_there`] returns `false`.
    pub(crate) fn write(&mut self, source: &ImageSource<'_>, offset: usize, count: usize) -> usize {
        self.len = 0;
        let end = (offset + count).min(IMAGE_MAX);
        let read = self.bytes.get_mut(offset..end).map_or(0, |place| source.read(offset, place));
        offset + read
    }

    /// Marks the image as complete: all `len` bytes are stored.
    pub(crate) fn finish(&mut self, len: usize) {
        self.len = len.min(IMAGE_MAX);
    }
}
