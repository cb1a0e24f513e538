//! What `dynocar init` asks of somebody at a terminal, which here is one of `script`'s.

use std::fs::read_to_string;
use std::io::{Read, Write};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use dynocar_tests::process::Site;

use crate::commands::{DYNOCAR, dynocar, run, said};

/// More than any machine needs.
const WATCHDOG: Duration = Duration::from_secs(120);

/// Somebody at a terminal.
struct Terminal {
    process: Child,
    keys: ChildStdin,
    shown: Arc<Mutex<Vec<u8>>>,
    reading: JoinHandle<()>,
    /// How much of what is shown has been read.
    seen: usize,
}

impl Terminal {
    fn start(site: &Site, arguments: &str) -> Self {
        let mut process = Command::new("script")
            .args(["-qefc", &format!("{DYNOCAR} {arguments}"), "/dev/null"])
            .current_dir(site.path())
            .env("TERM", "xterm")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("script, of util-linux");
        let (keys, mut screen) = (process.stdin.take().unwrap(), process.stdout.take().unwrap());
        let shown = Arc::new(Mutex::new(Vec::new()));
        let writing = Arc::clone(&shown);
        let reading = std::thread::spawn(move || {
            let mut bytes = [0; 1024];
            while let Ok(count @ 1..) = screen.read(&mut bytes) {
                writing.lock().unwrap().extend(&bytes[..count]);
            }
        });
        Terminal { process, keys, shown, reading, seen: 0 }
    }

    /// Waits until this is shown.
    fn see(&mut self, words: &str) {
        let begun = Instant::now();
        loop {
            let shown = text(&self.shown);
            if let Some(place) = shown[self.seen..].find(words) {
                self.seen += place + words.len();
                return;
            }
            assert!(begun.elapsed() < WATCHDOG, "{words:?} is not in {:?}", &shown[self.seen..]);
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Types.
    fn press(&mut self, keys: &str) {
        self.keys.write_all(keys.as_bytes()).unwrap();
        self.keys.flush().unwrap();
    }

    /// Answers a question.
    fn answer(&mut self, question: &str, answer: &str) {
        self.see(question);
        self.press(&format!("{answer}\r"));
    }

    fn end(mut self) -> (ExitStatus, String) {
        let status = self.process.wait().unwrap();
        self.reading.join().unwrap();
        (status, text(&self.shown))
    }
}

fn text(shown: &Mutex<Vec<u8>>) -> String {
    String::from_utf8_lossy(&shown.lock().unwrap()).into_owned()
}

#[test]
fn at_a_terminal_every_question_has_its_default_and_a_wrong_answer_is_asked_again() {
    let site = Site::new();
    site.write("a.csv", &run("t,v [km/h],F [kN],x"));
    let mut terminal = Terminal::start(&site, "init --b 0.02");
    terminal.answer("Folder for the files [my_train]: ", "");
    terminal.answer("Recorded run, a CSV file; none is needed [none]: ", "nowhere.csv");
    terminal.see("nowhere.csv: expected a file");
    terminal.answer("[none]: ", "a.csv");
    terminal.answer("Another one [none]: ", "");
    terminal.answer("Name of the train [my train]: ", "Test train");
    terminal.answer("Gross mass with its load, t [by the recordings, else 200.0]: ", "-3");
    terminal.see("train.mass_t = -3: expected a mass in t above 0, at most 100000");
    terminal.answer("200.0]: ", "114,5");
    terminal.answer("Length over the couplers, m [57.25]: ", "long");
    terminal.see("long: expected a number");
    terminal.answer("[57.25]: ", "");
    terminal.answer("Number of cars, with the locomotive [2]: ", "");
    terminal.answer("share of the mass [0.06]: ", "");
    terminal.answer("N/kN [1.5]: ", "1.7");
    terminal.answer("c, N/kN per (m/s)² [0.0015]: ", "");
    let (status, shown) = terminal.end();
    assert!(status.success(), "{shown}");
    assert!(shown.contains("written: my_train/train.toml, my_train/daemon.toml"), "{shown}");
    let train = read_to_string(site.path().join("my_train/train.toml")).unwrap();
    let line = |key: &str| train.lines().find(|line| line.starts_with(key)).unwrap_or_default();
    assert_eq!(line("name = "), "name = \"Test train\"");
    for (key, is_default) in [
        ("mass_t = 114.5 ", false),
        ("length_m = 57.25 ", true),
        ("a = 1.7 ", false),
        ("b = 0.02 ", false),
        ("c = ", true),
    ] {
        assert!(!line(key).is_empty(), "{key}: {train}");
        assert_eq!(line(key).contains("# DEFAULT"), is_default, "{key}: {train}");
    }
    assert!(site.path().join("my_train/dataset.toml").is_file());
    let mut again = Terminal::start(&site, "init");
    again.answer("Folder for the files [my_train]: ", "");
    let (status, shown) = again.end();
    assert!(!status.success());
    assert!(shown.contains("my_train/train.toml: exists already"), "{shown}");
    assert!(!shown.contains("[none]"), "before the other questions: {shown}");
}

#[test]
fn questions_that_are_broken_off_leave_nothing_behind() {
    let site = Site::new();
    let mut terminal = Terminal::start(&site, "init");
    terminal.answer("Folder for the files [my_train]: ", "made");
    terminal.see("[none]: ");
    terminal.press("\x03");
    let (status, shown) = terminal.end();
    assert!(!status.success(), "{shown}");
    assert!(!site.path().join("made").exists());
}

#[test]
fn nobody_is_asked_where_a_folder_is_given_or_nobody_is_there() {
    let site = Site::new();
    let (status, shown) = Terminal::start(&site, "init made").end();
    assert!(status.success(), "{shown}");
    assert!(!shown.contains("]: "), "{shown}");
    let output = dynocar(&site, &["init"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("required arguments were not provided"), "{}", said(&output));
}
