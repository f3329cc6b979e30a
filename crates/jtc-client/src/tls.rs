//! TLS of a client, with its trusted certificates.
use std::io;
use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;

use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject as _;
use rustls::{ClientConfig, RootCertStore};
use tungstenite::Connector;
use tungstenite::stream::MaybeTlsStream;

/// Creates a connector that trusts the certificates in `file`. If no file is specified, the connector trusts the certificates of the
/// system.
///
/// # Errors
///
/// Returns an error if the file contains no certificate, or if the system has no certificates.
pub(crate) fn connector(file: Option<&Path>) -> io::Result<Connector> {
    let mut roots = RootCertStore::empty();
    let certificates: Vec<CertificateDer<'static>> = match file {
        Some(path) => {
            let wrong = |error| io::Error::other(format!("{}: {error}", path.display()));
            CertificateDer::pem_file_iter(path).map_err(wrong)?.collect::<Result<_, _>>().map_err(wrong)?
        }
        None => rustls_native_certs::load_native_certs().certs,
    };
    // Invalid certificates are ignored, because some of the system's many certificates may be invalid.
    let (added, _) = roots.add_parsable_certificates(certificates);
    if added == 0 {
        let whose = file.map_or("the system".into(), |path| path.display().to_string());
        return Err(io::Error::other(format!("{whose} has no valid certificate")));
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(io::Error::other)?
        .with_root_certificates(roots)
        .with_no_client_auth();
    Ok(Connector::Rustls(Arc::new(config)))
}

/// Returns the underlying socket.
pub(crate) fn socket(stream: &mut MaybeTlsStream<TcpStream>) -> io::Result<&mut TcpStream> {
    match stream {
        MaybeTlsStream::Rustls(stream) => Ok(&mut stream.sock),
        MaybeTlsStream::Plain(stream) => Ok(stream),
        // This crate creates only plain and TLS streams.
        _ => Err(io::ErrorKind::Unsupported.into()),
    }
}
