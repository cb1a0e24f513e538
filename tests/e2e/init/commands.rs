//! Commands as a person types them, and a recording for them.

use std::fmt::Write as _;
use std::process::{Command, Output, Stdio};

use dynocar_tests::process::DaemonSite;

pub const DYNOCAR: &str = env!("CARGO_BIN_EXE_dynocar-under-test");

/// Returns the printed text for people.
pub fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Runs a command in the site's folder, with empty standard input.
pub fn dynocar(site: &DaemonSite, arguments: &[&str]) -> Output {
    let mut command = Command::new(DYNOCAR);
    command.args(arguments).current_dir(site.path()).stdin(Stdio::null());
    command.output().unwrap()
}

/// Returns the standard output of a command that must succeed.
pub fn done(site: &DaemonSite, arguments: &[&str]) -> String {
    let output = dynocar(site, arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", said(&output));
    String::from_utf8(output.stdout).unwrap()
}

/// A run that pulls, coasts and brakes, for ten minutes at 1 Hz.
pub fn run(header: &str) -> String {
    let (mut text, mut speed_mps) = (format!("{header}\n"), 0.0_f64);
    for second in 0..600 {
        let force_kn = match second {
            0..60 => 60.0,
            60..500 => 0.0,
            _ if speed_mps > 1.0 => -30.0,
            _ => 0.0,
        };
        writeln!(text, "{second},{:.3},{force_kn},0", speed_mps * 3.6).unwrap();
        let w0 = 1.0 + 0.02 * speed_mps + 0.0004 * speed_mps * speed_mps;
        speed_mps = (speed_mps + (force_kn - 0.981 * w0) / 105.0).max(0.0);
    }
    text
}
