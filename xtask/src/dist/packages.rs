//! Contents of the packages and archives of the commands `jtc` and `ucom`.
use std::path::Path;

use anyhow::{Context, Result};

use super::deb::Deb;
use super::images::{self, Image};
use super::pages::Pages;
use super::programs::{PROGRAMS, Platform};
use super::tree::{Tree, gzip};
use crate::shell::root;

/// Revision number of the Debian packages of a release version.
const REVISION: u32 = 1;

/// udev rules for serial ports. Both packages install these rules, under different file names.
const RULES: &str = include_str!("../../packaging/serial.rules");

/// Findings of lintian that the packages intentionally contain, with the reasons.
const OVERRIDES: &str = "\
# One program for every distribution.
NAME: statically-linked-binary
# Made by the project, and not uploaded to Debian.
NAME: initial-upload-closes-no-bugs
# A motion is stopped before the program of its agent goes; where systemd runs, and nothing is enabled.
NAME: maintainer-script-calls-systemctl
";

/// Data that all packages of a release share.
pub(super) struct Release {
    /// Version of the release, such as `0.2.0`.
    pub version: String,
    /// Unix time of the release, s.
    pub time: u64,
    /// Text of the file THIRD-PARTY.txt.
    pub third_party: String,
    /// Flash images of the firmware for the boards.
    pub images: Vec<Image>,
}

/// File that belongs to a release.
pub(super) struct Made {
    /// Name of the file.
    pub name: String,
    /// Contents of the file.
    pub bytes: Vec<u8>,
}

impl Release {
    /// Returns the Debian package and the archive of each command. `programs` is the folder of the programs. `runnable` is the folder
    /// of programs that run on this computer.
    pub(super) fn packages(&self, platform: Platform, programs: &Path, runnable: &Path) -> Result<Vec<Made>> {
        let mut made = Vec::new();
        for (name, _) in PROGRAMS {
            let pages = Pages::of(runnable, name)?;
            let path = programs.join(name);
            let program = std::fs::read(&path).with_context(|| path.display().to_string())?;
            made.push(self.deb(name, platform, &program, &pages)?);
            made.push(self.archive(name, platform, &program, &pages)?);
        }
        Ok(made)
    }

    fn deb(&self, name: &str, platform: Platform, program: &[u8], pages: &Pages) -> Result<Made> {
        let mut tree = Tree::default();
        tree.put_program(format!("usr/bin/{name}"), program);
        pages.install(name, &mut tree)?;
        tree.put(
            format!("usr/lib/udev/rules.d/70-{name}.rules"),
            RULES.replace("openjtc_", &format!("{name}_")),
        );
        let doc = format!("usr/share/doc/{name}");
        tree.put(format!("{doc}/copyright"), copyright()?);
        tree.put(format!("{doc}/THIRD-PARTY.txt.gz"), gzip(self.third_party.as_bytes())?);
        tree.put(format!("{doc}/changelog.gz"), gzip(&std::fs::read(root().join("CHANGELOG.md"))?)?);
        let version = format!("{}-{REVISION}", self.version);
        let date = rfc2822(self.time)?;
        let changes = format!(
            "{name} ({version}) stable; urgency=medium\n\n  * Release {}; changelog.gz lists the changes.\n\n -- {MAINTAINER}  {date}\n",
            self.version
        );
        tree.put(format!("{doc}/changelog.Debian.gz"), gzip(changes.as_bytes())?);
        tree.put(format!("usr/share/lintian/overrides/{name}"), OVERRIDES.replace("NAME", name));
        let jtc = name == "jtc";
        if jtc {
            images::install(&self.images, &self.version, "usr/share/openjtc/firmware", &mut tree)?;
            let unit = include_str!("../../packaging/jtc-serve@.service");
            tree.put("usr/lib/systemd/system/jtc-serve@.service", unit);
            tree.put("usr/lib/sysusers.d/jtc.conf", include_str!("../../packaging/jtc.sysusers"));
            tree.put(format!("{doc}/examples/cell.env"), include_str!("../../packaging/cell.env"));
        }
        let jtc_scripts = [
            ("postinst", include_str!("../../packaging/jtc.postinst")),
            ("prerm", include_str!("../../packaging/jtc.prerm")),
            ("postrm", include_str!("../../packaging/jtc.postrm")),
        ];
        let ucom_scripts = [("postinst", include_str!("../../packaging/ucom.postinst"))];
        let deb = Deb {
            name,
            version: &version,
            architecture: platform.debian,
            fields: &fields(if jtc { JTC } else { UCOM }),
            tree: &tree,
            scripts: if jtc { &jtc_scripts } else { &ucom_scripts },
        };
        Ok(Made { name: deb.file_name(), bytes: deb.bytes(self.time)? })
    }

    fn archive(&self, name: &str, platform: Platform, program: &[u8], pages: &Pages) -> Result<Made> {
        let mut tree = Tree::default();
        tree.put_program(format!("bin/{name}"), program);
        pages.unpacked(name, &mut tree);
        for file in ["LICENSE-MIT", "LICENSE-APACHE", "CHANGELOG.md"] {
            tree.copy(file, &root().join(file))?;
        }
        tree.put("THIRD-PARTY.txt", &*self.third_party);
        tree.put("udev/70-openjtc.rules", RULES);
        if name == "jtc" {
            // The program is in the folder `bin`. The program searches for the images at this path, relative to the
            // parent of `bin`.
            images::install(&self.images, &self.version, "share/openjtc/firmware", &mut tree)?;
        }
        let folder = format!("{name}-{}-{}-linux", self.version, platform.machine);
        let bytes = tree.tar_gz(&format!("{folder}/"), self.time)?;
        Ok(Made { name: format!("{folder}.tar.gz"), bytes })
    }
}

/// Maintainer field of the packages. The project has no mail address, because users report problems in its repository.
const MAINTAINER: &str = "The openjtc contributors <openjtc@noreply.invalid>";

const JTC: &str = "\
Description: joint trajectory controller for robot arms: host, agent, simulator
 Checks trajectories for six-axis, torque-controlled robot arms, uploads and
 executes them, plans, jogs, teaches, records and reports; puts firmware on
 the controller's boards; serves an arm to many clients and to a browser.
 .
 It simulates an arm with its controller, so that all of it can be tried
 without hardware: `jtc demo`. The agents of the unit jtc-serve@ run when
 somebody enables them. This is no certified safety function.";

const UCOM: &str = "\
Description: numbers, updates and drives chains of UCoM boards on CAN
 Numbers the boards of a chain on a CAN bus, lists what each of them is,
 updates their firmware and proves it, reads and writes their values by name.
 .
 It simulates such chains: `ucom sim`.";

fn fields(description: &str) -> String {
    format!(
        "Maintainer: {MAINTAINER}\nSection: science\nPriority: optional\nSuggests: bash-completion\n{description}"
    )
}

/// Returns the licences of this project in the format of Debian.
fn copyright() -> Result<String> {
    let mit = std::fs::read_to_string(root().join("LICENSE-MIT")).context("LICENSE-MIT")?;
    let (line, terms) =
        (mit.lines().find(|line| line.starts_with("Copyright")), mit.split_once("Permission is"));
    let (line, terms) =
        (line.context("LICENSE-MIT names nobody")?, terms.context("LICENSE-MIT has no terms")?.1);
    let owner = line.trim_start_matches("Copyright (c) ");
    let terms: String = format!("Permission is{terms}")
        .lines()
        .map(|line| if line.trim().is_empty() { " .\n".to_owned() } else { format!(" {line}\n") })
        .collect();
    Ok(format!(
        "Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/\nUpstream-Name: openjtc\n\
         Comment: The programs contain what others wrote; THIRD-PARTY.txt.gz lists each part with its licence and\n its text.\n\n\
         Files: *\nCopyright: {owner}\nLicense: MIT or Apache-2.0\n\n\
         License: MIT\n{terms}\n\
         License: Apache-2.0\n On Debian systems the text of this licence is in /usr/share/common-licenses/Apache-2.0.\n"
    ))
}

/// Returns a Unix time in the date format of e-mail.
fn rfc2822(time: u64) -> Result<String> {
    let mut date = crate::shell::command("date");
    let text = crate::shell::read(date.env("LC_ALL", "C").args(["-u", "-R", "-d", &format!("@{time}")]))
        .context("date")?;
    Ok(text.trim().to_owned())
}
