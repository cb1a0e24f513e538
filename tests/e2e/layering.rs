//! The invariants of `ARCHITECTURE.md` that can be read off the dependency tree and the sources.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::Command;

use dynocar_tests::sources::{is_of_tests, rust_files, without_tests, workspace};

/// Returns the names of all packages that a package is built from.
fn dependencies(package: &str) -> Vec<String> {
    let lines = tree(package, "normal");
    lines.iter().filter_map(|line| line.split(' ').next()).map(str::to_owned).collect()
}

/// Returns name and version of all packages on which a package depends by edges of some kinds; a package may occur more
/// than once.
fn tree(package: &str, edges: &str) -> Vec<String> {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--edges", edges, "--prefix", "none", "--format", "{p}"])
        .args(["--package", package])
        .current_dir(workspace())
        .output()
        .expect("cargo tree");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8_lossy(&output.stdout);
    lines.lines().map(|line| line.trim_end_matches(" (*)").to_owned()).collect()
}

fn assert_free_of(package: &str, forbidden: &[&str]) {
    let names = dependencies(package);
    assert!(names.iter().any(|name| name == package), "cargo tree lists the package itself");
    for name in names {
        let is_forbidden = forbidden.iter().any(|it| name.starts_with(it));
        assert!(!is_forbidden, "{package} must not be built from {name}");
    }
}

/// The packages without channel, clock, file, thread and log: the declaration, the live pipelines, the methods of the
/// papers, the reading of recorded runs, and their explanation. The last marks the parallel computations (rayon); its
/// callers choose the threads (decision 0018).
const PURE: [&str; 5] =
    ["dynocar-model", "dynocar-core", "dynocar-estimators", "dynocar-dataset", "dynocar-analysis"];
/// Their sources.
const PURE_FOLDERS: [&str; 5] = [
    "daemon/model/src",
    "daemon/core/src",
    "daemon/estimators/src",
    "daemon/dataset/src",
    "daemon/analysis/src",
];
/// The folders of the papers' own methods, by first author.
const PAPERS: [&str; 4] = ["liu", "wang", "xia", "xie"];
/// The most packages that the daemon and its demo are built from, their build scripts' too.
const DAEMON_PACKAGES_MAX: usize = 130;

#[test]
fn what_is_pure_knows_no_channel_clock_or_logger() {
    for package in PURE {
        assert_free_of(
            package,
            &["iceoryx2", "tracing", "log", "tokio", "rustix", "libc", "dynocar-transport"],
        );
    }
}

#[test]
fn the_model_estimates_nothing_and_knows_no_estimator() {
    assert_free_of(
        "dynocar-model",
        &["dynocar-core", "dynocar-estimators", "dynocar-dataset", "dynocar-analysis"],
    );
    assert_free_of("dynocar-model", &["nalgebra", "serde", "toml"]);
}

#[test]
fn the_core_stands_without_the_methods_of_the_papers() {
    assert_free_of("dynocar-core", &["dynocar-estimators", "toml"]);
    for paper in PAPERS {
        let folder = workspace().join("daemon/estimators/src").join(paper);
        assert!(folder.join("mod.rs").is_file(), "{} is there", folder.display());
    }
    for file in ["daemon/model/src", "daemon/core/src"].into_iter().flat_map(rust_files) {
        let text = std::fs::read_to_string(&file).expect("a source file");
        let words = text.split(|letter: char| !letter.is_alphanumeric() && letter != '_');
        for word in words {
            assert!(!PAPERS.contains(&word), "{}: {word}", file.display());
        }
    }
}

#[test]
fn what_runs_live_is_built_without_what_explains_recordings() {
    for package in ["dynocar-core", "dynocar-estimators"] {
        assert_free_of(package, &["dynocar-dataset", "dynocar-analysis", "csv", "strsim", "rayon"]);
    }
    assert_free_of(
        "dynocar-dataset",
        &["dynocar-estimators", "dynocar-analysis", "statrs", "granit-parser"],
    );
    // The daemon's program reads its files as datasets' are read; its threads know nothing of that.
    for folder in ["daemon/src/runtime", "daemon/src/shadow", "daemon/src/state"] {
        for file in rust_files(folder) {
            let text = std::fs::read_to_string(&file).expect("a source file");
            assert!(!text.contains("dynocar_dataset"), "{}", file.display());
        }
    }
}

#[test]
fn what_is_installed_next_to_a_controller_draws_zips_asks_and_imports_nothing() {
    assert_free_of(
        "dynocar",
        &[
            "dynocar-workshop",
            "dynocar-analysis",
            "dynocar-fmu",
            "plotters",
            "zip",
            "dialoguer",
            "indicatif",
            "granit-parser",
            "statrs",
            "clap_complete",
            "clap_mangen",
        ],
    );
    let packages: BTreeSet<String> = tree("dynocar", "normal,build").into_iter().collect();
    assert!(packages.len() <= DAEMON_PACKAGES_MAX, "{}: {packages:#?}", packages.len());
}

#[test]
fn the_workshop_reads_every_format_itself_and_has_neither_network_nor_arrow() {
    for format in ["mcap", "parquet"] {
        assert!(dependencies("dynocar-workshop").iter().any(|it| it == format), "{format}");
    }
    assert_free_of("dynocar-workshop", &["dynocar-recording", "tokio", "arrow"]);
}

#[test]
fn what_a_controller_links_pulls_in_no_estimator() {
    for package in ["dynocar-client", "dynocar-transport", "dynocar-shared"] {
        assert_free_of(
            package,
            &[
                "dynocar-model",
                "dynocar-core",
                "dynocar-estimators",
                "dynocar-analysis",
                "nalgebra",
            ],
        );
    }
}

#[test]
fn what_a_simulator_loads_has_no_channel() {
    assert_free_of("dynocar-fmu", &["iceoryx2", "dynocar-transport", "tracing", "rustix", "clap"]);
}

#[test]
fn what_recordings_are_written_with_is_in_no_controller_and_no_daemon() {
    for package in ["dynocar", "dynocar-client", "dynocar-fmu"].into_iter().chain(PURE) {
        assert_free_of(
            package,
            &["dynocar-recording", "dynocar-mcap", "mcap", "prost", "parquet", "arrow"],
        );
    }
    assert_free_of("dynocar-recording", &["parquet", "arrow"]);
}

#[test]
fn the_terminal_stays_out_of_daemon_and_controller() {
    for package in ["dynocar", "dynocar-client"].into_iter().chain(PURE) {
        assert_free_of(package, &["ratatui", "crossterm"]);
    }
}

#[test]
fn what_serves_viewers_is_in_no_controller_no_daemon_and_no_recorder() {
    for package in ["dynocar", "dynocar-client", "dynocar-recording", "dynocar-watch"] {
        assert_free_of(package, &["dynocar-live", "foxglove", "tokio", "tungstenite"]);
    }
}

#[test]
fn what_serves_trains_and_what_reads_recordings_stand_on_the_transport_and_on_no_client() {
    let folders = [
        "shared/transport/src",
        "daemon/src/runtime",
        "daemon/src/shadow",
        "daemon/mcap/src",
        "daemon/recording/src",
        "daemon/parquet/src",
        "daemon/live/src",
        "daemon/workshop/src",
    ];
    for file in folders.into_iter().flat_map(rust_files) {
        let text = std::fs::read_to_string(&file).expect("a source file");
        assert!(!text.contains("dynocar_client"), "{}", file.display());
    }
}

#[test]
fn the_contract_depends_on_nothing() {
    assert_eq!(dependencies("dynocar-shared"), ["dynocar-shared"]);
}

#[test]
fn what_is_pure_touches_no_file_thread_clock_or_terminal() {
    let folders = PURE_FOLDERS.map(rust_files);
    assert!(folders.iter().all(|files| files.len() > 10), "the sources were found");
    let forbidden =
        ["std::fs", "std::thread", "std::net", "Instant::now", "SystemTime", "println!("];
    for file in folders.into_iter().flatten() {
        let text = std::fs::read_to_string(&file).expect("a source file");
        for word in forbidden {
            assert!(!text.contains(word), "{}: {word}", file.display());
        }
    }
}

#[test]
fn admission_alone_knows_its_parts_and_writes_a_status() {
    const ADMISSION: &str = "daemon/core/src/pipeline/admission";
    let parts =
        ["Validator", "ForceGate", "GateVerdict", "plausibility::watch", "snapshot.status = "];
    let own = rust_files(ADMISSION);
    for part in parts {
        let named = |file: &PathBuf| std::fs::read_to_string(file).expect("a file").contains(part);
        assert!(own.iter().any(named), "{part} is there");
    }
    let folders = ["daemon", "client/src", "shared", "bench/src", "tests/src"].map(rust_files);
    for file in folders.into_iter().flatten().filter(|it| !is_of_tests(it) && !own.contains(it)) {
        let text = std::fs::read_to_string(&file).expect("a source file");
        for line in without_tests(&text) {
            let part = parts.iter().find(|part| line.contains(*part));
            assert_eq!(part, None, "{}: {line}", file.display());
        }
    }
}
