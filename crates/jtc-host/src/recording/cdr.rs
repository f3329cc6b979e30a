//! Encoder and decoder for little-endian CDR, the encoding of ROS 2 messages. Each value is aligned to its size. Offsets are counted from
//! the end of the 4-byte header.

/// Encoder of a message.
#[derive(Default)]
pub(super) struct Encoder {
    bytes: Vec<u8>,
}

const HEADER: [u8; 4] = [0, 1, 0, 0];

impl Encoder {
    /// Begins a new message and reuses the memory of the previous message.
    pub(super) fn start(&mut self) -> &mut Self {
        self.bytes.clear();
        self.bytes.extend(HEADER);
        self
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn align(&mut self, to: usize) {
        while !(self.bytes.len() - HEADER.len()).is_multiple_of(to) {
            self.bytes.push(0);
        }
    }

    pub(super) fn u8(&mut self, v: u8) -> &mut Self {
        self.bytes.push(v);
        self
    }

    pub(super) fn u16(&mut self, v: u16) -> &mut Self {
        self.align(2);
        self.bytes.extend(v.to_le_bytes());
        self
    }

    pub(super) fn u32(&mut self, v: u32) -> &mut Self {
        self.align(4);
        self.bytes.extend(v.to_le_bytes());
        self
    }

    pub(super) fn f64(&mut self, v: f64) -> &mut Self {
        self.align(8);
        self.bytes.extend(v.to_le_bytes());
        self
    }

    pub(super) fn string(&mut self, v: &str) -> &mut Self {
        self.u32(v.len() as u32 + 1);
        self.bytes.extend(v.as_bytes());
        self.u8(0)
    }

    /// Writes a sequence as its length followed by its values.
    pub(super) fn f64s(&mut self, values: [f64; 6]) -> &mut Self {
        self.u32(6);
        self.array(values)
    }

    /// Writes a fixed-length array, which consists only of its values.
    pub(super) fn array(&mut self, values: [f64; 6]) -> &mut Self {
        for v in values {
            self.f64(v);
        }
        self
    }

    /// Writes a `std_msgs/UInt8MultiArray` without dimensions.
    pub(super) fn byte_array(&mut self, bytes: &[u8]) -> &mut Self {
        self.u32(0).u32(0).u32(bytes.len() as u32);
        self.bytes.extend(bytes);
        self
    }

    /// Writes a `std_msgs/Header` with a time stamp in ns since 1970.
    pub(super) fn header(&mut self, stamp_ns: u64, frame: &str) -> &mut Self {
        self.u32((stamp_ns / 1_000_000_000) as u32).u32((stamp_ns % 1_000_000_000) as u32).string(frame)
    }
}

/// Decoder of a message. Every method returns `None` if the message is too short.
pub(super) struct Decoder<'a> {
    body: &'a [u8],
    at: usize,
}

impl<'a> Decoder<'a> {
    /// Creates a decoder. Returns `None` if the message is not little-endian CDR.
    pub(super) fn new(bytes: &'a [u8]) -> Option<Self> {
        let body = bytes.strip_prefix(&HEADER[..2])?.get(2..)?;
        Some(Self { body, at: 0 })
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let start = self.at.next_multiple_of(N);
        let value = self.body.get(start..start + N)?.try_into().ok()?;
        self.at = start + N;
        Some(value)
    }

    pub(super) fn u8(&mut self) -> Option<u8> {
        self.take().map(u8::from_le_bytes)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    pub(super) fn string(&mut self) -> Option<&'a str> {
        let len = self.u32()? as usize;
        let end = self.at.checked_add(len)?;
        let bytes = self.body.get(self.at..end)?;
        self.at = end;
        std::str::from_utf8(bytes.strip_suffix(&[0])?).ok()
    }

    pub(super) fn skip_string(&mut self) -> Option<()> {
        let len = self.u32()? as usize;
        self.at = self.at.checked_add(len).filter(|&end| end <= self.body.len())?;
        Some(())
    }

    /// Reads the bytes of a `std_msgs/UInt8MultiArray`. Dimensions, which only name parts of the bytes, are skipped.
    pub(super) fn byte_array(&mut self) -> Option<&'a [u8]> {
        for _ in 0..self.u32()? {
            self.skip_string()?;
            self.u32()?;
            self.u32()?;
        }
        self.u32()?;
        let len = self.u32()? as usize;
        let bytes = self.body.get(self.at..self.at.checked_add(len)?)?;
        self.at += len;
        Some(bytes)
    }

    pub(super) fn array(&mut self) -> Option<[f64; 6]> {
        let mut values = [0.0; 6];
        for v in &mut values {
            *v = self.f64()?;
        }
        Some(values)
    }

    /// Reads a sequence and returns its first six values. Missing values are NaN.
    pub(super) fn f64s(&mut self) -> Option<[f64; 6]> {
        let mut values = [f64::NAN; 6];
        let len = self.u32()? as usize;
        if len > self.body.len() / 8 {
            return None;
        }
        for i in 0..len {
            let v = self.f64()?;
            if let Some(slot) = values.get_mut(i) {
                *slot = v;
            }
        }
        Some(values)
    }

    pub(super) fn skip_header(&mut self) -> Option<()> {
        self.u32()?;
        self.u32()?;
        self.skip_string()
    }
}
