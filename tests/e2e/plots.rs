//! `dynocar explain --plots` as a user runs it.

use std::path::Path;
use std::process::Command;

#[test]
fn every_plot_of_the_report_becomes_a_file_that_stands_alone() {
    let folder = tempfile::tempdir().unwrap();
    let plots = folder.path().join("plots");
    let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo");
    let output = Command::new(env!("CARGO_BIN_EXE_dynocar-workshop-under-test"))
        .args(["explain".as_ref(), demo.as_os_str()])
        .args(["--plots".as_ref(), plots.as_os_str()])
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let mut names: Vec<String> = Vec::new();
    for entry in std::fs::read_dir(&plots).unwrap() {
        let path = entry.unwrap().path();
        let svg = std::fs::read_to_string(&path).unwrap();
        let named = format!("plot: {}\n", path.display());
        assert!(errors.contains(&named), "{named}{errors}");
        assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"), "{named}");
        assert!(svg.contains("xmlns=\"http://www.w3.org/2000/svg\""), "{named}");
        assert!(!svg.contains("NaN") && svg.matches("<rect").count() >= 1, "{named}");
        names.push(path.file_name().unwrap().to_string_lossy().into());
    }
    assert_eq!(names.len(), errors.lines().count());
    assert!(names.iter().any(|name| name.starts_with("errors_")), "{names:?}");
    for name in ["residual_by_speed.svg", "residual_by_run.svg"] {
        assert!(names.iter().any(|other| other == name), "{name} {names:?}");
    }
}
