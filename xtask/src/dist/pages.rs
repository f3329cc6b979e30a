//! Manual pages and shell completions, which the programs print.
use std::path::Path;

use anyhow::{Context, Result, ensure};

use super::tree::Tree;
use crate::shell::{self, Scratch};

/// Manual pages and completions that a program prints. The program must run on this computer.
pub(super) struct Pages {
    /// Manual pages by their file names, such as `jtc-serve.1`.
    pub manual: Vec<(String, Vec<u8>)>,
    bash: Vec<u8>,
    zsh: Vec<u8>,
    fish: Vec<u8>,
}

impl Pages {
    /// Returns the pages of the program with this name in `folder`.
    pub(super) fn of(folder: &Path, name: &str) -> Result<Self> {
        let program = folder.join(name);
        // The code removes the environment variables of `jtc` and `ucom`, because options that the user has set must
        // not become part of the packages.
        let ask = || {
            let mut ask = shell::command(&program);
            ask.env_clear();
            ask
        };
        let scratch = Scratch::new(&format!("pages-{name}"))?;
        shell::read(ask().args(["man", "--out"]).arg(scratch.path()))?;
        let mut manual = Vec::new();
        for entry in std::fs::read_dir(scratch.path())? {
            let path = entry?.path();
            let page = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            manual.push((page, std::fs::read(&path).with_context(|| path.display().to_string())?));
        }
        manual.sort();
        ensure!(manual.iter().any(|(page, _)| *page == format!("{name}.1")), "{name} has no manual page");
        let completions = |shell: &str| -> Result<Vec<u8>> {
            let text = shell::read(ask().args(["completions", shell]))?;
            ensure!(text.contains(name), "{name} prints no completions for {shell}");
            Ok(text.into_bytes())
        };
        Ok(Self { manual, bash: completions("bash")?, zsh: completions("zsh")?, fish: completions("fish")? })
    }

    /// Installs the manual pages and completions at the paths that Debian uses.
    pub(super) fn install(&self, name: &str, tree: &mut Tree) -> Result<()> {
        for (page, text) in &self.manual {
            tree.put(format!("usr/share/man/man1/{page}.gz"), super::tree::gzip(text)?);
        }
        tree.put(format!("usr/share/bash-completion/completions/{name}"), &*self.bash);
        tree.put(format!("usr/share/zsh/vendor-completions/_{name}"), &*self.zsh);
        tree.put(format!("usr/share/fish/vendor_completions.d/{name}.fish"), &*self.fish);
        Ok(())
    }

    /// Adds the manual pages and completions at the paths that the archives use.
    pub(super) fn unpacked(&self, name: &str, tree: &mut Tree) {
        for (page, text) in &self.manual {
            tree.put(format!("man/man1/{page}"), &**text);
        }
        tree.put(format!("completions/{name}.bash"), &*self.bash);
        tree.put(format!("completions/_{name}"), &*self.zsh);
        tree.put(format!("completions/{name}.fish"), &*self.fish);
    }
}
