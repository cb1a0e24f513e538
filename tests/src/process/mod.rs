//! Real processes with a run-time directory of their own.

mod site;
mod terminal;

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use dynocar::runtime::system::ends_with_this;
use rustix::process::{Pid, Signal, kill_process};

pub use site::{DaemonSite, hosts_in, remove_segments, segments_of};
pub use terminal::{Terminal, Tie};

/// Time that a test waits for an expected event before it reports a hang.
pub const WATCHDOG: Duration = Duration::from_secs(30);

/// A running program; killed when dropped.
pub struct Process {
    child: Child,
    lines: Arc<Mutex<Vec<String>>>,
    errors: PathBuf,
}

impl Process {
    /// Starts a program whose standard error goes into a file.
    fn start(mut command: Command, errors: PathBuf) -> Process {
        let mut child = ends_with_this(&mut command)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(File::create(&errors).expect("a file for standard error"))
            .spawn()
            .expect("the program to start");
        let lines = Arc::new(Mutex::new(Vec::new()));
        let output = child.stdout.take().expect("piped standard output");
        let sink = Arc::clone(&lines);
        std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                sink.lock().expect("no panic while holding the lines").push(line);
            }
        });
        Process { child, lines, errors }
    }

    /// Starts a program whose streams go elsewhere.
    fn from_command(mut command: Command) -> Process {
        let child = ends_with_this(&mut command).spawn().expect("the program to start");
        Process { child, lines: Arc::default(), errors: PathBuf::new() }
    }

    /// Returns its process number.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends a signal.
    ///
    /// # Panics
    ///
    /// When the process is gone.
    pub fn signal(&self, signal: Signal) {
        let pid = Pid::from_raw(self.child.id() as i32).expect("a process id");
        kill_process(pid, signal).expect("the process to be there");
    }

    /// Kills it as `kill -9` does, and waits for its end.
    ///
    /// # Panics
    ///
    /// When the process is gone.
    pub fn kill(mut self) {
        self.signal(Signal::KILL);
        self.child.wait().expect("an exit status");
    }

    /// Sends a signal that ends it, and waits for its end.
    ///
    /// # Panics
    ///
    /// When the process is gone, or after [`WATCHDOG`].
    pub fn end(&mut self, signal: Signal) -> ExitStatus {
        self.signal(signal);
        self.wait()
    }

    /// Stops it as `kill -STOP` does, and waits until all of it stands still.
    ///
    /// # Panics
    ///
    /// When the process is gone, or after [`WATCHDOG`].
    pub fn stop(&self) {
        self.signal(Signal::STOP);
        let tasks = format!("/proc/{}/task", self.id());
        // "pid (name) state": the name may hold anything, so that the last parenthesis counts.
        let is_stopped =
            |stat: String| stat.rsplit(") ").next().is_some_and(|it| it.starts_with('T'));
        let all_stopped = || {
            std::fs::read_dir(&tasks)
                .expect("its threads")
                .flatten()
                .all(|task| std::fs::read_to_string(task.path().join("stat")).is_ok_and(is_stopped))
        };
        await_true(all_stopped, || format!("process {} to stop", self.id()));
    }

    /// Waits for its end.
    ///
    /// # Panics
    ///
    /// After [`WATCHDOG`].
    pub fn wait(&mut self) -> ExitStatus {
        let start = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().expect("an exit status") {
                return status;
            }
            assert!(start.elapsed() < WATCHDOG, "still running; it said:\n{}", self.errors());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Returns its exit status, if it has ended.
    ///
    /// # Panics
    ///
    /// When the system does not say.
    pub fn try_wait(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().expect("an exit status")
    }

    /// Returns everything that a program which has ended wrote to standard output.
    ///
    /// # Panics
    ///
    /// After [`WATCHDOG`], when somebody else keeps the output open.
    pub fn output(&self) -> String {
        await_true(|| Arc::strong_count(&self.lines) == 1, || "the end of the output".into());
        self.lines().join("\n")
    }

    /// Returns its standard output so far.
    ///
    /// # Panics
    ///
    /// When the thread that collects it has panicked.
    pub fn lines(&self) -> Vec<String> {
        self.lines.lock().expect("no panic while holding the lines").clone()
    }

    /// Returns its newest line of standard output.
    ///
    /// # Panics
    ///
    /// When the thread that collects it has panicked.
    pub fn last_line(&self) -> Option<String> {
        self.lines.lock().expect("no panic while holding the lines").last().cloned()
    }

    /// Returns its standard output from a line on.
    ///
    /// # Panics
    ///
    /// When the thread that collects it has panicked.
    pub fn lines_from(&self, first: usize) -> Vec<String> {
        self.lines.lock().expect("no panic while holding the lines")[first..].to_vec()
    }

    /// Returns its standard error so far.
    pub fn errors(&self) -> String {
        std::fs::read_to_string(&self.errors).unwrap_or_default()
    }

    /// Waits until its newest line of standard output satisfies a condition, and gives it.
    ///
    /// # Panics
    ///
    /// After [`WATCHDOG`], with its standard error.
    pub fn await_line(&self, what: &str, condition: impl Fn(&str) -> bool) -> String {
        let mut newest = String::new();
        await_true(
            || {
                newest = self.last_line().unwrap_or_default();
                condition(&newest)
            },
            || format!("{what}; standard error:\n{}", self.errors()),
        );
        newest
    }

    /// Waits until its standard error contains a text.
    ///
    /// # Panics
    ///
    /// After [`WATCHDOG`], with its standard error.
    pub fn await_error(&self, text: &str) {
        await_true(
            || self.errors().contains(text),
            || format!("{text:?} in standard error:\n{}", self.errors()),
        );
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // A process that has ended by itself is as good as a killed one.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Waits until a condition holds.
///
/// # Panics
///
/// After [`WATCHDOG`], with the awaited condition.
pub fn await_true(mut condition: impl FnMut() -> bool, what: impl Fn() -> String) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < WATCHDOG, "waited in vain for {}", what());
        std::thread::sleep(Duration::from_millis(2));
    }
}
