//! Compact format of curves for a page, with numbers in base64.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// Returns the values as `{"k":"f32","d":base64}`. Returns `null` if all values are unknown.
pub(super) fn fine(values: &[f64]) -> Value {
    if !values.iter().any(|v| v.is_finite()) {
        return Value::Null;
    }
    let bytes: Vec<u8> = values.iter().flat_map(|&v| (v as f32).to_le_bytes()).collect();
    json!({ "k": "f32", "d": STANDARD.encode(bytes) })
}

/// Returns the values as `{"k":"i16","o":offset,"s":scale,"d":base64}` scaled to the range of the values. The integer -32768 marks an
/// unknown value. If all values are equal, returns `{"k":"c","v":value}`; if all values are unknown, returns `null`.
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
