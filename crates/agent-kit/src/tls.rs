//! TLS configuration that an agent loads from certificate files.
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustls::ServerConfig;
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};

/// Reason why TLS cannot be configured.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// File that is not a valid certificate or private key.
    #[error("{path}: {what}", path = path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Problem in the contents of the file.
        what: String,
    },
    /// Private key that other users can read.
    #[error("{path}: mode {mode:04o}: every user of this computer can read this private key", path = path.display())]
    Open {
        /// Path of the file.
        path: PathBuf,
        /// Mode of the file.
        mode: u32,
    },
    /// Certificate and private key that do not match.
    #[error("certificate and private key do not work together: {0}")]
    Pair(rustls::Error),
}

impl host_kit::Diagnose for TlsError {
    fn diagnosis(&self) -> host_kit::Diagnosis {
        let next = match self {
            Self::Open { path, .. } => format!("`chmod 600 {}`", path.display()),
            Self::File { .. } | Self::Pair(_) => {
                "pass a PEM certificate chain with --tls-cert and its PEM private key with --tls-key".into()
            }
        };
        host_kit::Diagnosis::new(host_kit::ErrorKind::Usage, "tls", next)
    }
}

/// Returns a TLS configuration for TLS 1.2 and 1.3. The certificate chain and its private key are PEM files. The
/// agent's own certificate is the first certificate in the chain.
///
/// # Errors
///
/// A [`TlsError`] if a file is not valid, if other users can read the private key, or if the key and the certificate
/// do not match.
pub fn load(certificate: &Path, key: &Path) -> Result<Arc<ServerConfig>, TlsError> {
    let wrong = |path: &Path| {
        let path = path.to_owned();
        move |error: rustls::pki_types::pem::Error| TlsError::File { path, what: error.to_string() }
    };
    let chain = CertificateDer::pem_file_iter(certificate).map_err(wrong(certificate))?;
    let chain: Vec<_> = chain.collect::<Result<_, _>>().map_err(wrong(certificate))?;
    if chain.is_empty() {
        let what = "the file contains no certificate".to_owned();
        return Err(TlsError::File { path: certificate.to_owned(), what });
    }
    let private = PrivateKeyDer::from_pem_file(key).map_err(wrong(key))?;
    check_mode(key).map_err(|error| match error {
        Ok(mode) => TlsError::Open { path: key.to_owned(), mode },
        Err(error) => TlsError::File { path: key.to_owned(), what: error.to_string() },
    })?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, private))
        .map_err(TlsError::Pair)?;
    Ok(Arc::new(config))
}

#[cfg(unix)]
fn check_mode(path: &Path) -> Result<(), Result<u32, io::Error>> {
    use std::os::unix::fs::PermissionsExt as _;
    let mode = std::fs::metadata(path).map_err(Err)?.permissions().mode() & 0o777;
    if mode & 0o007 == 0 { Ok(()) } else { Err(Ok(mode)) }
}

#[cfg(not(unix))]
fn check_mode(_: &Path) -> Result<(), Result<u32, io::Error>> {
    Ok(())
}
