//! Messages of the Foxglove WebSocket protocol, version 1. A text message is a JSON object with the key `op`. The
//! first byte of a binary message is its type. Numbers in binary messages are little-endian.
use std::collections::BTreeMap;

/// Names of the protocol that the agent accepts in the handshake.
pub(super) const NAMES: [&str; 2] = ["foxglove.websocket.v1", "foxglove.sdk.v1"];

/// Text messages of the agent to a client.
#[derive(serde::Serialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(super) enum ToClient<'a> {
    /// First message to each client.
    ServerInfo {
        name: &'a str,
        capabilities: &'a [&'a str],
        supported_encodings: &'a [&'a str],
        metadata: BTreeMap<&'a str, String>,
        session_id: &'a str,
    },
    /// Message for the user. Level 0 is information, level 1 a warning, level 2 an error.
    Status { level: u8, message: String },
    /// Channels that a client can subscribe to.
    Advertise { channels: Vec<Channel<'a>> },
    /// Services that a client can call.
    AdvertiseServices { services: Vec<Service<'a>> },
    /// Failed call of a service, with the reason.
    ServiceCallFailure { service_id: u32, call_id: u32, message: String },
}

impl ToClient<'_> {
    pub(super) fn text(&self) -> String {
        // The message contains only strings and numbers, so the conversion to JSON cannot fail.
        serde_json::to_string(self).unwrap_or_default()
    }
}

#[derive(serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Channel<'a> {
    pub id: u32,
    pub topic: &'a str,
    pub encoding: &'a str,
    pub schema_name: &'a str,
    pub schema: &'a str,
    pub schema_encoding: &'a str,
}

#[derive(serde::Serialize)]
pub(super) struct Service<'a> {
    pub id: u32,
    pub name: &'a str,
    #[serde(rename = "type")]
    pub kind: &'a str,
    pub request: Shape<'a>,
    pub response: Shape<'a>,
}

/// Format of the request or of the response of a service.
#[derive(serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Shape<'a> {
    pub encoding: &'a str,
    pub schema_name: &'a str,
    pub schema_encoding: &'a str,
    pub schema: &'a str,
}

/// Text messages of a client to the agent.
#[derive(serde::Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(super) enum FromClient {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    /// Message about a function of the protocol that the server has not announced.
    #[serde(other)]
    Other,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Subscription {
    pub id: u32,
    pub channel_id: u32,
}

/// Returns the message with the data of a channel for one subscription.
pub(super) fn data(subscription: u32, stamp_ns: u64, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(13 + payload.len());
    bytes.push(1);
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(stamp_ns.to_le_bytes());
    bytes.extend(payload);
    bytes
}

/// Call of a service by a client.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Call<'a> {
    pub service: u32,
    pub call: u32,
    pub encoding: &'a [u8],
}

impl<'a> Call<'a> {
    /// Parses a binary message; returns `None` if it is not a valid call.
    pub(super) fn parse(bytes: &'a [u8]) -> Option<Self> {
        let (2, rest) = bytes.split_first()? else { return None };
        let (service, rest) = number(rest)?;
        let (call, rest) = number(rest)?;
        let (length, rest) = number(rest)?;
        let encoding = rest.get(..usize::try_from(length).ok()?)?;
        Some(Self { service, call, encoding })
    }

    /// Returns the response message to the call, in the encoding of the call.
    pub(super) fn answer(&self, payload: &[u8]) -> Vec<u8> {
        let mut bytes = vec![3];
        bytes.extend(self.service.to_le_bytes());
        bytes.extend(self.call.to_le_bytes());
        bytes.extend((self.encoding.len() as u32).to_le_bytes());
        bytes.extend(self.encoding);
        bytes.extend(payload);
        bytes
    }
}

fn number(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let (number, rest) = bytes.split_first_chunk::<4>()?;
    Some((u32::from_le_bytes(*number), rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expected bytes were computed by hand from the tables in the specification of the protocol.
    #[test]
    fn binary_messages_have_the_bytes_of_the_specification() {
        assert_eq!(
            data(0x0403_0201, 0x1122_3344_5566_7788, b"ab"),
            [1, 1, 2, 3, 4, 0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11, b'a', b'b']
        );
        let bytes = [2, 7, 0, 0, 0, 9, 1, 0, 0, 4, 0, 0, 0, b'j', b's', b'o', b'n', b'{', b'}'];
        let call = Call::parse(&bytes).expect("a call");
        assert_eq!(call, Call { service: 7, call: 265, encoding: b"json" });
        let answer = [3, 7, 0, 0, 0, 9, 1, 0, 0, 4, 0, 0, 0, b'j', b's', b'o', b'n', b'{', b'}'];
        assert_eq!(call.answer(b"{}"), answer);
        // A message is not a valid call if it is incomplete, too long, or of another type.
        for n in 0..17 {
            assert_eq!(Call::parse(&bytes[..n]), None, "{n}");
        }
        assert_eq!(Call::parse(&answer), None);
        assert_eq!(Call::parse(&[2, 0, 0, 0, 0, 0, 0, 0, 0, 255, 255, 255, 255, 0]), None);
    }

    #[test]
    fn what_is_not_announced_is_known_as_such_and_no_text_is_none() {
        for text in [r#"{"op":"getParameters","parameterNames":[]}"#, r#"{"op":"fetchAsset"}"#] {
            assert!(matches!(serde_json::from_str(text), Ok(FromClient::Other)), "{text}");
        }
        let text = r#"{"op":"unsubscribe","subscriptionIds":[3,4]}"#;
        assert!(
            matches!(serde_json::from_str(text), Ok(FromClient::Unsubscribe { subscription_ids }) if subscription_ids == [3, 4])
        );
        for text in ["", "[]", r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}"#] {
            assert!(serde_json::from_str::<FromClient>(text).is_err(), "{text}");
        }
    }
}
