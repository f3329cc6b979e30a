//! Web pages of the dashboard. The pages are part of the program, so a browser does not need other files.
//!
//! A page of the dashboard contains no secrets. The agent serves a dashboard page to every browser that requests the
//! page by one of the agent's names. The agent never serves a page to pages of other sites. If the agent requires a
//! token, the page asks the user for it. Later requests of the dashboard page pass the access gate, like the requests
//! of other clients.
use std::io::Write as _;
use std::sync::Arc;

use axum::body::{Body, Bytes};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};
use flate2::Compression;
use flate2::write::GzEncoder;
use rust_embed::{EmbeddedFile, RustEmbed};

use crate::gate::Gate;

/// Dashboard files that `npm run build` has generated in `web/`.
#[derive(RustEmbed)]
#[folder = "../../web/dist"]
#[allow_missing = true]
struct Built;

/// Permissions of a dashboard page: it may use its own scripts and files, and send requests to this agent. No page of
/// another site may show a dashboard page in a frame.
const POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; \
                      connect-src 'self' ws: wss:; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// Directory of files whose names contain a hash of the file contents.
const LASTING: &str = "assets/";
/// File name extensions of formats that are already compressed.
const COMPRESSED: [&str; 3] = ["png", "woff2", "ico"];

/// HTTP header that states which sites may use a file.
pub(crate) const SHOWN_TO: HeaderName = HeaderName::from_static("cross-origin-resource-policy");

/// Dashboard file, ready to be sent.
struct File {
    name: String,
    kind: &'static str,
    /// Entity tag of the file, computed from its contents.
    tag: HeaderValue,
    bytes: Bytes,
    /// Contents of the file, compressed with gzip; `None` if the compressed form is not shorter.
    gzip: Option<Bytes>,
}

/// Dashboard pages of an agent.
#[derive(Clone)]
pub struct Pages {
    gate: Gate,
    /// Name of the file that is served at `/`.
    first: &'static str,
    files: Arc<[File]>,
}

impl Pages {
    /// Creates the dashboard pages for this gate. `first` is the file that is served at `/`, for example
    /// `index.html`.
    pub fn new(gate: Gate, first: &'static str) -> Self {
        let files = Built::iter().filter_map(|name| Built::get(&name).map(|file| File::of(&name, file)));
        Self { gate, first, files: files.collect() }
    }

    /// Returns the dashboard file for the path of a request.
    fn find(&self, path: &str) -> Option<&File> {
        let name = match path.strip_prefix('/')? {
            "" => self.first,
            name => name,
        };
        self.files.iter().find(|file| file.name == name)
    }
}

impl File {
    fn of(name: &str, file: EmbeddedFile) -> Self {
        let ending = name.rsplit('.').next().unwrap_or_default();
        let gzip = (!COMPRESSED.contains(&ending)).then(|| gzip(&file.data)).flatten();
        let tag: String = file.metadata.sha256_hash().iter().map(|byte| format!("{byte:02x}")).collect();
        let tag =
            HeaderValue::try_from(format!("\"{tag}\"")).unwrap_or_else(|_| HeaderValue::from_static("\"\""));
        Self { name: name.to_owned(), kind: kind(ending), tag, bytes: file.data.into_owned().into(), gzip }
    }

    /// Returns the answer to a request for this file with these headers.
    fn answer(&self, request: &HeaderMap) -> Response {
        let lasts =
            if self.name.starts_with(LASTING) { "public, max-age=31536000, immutable" } else { "no-cache" };
        let known = request.get(header::IF_NONE_MATCH) == Some(&self.tag);
        let packed = self.gzip.as_ref().filter(|_| takes_gzip(request));
        let body = match (known, packed) {
            (true, _) => Body::empty(),
            (false, packed) => packed.unwrap_or(&self.bytes).clone().into(),
        };
        let mut answer = Response::new(body);
        let headers = answer.headers_mut();
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(lasts));
        headers.insert(header::ETAG, self.tag.clone());
        headers.insert(header::VARY, HeaderValue::from_static("Accept-Encoding"));
        headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
        headers.insert(header::X_FRAME_OPTIONS, HeaderValue::from_static("DENY"));
        headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
        headers.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
        headers.insert(SHOWN_TO, HeaderValue::from_static("same-origin"));
        if known {
            *answer.status_mut() = StatusCode::NOT_MODIFIED;
            return answer;
        }
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(self.kind));
        if packed.is_some() {
            headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static("gzip"));
        }
        answer
    }
}

/// Middleware in front of the gate: serves the pages and passes all other requests to the gate.
pub async fn show(State(pages): State<Pages>, request: Request, next: Next) -> Response {
    let looks = [Method::GET, Method::HEAD].contains(request.method());
    // A WebSocket request at `/` does not request the dashboard page.
    let socket = request.headers().contains_key(header::SEC_WEBSOCKET_KEY);
    match pages.find(request.uri().path()).filter(|_| looks && !socket) {
        Some(file) => match pages.gate.is_own(request.headers()) {
            Ok(()) => file.answer(request.headers()),
            Err(refusal) => refusal.into_response(),
        },
        None => next.run(request).await,
    }
}

fn takes_gzip(headers: &HeaderMap) -> bool {
    let encodings = headers.get(header::ACCEPT_ENCODING).and_then(|value| value.to_str().ok());
    encodings.is_some_and(|text| {
        text.split(',').any(|one| one.split(';').next().unwrap_or_default().trim() == "gzip")
    })
}

/// Returns the bytes compressed with gzip, or `None` if the compressed form is not shorter.
fn gzip(bytes: &[u8]) -> Option<Bytes> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).ok()?;
    let packed = encoder.finish().ok()?;
    (packed.len() < bytes.len()).then(|| packed.into())
}

fn kind(ending: &str) -> &'static str {
    match ending {
        "html" => "text/html; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "ico" => "image/x-icon",
        "woff2" => "font/woff2",
        "json" | "webmanifest" => "application/json",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::{Access, Tokens};
    use crate::log::CommandLog;

    fn pages() -> Pages {
        let tokens = Tokens { operator: "o".repeat(43), viewer: "v".repeat(43) };
        let access = Access::new(tokens, ([127, 0, 0, 1], 8780).into(), &[]);
        let log = CommandLog::open(None, crate::log::LIMIT, |_| {}).expect("no file is needed");
        Pages::new(Gate::new(access, Arc::new(log.into())), "index.html")
    }

    #[test]
    fn a_page_is_found_by_its_name_and_the_first_one_by_none() {
        let pages = pages();
        let first = pages.find("/").expect("there is a first page");
        assert_eq!((first.name.as_str(), first.kind), ("index.html", "text/html; charset=utf-8"));
        assert_eq!(pages.find("/index.html").map(|file| &file.tag), Some(&first.tag));
        for path in
            ["", "index.html", "//index.html", "/../Cargo.toml", "/api/status", "/assets", "/assets/", "/%2e"]
        {
            assert!(pages.find(path).is_none(), "{path}");
        }
    }

    #[test]
    fn a_file_is_sent_as_the_browser_takes_it_and_not_again_while_it_is_the_same() {
        let text = b"one and one and one and one and one".repeat(20);
        let tag = HeaderValue::from_static("\"a\"");
        let file = |name: &str| File {
            name: name.into(),
            kind: kind("js"),
            tag: tag.clone(),
            bytes: text.clone().into(),
            gzip: gzip(&text),
        };
        let answer = |name: &str, headers: &[(HeaderName, &'static str)]| {
            let headers =
                headers.iter().map(|(name, value)| (name.clone(), HeaderValue::from_static(value))).collect();
            let answer = file(name).answer(&headers);
            let header = |name| {
                answer.headers().get(name).and_then(|value| value.to_str().ok()).unwrap_or("").to_owned()
            };
            (answer.status().as_u16(), header(header::CONTENT_ENCODING), header(header::CACHE_CONTROL))
        };
        for (encodings, sent) in
            [("gzip, br", "gzip"), ("br;q=1, gzip;q=0.8", "gzip"), ("br, xgzip", ""), ("", "")]
        {
            let (status, encoding, _) = answer("a.js", &[(header::ACCEPT_ENCODING, encodings)]);
            assert_eq!((status, encoding.as_str()), (200, sent), "{encodings}");
        }
        // The file name contains the hash of the contents, so the file never changes.
        assert!(
            answer("assets/a.js", &[]).2.contains("immutable") && answer("index.html", &[]).2 == "no-cache"
        );
        assert_eq!(answer("a.js", &[(header::IF_NONE_MATCH, "\"a\"")]).0, 304);
        assert_eq!(answer("a.js", &[(header::IF_NONE_MATCH, "\"b\"")]).0, 200);
        let mut unpacked = Vec::new();
        let packed = gzip(&text).expect("it is shorter");
        std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&packed[..]), &mut unpacked)
            .expect("it is whole");
        assert_eq!(unpacked, text);
        assert!(gzip(b"ab").is_none(), "nothing is made longer");
    }
}
