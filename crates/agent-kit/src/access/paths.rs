//! Classes of HTTP requests. The class depends only on the method and the path, so the agent knows it before it reads
//! the body.

/// Paths that pages of allowed origins may request. A GET request to one of these paths changes nothing.
const LOOKS: [&str; 5] = ["/", "/api/foxglove", "/api/stream", "/api/status", "/metrics"];

/// Returns `true` if a request with this method and path has read-only access.
pub fn looks(method: &str, path: &str) -> bool {
    ["GET", "HEAD"].contains(&method) && LOOKS.contains(&path)
}

/// Paths of Stop and Pause. A Stop or a Pause needs no lease, and from this computer no token.
const HALTS: [&str; 2] = ["/api/stop", "/api/pause"];

/// Returns `true` if a request with this method and path is a Stop or a Pause.
pub fn halts(method: &str, path: &str) -> bool {
    method == "POST" && HALTS.contains(&path)
}

/// Returns `true` if a request with this method and path is served even when only the reserved connections are free.
/// Such requests are Stop and Pause, and the requests that stop a board, set its outputs or cancel a job. The
/// WebSocket that `jtc traj stop` uses for its Stop is also served.
pub fn stops(method: &str, path: &str) -> bool {
    let number = |part: &str| part.parse::<u64>().is_ok();
    let board = path.strip_prefix("/api/boards/").and_then(|rest| rest.split_once('/'));
    let job = path.strip_prefix("/api/jobs/");
    halts(method, path)
        || (method, path) == ("GET", "/api/line")
        || board.is_some_and(|(board, what)| {
            number(board) && [("POST", "stop"), ("PUT", "outputs")].contains(&(method, what))
        })
        || (method == "DELETE" && job.is_some_and(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_that_stop_are_told_from_all_others() {
        for (method, path) in [("POST", "/api/stop"), ("POST", "/api/pause")] {
            assert!(halts(method, path) && stops(method, path), "{method} {path}");
        }
        for (method, path) in [
            ("POST", "/api/boards/3/stop"),
            ("PUT", "/api/boards/3/outputs"),
            ("DELETE", "/api/jobs/17"),
            ("GET", "/api/line"),
        ] {
            assert!(!halts(method, path) && stops(method, path), "{method} {path}");
        }
        for (method, path) in [
            ("GET", "/api/stop"),
            ("GET", "/api/line/"),
            ("GET", "/api/stream"),
            ("post", "/api/stop"),
            ("POST", "/api/stop/"),
            ("POST", "/api/stops"),
            ("POST", "//api/stop"),
            ("POST", "/api/%73top"),
            ("POST", "/api/boards//stop"),
            ("POST", "/api/boards/x/stop"),
            ("POST", "/api/boards/3/start"),
            ("PUT", "/api/boards/3/stop"),
            ("POST", "/api/boards/3/x/stop"),
            ("DELETE", "/api/jobs/"),
            ("DELETE", "/api/lease"),
            ("GET", "/api/jobs/17"),
            ("POST", "/api/run"),
        ] {
            assert!(!stops(method, path), "{method} {path}");
        }
    }
}
