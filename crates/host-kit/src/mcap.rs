//! Reader of MCAP files, including files whose writer was killed.
use std::io::{ErrorKind, Read};

use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// Longest record that the reader accepts, in bytes. The reader allocates memory for the stated length of a record
/// before it detects that bytes are missing. A damaged file may state a wrong length, so a limit is needed.
const MAX_RECORD: usize = 1 << 26;

/// Passes the channels, messages and metadata of a file to `see`, including the messages in chunks. Returns `true` if
/// the file is complete. The function reads the file from beginning to end in small pieces, so the memory contains at
/// most one record. The function skips attachments and indices without reading them, because the `mcap` library panics
/// if they are damaged. The function ignores errors after the data, because only the index follows the data.
///
/// # Errors
///
/// Returns an error at the first record that cannot be read or that `see` refuses, and for an error of `file` itself.
/// The records before this record were already passed to `see`.
pub fn each_record<E: From<McapError>>(
    mut file: impl Read,
    mut see: impl FnMut(Record<'_>) -> Result<(), E>,
) -> Result<bool, E> {
    // An incomplete file has no magic bytes at its end, so the reader must not require these bytes.
    let options =
        LinearReaderOptions::default().with_skip_end_magic(true).with_record_length_limit(MAX_RECORD);
    let mut reader = LinearReader::new_with_options(options);
    let mut whole = false;
    while let Some(event) = reader.next_event() {
        let event = match event {
            Err(_) if whole => break,
            other => other?,
        };
        match event {
            LinearReadEvent::ReadRequest(wanted) => {
                let read = loop {
                    match file.read(reader.insert(wanted)) {
                        Err(error) if error.kind() == ErrorKind::Interrupted => {}
                        read => break read.map_err(McapError::Io)?,
                    }
                };
                reader.notify_read(read);
            }
            LinearReadEvent::Record { opcode: opcode @ (op::CHANNEL | op::MESSAGE | op::METADATA), data } => {
                see(mcap::parse_record(opcode, data)?)?;
            }
            LinearReadEvent::Record { opcode: op::DATA_END, .. } => whole = true,
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::io::Cursor;

    use mcap::records::MessageHeader;

    use super::*;

    /// Returns a file with `n` messages, each in its own chunk.
    fn written(n: u32) -> Vec<u8> {
        let mut out = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
        let channel = out.add_channel(0, "topic", "json", &BTreeMap::new()).unwrap();
        for sequence in 0..n {
            let time = u64::from(sequence);
            let header = MessageHeader { channel_id: channel, sequence, log_time: time, publish_time: time };
            out.write_to_known_channel(&header, b"{}").unwrap();
            out.flush().unwrap();
        }
        out.finish().unwrap();
        out.into_inner().into_inner()
    }

    fn read(file: &[u8]) -> (usize, Result<bool, McapError>) {
        let mut messages = 0;
        let end = each_record(file, |record| {
            messages += usize::from(matches!(record, Record::Message { .. }));
            Ok(())
        });
        (messages, end)
    }

    #[test]
    fn a_file_is_read_wherever_it_was_cut_off() {
        let file = written(5);
        assert!(matches!(read(&file), (5, Ok(true))));
        let mut last = 0;
        for end in 0..file.len() {
            let (messages, _) = read(&file[..end]);
            assert!(messages >= last && messages <= 5, "{end}: {messages} after {last}");
            last = messages;
        }
        assert_eq!(last, 5);
    }

    #[test]
    fn what_the_caller_refuses_is_its_error() {
        let refused = each_record(written(2).as_slice(), |_| Err(McapError::BadIndex));
        assert!(matches!(refused, Err(McapError::BadIndex)));
    }
}
