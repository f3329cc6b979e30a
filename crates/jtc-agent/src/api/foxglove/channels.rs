//! Channels of the Foxglove protocol, and the subscriptions of a client.
use std::collections::BTreeMap;

use jtc_host::recording::Topic;

use super::protocol::{Channel, Service, Shape, Subscription};

/// Number of the channel that contains the status as text. All other channels contain numeric values.
pub(super) const STATUS: u32 = Topic::ALL.len() as u32 + 1;
const STATUS_SCHEMA: &str = r#"{
  "type": "object",
  "properties": {
    "state": { "type": "string", "description": "State of the controller" },
    "trajectory": { "type": "string", "description": "State of the trajectory" },
    "point": { "type": "integer", "description": "Current 1 ms point of the trajectory" },
    "errors": { "type": "array", "items": { "type": "string" }, "description": "Current errors" },
    "held_stop": { "type": "string", "description": "Cause of the held stop; empty: no held stop" },
    "errors_occurred": { "type": "array", "items": { "type": "string" }, "description": "Errors since the last clear" },
    "next": { "type": "string", "description": "Remedy; empty: no problem" },
    "age_ms": { "type": "integer", "description": "Age of the status" },
    "commanded_by": { "type": "string", "description": "Lease holder; empty: none" },
    "simulated": { "type": "boolean", "description": "`true`: the controller is simulated" }
  }
}"#;

/// Numbers of the services that a client can call.
pub(super) const STOP: u32 = 1;
pub(super) const PAUSE: u32 = 2;

/// Returns the topic of a channel; `None` for the text channel and for an unknown channel.
pub(super) fn topic(channel: u32) -> Option<Topic> {
    Topic::ALL.get((channel as usize).checked_sub(1)?).copied()
}

/// Returns all channels that the agent offers.
pub(super) fn channels() -> Vec<Channel<'static>> {
    let numbered = (1..).zip(Topic::ALL).map(|(id, topic)| {
        let (schema_name, schema) = topic.schema();
        Channel { id, topic: topic.name(), encoding: "cdr", schema_name, schema, schema_encoding: "ros2msg" }
    });
    let status = Channel {
        id: STATUS,
        topic: "/jtc/status",
        encoding: "json",
        schema_name: "openjtc.Status",
        schema: STATUS_SCHEMA,
        schema_encoding: "jsonschema",
    };
    numbered.chain([status]).collect()
}

/// Returns the services that a client can call: Stop and Pause.
pub(super) fn services() -> Vec<Service<'static>> {
    let shape =
        |schema_name, schema| Shape { encoding: "json", schema_name, schema_encoding: "jsonschema", schema };
    let service = |id, name| Service {
        id,
        name,
        kind: "openjtc.Halt",
        request: shape("openjtc.HaltRequest", r#"{"type":"object","properties":{}}"#),
        response: shape(
            "openjtc.HaltResponse",
            r#"{"type":"object","properties":{"sent":{"type":"string"},"halt":{"type":"integer"}}}"#,
        ),
    };
    vec![service(STOP, "stop"), service(PAUSE, "pause")]
}

/// Subscription of a client. `latched` is `true` if the constant data of the channel must still be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Subscribed {
    channel: u32,
    latched: bool,
}

/// Subscriptions of a client, at most one per channel.
#[derive(Default)]
pub(super) struct Subscriptions(BTreeMap<u32, Subscribed>);

impl Subscriptions {
    /// Adds a subscription of the client. The error is a message for the user.
    pub(super) fn add(
        &mut self,
        Subscription { id, channel_id: channel }: &Subscription,
    ) -> Result<(), String> {
        if topic(*channel).is_none() && *channel != STATUS {
            return Err(format!("subscription {id} refused: channel {channel} does not exist"));
        }
        if self.0.contains_key(id) || self.0.values().any(|other| other.channel == *channel) {
            return Err(format!(
                "subscription {id} refused: it already exists, or channel {channel} already has a \
                subscription"
            ));
        }
        self.0.insert(
            *id,
            Subscribed { channel: *channel, latched: topic(*channel) == Some(Topic::Description) },
        );
        Ok(())
    }

    /// Removes a subscription of the client.
    pub(super) fn remove(&mut self, id: u32) {
        self.0.remove(&id);
    }

    /// Returns the subscriptions of constant data that still wait for their data.
    pub(super) fn take_latched(&mut self) -> Vec<u32> {
        let due = |(id, subscribed): (&u32, &mut Subscribed)| {
            std::mem::take(&mut subscribed.latched).then_some(*id)
        };
        self.0.iter_mut().filter_map(due).collect()
    }

    /// Returns the subscription number and the channel number of each subscription to changing data.
    pub(super) fn live(&self) -> Vec<(u32, u32)> {
        let live =
            self.0.iter().filter(|(_, subscribed)| topic(subscribed.channel) != Some(Topic::Description));
        live.map(|(id, subscribed)| (*id, subscribed.channel)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_is_subscribed_to_once_and_the_description_comes_once_for_each_time() {
        let mut subscriptions = Subscriptions::default();
        let ids: Vec<u32> = channels().iter().map(|channel| channel.id).collect();
        assert_eq!(ids, (1..=STATUS).collect::<Vec<_>>());
        for channel_id in [0, STATUS + 1, u32::MAX] {
            assert!(subscriptions.add(&Subscription { id: 1, channel_id }).is_err());
        }
        for channel_id in ids {
            subscriptions.add(&Subscription { id: 100 + channel_id, channel_id }).expect("it is new");
            assert!(subscriptions.add(&Subscription { id: 200 + channel_id, channel_id }).is_err());
        }
        let described = channels().iter().find(|c| c.topic == "/robot_description").map_or(0, |c| c.id);
        assert_eq!(subscriptions.live().len(), STATUS as usize - 1);
        for _ in 0..2 {
            assert_eq!(subscriptions.take_latched(), [100 + described]);
            assert!(subscriptions.take_latched().is_empty());
            subscriptions.remove(100 + described);
            let again = Subscription { id: 100 + described, channel_id: described };
            subscriptions.add(&again).expect("it is gone");
        }
    }
}
