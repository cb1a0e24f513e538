//! A guide of `docs/guides`, and its commands as a reader types them.

use std::path::Path;
use std::process::{Command, Stdio};

use dynocar_tests::process::DaemonSite;

use crate::commands::DYNOCAR;

pub const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Returns the text of a guide.
pub fn guide(name: &str) -> String {
    std::fs::read_to_string(Path::new(ROOT).join("docs/guides").join(name)).expect("the guide")
}

/// Returns the lines of a guide's code blocks in a language.
pub fn blocks<'g>(guide: &'g str, language: &str) -> Vec<&'g str> {
    let mark = format!("```{language}\n");
    let blocks = guide.split(&mark).skip(1).filter_map(|rest| rest.split("```").next());
    blocks.flat_map(str::lines).collect()
}

/// Puts `dynocar` on the path of a site's commands.
pub fn install(site: &DaemonSite) {
    std::fs::create_dir(site.path().join("bin")).unwrap();
    std::os::unix::fs::symlink(DYNOCAR, site.path().join("bin/dynocar")).unwrap();
}

/// Runs a line that must succeed in the site's folder; returns its standard error.
pub fn run(site: &DaemonSite, line: &str) -> String {
    let path = std::env::var("PATH").unwrap_or_default();
    let output = Command::new("sh")
        .args(["-c", line])
        .current_dir(site.path())
        .env("PATH", format!("{}:{path}", site.path().join("bin").display()))
        .env("DYNOCAR_ROOT", site.host().root())
        .env("STATE_DIRECTORY", site.path().join("states"))
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{line}: {words}");
    assert!(!words.contains("panicked"), "{line}: {words}");
    words
}
