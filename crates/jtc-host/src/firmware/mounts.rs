//! Where the drives of boards are mounted, and which serial port is on the same USB device.

use std::fs;
use std::path::{Path, PathBuf};

use super::Drive;

/// Places of the system in which drives are looked for.
#[derive(Clone, Debug)]
pub struct Places {
    /// The table of mounts, as Linux has it.
    pub mounts: PathBuf,
    /// Links from labels to devices.
    pub by_label: PathBuf,
    /// Folders in which each folder may be a drive.
    pub folders: Vec<PathBuf>,
}

impl Places {
    /// Those of this computer.
    pub fn of_system() -> Self {
        let mut folders: Vec<PathBuf> = vec!["/Volumes".into()];
        if cfg!(windows) {
            folders.clear();
        }
        Self { mounts: "/proc/self/mounts".into(), by_label: "/dev/disk/by-label".into(), folders }
    }

    /// The drives of ST-LINKs that are mounted, by path.
    pub fn drives(&self) -> Vec<Drive> {
        let mut drives: Vec<Drive> =
            self.mounted().iter().filter_map(|(device, path)| self.drive(device, path)).collect();
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

    /// The drive at a folder that was named, with what the system knows of it.
    ///
    /// # Errors
    ///
    /// Those of [`Drive::at`].
    pub fn at(&self, path: &Path) -> Result<Drive, super::FirmwareError> {
        let drive = Drive::at(path)?;
        let real = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let device = self.mounted().into_iter().find(|(_, at)| *at == real).map(|(device, _)| device);
        let label = device.as_deref().and_then(|device| self.label(device));
        Ok(drive.of_system(device, label))
    }

    fn drive(&self, device: &Path, path: &Path) -> Option<Drive> {
        let drive = Drive::at(path).ok()?;
        Some(drive.of_system(Some(device.to_owned()), self.label(device)))
    }

    /// Devices and where they are mounted, of file systems that such a drive can have.
    fn mounted(&self) -> Vec<(PathBuf, PathBuf)> {
        let text = fs::read_to_string(&self.mounts).unwrap_or_default();
        let mount = |line: &str| {
            let mut words = line.split(' ');
            let (device, path, kind) = (words.next()?, words.next()?, words.next()?);
            let fat = matches!(kind, "vfat" | "msdos" | "fuseblk" | "exfat");
            (fat && device.starts_with('/')).then(|| (unescaped(device).into(), unescaped(path).into()))
        };
        text.lines().filter_map(mount).collect()
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
}

/// A path as the table of mounts writes it: `\040` is a blank.
fn unescaped(text: &str) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some((before, behind)) = rest.split_once('\\') {
        plain += before;
        match behind.get(..3).and_then(|digits| u8::from_str_radix(digits, 8).ok()) {
            Some(byte) => {
                plain.push(byte.into());
                rest = &behind[3..];
            }
            None => {
                plain.push('\\');
                rest = behind;
            }
        }
    }
    plain + rest
}

/// A serial port and a drive are functions of one USB device, so of one board. `None` where the system does not say; Linux does.
pub fn same_usb_device(port: &str, drive: &Drive) -> Option<bool> {
    same_usb_device_in(Path::new("/sys/class"), port, drive)
}

fn same_usb_device_in(classes: &Path, port: &str, drive: &Drive) -> Option<bool> {
    let of_port = usb_device(&classes.join("tty"), Path::new(port))?;
    let of_drive = usb_device(&classes.join("block"), drive.device.as_deref()?)?;
    Some(of_port == of_drive)
}

/// The folder of the USB device that a device node is a function of.
fn usb_device(class: &Path, node: &Path) -> Option<PathBuf> {
    let node = fs::canonicalize(node).unwrap_or_else(|_| node.to_owned());
    let mut at = fs::canonicalize(class.join(node.file_name()?)).ok()?;
    // The device itself is what has the number of its maker.
    while !at.join("idVendor").exists() {
        at = at.parent()?.to_owned();
    }
    Some(at)
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::symlink;

    use super::super::Fit;
    use super::*;

    #[test]
    fn drives_are_found_where_they_are_mounted_with_their_labels() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["dev", "by-label", "a b", "usb", "empty", "more", "more/NOD_H743ZI2"] {
            fs::create_dir(at(name)).unwrap();
        }
        for device in ["dev/sda", "dev/sdb", "dev/sdc"] {
            fs::write(at(device), "").unwrap();
        }
        for drive in ["a b", "usb", "more/NOD_H743ZI2"] {
            fs::write(at(drive).join("DETAILS.TXT"), "Version: V3J13\n").unwrap();
        }
        symlink(at("dev/sda"), at("by-label/NOD_H745ZIQ")).unwrap();
        let line = |device: &str, path: &str, kind: &str| {
            format!(
                "{} {} {kind} rw 0 0\n",
                at(device).display(),
                at(path).display().to_string().replace(' ', "\\040")
            )
        };
        let mounts = line("dev/sda", "a b", "vfat")
            + &line("dev/sdb", "empty", "vfat")
            + &line("dev/sdc", "usb", "ext4");
        fs::write(at("mounts"), mounts + "proc /proc proc rw 0 0\nbroken\n").unwrap();
        let places = Places {
            mounts: at("mounts"),
            by_label: at("by-label"),
            folders: vec![at("more"), at("nowhere")],
        };
        let drives = places.drives();
        let found: Vec<_> = drives.iter().map(|d| (d.path.clone(), d.label.as_deref())).collect();
        assert_eq!(found, [(at("a b"), Some("NOD_H745ZIQ")), (at("more/NOD_H743ZI2"), Some("NOD_H743ZI2"))]);
        // One that is named is the same drive, with the label of its device.
        let named = places.at(&at("a b")).unwrap();
        assert_eq!((&named, named.fit("nucleo-h745zi-q")), (&drives[0], Fit::Same));
        assert_eq!(places.at(&at("usb")).unwrap().label.as_deref(), Some("usb"));
    }

    #[test]
    fn a_port_and_a_drive_are_of_one_board_when_they_are_of_one_usb_device() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in [
            "1-2/1-2:1.1/host0/block/sda",
            "1-2/1-2:1.2/tty/ttyACM0",
            "1-3/1-3:1.2/tty/ttyACM1",
            "class/tty",
            "class/block",
        ] {
            fs::create_dir_all(at(name)).unwrap();
        }
        for device in ["1-2", "1-3"] {
            fs::write(at(device).join("idVendor"), "0483\n").unwrap();
        }
        symlink(at("1-2/1-2:1.1/host0/block/sda"), at("class/block/sda")).unwrap();
        symlink(at("1-2/1-2:1.2/tty/ttyACM0"), at("class/tty/ttyACM0")).unwrap();
        symlink(at("1-3/1-3:1.2/tty/ttyACM1"), at("class/tty/ttyACM1")).unwrap();
        let drive = |device: Option<&str>| Drive {
            path: at("x"),
            label: None,
            code: None,
            details: String::new(),
            device: device.map(Into::into),
        };
        let same = |port: &str, device| same_usb_device_in(&at("class"), port, &drive(device));
        assert_eq!(same("/dev/ttyACM0", Some("/dev/sda")), Some(true));
        assert_eq!(same("/dev/ttyACM1", Some("/dev/sda")), Some(false));
        assert_eq!(same("/tmp/jtc", Some("/dev/sda")), None);
        assert_eq!(same("/dev/ttyACM0", Some("/dev/sdz")), None);
        assert_eq!(same("/dev/ttyACM0", None), None);
    }

    #[test]
    fn paths_of_the_table_of_mounts_are_read() {
        for (text, plain) in [("/a", "/a"), ("/a\\040b\\134c", "/a b\\c"), ("/a\\9", "/a\\9"), ("\\", "\\")] {
            assert_eq!(unescaped(text), plain);
        }
    }
}
