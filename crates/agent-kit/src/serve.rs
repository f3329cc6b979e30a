//! Serving an agent until it is to end.
use std::io;
use std::net::TcpListener;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::ConnectInfo;
use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use rustls::ServerConfig;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::sync::Semaphore;
use tokio_rustls::TlsAcceptor;

/// How often is looked whether it is to end.
const LOOK: Duration = Duration::from_millis(50);
/// Connections at once from this computer, and as many from others: these cannot keep those out.
const CONNECTIONS_MAX: usize = 256;
/// Where fewer places than that are left, a connection is for one request, that comes at once: those that are kept open and ask for nothing
/// keep no Stop out.
const FEW: usize = CONNECTIONS_MAX / 2;
/// Longest that the head of a request may take, and that a connection waits for the next one.
const HEAD_TIME: Duration = Duration::from_secs(10);
const HEAD_TIME_OF_FEW: Duration = Duration::from_secs(1);

/// Serves `router` at `listener`, with TLS where it is given, until `ended` is true. Blocks.
///
/// # Errors
///
/// The system has no threads, or the listener fails.
pub fn serve(
    router: Router,
    listener: TcpListener,
    tls: Option<Arc<ServerConfig>>,
    ended: impl Fn() -> bool + Send + 'static,
) -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    listener.set_nonblocking(true)?;
    let served = runtime.block_on(async move {
        let listener = tokio::net::TcpListener::from_std(listener)?;
        let end = async {
            while !ended() {
                tokio::time::sleep(LOOK).await;
            }
        };
        tokio::select! {
            () = accept(router, &listener, tls.map(TlsAcceptor::from)) => Ok(()),
            () = end => Ok(()),
        }
    });
    // Sockets that are still open end with it.
    runtime.shutdown_timeout(Duration::from_millis(200));
    served
}

/// Takes connections for ever.
async fn accept(router: Router, listener: &tokio::net::TcpListener, tls: Option<TlsAcceptor>) {
    let (here, elsewhere) = (Semaphore::new(CONNECTIONS_MAX), Semaphore::new(CONNECTIONS_MAX));
    let (here, elsewhere) = (Arc::new(here), Arc::new(elsewhere));
    loop {
        let Ok((stream, peer)) = listener.accept().await else {
            // No more files, for the time being.
            tokio::time::sleep(LOOK).await;
            continue;
        };
        let room = if peer.ip().to_canonical().is_loopback() { &here } else { &elsewhere };
        // Without room it is closed at once.
        let Ok(permit) = room.clone().try_acquire_owned() else { continue };
        let few = room.available_permits() < FEW;
        let (router, tls) = (router.clone().layer(Extension(ConnectInfo(peer))), tls.clone());
        tokio::spawn(async move {
            // A status of 175 bytes is not to wait for more.
            let _ = stream.set_nodelay(true);
            match tls {
                None => serve_connection(router, stream, few).await,
                // Whoever does not shake hands, or not in time, gets no word.
                Some(tls) => {
                    if let Ok(Ok(stream)) = tokio::time::timeout(head_time(few), tls.accept(stream)).await {
                        serve_connection(router, stream, few).await;
                    }
                }
            }
            drop(permit);
        });
    }
}

fn head_time(few: bool) -> Duration {
    if few { HEAD_TIME_OF_FEW } else { HEAD_TIME }
}

async fn serve_connection(
    router: Router,
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    few: bool,
) {
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(head_time(few))
        .keep_alive(!few)
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router))
        .with_upgrades()
        .await;
    // Whoever is gone needs no answer.
    drop(served);
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::net::TcpStream;
    use std::sync::atomic::{AtomicBool, Ordering};

    use axum::routing::get;

    use super::*;

    fn ask(stream: &mut TcpStream) -> io::Result<String> {
        stream.write_all(b"GET / HTTP/1.1\r\nhost: x\r\n\r\n")?;
        let mut answer = [0; 256];
        let n = stream.read(&mut answer)?;
        Ok(String::from_utf8_lossy(&answer[..n]).into_owned())
    }

    #[test]
    fn connections_that_are_kept_open_keep_nobody_out() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port is free");
        let address = listener.local_addr().expect("it has one");
        let over = Arc::new(AtomicBool::new(false));
        let ended = over.clone();
        let router = Router::new().route("/", get(|| async { "here" }));
        let served =
            std::thread::spawn(move || serve(router, listener, None, move || ended.load(Ordering::Relaxed)));
        let mut kept = Vec::new();
        for n in 0..2 * CONNECTIONS_MAX {
            let mut stream = TcpStream::connect(address).expect("it listens");
            let answer = ask(&mut stream).expect("there is room");
            assert!(answer.ends_with("here"), "{n}: {answer:?}");
            kept.push(stream);
        }
        assert!(ask(&mut kept[0]).expect("it is kept open").ends_with("here"));
        over.store(true, Ordering::Relaxed);
        served.join().expect("it ends").expect("it has served");
    }
}
