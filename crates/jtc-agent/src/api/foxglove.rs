//! Live data for Foxglove, Lichtblick and PlotJuggler over the Foxglove WebSocket protocol. The message types are
//! those of recordings.
//!
//! A client receives the latest values of the arm at most 25 times a second. The agent sends pings, and the answers
//! show how much data the client has read. If a ping is unanswered for 400 ms, the agent sends no further values
//! until the client answers. A slow client therefore loses messages but always sees recent data. The agent
//! disconnects a client that does not read at all.
mod channels;
mod protocol;

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use agent_kit::api::Problem;
use axum::Extension;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse as _, Response};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt as _, StreamExt as _};
use host_kit::FrontEnd;
use jtc_host::labels;
use jtc_host::recording::{MessageWriter, Topic};
use jtc_host::sample::Sample;
use jtc_wire::{ExecCommand, Status};
use serde_json::json;
use tokio::sync::Notify;
use tokio::time::{Instant, MissedTickBehavior, interval, sleep_until, timeout};

use self::channels::{PAUSE, STATUS, STOP, Subscriptions};
use self::protocol::{Call, FromClient, NAMES, ToClient};
use super::{Agent, Caller};

/// Longest message of a client, bytes.
const MESSAGE_MAX: usize = 64 << 10;
/// Largest number of messages that a client may send, per second and in one burst.
const MESSAGES_PER_S: f64 = 50.0;
const MESSAGES_AT_ONCE: f64 = 500.0;
/// Largest number of answers that are queued for a client.
const ANSWERS_MAX: usize = 64;
/// Shortest interval between two messages with values.
const PERIOD: Duration = Duration::from_millis(40);
/// Longest interval between two text messages with the status.
const QUIET: Duration = Duration::from_millis(500);
/// Interval at which the agent checks how much data a client has read.
const PING_TIME: Duration = Duration::from_millis(200);
/// Time after which the agent sends no new data to a client that does not read, until the client reads again.
const LATE: Duration = Duration::from_millis(400);
/// Time after which the agent disconnects a client that does not read.
const GONE: Duration = Duration::from_secs(10);
/// Longest time for which a client may leave a message unread.
const SEND_TIME: Duration = Duration::from_secs(5);

/// Returns `true` if these headers request the Foxglove WebSocket protocol.
pub(super) fn is_asked(headers: &HeaderMap) -> bool {
    headers
        .get_all(header::SEC_WEBSOCKET_PROTOCOL)
        .into_iter()
        .filter_map(|names| names.to_str().ok())
        .flat_map(|names| names.split(','))
        .any(|name| NAMES.contains(&name.trim()))
}

/// Serves `GET /api/foxglove`, and `GET /` for requests of the Foxglove WebSocket protocol.
pub(super) async fn foxglove(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if !is_asked(&headers) {
        let message = format!("subprotocol missing: this socket accepts {}", NAMES.join(" and "));
        let next = "send one of them in Sec-WebSocket-Protocol, or use /api/stream, which needs none";
        return Problem::new("request", message, next).unreadable().into_response();
    }
    let sockets = agent.sockets.clone();
    let upgrade = upgrade.protocols(NAMES).max_message_size(MESSAGE_MAX).max_frame_size(MESSAGE_MAX);
    sockets.serve(caller.role, upgrade, async move |socket| serve(&agent, &caller, socket).await)
}

/// State that the sender and the receiver of a WebSocket share.
struct Shared {
    wanted: Mutex<Wanted>,
    /// Notification that a message must be sent at once.
    wake: Notify,
    /// Number of the last ping that the client has answered.
    read: AtomicU64,
}

#[derive(Default)]
struct Wanted {
    subscriptions: Subscriptions,
    answers: VecDeque<Message>,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Wanted> {
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Queues an answer for the client. Returns `false` if the client does not read its answers.
    fn answer(&self, message: Message) -> bool {
        let mut wanted = self.lock();
        wanted.answers.push_back(message);
        self.wake.notify_one();
        wanted.answers.len() <= ANSWERS_MAX
    }

    fn warn(&self, message: String) -> bool {
        self.answer(Message::Text(ToClient::Status { level: 1, message }.text().into()))
    }
}

async fn serve(agent: &Agent, caller: &Caller, socket: WebSocket) {
    let shared = Shared { wanted: Mutex::default(), wake: Notify::new(), read: AtomicU64::new(0) };
    let (to, from) = socket.split();
    // Sending and receiving on the connection do not wait for each other. A Stop is therefore accepted even from a
    // client that does not read.
    tokio::select! {
        () = receive(agent, caller, &shared, from) => {}
        () = Sender { agent, caller, shared: &shared, to, pinged: 0, pinged_at: Instant::now() }.run() => {}
    }
}

/// Processes the messages of the client until the client disconnects or exceeds its limits.
async fn receive(agent: &Agent, caller: &Caller, shared: &Shared, mut from: SplitStream<WebSocket>) {
    let (mut allowance, mut at) = (MESSAGES_AT_ONCE, Instant::now());
    while let Some(Ok(message)) = from.next().await {
        allowance = (allowance + at.elapsed().as_secs_f64() * MESSAGES_PER_S).min(MESSAGES_AT_ONCE) - 1.0;
        at = Instant::now();
        let taken = match message {
            Message::Text(text) => ask(shared, &text),
            Message::Binary(bytes) => call(agent, caller, shared, &bytes),
            Message::Pong(number) => {
                let number = number.as_ref().try_into().map_or(0, u64::from_be_bytes);
                shared.read.fetch_max(number, Ordering::Relaxed);
                true
            }
            Message::Ping(_) => true,
            Message::Close(_) => false,
        };
        if !taken || allowance < 0.0 {
            return;
        }
    }
}

/// Processes a text message of the client. Returns `false` if the agent disconnects the client.
fn ask(shared: &Shared, text: &str) -> bool {
    match serde_json::from_str(text) {
        Ok(FromClient::Subscribe { subscriptions }) => subscriptions.iter().all(|subscription| {
            let added = shared.lock().subscriptions.add(subscription);
            shared.wake.notify_one();
            added.map_or_else(|why| shared.warn(why), |()| true)
        }),
        Ok(FromClient::Unsubscribe { subscription_ids }) => {
            let mut wanted = shared.lock();
            subscription_ids.into_iter().for_each(|id| wanted.subscriptions.remove(id));
            true
        }
        Ok(FromClient::Other) => {
            shared.warn("request ignored: this server does not offer that operation".to_owned())
        }
        Err(error) => shared.warn(format!("message not understood: {error}")),
    }
}

/// Processes a binary message, which calls the service Stop or Pause. Refuses the call if the client may not send
/// Stops and Pauses.
fn call(agent: &Agent, caller: &Caller, shared: &Shared, bytes: &[u8]) -> bool {
    let Some(call) = Call::parse(bytes) else {
        return shared.warn("message ignored: this server accepts no messages on channels".to_owned());
    };
    let command = match call.service {
        STOP => Ok(ExecCommand::Stop),
        PAUSE => Ok(ExecCommand::Pause),
        other => Err(format!("service {other} does not exist")),
    };
    let done = command.and_then(|command| {
        if caller.looks_only {
            return Err("pages of this origin have read-only access".to_owned());
        }
        agent.halt(&caller.clone().into(), command).map_err(|error| error.message.clone())
    });
    shared.answer(match done {
        Ok(sent) => {
            let payload = serde_json::to_vec(&sent.0).unwrap_or_default();
            Message::Binary(call.answer(&payload).into())
        }
        Err(message) => {
            let (service_id, call_id) = (call.service, call.call);
            Message::Text(ToClient::ServiceCallFailure { service_id, call_id, message }.text().into())
        }
    })
}

/// State of the connection for messages to the client.
struct Sender<'a> {
    agent: &'a Agent,
    caller: &'a Caller,
    shared: &'a Shared,
    to: SplitSink<WebSocket, Message>,
    /// Number of the last ping; `pinged_at` is its time.
    pinged: u64,
    pinged_at: Instant,
}

/// End of the connection: the client has disconnected, or the agent disconnects the client.
struct Gone;

impl Sender<'_> {
    async fn run(mut self) {
        // Every error of `deliver` has the same effect: the connection ends.
        let _ = self.deliver().await;
    }

    async fn deliver(&mut self) -> Result<(), Gone> {
        self.greet().await?;
        let arm = self.agent.identity().await.arm;
        let (mut writer, delay_ticks) = (MessageWriter::new(&arm), arm.config().delay_ticks);
        let mut statuses = self.agent.line.changes();
        let mut period = interval(PERIOD);
        period.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let (mut last, mut quiet) = (None, Instant::now());
        loop {
            self.answer(&mut writer).await?;
            if let Some(why) = self.agent.line.lost() {
                let message = format!("the port is lost: {why}");
                return self.text(&ToClient::Status { level: 2, message }).await;
            }
            let due = async {
                period.tick().await;
                tokio::select! {
                    changed = statuses.changed() => changed.map_err(|_| Gone),
                    () = sleep_until(quiet) => Ok(()),
                }
            };
            tokio::select! {
                due = due => due?,
                () = self.shared.wake.notified() => continue,
            }
            let Some((at, status)) = self.agent.line.with(|line, _| line.status().copied()) else { continue };
            let (new, overdue) = (last != Some(at), Instant::now() >= quiet);
            if !(new || overdue) || !self.has_read()? {
                continue;
            }
            (last, quiet) = (Some(at), Instant::now() + QUIET);
            let sample = self.agent.line.sample(&status, delay_ticks);
            self.values(&mut writer, at, (&status, &sample), new).await?;
            self.ping().await?;
        }
    }

    /// Sends the first messages, which every client receives.
    async fn greet(&mut self) -> Result<(), Gone> {
        let services: &[&str] = if self.caller.looks_only { &[] } else { &["services"] };
        let simulated = if self.agent.simulated { " (SIMULATED)" } else { "" };
        self.text(&ToClient::ServerInfo {
            name: &format!("openjtc {}{simulated}", self.agent.port),
            capabilities: services,
            supported_encodings: &["json"],
            metadata: BTreeMap::from([("version", env!("CARGO_PKG_VERSION").to_owned())]),
            session_id: &self.agent.id.clone(),
        })
        .await?;
        self.text(&ToClient::Advertise { channels: channels::channels() }).await?;
        if self.caller.looks_only {
            return Ok(());
        }
        self.text(&ToClient::AdvertiseServices { services: channels::services() }).await
    }

    /// Sends queued answers, and sends the robot description to new subscriptions.
    async fn answer(&mut self, writer: &mut MessageWriter) -> Result<(), Gone> {
        let (answers, latched) = {
            let mut wanted = self.shared.lock();
            (std::mem::take(&mut wanted.answers), wanted.subscriptions.take_latched())
        };
        for answer in answers {
            self.send(answer).await?;
        }
        let stamp = unix_ns(Duration::ZERO);
        for id in latched {
            let sample = Sample::default();
            if let Some(message) = writer.write(Topic::Description, stamp, &sample) {
                let message = protocol::data(id, stamp, message);
                self.send(Message::Binary(message.into())).await?;
            }
        }
        Ok(())
    }

    /// Sends the values in a status to all subscriptions. If these values were already sent (`new` is `false`), sends
    /// only the text message with the status.
    async fn values(
        &mut self,
        writer: &mut MessageWriter,
        at: Duration,
        (status, sample): (&Status, &Sample),
        new: bool,
    ) -> Result<(), Gone> {
        let age = self.agent.line.now().saturating_sub(at);
        let stamp = unix_ns(age);
        let live = self.shared.lock().subscriptions.live();
        for (id, channel) in live {
            let message = match channels::topic(channel) {
                Some(topic) if new => {
                    writer.write(topic, stamp, sample).map(|m| protocol::data(id, stamp, m))
                }
                None if channel == STATUS => {
                    Some(protocol::data(id, unix_ns(Duration::ZERO), &self.in_words(age, status)))
                }
                _ => None,
            };
            if let Some(message) = message {
                self.send(Message::Binary(message.into())).await?;
            }
        }
        Ok(())
    }

    fn in_words(&self, age: Duration, status: &Status) -> Vec<u8> {
        let stop = self.agent.jobs.stops.cause(status, self.agent.line.now());
        let cause = stop.as_ref().map(|(cause, _)| cause);
        let words = json!({
            "state": status.state.name(),
            "trajectory": status.trajectory.name(),
            "point": status.point,
            "errors": labels::causes(status),
            "held_stop": cause.map(ToString::to_string).unwrap_or_default(),
            "errors_occurred": labels::errors(status.occurred),
            "next": jtc_host::held_stop::next_step(status, cause).plain(FrontEnd::Agent),
            "age_ms": age.as_millis() as u64,
            "commanded_by": self.agent.line.http_session().unwrap_or_default(),
            "simulated": self.agent.simulated,
        });
        words.to_string().into_bytes()
    }

    /// Returns `true` if the agent may send more data: the client has answered the last ping, or this ping is less
    /// than 400 ms old. Returns an error if the ping is unanswered for more than 10 s.
    fn has_read(&self) -> Result<bool, Gone> {
        if self.shared.read.load(Ordering::Relaxed) >= self.pinged {
            return Ok(true);
        }
        match self.pinged_at.elapsed() {
            late if late > GONE => Err(Gone),
            late => Ok(late < LATE),
        }
    }

    /// Sends a ping to the client after the data. When the client answers the ping, it has read all data that was sent
    /// before the ping.
    async fn ping(&mut self) -> Result<(), Gone> {
        let back = self.shared.read.load(Ordering::Relaxed) >= self.pinged;
        if !back || self.pinged_at.elapsed() < PING_TIME {
            return Ok(());
        }
        (self.pinged, self.pinged_at) = (self.pinged + 1, Instant::now());
        self.send(Message::Ping(self.pinged.to_be_bytes().to_vec().into())).await
    }

    async fn text(&mut self, message: &ToClient<'_>) -> Result<(), Gone> {
        self.send(Message::Text(message.text().into())).await
    }

    async fn send(&mut self, message: Message) -> Result<(), Gone> {
        match timeout(SEND_TIME, self.to.send(message)).await {
            Ok(Ok(())) => Ok(()),
            _ => Err(Gone),
        }
    }
}

/// Returns the time that lies `ago` before the present time, in ns since 1970.
fn unix_ns(ago: Duration) -> u64 {
    u64::try_from(host_kit::unix_time().saturating_sub(ago).as_nanos()).unwrap_or(u64::MAX)
}
