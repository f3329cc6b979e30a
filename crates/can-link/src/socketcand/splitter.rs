//! Splits a TCP stream into messages. The stream can arrive in pieces of any length.

/// Longest message that is stored. The longest message of the protocol, a CAN FD frame with blanks between its bytes,
/// has 240 characters.
pub(crate) const LONGEST: usize = 512;

/// Splits a stream into messages, with bounded memory. The stream can arrive in pieces of any length.
pub(crate) struct Splitter {
    /// Bytes after the last `<`.
    message: Vec<u8>,
    inside: bool,
    /// `true` if the message in `message` was already returned.
    complete: bool,
    noise: u64,
}

impl Splitter {
    pub(crate) fn new() -> Self {
        Self { message: Vec::with_capacity(LONGEST), inside: false, complete: false, noise: 0 }
    }

    /// Returns the number of invalid messages so far: too long, not ASCII, or without an end.
    pub(crate) fn noise(&self) -> u64 {
        self.noise
    }

    /// Returns the number of bytes that the splitter has allocated.
    #[cfg(any(test, feature = "fuzzing"))]
    pub(crate) fn capacity(&self) -> usize {
        self.message.capacity()
    }

    /// Returns the text between `<` and `>` of the next message, and removes the bytes of this message from `bytes`.
    pub(crate) fn next<'a>(&'a mut self, bytes: &mut &[u8]) -> Option<&'a str> {
        if self.complete {
            self.complete = false;
            self.message.clear();
        }
        while let Some((&byte, rest)) = bytes.split_first() {
            *bytes = rest;
            match byte {
                b'<' => {
                    // A `<` inside a message begins a new message. The end of the unfinished message was lost, so
                    // this message is counted as invalid.
                    self.noise += u64::from(self.inside);
                    self.inside = true;
                    self.message.clear();
                }
                b'>' if self.inside => {
                    self.inside = false;
                    if self.message.is_ascii() {
                        self.complete = true;
                        return str::from_utf8(&self.message).ok();
                    }
                    self.noise += 1;
                    self.message.clear();
                }
                _ if !self.inside => {}
                _ if self.message.len() == LONGEST => {
                    self.noise += 1;
                    self.inside = false;
                    self.message.clear();
                }
                _ => self.message.push(byte),
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn messages(splitter: &mut Splitter, mut bytes: &[u8]) -> Vec<String> {
        std::iter::from_fn(|| splitter.next(&mut bytes).map(str::to_owned)).collect()
    }

    #[test]
    fn messages_are_found_wherever_the_stream_is_cut() {
        let stream = b"xx< hi ><ok>\n< frame 1 1.0  > > < send < echo >\xFF<\xFF>";
        let whole = [" hi ", "ok", " frame 1 1.0  ", " echo "];
        for cut in 0..=stream.len() {
            let mut splitter = Splitter::new();
            let mut found = messages(&mut splitter, &stream[..cut]);
            found.extend(messages(&mut splitter, &stream[cut..]));
            assert_eq!(found, whole, "cut at {cut}");
            assert_eq!(splitter.noise(), 2);
        }
    }

    #[test]
    fn an_endless_message_takes_bounded_memory_and_the_next_is_found() {
        let mut splitter = Splitter::new();
        assert!(messages(&mut splitter, b"<").is_empty());
        for _ in 0..1000 {
            assert!(messages(&mut splitter, &[b'a'; 4096]).is_empty());
        }
        assert_eq!(splitter.capacity(), LONGEST);
        assert_eq!(messages(&mut splitter, b"> < hi >"), [" hi "]);
        assert_eq!(splitter.noise(), 1);
    }
}
