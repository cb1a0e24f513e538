//! A terminal that a program runs on, and that can be closed under it.

use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};

use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Action, Winsize, tcflow, tcsetwinsize};

use super::{Process, await_true};

/// Relation of a program to its terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tie {
    /// It leads the terminal's session: a closed terminal sends it SIGHUP.
    Leader,
    /// It leads the session and ignores SIGHUP, as `nohup` starts programs.
    Deaf,
    /// It writes on a terminal of another session: a closed terminal sends it no signal.
    Guest,
}

/// A user's end of a terminal, and the program's.
pub struct Terminal {
    near: File,
    far: OwnedFd,
    shown: Vec<u8>,
    /// Length of the shown text that was already searched.
    seen: usize,
}

impl Default for Terminal {
    fn default() -> Self {
        Terminal::open()
    }
}

impl Terminal {
    /// Returns a new terminal of 80 times 24 characters.
    ///
    /// # Panics
    ///
    /// When the system gives none.
    pub fn open() -> Self {
        let near = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)
            .expect("a terminal");
        grantpt(&near).and_then(|()| unlockpt(&near)).expect("a terminal for us");
        let name = ptsname(&near, Vec::new()).expect("the terminal's name");
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let far = rustix::fs::open(name, flags, Mode::empty()).expect("the terminal's other end");
        let size = Winsize { ws_row: 24, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(&far, size).expect("a size");
        rustix::fs::fcntl_setfl(&near, OFlags::NONBLOCK).expect("reading without waiting");
        Terminal { near: near.into(), far, shown: Vec::new(), seen: 0 }
    }

    /// Starts a program on it, with all three streams; a terminal that draws, unless the command says otherwise.
    ///
    /// # Panics
    ///
    /// When it cannot be started.
    pub fn start(&self, mut command: Command, tie: Tie) -> Process {
        let stream = || Stdio::from(self.far.as_fd().try_clone_to_owned().expect("a handle"));
        command.stdin(stream()).stdout(stream()).stderr(stream());
        for (name, value) in [("TERM", "xterm"), ("LC_ALL", "C.UTF-8")] {
            if !command.get_envs().any(|it| it.0 == name) {
                command.env(name, value);
            }
        }
        // SAFETY: between fork and exec only system calls are made.
        unsafe { command.pre_exec(move || bind(tie)) };
        Process::from_command(command)
    }

    /// Returns the text shown so far.
    pub fn text(&mut self) -> String {
        let mut bytes = [0; 4096];
        loop {
            match self.near.read(&mut bytes) {
                Ok(count @ 1..) => self.shown.extend(&bytes[..count]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                // Nothing more for now.
                _ => return String::from_utf8_lossy(&self.shown).into_owned(),
            }
        }
    }

    /// Waits until this text is shown, after the text of the previous call.
    ///
    /// # Panics
    ///
    /// After [`super::WATCHDOG`], with the shown text.
    pub fn see(&mut self, words: &str) {
        let (mut shown, seen) = (String::new(), self.seen);
        let mut place = None;
        await_true(
            || {
                shown = self.text();
                place = shown[seen..].find(words);
                place.is_some()
            },
            || format!("{words:?} on the terminal"),
        );
        self.seen += place.unwrap_or_default() + words.len();
    }

    /// Takes nothing more, as a terminal at the other end of a connection that hangs: who writes waits.
    ///
    /// # Panics
    ///
    /// When the system does not let us.
    pub fn halt(&self) {
        tcflow(&self.far, Action::OOff).expect("a terminal that can be halted");
    }

    /// Types.
    ///
    /// # Panics
    ///
    /// When the terminal takes no more.
    pub fn press(&mut self, keys: &str) {
        self.near.write_all(keys.as_bytes()).expect("a terminal that takes keys");
    }
}

/// Gives a program that is about to start its place on the terminal that is its standard input.
fn bind(tie: Tie) -> std::io::Result<()> {
    let action = if tie == Tie::Deaf { libc::SIG_IGN } else { libc::SIG_DFL };
    // SAFETY: no handler of ours is in the way; the tests may themselves run under `nohup`.
    if unsafe { libc::signal(libc::SIGHUP, action) } == libc::SIG_ERR {
        return Err(std::io::Error::last_os_error());
    }
    rustix::process::setsid()?;
    if tie != Tie::Guest {
        rustix::process::ioctl_tiocsctty(rustix::stdio::stdin())?;
    }
    Ok(())
}
