//! Time limits for connections and bodies of requests. A client that sends or reads too slowly loses its connection.
use std::io::{self, IoSlice};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::BoxError;
use hyper::body::{Body, Bytes, Frame, Incoming, SizeHint};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep, sleep_until};

/// Longest time for which a client may leave data unread without reading any byte. All such waits of a connection
/// together may take this time plus one second for each `TAKES_PER_S` bytes that the client has read. Even for a
/// client that reads fast, a single wait may not be longer.
const TAKES_NOTHING: Duration = Duration::from_secs(10);
const TAKES_PER_S: f64 = 16_000.0;

/// Body of a request that must be complete within a time limit.
pub(super) struct InTime {
    body: Incoming,
    end: Option<(Pin<Box<Sleep>>, Duration)>,
}

impl InTime {
    /// Creates the body with the time limit `within` from now. With `None`, another part of the server limits the time.
    pub(super) fn new(body: Incoming, within: Option<Duration>) -> Self {
        let end = |within| (Box::pin(sleep_until(Instant::now() + within)), within);
        Self { body, end: within.map(end) }
    }
}

impl Body for InTime {
    type Data = Bytes;
    type Error = BoxError;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, BoxError>>> {
        if let Poll::Ready(frame) = Pin::new(&mut self.body).poll_frame(context) {
            return Poll::Ready(frame.map(|frame| frame.map_err(Into::into)));
        }
        let Some((end, within)) = &mut self.end else { return Poll::Pending };
        end.as_mut().poll(context).map(|()| {
            let text = format!(
                "the request body was not complete within {} s, and few connections are free",
                within.as_secs()
            );
            Some(Err(text.into()))
        })
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// Connection that the server closes if the client does not read.
pub(super) struct Taken<S> {
    stream: S,
    /// `true` after the connection has become a WebSocket, which has its own time limits.
    released: Arc<AtomicBool>,
    since: Option<Instant>,
    waited: Duration,
    bytes: u64,
    timer: Pin<Box<Sleep>>,
}

impl<S> Taken<S> {
    pub(super) fn new(stream: S, released: Arc<AtomicBool>) -> Self {
        let timer = Box::pin(sleep_until(Instant::now()));
        Self { stream, released, since: None, waited: Duration::ZERO, bytes: 0, timer }
    }

    /// Returns the longest total waiting time of this connection, which increases with the number of bytes that the
    /// client has read.
    fn patience(&self) -> Duration {
        TAKES_NOTHING + Duration::from_secs_f64(self.bytes as f64 / TAKES_PER_S)
    }

    /// Processes the result of a write: either bytes were written, or the write waits until the client reads.
    fn see<T>(
        &mut self,
        context: &mut Context<'_>,
        written: Poll<io::Result<T>>,
        bytes: impl FnOnce(&T) -> usize,
    ) -> Poll<io::Result<T>> {
        match &written {
            Poll::Ready(done) => {
                let bytes = done.as_ref().map_or(0, bytes);
                self.bytes = self.bytes.saturating_add(bytes as u64);
                self.waited += self.since.take().map_or(Duration::ZERO, |since| since.elapsed());
                self.waited = self.waited.max(self.patience().saturating_sub(TAKES_NOTHING));
                written
            }
            Poll::Pending if self.released.load(Ordering::Relaxed) => written,
            Poll::Pending => {
                let since = *self.since.get_or_insert_with(Instant::now);
                let patience = self.patience();
                self.timer.as_mut().reset(since + patience.saturating_sub(self.waited));
                match self.timer.as_mut().poll(context) {
                    Poll::Ready(()) => Poll::Ready(Err(io::ErrorKind::TimedOut.into())),
                    Poll::Pending => Poll::Pending,
                }
            }
        }
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Taken<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Taken<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.see(context, written, |bytes| *bytes)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write_vectored(context, slices);
        self.see(context, written, |bytes| *bytes)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let flushed = Pin::new(&mut self.stream).poll_flush(context);
        self.see(context, flushed, |()| 0)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let shut = Pin::new(&mut self.stream).poll_shutdown(context);
        self.see(context, shut, |()| 0)
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};

    use super::*;

    /// Simulates a client that reads `piece` bytes after each wait of `pause`. Returns the number of bytes that the
    /// client received, and `true` if it received the whole answer.
    fn taken(bytes: usize, piece: usize, pause: Duration) -> (usize, bool) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().start_paused(true).build();
        runtime.expect("a runtime").block_on(async {
            let (here, mut there) = tokio::io::duplex(1024);
            let reader = tokio::spawn(async move {
                let (mut all, mut buffer) = (0, vec![0; piece]);
                loop {
                    tokio::time::sleep(pause).await;
                    match there.read(&mut buffer).await {
                        Ok(n @ 1..) => all += n,
                        _ => return all,
                    }
                }
            });
            let mut stream = Taken::new(here, Arc::default());
            let whole = stream.write_all(&vec![7; bytes]).await.and(stream.flush().await).is_ok();
            drop(stream);
            (reader.await.expect("it reads"), whole)
        })
    }

    #[test]
    fn who_takes_an_answer_too_slowly_is_closed_and_who_takes_it_gets_all() {
        let ms = Duration::from_millis;
        for (bytes, piece, pause, whole) in [
            (100_000, 1024, ms(1), true),
            (100_000, 1024, ms(50), true),
            (1_000_000, 1024, ms(55), true),
            (100_000, 1024, ms(9_000), false),
            (100_000, 1, ms(20), false),
            (1_000_000, 1, ms(1), false),
            (1_000_000, 512, ms(100), false),
            (500, 1, ms(1_000), true),
        ] {
            let (got, all) = taken(bytes, piece, pause);
            assert_eq!((got == bytes, all), (whole, whole), "{bytes} bytes, {piece} each {pause:?}: {got}");
        }
        // The client reads one byte per hour.
        assert!(!taken(100_000, 1, Duration::from_secs(3600)).1);
    }

    /// A client that reads quickly and then stops reading loses its connection after the same time as any other client.
    #[test]
    fn bytes_that_were_taken_quickly_give_no_time_to_take_nothing() {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().start_paused(true).build();
        runtime.expect("a runtime").block_on(async {
            let (here, mut there) = tokio::io::duplex(1024);
            let mut stream = Taken::new(here, Arc::default());
            let reader = tokio::spawn(async move {
                let mut all = vec![0; 10_000_000];
                there.read_exact(&mut all).await.expect("it comes");
                tokio::time::sleep(Duration::from_secs(3600)).await;
            });
            stream.write_all(&vec![7; 10_000_000]).await.expect("it is taken");
            let begun = Instant::now();
            assert!(stream.write_all(&vec![7; 10_000]).await.is_err());
            assert!(begun.elapsed() <= TAKES_NOTHING + Duration::from_secs(1), "{:?}", begun.elapsed());
            reader.abort();
        });
    }

    /// The server does not close a WebSocket that is silent for a long time.
    #[test]
    fn a_connection_that_has_become_a_socket_is_not_closed() {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().start_paused(true).build();
        runtime.expect("a runtime").block_on(async {
            let (here, mut there) = tokio::io::duplex(16);
            let mut stream = Taken::new(here, Arc::new(true.into()));
            let written = tokio::spawn(async move { stream.write_all(&[7; 64]).await.is_ok() });
            tokio::time::sleep(Duration::from_secs(3600)).await;
            let mut all = [0; 64];
            there.read_exact(&mut all).await.expect("it comes");
            assert!(written.await.expect("it writes"));
        });
    }
}
