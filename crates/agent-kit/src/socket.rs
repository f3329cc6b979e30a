//! Limits for WebSockets: the number of WebSockets, and the traffic of clients with read-only access.
use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::StatusCode;
use axum::response::{IntoResponse as _, Response};
use serde::Serialize;
use tokio::sync::Semaphore;

use crate::access::Role;

/// Largest number of WebSockets of viewers. `OPERATORS_MAX` is the limit for operators. Separate limits
/// ensure that viewers cannot block operators.
const VIEWERS_MAX: usize = 128;
const OPERATORS_MAX: usize = 32;
/// Protocol name that a page requests for its WebSocket, in addition to `bearer.` with the token.
pub const PROTOCOL: &str = "openjtc";
/// Longest message of a client with read-only access, in bytes.
pub const MESSAGE_MAX: usize = 1024;
/// Largest number of pings that a client may send between two messages that it receives.
const NOISE_MAX: u32 = 100;
/// Longest time in which a client may leave a message unread.
const SEND_TIME: Duration = Duration::from_secs(5);

/// Limits for the numbers of open WebSockets.
#[derive(Clone)]
pub struct Sockets {
    viewers: Arc<Semaphore>,
    operators: Arc<Semaphore>,
}

impl Default for Sockets {
    fn default() -> Self {
        let places = |most| Arc::new(Semaphore::new(most));
        Self { viewers: places(VIEWERS_MAX), operators: places(OPERATORS_MAX) }
    }
}

impl Sockets {
    /// Serves a WebSocket of this role if the limit is not reached.
    pub fn serve<F: Future<Output = ()> + Send + 'static>(
        &self,
        role: Role,
        upgrade: WebSocketUpgrade,
        serve: impl FnOnce(WebSocket) -> F + Send + 'static,
    ) -> Response {
        let places = match role {
            Role::Operator => &self.operators,
            Role::Viewer => &self.viewers,
        };
        let Ok(place) = places.clone().try_acquire_owned() else {
            return StatusCode::SERVICE_UNAVAILABLE.into_response();
        };
        upgrade.on_upgrade(async move |socket| {
            serve(socket).await;
            drop(place);
        })
    }
}

/// Waits until the client disconnects or sends an unexpected message.
pub(crate) async fn ended(socket: &mut WebSocket) {
    let mut noise = 0;
    while let Some(Ok(Message::Ping(_) | Message::Pong(_))) = socket.recv().await {
        noise += 1;
        if noise > NOISE_MAX {
            return;
        }
    }
}

/// Sends a message as JSON. Returns `false` if the client does not accept the message in time.
pub(crate) async fn pass(socket: &mut WebSocket, message: &impl Serialize) -> bool {
    // The message contains only strings and numbers, so the conversion to JSON cannot fail.
    let text = serde_json::to_string(message).unwrap_or_default();
    matches!(tokio::time::timeout(SEND_TIME, socket.send(Message::Text(text.into()))).await, Ok(Ok(())))
}
