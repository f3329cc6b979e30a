//! Curves made small enough for a page: packed as numbers in base64.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// As `{"k":"f32","d":base64}`; `null` when no value is known.
pub(super) fn fine(values: &[f64]) -> Value {
    if !values.iter().any(|v| v.is_finite()) {
        return Value::Null;
    }
    let bytes: Vec<u8> = values.iter().flat_map(|&v| (v as f32).to_le_bytes()).collect();
    json!({ "k": "f32", "d": STANDARD.encode(bytes) })
}

/// As `{"k":"i16","o":offset,"s":scale,"d":base64}` over the range of the values, -32768 where one is unknown; as
/// `{"k":"c","v":value}` when they are all the same; `null` when none is known.
pub(super) fn coarse(values: &[f64]) -> Value {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let (Some(low), Some(high)) = (finite().reduce(f64::min), finite().reduce(f64::max)) else {
        return Value::Null;
    };
    if low == high && values.iter().all(|v| v.is_finite()) {
        return json!({ "k": "c", "v": low });
    }
    let offset = (low + high) / 2.0;
    let scale = ((high - low) / 65_534.0).max(f64::MIN_POSITIVE);
    let quantise = |v: f64| if v.is_finite() { ((v - offset) / scale).round() as i16 } else { i16::MIN };
    let bytes: Vec<u8> = values.iter().flat_map(|&v| quantise(v).to_le_bytes()).collect();
    json!({ "k": "i16", "o": offset, "s": scale, "d": STANDARD.encode(bytes) })
}
