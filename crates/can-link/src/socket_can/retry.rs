//! Waiting for space in the kernel's transmit queue.

use std::io;
use std::time::Duration;

/// The kernel's error number for a full transmit queue. The kernel itself does not wait for space in the queue.
const ENOBUFS: i32 = 105;
/// Pause between two write attempts, which is the duration of a frame on a fast bus.
const PAUSE: Duration = Duration::from_micros(200);
/// Time without space in the transmit queue after which the bus is considered to have failed.
const TIMEOUT: Duration = Duration::from_secs(10);

/// Calls the write function, and repeats the call while the transmit queue is full. After 10 s without space,
/// returns an error with the likely causes.
pub(super) fn retry_while_full(
    mut write: impl FnMut() -> io::Result<()>,
    mut pause: impl FnMut(Duration),
) -> io::Result<()> {
    let mut waited = Duration::ZERO;
    loop {
        match write() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) if is_full(&error) => {
                if waited >= TIMEOUT {
                    let cause = "the transmit queue has been full for 10 s: check that a node acknowledges, \
                                 the bit rate and the termination";
                    return Err(io::Error::new(io::ErrorKind::TimedOut, cause));
                }
                pause(PAUSE);
                waited += PAUSE;
            }
            other => return other,
        }
    }
}

fn is_full(error: &io::Error) -> bool {
    error.raw_os_error() == Some(ENOBUFS) || error.kind() == io::ErrorKind::WouldBlock
}

#[cfg(test)]
mod tests {
    use super::*;

    /// EAGAIN, the error of a non-blocking socket.
    const EAGAIN: i32 = 11;

    fn run(mut answers: Vec<Option<i32>>) -> (io::Result<()>, Duration, usize) {
        let mut waited = Duration::ZERO;
        answers.reverse();
        let mut tries = 0;
        let write = || {
            tries += 1;
            // The last result in the list is returned again in each further call.
            let answer = if answers.len() > 1 { answers.pop().flatten() } else { answers[0] };
            answer.map_or(Ok(()), |number| Err(io::Error::from_raw_os_error(number)))
        };
        let result = retry_while_full(write, |pause| waited += pause);
        (result, waited, tries)
    }

    #[test]
    fn a_full_queue_is_waited_for() {
        let full = [vec![Some(ENOBUFS); 900], vec![Some(EAGAIN); 99], vec![None]].concat();
        let (result, waited, tries) = run(full);
        assert!(result.is_ok());
        assert_eq!((waited, tries), (PAUSE * 999, 1000));
        // If a signal interrupts the write, the write is repeated without a pause.
        let (result, waited, _) = run(vec![Some(4), None]);
        assert!(result.is_ok() && waited.is_zero());
    }

    #[test]
    fn a_dead_bus_is_an_error_after_a_while_and_other_errors_at_once() {
        let (result, waited, _) = run(vec![Some(ENOBUFS)]);
        assert!(result.unwrap_err().to_string().contains("acknowledge"));
        assert_eq!(waited, TIMEOUT);
        let (result, waited, tries) = run(vec![Some(100), None]);
        assert_eq!((result.unwrap_err().raw_os_error(), waited, tries), (Some(100), Duration::ZERO, 1));
    }
}
