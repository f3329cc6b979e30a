//! HTTP server of an agent, which runs until the agent ends.
mod in_time;
mod places;

use std::convert::Infallible;
use std::io;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::body::Body;
use axum::extract::ConnectInfo;
use axum::http::Request;
use axum::response::{IntoResponse as _, Response};
use axum::{Extension, Router};
use host_kit::ErrorKind;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use rustls::ServerConfig;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio_rustls::TlsAcceptor;

use crate::access::stops;
use crate::api::Problem;
use in_time::{InTime, Taken};
use places::{Place, Places};

/// Interval at which the server checks whether it must end.
const LOOK: Duration = Duration::from_millis(50);
/// Longest time for receiving the head of a request, and longest time that an idle connection waits for its next
/// request.
const HEAD_TIME: Duration = Duration::from_secs(10);
const HEAD_TIME_OF_FEW: Duration = Duration::from_secs(1);
/// Longest head of a request, in bytes.
const HEAD_MAX: usize = 16 << 10;
/// Longest time for receiving the body of a request while few connections are free. If more connections are free, the
/// server limits only the time of the whole request.
const BODY_TIME_OF_FEW: Duration = Duration::from_secs(1);

/// Serves `router` at `listener`, with TLS if TLS is configured, until `ended` returns `true`. Blocks the calling
/// thread.
///
/// # Errors
///
/// The operating system cannot start threads, or the listener fails.
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
    // Ending the runtime also closes WebSockets that are still open.
    runtime.shutdown_timeout(Duration::from_millis(200));
    served
}

/// Accepts connections in an endless loop.
async fn accept(router: Router, listener: &tokio::net::TcpListener, tls: Option<TlsAcceptor>) {
    let (here, elsewhere) = (Places::here(), Places::elsewhere());
    loop {
        let Ok((stream, peer)) = listener.accept().await else {
            // The program has reached its limit of open files, so it waits before it accepts the next connection.
            tokio::time::sleep(LOOK).await;
            continue;
        };
        let places = if peer.ip().to_canonical().is_loopback() { &here } else { &elsewhere };
        let (router, tls) = (router.clone().layer(Extension(ConnectInfo(peer))), tls.clone());
        let connection = async move |place: Place| {
            // A short message, such as a status of 175 bytes, must be sent at once, without waiting for more data.
            let _ = stream.set_nodelay(true);
            match tls {
                None => serve_connection(router, stream, place).await,
                // If a client does not complete the TLS handshake in time, the agent does not answer the client.
                Some(tls) => {
                    let handshake = tokio::time::timeout(head_time(place.few), tls.accept(stream));
                    if let Ok(Ok(stream)) = handshake.await {
                        serve_connection(router, stream, place).await;
                    }
                }
            }
        };
        places.run(connection).await;
    }
}

fn head_time(few: bool) -> Duration {
    if few { HEAD_TIME_OF_FEW } else { HEAD_TIME }
}

async fn serve_connection(
    router: Router,
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    place: Place,
) {
    let few = place.few;
    let (router, place) = (TowerToHyperService::new(router), Arc::new(place));
    let service = {
        let place = place.clone();
        service_fn(move |request: Request<Incoming>| {
            let served = place.serves(stops(request.method().as_str(), request.uri().path()));
            let within = place.are_few().then_some(BODY_TIME_OF_FEW);
            let router = router.clone();
            async move {
                if !served {
                    return Ok::<Response, Infallible>(full());
                }
                router.call(request.map(|body| Body::new(InTime::new(body, within)))).await
            }
        })
    };
    let is_socket = Arc::<AtomicBool>::default();
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(head_time(few))
        .max_buf_size(HEAD_MAX)
        .keep_alive(!few)
        .serve_connection(TokioIo::new(Taken::new(stream, is_socket.clone())), service)
        .with_upgrades()
        .await;
    is_socket.store(true, Ordering::Relaxed);
    // An error is ignored, because the connection is closed and its client cannot receive an answer. The place of a
    // WebSocket also becomes free here, because `Sockets` counts WebSockets separately.
    drop((served, place));
}

/// Returns the answer to a request if all free connections are reserved for Stop and Pause.
fn full() -> Response {
    let next = "send the request again after 1 s; the agent still accepts Stop and Pause";
    Problem::new("full", "all connections of this agent are in use", next)
        .kind(ErrorKind::NoLink)
        .into_response()
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::net::TcpStream;
    use std::sync::atomic::{AtomicBool, Ordering};

    use axum::routing::get;

    use super::places::CONNECTIONS_MAX;
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
