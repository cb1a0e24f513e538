//! Questions of `dynocar init` to a user at a terminal.

use std::fs::read_to_string;
use std::process::ExitStatus;

use dynocar_tests::process::{DaemonSite, Process, Terminal, Tie};

use crate::commands::{DYNOCAR, dynocar, run, said};

/// A user at a terminal whom `dynocar` asks.
struct Asked {
    process: Process,
    terminal: Terminal,
}

impl Asked {
    fn start(site: &DaemonSite, arguments: &[&str]) -> Self {
        let mut command = site.command(DYNOCAR, arguments);
        command.current_dir(site.path());
        let terminal = Terminal::open();
        Asked { process: terminal.start(command, Tie::Leader), terminal }
    }

    /// Answers a question.
    fn answer(&mut self, question: &str, answer: &str) {
        self.terminal.see(question);
        self.terminal.press(&format!("{answer}\r"));
    }

    fn end(mut self) -> (ExitStatus, String) {
        (self.process.wait(), self.terminal.text())
    }
}

#[test]
fn at_a_terminal_every_question_has_its_default_and_a_wrong_answer_is_asked_again() {
    let site = DaemonSite::new();
    site.write("a.csv", &run("t,v [km/h],F [kN],x"));
    let mut asked = Asked::start(&site, &["init", "--b", "0.02"]);
    asked.answer("Folder for the files [my_train]: ", "");
    asked.answer("Recorded run, a CSV file; none is needed [none]: ", "nowhere.csv");
    asked.terminal.see("nowhere.csv: expected a file");
    asked.answer("[none]: ", "a.csv");
    asked.answer("Another one [none]: ", "");
    asked.answer("Name of the train [my train]: ", "Test train");
    asked.answer("Gross mass with its load, t [by the recordings, else 200.0]: ", "-3");
    asked.terminal.see("train.mass_t = -3: expected a mass in t above 0, at most 100000");
    asked.answer("200.0]: ", "114,5");
    asked.answer("Length over the couplers, m [57.25]: ", "long");
    asked.terminal.see("long: expected a number");
    asked.answer("[57.25]: ", "");
    asked.answer("Number of cars, with the locomotive [2]: ", "");
    asked.answer("share of the mass [0.06]: ", "");
    asked.answer("N/kN [1.5]: ", "1.7");
    asked.answer("c, N/kN per (m/s)² [0.0015]: ", "");
    let (status, shown) = asked.end();
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
    let mut again = Asked::start(&site, &["init"]);
    again.answer("Folder for the files [my_train]: ", "");
    let (status, shown) = again.end();
    assert!(!status.success());
    assert!(shown.contains("my_train/train.toml: exists already"), "{shown}");
    assert!(!shown.contains("[none]"), "before the other questions: {shown}");
}

#[test]
fn questions_that_are_broken_off_leave_nothing_behind() {
    let site = DaemonSite::new();
    let mut asked = Asked::start(&site, &["init"]);
    asked.answer("Folder for the files [my_train]: ", "made");
    asked.terminal.see("[none]: ");
    asked.terminal.press("\x03");
    let (status, shown) = asked.end();
    assert!(!status.success(), "{shown}");
    assert!(!site.path().join("made").exists());
}

#[test]
fn nobody_is_asked_where_a_folder_is_given_or_nobody_is_there() {
    let site = DaemonSite::new();
    let (status, shown) = Asked::start(&site, &["init", "made"]).end();
    assert!(status.success(), "{shown}");
    assert!(!shown.contains("]: "), "{shown}");
    let output = dynocar(&site, &["init"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("required arguments were not provided"), "{}", said(&output));
}
