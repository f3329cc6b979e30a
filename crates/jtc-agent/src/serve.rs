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
use tokio::net::TcpStream;
use tokio::sync::Semaphore;

/// How often is looked whether it is to end.
const LOOK: Duration = Duration::from_millis(50);
/// Connections at once from this computer, and as many from others: these cannot keep those out.
const CONNECTIONS_MAX: usize = 256;
/// Longest that the head of a request may take.
const HEAD_TIME: Duration = Duration::from_secs(10);

/// Serves `router` at `listener` until `ended` is true. Blocks.
///
/// # Errors
///
/// The system has no threads, or the listener fails.
pub fn serve(
    router: Router,
    listener: TcpListener,
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
            () = accept(router, &listener) => Ok(()),
            () = end => Ok(()),
        }
    });
    // Sockets that are still open end with it.
    runtime.shutdown_timeout(Duration::from_millis(200));
    served
}

/// Takes connections for ever.
async fn accept(router: Router, listener: &tokio::net::TcpListener) {
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
        let router = router.clone().layer(Extension(ConnectInfo(peer)));
        tokio::spawn(async move {
            serve_connection(router, stream).await;
            drop(permit);
        });
    }
}

async fn serve_connection(router: Router, stream: TcpStream) {
    // A status of 175 bytes is not to wait for more.
    let _ = stream.set_nodelay(true);
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router))
        .with_upgrades()
        .await;
    // Whoever is gone needs no answer.
    drop(served);
}
