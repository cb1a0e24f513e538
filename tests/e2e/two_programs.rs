//! One name for the user: `dynocar` becomes the workshop for work away from a controller.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use dynocar_tests::process::DaemonSite;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const WORKSHOP: &str = env!("CARGO_BIN_EXE_dynocar-workshop-under-test");
const CONFIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/daemon.toml");
const TRAIN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo/train.toml");

/// A program as it is installed, in a folder of the site.
fn installed(site: &DaemonSite, program: &str, place: &str) -> PathBuf {
    let path = site.path().join(place);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    // Another process copies it: a concurrent test that forks would otherwise hold the file open for writing.
    assert!(Command::new("cp").arg(program).arg(&path).status().unwrap().success());
    path
}

fn run(program: &Path, search_path: &Path, arguments: &[&str]) -> Output {
    Command::new(program).args(arguments).env("PATH", search_path).output().unwrap()
}

fn words(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Returns the commands of a program with the help text of each, under all headings.
fn commands(program: &str) -> Vec<(String, String)> {
    let help = words(&Command::new(program).arg("--help").output().unwrap().stdout);
    let is_name = |name: &str| name.starts_with(|letter: char| letter.is_ascii_lowercase());
    let split = |line: &str| {
        let (name, about) = line.strip_prefix("  ")?.split_once("  ")?;
        (is_name(name) && name != "help").then(|| (name.to_owned(), about.trim().to_owned()))
    };
    help.lines().filter_map(split).collect()
}

#[test]
fn one_help_lists_every_command_as_its_own_program_says_it() {
    let (all, of_workshop) = (commands(DYNOCAR), commands(WORKSHOP));
    assert!(of_workshop.len() > 9, "{of_workshop:?}");
    for command in &of_workshop {
        assert!(all.contains(command), "{command:?} is not in {all:#?}");
    }
    for name in ["demo", "run", "health", "check", "replay", "models"] {
        assert!(all.iter().any(|(it, _)| it == name), "{name}");
    }
}

#[test]
fn the_workshop_is_found_next_to_the_program_else_on_the_search_path() {
    let site = DaemonSite::new();
    let nowhere = site.path().join("nowhere");
    let beside = installed(&site, DYNOCAR, "both/dynocar");
    installed(&site, WORKSHOP, "both/dynocar-workshop");
    let alone = installed(&site, DYNOCAR, "alone/dynocar");
    let other = site.path().join("both");
    for (program, search_path) in [(&beside, &nowhere), (&alone, &other)] {
        let output = run(program, search_path, &["explain", "--help"]);
        assert!(output.status.success(), "{}", words(&output.stderr));
        assert!(words(&output.stdout).contains("Usage: dynocar explain"), "as it was called");
        for command in ["explain", "run"] {
            let [asked, option] = [["help", command], [command, "--help"]]
                .map(|arguments| run(program, search_path, &arguments).stdout);
            assert!(asked == option && !asked.is_empty(), "{command}: {}", words(&asked));
        }
        // Problems found by the workshop are reported, and end the command, as if there were one program.
        let output = run(program, search_path, &["explain", "no-such-dataset"]);
        assert_eq!(output.status.code(), Some(2));
        assert!(words(&output.stderr).starts_with("dynocar: no-such-dataset: no such file"));
    }
    let output = run(&alone, &nowhere, &["explain", "no-such-dataset"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(
        words(&output.stderr),
        "dynocar: this needs the program dynocar-workshop, which is neither beside dynocar nor on \
         the search path; `cargo build --release -p dynocar-workshop` makes it\n"
    );
}

#[test]
fn a_configuration_is_checked_without_the_workshop_and_alike_with_it() {
    let site = DaemonSite::new();
    let nowhere = site.path().join("nowhere");
    let alone = installed(&site, DYNOCAR, "alone/dynocar");
    for options in [&["check", CONFIG][..], &["check", CONFIG, "--json", "-"]] {
        let output = run(&alone, &nowhere, options);
        assert!(output.status.success(), "{}", words(&output.stderr));
        let of_workshop = run(Path::new(WORKSHOP), &nowhere, options);
        assert_eq!(words(&output.stdout), words(&of_workshop.stdout));
    }
    let broken = site.write("broken.toml", "[pipelines\n");
    let broken = broken.to_str().unwrap();
    for options in [&["check", broken][..], &["check", broken, "--json", "-"]] {
        let output = run(&alone, &nowhere, options);
        let of_workshop = run(Path::new(WORKSHOP), &nowhere, options);
        assert_eq!(output.status.code(), Some(2));
        assert_eq!(words(&output.stderr), words(&of_workshop.stderr));
        assert_eq!(words(&output.stdout), words(&of_workshop.stdout));
    }
    let output = run(&alone, &nowhere, &["check", TRAIN]);
    assert_eq!(output.status.code(), Some(1), "a train by itself is the workshop's");
    assert!(words(&output.stderr).contains("this needs the program dynocar-workshop"));
}
