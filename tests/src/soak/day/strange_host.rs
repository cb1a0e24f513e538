//! A wall clock that jumps and a disk that fills, for one program.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::process::Command;

/// Code that the program under test loads before the C library.
const SOURCE: &str = include_str!("strange_host.c");

/// Clock and disk of one program that can be disturbed; other programs keep the real ones.
pub struct StrangeHost {
    control: File,
    variables: [(&'static str, String); 3],
}

impl StrangeHost {
    /// Returns a host without disturbances, with files of its own in `site`; its disk is that of `folder`.
    ///
    /// # Panics
    ///
    /// When the library cannot be compiled or the files cannot be written.
    pub fn new(site: &Path, folder: &Path) -> Self {
        let (source, library) = (site.join("strange_host.c"), site.join("strange_host.so"));
        std::fs::write(&source, SOURCE).expect("a source file");
        let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
        let mut command = Command::new(compiler);
        command.args(["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o"]);
        let status = command.arg(&library).arg(&source).arg("-ldl").status().expect("a C compiler");
        assert!(status.success(), "the strange host does not compile");
        let path = site.join("strange_host");
        let control = File::create(&path).expect("a file that says how strange the host is");
        let folder = folder.canonicalize().expect("a folder");
        let text = |path: &Path| path.to_str().expect("a UTF-8 path").to_owned();
        let host = StrangeHost {
            control,
            variables: [
                ("LD_PRELOAD", text(&library)),
                ("STRANGE_HOST", text(&path)),
                ("STRANGE_FOLDER", text(&folder)),
            ],
        };
        host.set_clock_ahead(0);
        host.set_free(None);
        host
    }

    /// Returns the environment in which the program is to be started.
    pub fn variables(&self) -> [(&str, &str); 3] {
        self.variables.each_ref().map(|(name, value)| (*name, value.as_str()))
    }

    /// Sets the wall clock ahead by this many seconds of the true one, or back.
    pub fn set_clock_ahead(&self, seconds: i64) {
        self.set(0, seconds);
    }

    /// Leaves this many bytes free in the folder; `None` for no limit.
    pub fn set_free(&self, bytes: Option<i64>) {
        self.set(1, bytes.unwrap_or(-1));
    }

    fn set(&self, index: u64, value: i64) {
        self.control.write_all_at(&value.to_ne_bytes(), 8 * index).expect("the host's file");
    }
}
