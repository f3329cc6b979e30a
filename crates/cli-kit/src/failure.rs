//! Formats failures as JSON.

use host_kit::Failure;
use serde_json::{Value, json};

use crate::exit;

/// Returns the object `error` that `--json` prints for a failure.
pub fn error_object(failure: &Failure) -> Value {
    let Failure { kind, code, message, next, .. } = failure;
    json!({ "code": code, "message": message, "hint": next, "exit": exit::of(*kind) })
}
