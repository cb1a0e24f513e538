//! Another build of this program compared with this one: the cost of a change of an estimator.
//!
//! Both programs measure the same cases by turns, each in a process of its own. Ratios and
//! differences are taken round by round.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use super::measure::quartiles;
use crate::ending::{is_due, until_due};
use crate::output::{BenchError, Record};

/// Rounds of both programs.
const ROUNDS: usize = 31;

/// Measures the cases whose name contains `case` in this program and in another: the median times of an update in ns,
/// and over the rounds the medians of the difference and of the ratio of this build's time to the other's.
///
/// # Errors
///
/// When one of them cannot be run, or has no such case.
pub fn measure(other: &Path, case: &str) -> Result<Vec<Record>, BenchError> {
    let ours = std::env::current_exe()?;
    let mut rounds: Vec<[Vec<(String, f64)>; 2]> = Vec::with_capacity(ROUNDS);
    for round in until_due(0..ROUNDS) {
        // The program that runs first alternates from round to round.
        let (first, then) = if round % 2 == 0 { (&*ours, other) } else { (other, &*ours) };
        match times(first, case).and_then(|first| Ok([first, times(then, case)?])) {
            // The same signal ends the programs of the round.
            Err(_) if is_due() => break,
            Ok([first, then]) if round % 2 == 0 => rounds.push([first, then]),
            Ok([first, then]) => rounds.push([then, first]),
            Err(failure) => return Err(failure),
        }
    }
    let Some(first) = rounds.first() else {
        return Err("ended before the first round was over".into());
    };
    let named = |all: &[(String, f64)], name: &str| {
        all.iter().find(|(other, _)| other == name).map(|&(_, ns)| ns)
    };
    let names = first[0].iter().map(|(name, _)| name.clone());
    Ok(names
        .filter_map(|name| {
            let pairs = rounds.iter().map(|[a, b]| Some((named(a, &name)?, named(b, &name)?)));
            Some(record(&name, &pairs.collect::<Option<Vec<_>>>()?))
        })
        .collect())
}

fn record(name: &str, pairs: &[(f64, f64)]) -> Record {
    let of = |of: fn(&(f64, f64)) -> f64| quartiles(pairs.iter().map(of).collect());
    let [low, ratio, high] = of(|(ours, other)| ours / other);
    Record::default()
        .with("case", name)
        .number("ns", of(|pair| pair.0)[1], 1)
        .number("other ns", of(|pair| pair.1)[1], 1)
        .number("more ns", of(|(ours, other)| ours - other)[1], 1)
        .number("ratio", ratio, 2)
        .number("ratio_low", low, 2)
        .number("ratio_high", high, 2)
}

/// One measurement of a program: cases by name with the time of an update in ns.
fn times(program: &Path, case: &str) -> Result<Vec<(String, f64)>, BenchError> {
    let failed = |came: String| -> BenchError {
        let program = program.display();
        format!("{program}: expected the times of the cases as JSON, {came}").into()
    };
    let arguments = ["estimators", "--quick", "--case", case, "--json", "-"];
    let output = Command::new(program).args(arguments).output();
    let output = output.map_err(|error| failed(error.to_string()))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(failed(format!("{}: {}", output.status, said.trim())));
    }
    let answer: Value =
        serde_json::from_slice(&output.stdout).map_err(|error| failed(error.to_string()))?;
    let cases = answer["cases"].as_array().ok_or_else(|| failed("none came".into()))?;
    let time = |it: &Value| Some((it["case"].as_str()?.to_owned(), it["ns"].as_f64()?));
    cases
        .iter()
        .map(time)
        .collect::<Option<Vec<_>>>()
        .ok_or_else(|| failed("a case without name or time came".into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_taken_round_by_round_and_a_program_that_measures_nothing_is_named() {
        let pairs = [(100.0, 50.0), (120.0, 60.0), (90.0, 45.0)];
        let case = record("case", &pairs);
        assert_eq!((case.value("ratio"), case.value("more ns")), (Some(2.0), Some(50.0)));
        let error = times(Path::new("/bin/true"), "rls").unwrap_err();
        assert!(error.to_string().starts_with("/bin/true: expected the times"), "{error}");
    }
}
