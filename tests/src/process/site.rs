//! A separate run-time directory for the processes of one test.

use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use dynocar_shared::services::ROOT_VARIABLE;
use dynocar_transport::Host;
use tempfile::TempDir;

use super::Process;

/// A run-time directory with a configuration of its own; processes of different sites never meet.
pub struct DaemonSite {
    directory: TempDir,
}

impl Default for DaemonSite {
    fn default() -> Self {
        DaemonSite::new()
    }
}

impl DaemonSite {
    /// Returns a new, empty site.
    ///
    /// # Panics
    ///
    /// When no temporary directory can be made.
    pub fn new() -> Self {
        DaemonSite { directory: TempDir::new().expect("a temporary directory") }
    }

    /// Returns the site's folder for files.
    pub fn path(&self) -> &Path {
        self.directory.path()
    }

    /// Returns the site's run-time directory.
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

    /// Starts a program on this site that a Ctrl-C in the terminal does not reach.
    ///
    /// # Panics
    ///
    /// When it cannot be started.
    pub fn start_apart(&self, program: &str, arguments: &[&str]) -> Process {
        let mut command = self.command(program, arguments);
        command.process_group(0);
        self.start_command(command)
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

    /// Starts a program that may neither lock memory nor take a real-time priority, even if root runs the test.
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

    /// Returns a program on this site that is not started yet.
    pub fn command(&self, program: &str, arguments: &[&str]) -> Command {
        let mut command = Command::new(program);
        // A place of its own for each process: no daemon starts from another one's states unless a test says so.
        let states = self.path().join(format!("states-{}", unique_number()));
        command.args(arguments).env(ROOT_VARIABLE, self.root());
        command.env("XDG_STATE_HOME", states).env_remove("STATE_DIRECTORY");
        command
    }

    /// Starts a program on this site whose standard input is empty and whose other streams these are.
    ///
    /// # Panics
    ///
    /// When it cannot be started.
    pub fn start_into(
        &self,
        program: &str,
        arguments: &[&str],
        [output, errors]: [Stdio; 2],
    ) -> Process {
        let mut command = self.command(program, arguments);
        command.stdin(Stdio::null()).stdout(output).stderr(errors);
        Process::from_command(command)
    }

    fn start_command(&self, command: Command) -> Process {
        let errors = self.path().join(format!("stderr-{}", unique_number()));
        Process::start(command, errors)
    }

    /// Names of this site's shared-memory files.
    ///
    /// # Panics
    ///
    /// When `/dev/shm` cannot be read.
    pub fn segments(&self) -> Vec<String> {
        segments_of(&self.host())
    }
}

/// Returns the run-time directories that programs have made in a folder and in the folders of it.
///
/// # Panics
///
/// When one cannot be used.
pub fn hosts_in(folder: &Path) -> Vec<Host> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let of_entry = |path: PathBuf| match path.join("trains").is_dir() {
        true => vec![Host::at(&path).expect("a run-time directory")],
        false if path.is_dir() => hosts_in(&path),
        false => Vec::new(),
    };
    entries.flat_map(|entry| of_entry(entry.path())).collect()
}

impl Drop for DaemonSite {
    fn drop(&mut self) {
        remove_segments(&self.host());
    }
}

/// Returns the names of the shared-memory files of a run-time directory.
///
/// # Panics
///
/// When `/dev/shm` cannot be read.
pub fn segments_of(host: &Host) -> Vec<String> {
    let prefix = host.segment_prefix();
    std::fs::read_dir("/dev/shm")
        .expect("/dev/shm")
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.starts_with(&prefix))
        .collect()
}

/// Removes the shared-memory files of a run-time directory.
///
/// # Panics
///
/// When `/dev/shm` cannot be read.
pub fn remove_segments(host: &Host) {
    for name in segments_of(host) {
        // A file that another process removes first is gone as well.
        let _ = std::fs::remove_file(Path::new("/dev/shm").join(name));
    }
    let _ = std::fs::remove_dir_all(host.transport_directory());
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

/// Removes `CAP_IPC_LOCK` and `CAP_SYS_NICE` from the capabilities that a program can ever gain, and sets the limits
/// that allow the same to 0.
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
