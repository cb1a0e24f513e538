//! `dynocar watch` with a real daemon, in a real terminal by tmux.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use dynocar_client::SamplePublisher;
use dynocar_shared::{SampleField, TrainId, TrainSample};
use dynocar_tests::process::{DaemonSite, Process, Terminal, Tie, await_true};
use dynocar_transport::peer::RoleLock;
use dynocar_transport::{Announcement, Role, monotonic_now_ns};
use rustix::process::Signal;

#[path = "../../client/tests/support/mod.rs"]
mod support;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const WATCH: &str = env!("CARGO_BIN_EXE_dynocar-watch-under-test");
const PIPELINES: &str = "[[pipelines]]\nkind = \"trajectory_kalman\"\n\
                         [[pipelines]]\nkind = \"mass_kalman\"\n\
                         [[pipelines]]\nkind = \"residual_monitor\"\n";
const TRAIN: TrainId = TrainId(1);

fn config(site: &DaemonSite) -> PathBuf {
    site.write_config(1, "", PIPELINES)
}

fn daemon(site: &DaemonSite) -> Process {
    let daemon = site.start(DYNOCAR, &["run", "--config", config(site).to_str().unwrap()]);
    daemon.await_error("serving");
    daemon
}

/// A controller that sends a coasting train's samples until it is dropped.
struct Controller {
    must_end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Controller {
    fn of(site: &DaemonSite) -> Controller {
        let host = site.host();
        let must_end = Arc::new(AtomicBool::new(false));
        let is_ended = Arc::clone(&must_end);
        let thread = std::thread::spawn(move || {
            let mut publisher = SamplePublisher::open(&host, TRAIN).unwrap();
            let mut speed_mps = 30.0;
            while !is_ended.load(Ordering::Relaxed) {
                let mut sample = TrainSample::empty(TRAIN)
                    .with(SampleField::Speed, speed_mps)
                    .with(SampleField::TractionForce, 0.0)
                    .with(SampleField::BrakeForce, 0.0)
                    .with(SampleField::Gradient, 0.0);
                sample.time_ns = monotonic_now_ns();
                publisher.publish(&mut sample).unwrap();
                speed_mps -= 0.02 * 0.06;
                std::thread::sleep(Duration::from_millis(20));
            }
        });
        Controller { must_end, thread: Some(thread) }
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        self.must_end.store(true, Ordering::Relaxed);
        // A controller that failed has said so already.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

#[test]
fn lines_list_a_daemon_that_comes_goes_and_is_back_and_a_signal_ends_them() {
    let site = DaemonSite::new();
    let config = config(&site);
    let mut watch = site.start(WATCH, &["--config", config.to_str().unwrap()]);
    let await_words = |words: &str| watch.await_line(words, |line| line.contains(words));
    await_words("train 1: no daemon serves it; waiting");
    let first = daemon(&site);
    let controller = Controller::of(&site);
    await_words("train 1: daemon");
    let line =
        watch.await_line("an estimate", |line| line.contains("mass ") && line.contains("/s, used"));
    assert!(line.contains("resistance") && line.contains("suspect none"), "{line}");
    first.kill();
    let line = await_words("the daemon is gone; what it said last is shown");
    assert!(line.contains("resistance unavailable (daemon_silent)"), "{line}");
    let _second = daemon(&site);
    watch.await_line("the new daemon", |line| {
        line.contains("train 1: daemon") && !line.contains("daemon_silent")
    });
    drop(controller);
    assert_eq!(watch.end(Signal::TERM).code(), Some(0));
    assert_eq!(watch.errors(), "");
}

#[test]
fn an_incompatible_daemon_is_named_and_waited_out() {
    let site = DaemonSite::new();
    let lock = RoleLock::claim(&site.host(), TRAIN, Role::Daemon).unwrap();
    let path = std::fs::read_dir(site.host().trains_directory()).unwrap();
    let path = path
        .flatten()
        .map(|entry| entry.path())
        .find(|path| std::fs::read_to_string(path).is_ok_and(|text| text.contains("role=daemon")));
    let path = path.expect("the announcement");
    let text = std::fs::read_to_string(&path).unwrap();
    let schema = Announcement::of_this_process(Role::Daemon).schema;
    std::fs::write(&path, text.replace(&format!("schema={schema}"), "schema=99")).unwrap();
    let watch = site.start(WATCH, &["--plain"]);
    let line = watch.await_line("the other schema", |line| line.contains("schema 99"));
    assert!(line.contains("the daemon is incompatible"), "{line}");
    drop(lock);
    let _daemon = daemon(&site);
    watch.await_line("a daemon that fits", |line| line.contains("resistance"));
}

#[test]
fn wrong_words_are_refused_with_what_was_expected() {
    let site = DaemonSite::new();
    let config = config(&site);
    let config = config.to_str().unwrap();
    for (arguments, words) in [
        (&["--config", config, "--train", "7"][..], "--train 7: the configuration has train 1"),
        (&["--config", "/nowhere.toml"], "/nowhere.toml"),
        (&["--train", "one"], "invalid value 'one'"),
        (&["--colour"], "unexpected argument"),
    ] {
        let mut watch = site.start(WATCH, arguments);
        assert_eq!(watch.wait().code(), Some(2), "{arguments:?}: {}", watch.errors());
        assert!(watch.errors().contains(words), "{arguments:?}: {}", watch.errors());
    }
}

#[test]
fn a_reader_of_lines_that_goes_away_ends_them_quietly() {
    let site = DaemonSite::new();
    let script = format!("{WATCH} --plain | head -n 1; echo ended ${{PIPESTATUS[0]}}");
    let mut shell = site.start("bash", &["-c", &script]);
    assert!(shell.wait().success());
    assert!(shell.output().contains("no daemon serves any train under"), "{}", shell.output());
    assert!(shell.output().contains("ended 0"), "{}", shell.output());
    assert_eq!(shell.errors(), "");
}

/// A shell in a real terminal.
struct Screen {
    socket: PathBuf,
}

impl Screen {
    fn open(site: &DaemonSite, width: u16, height: u16) -> Screen {
        support::require("tmux", "tmux");
        let screen = Screen { socket: site.path().join("tmux") };
        let size = [width.to_string(), height.to_string()];
        let shell = format!(
            "env -u TMUX LC_ALL=C.UTF-8 PS1='$ ' DYNOCAR_ROOT={} sh",
            site.host().root().display()
        );
        let opened = screen.tmux(&[
            "-f",
            "/dev/null",
            "new-session",
            "-d",
            "-x",
            &size[0],
            "-y",
            &size[1],
            &shell,
        ]);
        assert!(opened.status.success(), "{}", String::from_utf8_lossy(&opened.stderr));
        screen
    }

    fn tmux(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new("tmux");
        command.env("LC_ALL", "C.UTF-8").arg("-S").arg(&self.socket).args(arguments);
        command.output().expect("tmux")
    }

    fn keys(&self, keys: &[&str]) {
        assert!(self.tmux(&[&["send-keys"], keys].concat()).status.success());
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(&self.tmux(&["capture-pane", "-p"]).stdout).into_owned()
    }

    /// Waits until all these words are on the screen.
    fn shows(&self, words: &[&str]) -> String {
        let is_there = || words.iter().all(|it| self.text().contains(it));
        await_true(is_there, || format!("{words:?} on the screen:\n{}", self.text()));
        self.text()
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.tmux(&["kill-server"]);
    }
}

/// `dynocar` and `dynocar-watch` side by side, as they are installed.
fn installed(site: &DaemonSite) -> PathBuf {
    for (program, name) in [(DYNOCAR, "dynocar"), (WATCH, "dynocar-watch")] {
        std::fs::copy(Path::new(program), site.path().join(name)).unwrap();
    }
    site.path().join("dynocar")
}

#[test]
fn in_a_terminal_it_shows_all_resizes_and_leaves_the_terminal_as_it_was() {
    let site = DaemonSite::new();
    let dynocar = installed(&site);
    let config = config(&site);
    let _daemon = daemon(&site);
    let _controller = Controller::of(&site);
    let screen = Screen::open(&site, 80, 24);
    let command = format!("{} watch --config {}", dynocar.display(), config.display());
    screen.keys(&["echo written before", "Enter"]);
    screen.keys(&[&format!("{command}; echo ended $?"), "Enter"]);
    let small = screen.shows(&["test train", "samples/s", "mass", "what to drive next", "q quit"]);
    assert!(small.lines().all(|line| line.chars().count() <= 80), "{small}");
    assert!(!small.contains("written before"), "a screen of its own: {small}");
    screen.keys(&["?"]);
    screen.shows(&["Tab, Shift-Tab"]);
    screen.keys(&["Right"]);
    screen.shows(&["2 residual_monitor"]);
    screen.keys(&["Left"]);
    assert!(screen.tmux(&["resize-window", "-x", "160", "-y", "50"]).status.success());
    screen.shows(&["unexplained force in kN", "evidence for the suspect"]);
    screen.keys(&["q"]);
    let left = screen.shows(&["ended 0"]);
    assert!(left.contains("written before"), "what was there is back: {left}");
    assert!(!left.contains("what to drive next"), "{left}");
    // Typed letters show again, and a line is a line.
    screen.keys(&["echo typed", "Enter"]);
    await_true(|| screen.text().matches("typed").count() == 2, || screen.text());
}

#[test]
fn signals_and_control_c_leave_the_terminal_as_it_was() {
    let site = DaemonSite::new();
    let screen = Screen::open(&site, 100, 30);
    for (index, end) in ["C-c", "TERM", "HUP"].into_iter().enumerate() {
        let file = site.path().join(format!("pid{index}"));
        let command =
            format!("sh -c 'echo $$ > {}; exec {WATCH}'; echo ended {index} $?", file.display());
        screen.keys(&[&command, "Enter"]);
        screen.shows(&["No daemon serves any train"]);
        match end {
            "C-c" => screen.keys(&["C-c"]),
            signal => {
                let pid = std::fs::read_to_string(&file).unwrap();
                let killed = Command::new("kill").args(["-s", signal, pid.trim()]).status();
                assert!(killed.unwrap().success());
            }
        }
        screen.shows(&[&format!("ended {index} 0")]);
    }
    screen.keys(&["echo typed", "Enter"]);
    await_true(|| screen.text().matches("typed").count() == 2, || screen.text());
}

#[test]
fn a_terminal_that_cannot_draw_gets_plain_lines_in_its_letters() {
    let site = DaemonSite::new();
    let _daemon = daemon(&site);
    for (term, locale) in [("dumb", "C.UTF-8"), ("xterm", "C"), ("", "C.UTF-8")] {
        let mut terminal = Terminal::open();
        let mut command = site.command(WATCH, &[]);
        command.env("TERM", term).env("LC_ALL", locale);
        let mut watch = terminal.start(command, Tie::Leader);
        terminal.see("train 1: daemon");
        assert_eq!(watch.end(Signal::TERM).code(), Some(0));
        let shown = terminal.text();
        assert!(!shown.contains('\x1b') && (locale != "C" || shown.is_ascii()), "{shown:?}");
    }
}
