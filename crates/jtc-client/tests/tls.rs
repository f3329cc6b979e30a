//! Tests of TLS. A client can connect only if it trusts the certificate of the agent.
use crate::common;

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::PathBuf;
use std::time::Duration;

use common::Served;
use jtc_agent::tls;
use jtc_client::{AgentPort, Options};
use jtc_host::{Diagnose as _, PortError, Session};

/// Creates a file with a certificate for the address of this computer, and a file with its key.
fn certificate(dir: &tempfile::TempDir, name: &str, mode: u32) -> (PathBuf, PathBuf) {
    use std::os::unix::fs::PermissionsExt as _;
    let made = rcgen::generate_simple_self_signed(["127.0.0.1".to_owned(), "localhost".to_owned()]);
    let rcgen::CertifiedKey { cert, signing_key } = made.expect("a certificate");
    let (file, key) = (dir.path().join(format!("{name}.pem")), dir.path().join(format!("{name}.key")));
    std::fs::write(&file, cert.pem()).expect("a file");
    std::fs::write(&key, signing_key.serialize_pem()).expect("a file");
    std::fs::set_permissions(&key, std::fs::Permissions::from_mode(mode)).expect("a mode");
    (file, key)
}

#[test]
fn a_session_works_over_tls_where_the_certificate_is_trusted() {
    let dir = tempfile::tempdir().expect("a directory");
    let (file, key) = certificate(&dir, "agent", 0o600);
    let served =
        Served::start_with(921_600, Some(tls::load(&file, &key).expect("they belong together")), &[]);
    let url = served.url().replace("http://", "https://");
    let options = |certificates: Option<PathBuf>| Options {
        name: "anna".into(),
        token: Some(served.tokens.operator.clone()),
        certificates,
        ..Options::default()
    };
    let mut session = Session::new(AgentPort::open(&url, &options(Some(file))).expect("it is trusted"));
    for _ in 0..50 {
        session.fresh_status().expect("it reports");
    }
    session.gripper(true).expect("it commands");

    // The client trusts only the certificate of another agent, trusts only the certificates of the system, or connects without TLS. Each of
    // these connections fails.
    let (other, _) = certificate(&dir, "other", 0o600);
    for certificates in [Some(other), None] {
        let refused = AgentPort::open(&url, &options(certificates)).err().expect("it is not trusted");
        assert!(matches!(refused, PortError::NoAgent { .. }), "{refused}");
    }
    let mut plain = TcpStream::connect(served.address).expect("it listens");
    plain.set_read_timeout(Some(Duration::from_secs(5))).expect("a time");
    let request = format!("GET /api/status HTTP/1.1\r\nHost: {}\r\n\r\n", served.address);
    plain.write_all(request.as_bytes()).expect("it reads");
    let mut answer = Vec::new();
    let _ = plain.read_to_end(&mut answer);
    assert!(!String::from_utf8_lossy(&answer).contains("HTTP"), "{answer:?}");
    session.fresh_status().expect("nobody else notices");
}

#[test]
fn certificates_and_keys_that_are_none_or_open_to_all_are_refused() {
    let dir = tempfile::tempdir().expect("a directory");
    let (file, key) = certificate(&dir, "agent", 0o600);
    let (other, open) = certificate(&dir, "other", 0o644);
    let missing = dir.path().join("missing");
    for (certificate, key, words) in [
        (&file, &open, "every user"),
        (&missing, &key, "missing"),
        (&file, &missing, "missing"),
        (&key, &key, "contains no certificate"),
        (&file, &file, "agent.pem"),
        (&other, &key, "certificate and private key"),
    ] {
        let error = tls::load(certificate, key).expect_err("it is refused");
        assert!(error.to_string().contains(words), "{words}: {error}");
        assert!(!error.hint().is_empty());
    }
}
