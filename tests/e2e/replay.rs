//! `dynocar replay` reports the fate of its own samples, and fails where no pipeline used them.

use std::path::Path;

use dynocar_tests::process::DaemonSite;

const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");
const PIPELINES: &str = "[[threads]]\nname = \"all\"\n\
                         [[pipelines]]\nkind = \"echo\"\nthread = \"all\"\n\
                         [[pipelines]]\nkind = \"rls\"\nthread = \"all\"\n";

/// Returns exit status and standard error of a replay of the demo's first run.
fn replay(site: &DaemonSite, more: &[&str]) -> (Option<i32>, String) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo");
    let mut arguments =
        vec!["replay", folder.to_str().expect("UTF-8"), "--run", "1", "--rate", "max"];
    arguments.extend(more);
    let mut process = site.start(DYNOCAR, &arguments);
    let status = process.wait();
    (status.code(), process.errors())
}

/// Returns the number before the first occurrence of some words.
fn number_before(words: &str, said: &str) -> u64 {
    let number = said.split(words).next().and_then(|it| it.split_whitespace().last());
    number.and_then(|it| it.parse().ok()).unwrap_or_else(|| panic!("no number of{words}: {said}"))
}

#[test]
fn a_replay_counts_its_own_samples_and_waits_for_the_daemon() {
    let site = DaemonSite::new();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo");
    for file in ["train.toml", "track.toml"] {
        site.write(file, &std::fs::read_to_string(folder.join(file)).expect("a demo file"));
    }
    let config = site.write(
        "daemon.toml",
        &format!("[[trains]]\nid = 1\nfile = \"train.toml\"\ntrack = \"track.toml\"\n{PIPELINES}"),
    );
    // Not awaited: the replay does.
    let daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().expect("UTF-8")]);
    for round in 0..3 {
        let (code, said) = replay(&site, &["--wait", "30"]);
        assert_eq!(code, Some(0), "{said}\n{}", daemon.errors());
        assert!(!said.contains("no daemon"), "round {round}: {said}");
        let published = number_before(" samples published", &said);
        for pipeline in ["pipeline 0 (echo)", "pipeline 1 (rls)"] {
            let line = said.lines().find(|line| line.contains(pipeline)).expect("its line");
            let count = |words| number_before(words, line);
            let rejected = line.split(" used, ").nth(1).expect("counts");
            let rejected = number_before(" rejected", rejected);
            let sum = count(" used") + rejected + count(" lost");
            assert_eq!(sum, published, "round {round}: {said}");
        }
    }
}

#[test]
fn a_replay_of_which_everything_was_refused_says_why_and_fails() {
    let site = DaemonSite::new();
    // A train of 200 t: the demo's weighs nine times as much.
    let config = site.write_config(1, "", PIPELINES);
    let _daemon = site.start(DYNOCAR, &["run", "--config", config.to_str().expect("UTF-8")]);
    let (code, said) = replay(&site, &["--wait", "30"]);
    assert_eq!(code, Some(1), "{said}");
    let published = number_before(" samples published", &said);
    let refused = format!("0 used, {published} rejected (mass_out_of_range {published}), 0 lost");
    assert!(said.contains(&refused), "{said}");
    assert!(said.contains("no pipeline used half of the"), "{said}");
}

#[test]
fn a_replay_to_nobody_says_so_and_fails() {
    let (code, said) = replay(&DaemonSite::new(), &["--wait", "0.01"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("nobody took the samples: no daemon serves train 1"), "{said}");
}
