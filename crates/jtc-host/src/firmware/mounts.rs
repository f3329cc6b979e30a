//! Search for the mount points of board drives, and for the serial ports on the same USB devices.

use std::fs;
use std::path::{Path, PathBuf};

use super::{Drive, FirmwareError, UsbDevice};

/// Paths at which the operating system lists drives and serial ports.
#[derive(Clone, Debug)]
pub struct Places {
    /// Path of the mount table, which has the Linux format.
    pub mounts: PathBuf,
    /// Folder that contains a link from each volume label to its device.
    pub by_label: PathBuf,
    /// Folders whose subfolders may be mount points of drives.
    pub folders: Vec<PathBuf>,
    /// Folder of the device classes, which contains links into the device tree.
    pub classes: PathBuf,
    /// Folder that contains the device nodes.
    pub nodes: PathBuf,
}

impl Places {
    /// Returns the paths on this computer.
    pub fn of_system() -> Self {
        let mut folders: Vec<PathBuf> = vec!["/Volumes".into()];
        if cfg!(windows) {
            folders.clear();
        }
        Self {
            mounts: "/proc/self/mounts".into(),
            by_label: "/dev/disk/by-label".into(),
            folders,
            classes: "/sys/class".into(),
            nodes: "/dev".into(),
        }
    }

    /// Returns the mounted drives of ST-LINKs, sorted by path.
    pub fn drives(&self) -> Vec<Drive> {
        let mounted = self.mounted().into_iter();
        let mut drives: Vec<Drive> =
            mounted.filter_map(|(device, path)| Some(self.known(Drive::at(&path).ok()?, device))).collect();
        let entries = self.folders.iter().filter_map(|folder| fs::read_dir(folder).ok());
        let others = entries.flatten().flatten().filter_map(|entry| Drive::at(&entry.path()).ok());
        drives.extend(others);
        if cfg!(windows) {
            drives
                .extend(('A'..='Z').filter_map(|letter| Drive::at(Path::new(&format!("{letter}:\\"))).ok()));
        }
        drives.sort_by(|a, b| a.path.cmp(&b.path));
        drives.dedup_by(|a, b| a.path == b.path);
        drives
    }

    /// Returns the drive that is mounted at a folder, with information from the operating system.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`Drive::at`].
    pub fn at(&self, path: &Path) -> Result<Drive, FirmwareError> {
        let drive = Drive::at(path)?;
        let real = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let device = self.mounted().into_iter().find(|(_, at)| *at == real).map(|(device, _)| device);
        Ok(match device {
            Some(device) => self.known(drive, device),
            None => drive,
        })
    }

    /// Checks that the drive is still present and was not replaced by another drive.
    ///
    /// # Errors
    ///
    /// Returns [`FirmwareError::Changed`] if the drive was removed or replaced. If this error is returned, no byte was written.
    pub fn still_there(&self, drive: &Drive) -> Result<(), FirmwareError> {
        let what = match self.at(&drive.path) {
            Ok(now) if now == *drive => return Ok(()),
            Ok(_) => "another drive is at this place now",
            Err(_) => "the drive has disappeared",
        };
        Err(FirmwareError::Changed { what: format!("{}: {what}", drive.path.display()) })
    }

    /// Searches for the drive at its path and returns its current state. If the drive was unplugged and plugged in again, it may be mounted
    /// in another folder. The function finds the drive in another folder if the USB device of the drive is known.
    pub fn again(&self, drive: &Drive) -> Option<Drive> {
        let connector = |found: &Drive| found.usb.as_ref().map(|usb| usb.folder.clone());
        let own = connector(drive);
        // A drive may still be mounted after its USB device was removed. Then no USB device is found for the drive,
        // and the drive is ignored.
        let here = self.at(&drive.path).ok().filter(|found| connector(found) == own);
        here.or_else(|| {
            own.as_ref()?;
            self.drives().into_iter().find(|found| connector(found) == own)
        })
    }

    fn known(&self, drive: Drive, device: PathBuf) -> Drive {
        let (label, usb) = (self.label(&device), self.usb_device("block", &device));
        drive.of_system(device, label, usb)
    }

    /// Returns the devices and mount points of all file systems that may be an ST-LINK drive, according to their type. If several devices
    /// are mounted at one folder, only the last device is visible.
    fn mounted(&self) -> Vec<(PathBuf, PathBuf)> {
        let table = fs::read(&self.mounts).unwrap_or_default();
        let mount = |line: &[u8]| {
            let mut words = line.split(|byte| *byte == b' ');
            let (device, path, kind) = (words.next()?, words.next()?, words.next()?);
            let fat = [&b"vfat"[..], b"msdos", b"fuseblk", b"exfat"].contains(&kind);
            if !fat || !device.starts_with(b"/") {
                return None;
            }
            Some((path_of(unescaped(device))?, path_of(unescaped(path))?))
        };
        let mut mounted: Vec<(PathBuf, PathBuf)> = Vec::new();
        for (device, path) in table.split(|byte| *byte == b'\n').filter_map(mount) {
            mounted.retain(|(_, at)| *at != path);
            mounted.push((device, path));
        }
        mounted
    }

    fn label(&self, device: &Path) -> Option<String> {
        let links = fs::read_dir(&self.by_label).ok()?.flatten();
        let device = fs::canonicalize(device).ok()?;
        let label = |link: fs::DirEntry| {
            let leads_here = fs::canonicalize(link.path()).ok().as_ref() == Some(&device);
            leads_here.then(|| link.file_name().to_string_lossy().into_owned())
        };
        links.into_iter().find_map(label)
    }

    /// Returns the names of the serial ports on the USB device of the drive. These serial ports are connected to the board of the drive.
    /// The list is empty if the operating system does not report the USB devices. Linux reports the USB devices.
    pub fn ports_of(&self, drive: &Drive) -> Vec<String> {
        let Some(usb) = &drive.usb else { return Vec::new() };
        let entries = fs::read_dir(self.classes.join("tty")).into_iter().flatten().flatten();
        let nodes = entries.map(|entry| self.nodes.join(entry.file_name()));
        let own = nodes.filter(|node| self.usb_device("tty", node).is_some_and(|of| of.folder == usb.folder));
        let mut ports: Vec<String> = own.map(|node| node.to_string_lossy().into_owned()).collect();
        ports.sort();
        ports
    }

    /// Returns `true` if a serial port and a drive belong to the same USB device, and therefore to the same board. Returns `None` if the
    /// operating system does not report the USB devices. Linux reports the USB devices.
    pub fn same_usb_device(&self, port: &str, drive: &Drive) -> Option<bool> {
        let of_port = self.usb_device("tty", Path::new(port))?;
        Some(of_port.folder == drive.usb.as_ref()?.folder)
    }

    /// Returns the USB device to which a device node belongs.
    fn usb_device(&self, class: &str, node: &Path) -> Option<UsbDevice> {
        let node = fs::canonicalize(node).unwrap_or_else(|_| node.to_owned());
        let mut folder = fs::canonicalize(self.classes.join(class).join(node.file_name()?)).ok()?;
        // Only the folder of a USB device contains a vendor id. The search goes up to this folder.
        while !folder.join("idVendor").exists() {
            folder = folder.parent()?.to_owned();
        }
        let number = fs::read_to_string(folder.join("devnum")).unwrap_or_default().trim().to_owned();
        Some(UsbDevice { folder, number })
    }
}

/// Decodes the bytes of a path in the mount table. For example, `\040` is a space.
fn unescaped(text: &[u8]) -> Vec<u8> {
    let mut plain = Vec::new();
    let mut rest = text;
    while let [first, behind @ ..] = rest {
        let digits = behind.get(..3).filter(|_| *first == b'\\').and_then(|d| std::str::from_utf8(d).ok());
        match digits.and_then(|digits| u8::from_str_radix(digits, 8).ok()) {
            Some(byte) => {
                plain.push(byte);
                rest = &behind[3..];
            }
            None => {
                plain.push(*first);
                rest = behind;
            }
        }
    }
    plain
}

/// Returns the path that consists of these bytes. The bytes may be invalid text.
#[cfg(unix)]
fn path_of(bytes: Vec<u8>) -> Option<PathBuf> {
    use std::os::unix::ffi::OsStringExt as _;
    Some(std::ffi::OsString::from_vec(bytes).into())
}

/// Returns the path that consists of these bytes. Returns `None` if the bytes are not valid text.
#[cfg(not(unix))]
fn path_of(bytes: Vec<u8>) -> Option<PathBuf> {
    String::from_utf8(bytes).ok().map(Into::into)
}

#[cfg(all(test, unix))]
mod tests {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt as _;
    use std::os::unix::fs::symlink;

    use super::super::Fit;
    use super::*;

    /// Simulated computer with two boards on USB. Each board has a drive and a serial port, which are listed at the paths `places`.
    struct Desk {
        folder: tempfile::TempDir,
        places: Places,
        table: Vec<u8>,
    }

    impl Desk {
        fn new() -> Self {
            let folder = tempfile::tempdir().unwrap();
            let at = |name: &str| folder.path().join(name);
            for name in ["dev", "by-label", "class/tty", "class/block"] {
                fs::create_dir_all(at(name)).unwrap();
            }
            for (usb, disk, tty) in [("1-2", "sda", "ttyACM0"), ("1-3", "sdb", "ttyACM1")] {
                for (class, part, name) in [("block", "1.1/host0/block", disk), ("tty", "1.2/tty", tty)] {
                    let device = at(&format!("{usb}/{usb}:{part}/{name}"));
                    fs::create_dir_all(&device).unwrap();
                    symlink(&device, at(&format!("class/{class}/{name}"))).unwrap();
                    fs::write(at(&format!("dev/{name}")), "").unwrap();
                }
                fs::write(at(usb).join("idVendor"), "0483\n").unwrap();
                fs::write(at(usb).join("devnum"), "7\n").unwrap();
            }
            // The port ttyS0 does not belong to a USB device.
            fs::create_dir_all(at("platform/ttyS0")).unwrap();
            symlink(at("platform/ttyS0"), at("class/tty/ttyS0")).unwrap();
            let places = Places {
                mounts: at("mounts"),
                by_label: at("by-label"),
                folders: vec![at("more"), at("nowhere")],
                classes: at("class"),
                nodes: at("dev"),
            };
            Self { folder, places, table: b"proc /proc proc rw 0 0\nbroken\n".to_vec() }
        }

        fn at(&self, name: &str) -> PathBuf {
            self.folder.path().join(name)
        }

        /// Creates a drive in a folder with the given name.
        fn mount(&mut self, device: &str, name: &[u8], kind: &str) -> PathBuf {
            let path = self.folder.path().join(OsStr::from_bytes(name));
            fs::create_dir_all(&path).unwrap();
            fs::write(path.join("DETAILS.TXT"), "Version: V3J13\n").unwrap();
            self.table.extend(format!("{} ", self.at(device).display()).bytes());
            for byte in path.as_os_str().as_bytes() {
                match byte {
                    b' ' => self.table.extend(b"\\040"),
                    _ => self.table.push(*byte),
                }
            }
            self.table.extend(format!(" {kind} rw 0 0\n").bytes());
            fs::write(self.at("mounts"), &self.table).unwrap();
            path
        }

        fn label(&self, device: &str, label: &str) {
            symlink(self.at(device), self.at("by-label").join(label)).unwrap();
        }
    }

    #[test]
    fn drives_are_found_where_they_are_mounted_with_their_labels() {
        let mut desk = Desk::new();
        fs::create_dir_all(desk.at("more/NOD_H743ZI2")).unwrap();
        fs::write(desk.at("more/NOD_H743ZI2/DETAILS.TXT"), "").unwrap();
        let one = desk.mount("dev/sda", b"a b", "vfat");
        let other = desk.mount("dev/sdc", b"usb", "ext4");
        desk.label("dev/sda", "NOD_H745ZIQ");
        let drives = desk.places.drives();
        let found: Vec<_> = drives.iter().map(|d| (d.path.clone(), d.label.as_deref())).collect();
        assert_eq!(
            found,
            [(one.clone(), Some("NOD_H745ZIQ")), (desk.at("more/NOD_H743ZI2"), Some("NOD_H743ZI2"))]
        );
        // A search by path returns the same drive as the list of drives, including the label of the block device.
        let named = desk.places.at(&one).unwrap();
        assert_eq!((&named, named.fit("nucleo-h745zi-q")), (&drives[0], Fit::Same));
        assert_eq!(desk.places.at(&other).unwrap().label.as_deref(), Some("usb"));
    }

    #[test]
    fn a_path_of_any_bytes_hides_no_drive() {
        let mut desk = Desk::new();
        let strange = desk.mount("dev/sdb", b"caf\xE9", "vfat");
        let one = desk.mount("dev/sda", b"one", "vfat");
        let paths: Vec<_> = desk.places.drives().into_iter().map(|drive| drive.path).collect();
        assert_eq!(paths, [strange, one]);
    }

    #[test]
    fn the_name_of_a_folder_is_no_label_where_the_device_is_known() {
        let mut desk = Desk::new();
        // Two NUCLEO-H743ZI boards are connected. The operating system has appended a 2 to the folder name of the
        // second drive, because both drives have the same label. This folder name must not be used as the label of
        // the drive.
        let path = desk.mount("dev/sdb", b"NODE_H743ZI2", "vfat");
        let drive = desk.places.at(&path).unwrap();
        assert_eq!((drive.label.as_deref(), drive.fit("nucleo-h743zi2")), (None, Fit::Unknown));
        assert_eq!(desk.places.drives(), [drive]);
    }

    #[test]
    fn a_drive_has_the_ports_of_its_own_usb_device() {
        let mut desk = Desk::new();
        let path = desk.mount("dev/sda", b"one", "vfat");
        let drive = desk.places.at(&path).unwrap();
        let port = |name: &str| desk.at("dev").join(name).to_str().unwrap().to_owned();
        assert_eq!(desk.places.ports_of(&drive), [port("ttyACM0")]);
        let same = |name: &str| desk.places.same_usb_device(name, &drive);
        assert_eq!(same(&port("ttyACM0")), Some(true));
        assert_eq!(same(&port("ttyACM1")), Some(false));
        assert_eq!((same("/dev/ttyS0"), same("/tmp/jtc")), (None, None));
        // For a drive without a known USB device, no serial ports are found.
        let unknown = Drive::at(&path).unwrap();
        assert_eq!(desk.places.ports_of(&unknown), [""; 0]);
        assert_eq!(desk.places.same_usb_device(&port("ttyACM0"), &unknown), None);
    }

    #[test]
    fn a_drive_that_comes_back_elsewhere_is_found_by_its_connector() {
        let mut desk = Desk::new();
        let path = desk.mount("dev/sda", b"one", "vfat");
        let other = desk.mount("dev/sdb", b"other", "vfat");
        let drive = desk.places.at(&path).unwrap();
        let again = |desk: &Desk| desk.places.again(&drive).map(|found| found.path);
        assert_eq!(again(&desk), Some(path));
        // The USB device was removed, but the drive is still mounted.
        fs::remove_file(desk.at("class/block/sda")).unwrap();
        assert_eq!(again(&desk), None);
        let elsewhere = desk.mount("dev/sdd", b"one1", "vfat");
        symlink(desk.at("1-2/1-2:1.1/host0/block/sda"), desk.at("class/block/sdd")).unwrap();
        assert_eq!(again(&desk), Some(elsewhere));
        assert_ne!(again(&desk), Some(other));
    }

    #[test]
    fn another_drive_in_the_same_place_is_not_the_one_that_was_looked_at() {
        let mut desk = Desk::new();
        let path = desk.mount("dev/sda", b"one", "vfat");
        desk.label("dev/sda", "NOD_H745ZIQ");
        let drive = desk.places.at(&path).unwrap();
        desk.places.still_there(&drive).unwrap();
        let refused = |desk: &Desk| {
            let error = desk.places.still_there(&drive).unwrap_err();
            assert!(matches!(error, FirmwareError::Changed { .. }), "{error}");
        };
        // The USB device was unplugged and plugged in again, so its number has changed.
        fs::write(desk.at("1-2/devnum"), "8\n").unwrap();
        refused(&desk);
        fs::write(desk.at("1-2/devnum"), "7\n").unwrap();
        desk.places.still_there(&drive).unwrap();
        // The drive of another board is mounted at the path of the drive.
        desk.mount("dev/sdb", b"one", "vfat");
        refused(&desk);
        // The drive was unmounted, so the folder is on a disk of this computer.
        fs::write(desk.at("mounts"), "").unwrap();
        refused(&desk);
        fs::remove_dir_all(&path).unwrap();
        refused(&desk);
    }

    #[test]
    fn paths_of_the_table_of_mounts_are_read() {
        for (text, plain) in [
            (&b"/a"[..], &b"/a"[..]),
            (b"/a\\040b\\134c", b"/a b\\c"),
            (b"/a\\9", b"/a\\9"),
            (b"\\", b"\\"),
            (b"\xE9\\303\\251", b"\xE9\xC3\xA9"),
        ] {
            assert_eq!(unescaped(text), plain);
        }
    }
}
