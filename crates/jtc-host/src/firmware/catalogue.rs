//! Catalogue of the installed firmware images: a folder that contains the images and the list `firmware.json`.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::{FLASH, FirmwareError, Image};

/// Name of the file that lists the images.
const FILE: &str = "firmware.json";
/// Folder in which packages install the images, relative to the installation prefix.
const INSTALLED: &str = "share/openjtc/firmware";
/// Environment variable with the path of a folder that contains a catalogue. If the variable is set, only this folder
/// is searched.
const VARIABLE: &str = "OPENJTC_FIRMWARE";

/// Entry in the catalogue about one image.
#[derive(Clone, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
pub struct CatalogueImage {
    /// Name of the board for which the image was built.
    pub board: String,
    /// Name of the image file in the folder of the catalogue.
    pub file: String,
    /// SHA-256 of the image file, hexadecimal.
    pub sha256: String,
    /// Flash address of the first byte of the image.
    pub address: u32,
    /// Size of the image file, bytes.
    pub bytes: u64,
}

impl CatalogueImage {
    /// Checks that the content of an image file matches the catalogue.
    fn check(&self, path: &Path, bytes: &[u8]) -> Result<(), FirmwareError> {
        let sha256: String = Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect();
        if bytes.len() as u64 == self.bytes && sha256.eq_ignore_ascii_case(&self.sha256) {
            return Ok(());
        }
        Err(FirmwareError::Damaged {
            path: path.to_owned(),
            sha256,
            bytes: bytes.len() as u64,
            listed: Box::new(self.clone()),
        })
    }
}

/// Content of `firmware.json`.
#[derive(Clone, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
pub struct Catalogue {
    /// Release version of the images.
    pub version: String,
    /// Images in the catalogue.
    pub images: Vec<CatalogueImage>,
    /// Folder of the catalogue.
    #[serde(skip)]
    pub folder: PathBuf,
}

impl Catalogue {
    /// Returns the folders in which the program searches for a catalogue. If the environment variable is set, its
    /// value is the only folder. Otherwise these are the folder in the program's own installation prefix, and the
    /// folder into which packages install images.
    pub fn folders() -> Vec<PathBuf> {
        if let Some(folder) = env::var_os(VARIABLE).filter(|folder| !folder.is_empty()) {
            return vec![folder.into()];
        }
        let program = env::current_exe().and_then(fs::canonicalize).ok();
        let beside = program.as_deref().and_then(Path::parent).and_then(Path::parent);
        let mut folders: Vec<PathBuf> = beside.map(|prefix| prefix.join(INSTALLED)).into_iter().collect();
        let system = Path::new("/usr").join(INSTALLED);
        if !folders.contains(&system) {
            folders.push(system);
        }
        folders
    }

    /// Returns the first catalogue that is found in `folders`.
    ///
    /// # Errors
    ///
    /// Returns [`FirmwareError::NoCatalogue`] if no folder contains a catalogue, and the errors of [`Catalogue::read`].
    pub fn find(folders: &[PathBuf]) -> Result<Self, FirmwareError> {
        match folders.iter().find(|folder| folder.join(FILE).exists()) {
            Some(folder) => Self::read(folder),
            None => Err(FirmwareError::NoCatalogue { folders: folders.to_vec() }),
        }
    }

    /// Reads the catalogue of a folder.
    ///
    /// # Errors
    ///
    /// Returns [`FirmwareError::File`] if the file cannot be read, and [`FirmwareError::BadCatalogue`] if its content is not valid.
    pub fn read(folder: &Path) -> Result<Self, FirmwareError> {
        let path = folder.join(FILE);
        let text =
            fs::read_to_string(&path).map_err(|source| FirmwareError::File { path: path.clone(), source })?;
        let bad = |why: String| FirmwareError::BadCatalogue { path: path.clone(), why };
        let mut catalogue: Self = serde_json::from_str(&text).map_err(|e| bad(e.to_string()))?;
        for image in &catalogue.images {
            if Path::new(&image.file).file_name() != Some(image.file.as_ref()) {
                return Err(bad(format!("{:?} is not the name of a file in this folder", image.file)));
            }
            if image.address != FLASH {
                return Err(bad(format!(
                    "{} is for address {:#010x}, expected {FLASH:#010x}, where the drive of a board writes",
                    image.file, image.address
                )));
            }
        }
        catalogue.folder = folder.to_owned();
        Ok(catalogue)
    }

    /// Returns `true` if the catalogue in the folder of an image file lists this file with the same content. Returns `false` if the folder
    /// does not contain a readable catalogue.
    ///
    /// # Errors
    ///
    /// Returns [`FirmwareError::Damaged`] if the content of the file differs from the catalogue.
    pub(super) fn lists(path: &Path, bytes: &[u8]) -> Result<bool, FirmwareError> {
        let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else { return Ok(false) };
        let Ok(catalogue) = Self::read(folder) else { return Ok(false) };
        match catalogue.images.iter().find(|image| name == image.file.as_str()) {
            Some(listed) => listed.check(path, bytes).map(|()| true),
            None => Ok(false),
        }
    }

    /// Returns the image of a board after its file was verified against the catalogue.
    ///
    /// # Errors
    ///
    /// Returns [`FirmwareError::NoBoard`] if the catalogue has no image for the board. Returns [`FirmwareError::Damaged`] if the file
    /// differs from the catalogue. Returns [`FirmwareError::BadCatalogue`] if the file is for another board. Also returns the errors of
    /// [`Image::read`].
    pub fn image(&self, board: &str) -> Result<Image, FirmwareError> {
        let Some(listed) = self.images.iter().find(|image| image.board == board) else {
            return Err(FirmwareError::NoBoard {
                board: board.to_owned(),
                known: self.images.iter().map(|image| image.board.clone()).collect(),
            });
        };
        let path = self.folder.join(&listed.file);
        let bytes = fs::read(&path).map_err(|source| FirmwareError::File { path: path.clone(), source })?;
        listed.check(&path, &bytes)?;
        let image = Image::parse(&path, bytes)?.listed();
        if image.record().board != board {
            let why = format!(
                "{} is listed for {board}, but its content is for {}",
                listed.file,
                image.record().board
            );
            return Err(FirmwareError::BadCatalogue { path: self.folder.join(FILE), why });
        }
        Ok(image)
    }
}

#[cfg(test)]
mod tests {
    use super::super::fake::{catalogue, image_bytes};
    use super::*;

    #[test]
    fn an_image_is_taken_when_its_digest_is_the_listed_one() {
        let folder = tempfile::tempdir().unwrap();
        catalogue(folder.path(), &["nucleo-h745zi-q", "nucleo-h743zi2"]);
        let found = Catalogue::find(&[folder.path().join("none"), folder.path().to_owned()]).unwrap();
        assert_eq!((found.version.as_str(), found.images.len()), ("0.2.0", 2));
        assert_eq!(found.image("nucleo-h743zi2").unwrap().record().board, "nucleo-h743zi2");
        let said = found.image("nucleo-f401re").unwrap_err().to_string();
        assert!(said.contains("nucleo-f401re") && said.contains("nucleo-h745zi-q, nucleo-h743zi2"), "{said}");
        // The test changes one bit of the image file.
        let path = folder.path().join("nucleo-h743zi2.bin");
        let mut bytes = fs::read(&path).unwrap();
        bytes[0x800] ^= 1;
        fs::write(&path, &bytes).unwrap();
        assert!(matches!(found.image("nucleo-h743zi2"), Err(FirmwareError::Damaged { .. })));
        assert!(found.image("nucleo-h745zi-q").is_ok());
    }

    #[test]
    fn a_catalogue_that_leads_elsewhere_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let write = |file: &str, address: u32| {
            let text = format!(
                r#"{{"version":"1","images":[{{"board":"b","file":"{file}","sha256":"","address":{address},"bytes":1}}]}}"#
            );
            fs::write(folder.path().join(FILE), text).unwrap();
            Catalogue::read(folder.path())
        };
        assert!(write("b.bin", FLASH).is_ok());
        for (file, address) in
            [("../b.bin", FLASH), ("/etc/passwd", FLASH), ("..", FLASH), ("b.bin", 0x0810_0000)]
        {
            assert!(matches!(write(file, address), Err(FirmwareError::BadCatalogue { .. })), "{file}");
        }
        fs::write(folder.path().join(FILE), "{").unwrap();
        assert!(matches!(Catalogue::read(folder.path()), Err(FirmwareError::BadCatalogue { .. })));
        let nowhere = Catalogue::find(&[folder.path().join("x")]).unwrap_err();
        assert!(matches!(nowhere, FirmwareError::NoCatalogue { .. }));
    }

    #[test]
    fn a_file_that_is_listed_for_another_board_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        catalogue(folder.path(), &["nucleo-h745zi-q"]);
        let text = fs::read_to_string(folder.path().join(FILE)).unwrap();
        fs::write(
            folder.path().join(FILE),
            text.replace("\"board\":\"nucleo-h745zi-q\"", "\"board\":\"nucleo-h743zi2\""),
        )
        .unwrap();
        let catalogue = Catalogue::read(folder.path()).unwrap();
        let said = catalogue.image("nucleo-h743zi2").unwrap_err().to_string();
        assert!(said.contains("but its content is for nucleo-h745zi-q"), "{said}");
        assert_eq!(image_bytes("b", 1).len() % 4, 0);
    }
}
