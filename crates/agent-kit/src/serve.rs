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
/// Longest that the head of a request may take.
const HEAD_TIME: Duration = Duration::from_secs(10);

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
        let (router, tls) = (router.clone().layer(Extension(ConnectInfo(peer))), tls.clone());
        tokio::spawn(async move {
            // A status of 175 bytes is not to wait for more.
            let _ = stream.set_nodelay(true);
            match tls {
                None => serve_connection(router, stream).await,
                // Whoever does not shake hands, or not in time, gets no word.
                Some(tls) => {
                    if let Ok(Ok(stream)) = tokio::time::timeout(HEAD_TIME, tls.accept(stream)).await {
                        serve_connection(router, stream).await;
                    }
                }
            }
            drop(permit);
        });
    }
}

async fn serve_connection(router: Router, stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static) {
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router))
        .with_upgrades()
        .await;
    // Whoever is gone needs no answer.
    drop(served);
}
