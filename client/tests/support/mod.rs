//! Shared support of the tests of the C interface: the libraries just built, the C compiler, a daemon played by the
//! test, and child processes that never outlive it.

#![allow(dead_code, reason = "each test uses its own part")]

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver as Lines, RecvTimeoutError, channel};
use std::time::Duration;

use dynocar_shared::snapshot::packed_index;
use dynocar_shared::{
    Parameter, ParameterSnapshot, PipelineKind, Quantity, RejectionReason, Status, TrainId,
    TrainSample,
};
use dynocar_transport::channel::{Receiver, SampleCount, Sender, Transport};
use dynocar_transport::peer::RoleLock;
use dynocar_transport::{Host, Role, monotonic_now_ns};

pub const TRAIN: TrainId = TrainId(11);
/// Index of the played daemon's only pipeline in its configuration.
pub const PIPELINE_INDEX: u32 = 3;
/// A child without output for this time has failed.
const PATIENCE: Duration = Duration::from_secs(120);

/// The client's folder, from its own tests and from those of its siblings.
pub fn client_directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../client")
}

/// The folder in which cargo put this test and, with the same build, the libraries.
pub fn library_directory() -> PathBuf {
    std::env::current_exe().unwrap().parent().unwrap().to_path_buf()
}

#[derive(Clone, Copy, Debug)]
pub enum Link {
    Static,
    Shared,
}

/// A call of a compiler with every warning an error, for the header's folder.
pub fn compiler(variable: &str, default: &str, standard: &str) -> Command {
    let program = std::env::var(variable).unwrap_or_else(|_| default.into());
    let mut command = Command::new(program);
    command.arg(format!("-std={standard}"));
    command.args(["-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"]);
    command.arg("-I").arg(client_directory().join("include"));
    command
}

/// [`compiler`] for C++.
pub fn cpp_compiler(standard: &str) -> Command {
    require("c++", "g++");
    compiler("CXX", "c++", standard)
}

/// Compiles and links a program as C++ into `out`.
pub fn build_cpp(source: &Path, standard: &str, out: &Path) {
    let mut command = cpp_compiler(standard);
    command.args(["-x", "c++"]).arg(source).args(["-x", "none", "-o"]).arg(out);
    command.arg(library_directory().join("libdynocar_client.a"));
    must_succeed(command.args(["-lpthread", "-ldl", "-lm"]));
}

/// Compiles and links a C program into `out`.
pub fn build_c(source: &Path, standard: &str, link: Link, out: &Path) {
    build_c_with(source, standard, link, out, &[]);
}

/// [`build_c`] with further options.
pub fn build_c_with(source: &Path, standard: &str, link: Link, out: &Path, options: &[&str]) {
    let mut command = compiler("CC", "cc", standard);
    command.args(options).arg(source).arg("-o").arg(out);
    let libraries = library_directory();
    match link {
        Link::Static => {
            command.arg(libraries.join("libdynocar_client.a"));
            command.args(["-lpthread", "-ldl", "-lm"]);
        }
        Link::Shared => {
            command.arg("-L").arg(&libraries).arg("-ldynocar_client");
            // Cargo's search path has the folder of an earlier build, too; this one goes before it.
            command.arg(format!("-Wl,--disable-new-dtags,-rpath,{}", libraries.display()));
        }
    }
    must_succeed(&mut command);
}

/// Runs a command to its end and gives its standard output.
pub fn must_succeed(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {}\n{words}", output.status);
    String::from_utf8(output.stdout).unwrap()
}

/// Sees to a program: installs Debian's or Ubuntu's package where there is none, or fails.
pub fn require(program: &str, package: &str) {
    let is_there =
        Command::new(program).arg("--version").output().is_ok_and(|it| it.status.success());
    if !is_there {
        let script = client_directory().join("../tests/install_tool.sh");
        must_succeed(Command::new(script).args([package, program]));
    }
}

/// A root of its own; takes the shared memory away that killed processes left under it.
pub struct TestRoot {
    directory: tempfile::TempDir,
    pub host: Host,
}

impl TestRoot {
    pub fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        let host = Host::at(directory.path()).unwrap();
        TestRoot { directory, host }
    }

    pub fn path(&self) -> &Path {
        self.directory.path()
    }
}

impl Drop for TestRoot {
    fn drop(&mut self) {
        let prefix = self.host.segment_prefix();
        // Files that cannot be removed stay behind; no test depends on them.
        for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&prefix) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
        let _ = std::fs::remove_dir_all(self.host.transport_directory());
    }
}

/// A daemon with one pipeline, played by this process.
pub struct PlayedDaemon {
    receiver: Receiver<TrainSample>,
    sender: Sender<ParameterSnapshot>,
    count: SampleCount,
    _role: RoleLock,
    // Last, so that it goes after all that uses it.
    root: TestRoot,
}

impl PlayedDaemon {
    pub fn start() -> Self {
        let root = TestRoot::new();
        let role = RoleLock::claim(&root.host, TRAIN, Role::Daemon).unwrap();
        let transport = Transport::open(&root.host, "played-daemon").unwrap();
        let receiver = transport.receiver(TRAIN).unwrap();
        let sender = transport.sender(TRAIN).unwrap();
        let count = SampleCount::open(&root.host, TRAIN).unwrap();
        count.serve(1, 1);
        PlayedDaemon { receiver, sender, count, _role: role, root }
    }

    pub fn root(&self) -> &Path {
        self.root.path()
    }

    pub fn host(&self) -> &Host {
        &self.root.host
    }

    pub fn next_sample(&self) -> Option<TrainSample> {
        let sample = self.receiver.receive()?;
        self.count.note_taken(0, sample.sequence);
        Some(sample)
    }

    pub fn answer(&self, sample: &TrainSample) {
        self.sender.send(&snapshot_for(sample)).unwrap();
    }
}

/// The played daemon's answer to a sample: parameters out of order, every covariance its own.
pub fn snapshot_for(sample: &TrainSample) -> ParameterSnapshot {
    let mut snapshot = ParameterSnapshot::empty();
    (snapshot.epoch, snapshot.sequence, snapshot.train_id) = (1, sample.sequence, TRAIN.0);
    snapshot.pipeline_index = PIPELINE_INDEX;
    snapshot.pipeline_kind = PipelineKind::ResistanceKalman as u32;
    snapshot.status = Status::Estimated as u32;
    snapshot.reason = 0;
    snapshot.quantities = Quantity::Resistance.bit() | Quantity::BrakingRatio.bit();
    snapshot.train_quantities = snapshot.quantities;
    snapshot.usable_quantities = snapshot.quantities;
    snapshot.sample_sequence = sample.sequence;
    snapshot.published_ns = monotonic_now_ns();
    snapshot.vouched_ns = snapshot.published_ns;
    snapshot.samples_rejected = 4;
    snapshot.rejected_by_reason[RejectionReason::WheelSlide as usize] = 4;
    snapshot.missing_manoeuvres = 0b1001;
    let parameters = [Parameter::Mass, Parameter::DavisC, Parameter::DavisA, Parameter::DavisB];
    snapshot.parameter_count = parameters.len() as u32;
    for (index, parameter) in parameters.into_iter().enumerate() {
        snapshot.parameters[index] = parameter as u32;
        snapshot.values[index] = [114.5, 0.0013, 1.7, 0.021][index];
        for other in 0..=index {
            let entry = if index == other { 0.25 } else { 0.01 };
            snapshot.covariance[packed_index(index, other)] = entry / (1 + index + other) as f64;
        }
    }
    (snapshot.speed_min_mps, snapshot.speed_max_mps) = (5.0, 30.0);
    snapshot
}

/// A child process whose lines are read as they come; killed when dropped.
pub struct Program {
    child: Child,
    lines: Lines<String>,
}

impl Program {
    pub fn start(command: &mut Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Program { child, lines }
    }

    /// The next line; `meanwhile` runs until it comes. `None` when the program has ended.
    pub fn next_line(&self, mut meanwhile: impl FnMut()) -> Option<String> {
        let start = std::time::Instant::now();
        loop {
            meanwhile();
            match self.lines.recv_timeout(Duration::from_micros(500)) {
                Ok(line) => return Some(line),
                Err(RecvTimeoutError::Disconnected) => return None,
                Err(RecvTimeoutError::Timeout) => {
                    assert!(start.elapsed() < PATIENCE, "the program says nothing");
                }
            }
        }
    }

    /// Waits for the end, which must be a good one.
    pub fn finish(mut self) {
        let status = self.child.wait().unwrap();
        assert!(status.success(), "{status}");
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // Both fail only when the child is gone already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
