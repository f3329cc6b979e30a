//! WebSocket that connects a client to the serial line. Binary messages contain bytes of the line, and text messages
//! contain notices of the agent.
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use agent_kit::api::Asked;
use axum::Extension;
use axum::extract::State;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt as _, StreamExt as _};
use jtc_host::port::Halts;
use serde_json::json;
use tokio::time::MissedTickBehavior;

use super::{Agent, Caller};
use crate::line::{ClientId, Delivery, Introduction, Policy, Role};
use crate::owner::Line;

/// Longest message of a client, bytes.
const MESSAGE_MAX: usize = 64 << 10;
/// Longest time for which a client may leave a message unread.
const SEND_TIME: Duration = Duration::from_secs(5);
/// Interval of the pings that check whether a client still answers.
const PING_TIME: Duration = Duration::from_secs(1);
/// Number of consecutive unanswered pings after which the client loses the lease.
const SILENT_MAX: u32 = 4;
/// Close code that a client receives when the agent disconnects it. The agent disconnects a client that sends invalid
/// bytes or too many frames, does not read, or is silent while it holds the lease.
pub const CLOSE_PUT_OUT: u16 = 4000;

/// Data about a client that the client sends in the URL of the WebSocket.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Joining {
    /// Name of the client, which users see.
    name: Option<String>,
    /// Policy for the client's motion when the client disconnects.
    #[serde(default)]
    policy: Policy,
}

/// First message of the agent to a client.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Hello {
    /// Name of the serial port.
    pub port: String,
    /// Bit rate of the serial line, Bd; `None` if the connection has no bit rate.
    pub baud: Option<u32>,
    /// `true` if the controller is simulated: no real arm moves.
    pub simulated: bool,
    /// Role of the client that receives this message.
    pub role: Role,
}

/// Notice of an agent to a client.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Notice {
    /// First message to the client.
    Hello(Hello),
    /// Frame of the client that was not passed on to the controller.
    Denied {
        /// Reason why the frame was not passed on.
        why: String,
    },
    /// Request of the client about the lease that was refused.
    LeaseDenied {
        /// Reason why the request was refused.
        why: String,
    },
    /// Stop or Pause of the arm. The agent refuses earlier motion requests of the client. For a new motion, the
    /// client first sends `{"asked_after": number}` with the number of this Stop or Pause.
    Halted {
        /// Number of this Stop or Pause.
        number: u64,
        /// Name of the client that requested this Stop or Pause.
        by: String,
        /// Command: Stop or Pause.
        command: String,
        /// Number of Stops and Pauses of other clients since this client connected.
        of_others: Halts,
    },
    /// Request of another client for the lease.
    LeaseWanted {
        /// Name of the client that requests the lease.
        by: String,
    },
}

impl Notice {
    fn message(&self) -> Message {
        // The message contains only strings and numbers, so the conversion to JSON cannot fail.
        Message::Text(serde_json::to_string(self).unwrap_or_default().into())
    }
}

/// Request of a client to the agent itself.
#[derive(Clone, Copy, Debug, serde::Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Wish {
    Lease(LeaseWish),
    /// Number of the last Stop or Pause that the client knew when its user requested the next motion.
    AskedAfter(u64),
}

#[derive(Clone, Copy, Debug, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
enum LeaseWish {
    Take,
    Release,
    /// Asks the lease holder to release the lease.
    Ask,
}

/// Serves `GET /api/line`: connects a client to the serial line.
pub(super) async fn line(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Asked(joining): Asked<Joining>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let sockets = agent.sockets.clone();
    let upgrade = upgrade.max_message_size(MESSAGE_MAX).max_frame_size(MESSAGE_MAX);
    sockets.serve(caller.role, upgrade, async move |socket| serve(&agent, &caller, joining, socket).await)
}

async fn serve(agent: &Agent, caller: &Caller, joining: Joining, mut socket: WebSocket) {
    let name = caller.named(joining.name.as_deref().unwrap_or_default());
    let role = caller.role;
    let introduction = Introduction { name: name.clone(), role, policy: joining.policy };
    let joined = agent.line.join(introduction);
    let client = joined.client();
    // Viewers can connect and disconnect without limit, so the log only counts their repetitions.
    let note = |what, facts| match role {
        Role::Operator => agent.note(what, facts),
        Role::Viewer => agent.gate.note_repeated(what, caller.peer, facts),
    };
    let from = caller.peer.to_string();
    note("joined", json!({ "client": client.0, "name": name, "role": role, "from": from }));
    let hello =
        Hello { port: agent.port.to_string(), baud: agent.line.baud(), simulated: agent.simulated, role };
    if matches!(
        tokio::time::timeout(SEND_TIME, socket.send(Notice::Hello(hello).message())).await,
        Ok(Ok(()))
    ) {
        pass(&agent.line, client, socket).await;
    }
    drop(joined);
    note("left", json!({ "client": client.0, "name": name }));
}

/// Passes messages to and from the client until the client or the line disconnects. Sending and receiving do not wait
/// for each other. The agent therefore receives a Stop even if the client does not read.
async fn pass(line: &Line, client: ClientId, socket: WebSocket) {
    let alive = AtomicBool::new(true);
    let (to, from) = socket.split();
    tokio::select! {
        () = receive(line, client, from, &alive) => {}
        () = deliver(line, client, to, &alive) => {}
    }
}

/// Passes the messages of the client on to the serial line.
async fn receive(line: &Line, client: ClientId, mut from: SplitStream<WebSocket>, alive: &AtomicBool) {
    while let Some(Ok(message)) = from.next().await {
        alive.store(true, Ordering::Relaxed);
        match message {
            Message::Binary(bytes) => line.with(|line, now| line.from_client(client, &bytes, now)),
            Message::Text(text) => wish(line, client, &text),
            Message::Pong(_) | Message::Ping(_) => {}
            Message::Close(_) => return,
        }
    }
}

/// Sends queued messages to the client, and checks that the client still answers.
async fn deliver(line: &Line, client: ClientId, mut to: SplitSink<WebSocket, Message>, alive: &AtomicBool) {
    let mut changes = line.changes();
    let mut pings = tokio::time::interval(PING_TIME);
    // If this computer was delayed, the agent does not send the missed pings later. The delay therefore does not
    // count as silence of the client.
    pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut silent = 0;
    // The agent assumes that a new client knows all Stops and Pauses before its connection.
    let mut known = line.with(|line, _| line.asked_after(client)).unwrap_or_default();
    loop {
        let (deliveries, halt) = line.with(|line, _| {
            let number = line.last_halt();
            let halt = (number != known).then(|| {
                let (by, command) = line.last_halt_by();
                let of_others = line.halts_of_others(client);
                Notice::Halted { number, by: by.to_owned(), command: command.name().to_owned(), of_others }
            });
            known = number;
            (line.take_deliveries(client), halt)
        });
        let Some(deliveries) = deliveries else {
            let reason =
                Utf8Bytes::from_static("disconnected: invalid frames, too many frames, or unread data");
            send(&mut to, Message::Close(Some(CloseFrame { code: CLOSE_PUT_OUT, reason }))).await;
            return;
        };
        for delivery in deliveries {
            let message = match delivery {
                Delivery::Bytes(bytes) => Message::Binary(bytes.into()),
                Delivery::Denied(denied) => Notice::Denied { why: denied.to_string() }.message(),
                Delivery::LeaseDenied(denied) => Notice::LeaseDenied { why: denied.to_string() }.message(),
                Delivery::LeaseWanted(by) => Notice::LeaseWanted { by }.message(),
            };
            if !send(&mut to, message).await {
                return;
            }
        }
        if line.lost().is_some() {
            return;
        }
        if let Some(halt) = halt
            && !send(&mut to, halt.message()).await
        {
            return;
        }
        tokio::select! {
            changed = changes.changed() => if changed.is_err() { return },
            _ = pings.tick() => {
                silent = if alive.swap(false, Ordering::Relaxed) { 0 } else { silent + 1 };
                if silent >= SILENT_MAX {
                    line.with(|line, now| line.lapse(client, now));
                }
                if !send(&mut to, Message::Ping(Vec::new().into())).await {
                    return;
                }
            }
        }
    }
}

/// Processes a request of a client to the agent; invalid requests are ignored.
fn wish(line: &Line, client: ClientId, text: &str) {
    let Ok(wish) = serde_json::from_str(text) else { return };
    line.with(|line, now| {
        let done = match wish {
            Wish::Lease(LeaseWish::Take) => line.take_lease(client, None, now),
            Wish::Lease(LeaseWish::Release) => line.release_lease(client, now),
            Wish::Lease(LeaseWish::Ask) => line.want_lease(client, now),
            Wish::AskedAfter(number) => {
                if let Err(denied) = line.ask_to_move(client, number, now) {
                    line.deliver(client, Delivery::Denied(denied));
                }
                return;
            }
        };
        if let Err(denied) = done {
            line.deliver(client, Delivery::LeaseDenied(denied));
        }
    });
    line.wake();
}

/// Sends a message to the client; returns `false` if the client does not receive the message.
async fn send(to: &mut SplitSink<WebSocket, Message>, message: Message) -> bool {
    matches!(tokio::time::timeout(SEND_TIME, to.send(message)).await, Ok(Ok(())))
}
