//! Failures in JSON.

use host_kit::Failure;
use serde_json::{Value, json};

use crate::exit;

/// Returns the object `error` of `--json`.
pub fn error_object(failure: &Failure) -> Value {
    let Failure { kind, code, message, next, .. } = failure;
    json!({ "code": code, "message": message, "hint": next, "exit": exit::of(*kind) })
}
