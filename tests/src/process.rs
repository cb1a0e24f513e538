//! Real processes with a run-time directory of their own.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use dynocar_client::Host;
use dynocar_shared::services::ROOT_VARIABLE;
use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

/// How long a test waits for what must happen before it calls it a hang.
pub const WATCHDOG: Duration = Duration::from_secs(30);

/// A run-time directory with a configuration of its own; processes of different sites never meet.
pub struct Site {
    directory: TempDir,
}

impl Default for Site {
    fn default() -> Self {
        Site::new()
    }
}

impl Site {
    /// A new, empty site.
    ///
    /// # Panics
    ///
    /// When no temporary directory can be made.
    pub fn new() -> Self {
        Site { directory: TempDir::new().expect("a temporary directory") }
    }

    /// The site's folder for files.
    pub fn path(&self) -> &Path {
        self.directory.path()
    }

    /// The site's run-time directory.
    ///
    /// # Panics
    ///
    /// When it cannot be used.
    pub fn host(&self) -> Host {
        Host::at(&self.root()).expect("a run-time directory")
    }

    fn root(&self) -> PathBuf {
        self.path().join("root")
    }

    /// Writes a file and gives its path.
    ///
    /// # Panics
    ///
    /// When it cannot be written.
    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path().join(name);
        std::fs::write(&path, text).expect("a file to be written");
        path
    }

    /// Writes a small train file and a daemon configuration with these pipelines for trains 1
    /// to `trains`; gives the configuration's path.
    pub fn write_config(&self, trains: u64, daemon_lines: &str, pipelines: &str) -> PathBuf {
        self.write("train.toml", TRAIN);
        let mut text = format!("[daemon]\n{daemon_lines}\n");
        for id in 1..=trains {
            text += &format!("[[trains]]\nid = {id}\nfile = \"train.toml\"\n");
        }
        self.write("daemon.toml", &(text + pipelines))
    }

    /// Starts a program on this site.
    ///
    /// # Panics
    ///
    /// When it cannot be started.
    pub fn start(&self, program: &str, arguments: &[&str]) -> Process {
        self.start_with(program, arguments, &[])
    }

    /// Starts a program on this site with more environment variables.
    ///
    /// # Panics
    ///
    /// When it cannot be started.
    pub fn start_with(
        &self,
        program: &str,
        arguments: &[&str],
        variables: &[(&str, &str)],
    ) -> Process {
        let mut command = self.command(program, arguments);
        command.envs(variables.iter().copied());
        self.start_command(command)
    }

    /// Starts a program that may neither lock memory nor take a real-time priority, whoever runs
    /// the test.
    ///
    /// # Panics
    ///
    /// When it cannot be started.
    pub fn start_without_real_time(&self, program: &str, arguments: &[&str]) -> Process {
        let mut command = self.command(program, arguments);
        // SAFETY: between fork and exec only system calls are made.
        unsafe { command.pre_exec(drop_real_time_rights) };
        self.start_command(command)
    }

    fn command(&self, program: &str, arguments: &[&str]) -> Command {
        let mut command = Command::new(program);
        command.args(arguments).env(ROOT_VARIABLE, self.root());
        command
    }

    fn start_command(&self, mut command: Command) -> Process {
        let errors = self.path().join(format!("stderr-{}", unique_number()));
        let mut child = command
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

    /// Names of this site's shared-memory files.
    ///
    /// # Panics
    ///
    /// When `/dev/shm` cannot be read.
    pub fn segments(&self) -> Vec<String> {
        let prefix = self.host().segment_prefix();
        std::fs::read_dir("/dev/shm")
            .expect("/dev/shm")
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .filter(|name| name.starts_with(&prefix))
            .collect()
    }
}

impl Drop for Site {
    fn drop(&mut self) {
        for name in self.segments() {
            // A file that another process removes first is gone as well.
            let _ = std::fs::remove_file(Path::new("/dev/shm").join(name));
        }
    }
}

const TRAIN: &str = "[train]
name = \"test train\"
mass_t = 200.0
length_m = 120.0
cars = 6
rotating_mass_factor = 0.08

[resistance]
a = 1.9
b = 0.03
c = 0.0043
";

/// Takes `CAP_IPC_LOCK` and `CAP_SYS_NICE` out of what a program may ever have again, and sets the
/// limits that stand in for them to nothing.
fn drop_real_time_rights() -> std::io::Result<()> {
    use rustix::process::{Resource, Rlimit, setrlimit};
    use rustix::thread::{CapabilitySet, remove_capability_from_bounding_set};
    for capability in [CapabilitySet::IPC_LOCK, CapabilitySet::SYS_NICE] {
        match remove_capability_from_bounding_set(capability) {
            // Who has no privileges cannot give them up, and need not.
            Ok(()) | Err(rustix::io::Errno::PERM) => {}
            Err(error) => return Err(error.into()),
        }
    }
    for resource in [Resource::Memlock, Resource::Rtprio] {
        setrlimit(resource, Rlimit { current: Some(0), maximum: Some(0) })?;
    }
    Ok(())
}

fn unique_number() -> u64 {
    static NEXT: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(0);
    NEXT.fetch_add(1, std::sync::atomic::Ordering::Relaxed)
}

/// A running program; killed when dropped.
pub struct Process {
    child: Child,
    lines: Arc<Mutex<Vec<String>>>,
    errors: PathBuf,
}

impl Process {
    /// Its process number.
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

    /// Its exit status, if it has ended.
    ///
    /// # Panics
    ///
    /// When the system does not tell.
    pub fn try_wait(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().expect("an exit status")
    }

    /// Everything that a program which has ended wrote to standard output.
    ///
    /// # Panics
    ///
    /// After [`WATCHDOG`], when somebody else keeps the output open.
    pub fn output(&self) -> String {
        await_true(|| Arc::strong_count(&self.lines) == 1, || "the end of the output".into());
        self.lines().join("\n")
    }

    /// Its standard output so far.
    ///
    /// # Panics
    ///
    /// When the thread that collects it has panicked.
    pub fn lines(&self) -> Vec<String> {
        self.lines.lock().expect("no panic while holding the lines").clone()
    }

    /// Its newest line of standard output.
    ///
    /// # Panics
    ///
    /// When the thread that collects it has panicked.
    pub fn last_line(&self) -> Option<String> {
        self.lines.lock().expect("no panic while holding the lines").last().cloned()
    }

    /// Its standard output from a line on.
    ///
    /// # Panics
    ///
    /// When the thread that collects it has panicked.
    pub fn lines_from(&self, first: usize) -> Vec<String> {
        self.lines.lock().expect("no panic while holding the lines")[first..].to_vec()
    }

    /// Its standard error so far.
    pub fn errors(&self) -> String {
        std::fs::read_to_string(&self.errors).unwrap_or_default()
    }

    /// Waits until its newest line of standard output satisfies a condition, and gives it.
    ///
    /// # Panics
    ///
    /// After [`WATCHDOG`], with what it said.
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
    /// After [`WATCHDOG`], with what it said.
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
/// After [`WATCHDOG`], with what was waited for.
pub fn await_true(mut condition: impl FnMut() -> bool, what: impl Fn() -> String) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < WATCHDOG, "waited in vain for {}", what());
        std::thread::sleep(Duration::from_millis(2));
    }
}
