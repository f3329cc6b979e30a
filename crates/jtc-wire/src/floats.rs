//! A list of floats in the body of a frame.

/// A list of big-endian f32 in the body of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Floats<'a>(pub(crate) &'a [u8]);

impl<'a> Floats<'a> {
    /// Creates a view of big-endian f32 in `bytes`. Ignores an incomplete float at the end.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self(&bytes[..bytes.len() & !3])
    }
    /// Returns all floats, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = f32> + use<'a> {
        self.0.as_chunks::<4>().0.iter().map(|bytes| f32::from_be_bytes(*bytes))
    }
    /// Returns the bytes of the list.
    pub fn as_bytes(&self) -> &'a [u8] {
        self.0
    }
}

impl Floats<'_> {
    /// Returns the number of floats.
    pub fn len(&self) -> usize {
        self.0.len() / 4
    }
    /// Returns true if the list has no floats.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Returns float `i`, or `None` if the list has fewer floats.
    pub fn get(&self, i: usize) -> Option<f32> {
        self.0.as_chunks::<4>().0.get(i).map(|bytes| f32::from_be_bytes(*bytes))
    }
}
