//! Estimates from each run alone, and their differences between the runs.
//!
//! A parameter of the train is the same in every run: where the estimates of single runs scatter more than their
//! intervals allow, something differs between the runs (a load, the weather), or the intervals lack a source of error.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use dynocar_analysis::dataset::{Role, Run};
use dynocar_model::units::Unit;
use dynocar_shared::HALF_95;
use serde::Serialize;

use super::answer::EstimatorAnswer;
use dynocar::cli::text::{TextTable, short};

/// Estimates from one run alone.
#[derive(Clone, Debug, Serialize)]
pub(super) struct RunAnswer {
    number: u32,
    file: String,
    role: Role,
    /// The declared mass.
    declared_mass_t: f64,
    estimators: Vec<EstimatorAnswer>,
}

/// How the estimates of a parameter scatter between the runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Spread {
    /// Runs with an estimate.
    runs: usize,
    mean: f64,
    /// Standard deviation of the runs' estimates.
    std_between: f64,
    /// Root mean square of the standard deviations that the runs state themselves.
    std_stated: f64,
}

/// The spread of each parameter of an estimator.
#[derive(Clone, Debug, Serialize)]
pub(super) struct EstimatorSpread {
    name: &'static str,
    parameters: BTreeMap<String, Spread>,
}

impl RunAnswer {
    /// Returns the answer of each estimator.
    pub(super) fn estimators(&mut self) -> &mut Vec<EstimatorAnswer> {
        &mut self.estimators
    }

    /// Returns the estimates from a run.
    pub(super) fn new(run: &Run, estimators: Vec<EstimatorAnswer>) -> Self {
        RunAnswer {
            number: run.number,
            file: run.file.clone(),
            role: run.role,
            declared_mass_t: run.mass_kg / 1000.0,
            estimators,
        }
    }
}

/// A column of a run table: its title, and each run's value with its standard deviation.
struct RunColumn {
    title: String,
    /// The speed in m/s at which it is.
    at_mps: Option<f64>,
    by_run: Vec<Option<(f64, f64)>>,
}

impl RunColumn {
    /// Returns the title for people, with a speed in their unit.
    fn shown(&self, speed_unit: Unit) -> String {
        let at = |speed_mps| short(speed_unit.from_base(speed_mps), 1);
        match self.at_mps {
            Some(speed_mps) => format!("w0 at {} {}", at(speed_mps), speed_unit.name()),
            None => self.title.clone(),
        }
    }

    fn spread(&self) -> Option<Spread> {
        spread(self.by_run.iter().flatten())
    }
}

/// Returns the mean and scatter of values with standard deviations; `None` for fewer than two.
fn spread<'a>(estimates: impl Iterator<Item = &'a (f64, f64)> + Clone) -> Option<Spread> {
    let count = estimates.clone().count();
    if count < 2 {
        return None;
    }
    let runs = count as f64;
    let mean = estimates.clone().map(|(value, _)| value).sum::<f64>() / runs;
    let squares: f64 = estimates.clone().map(|(value, _)| (value - mean).powi(2)).sum();
    let stated: f64 = estimates.map(|(_, std)| std * std).sum();
    Some(Spread {
        runs: count,
        mean,
        std_between: (squares / (runs - 1.0)).sqrt(),
        std_stated: (stated / runs).sqrt(),
    })
}

/// Returns the parameters of an estimator by its place, and the resistance at a speed that all runs drove.
fn quantities(runs: &[RunAnswer], index: usize) -> Vec<RunColumn> {
    let answers: Vec<&EstimatorAnswer> = runs.iter().map(|run| &run.estimators[index]).collect();
    let known = |value: &dyn Fn(&EstimatorAnswer) -> Option<(f64, f64)>| -> Vec<_> {
        answers
            .iter()
            .map(|answer| {
                let (value, std) = value(answer).filter(|_| answer.is_known())?;
                (value.is_finite() && std.is_finite()).then_some((value, std))
            })
            .collect()
    };
    let names = answers.iter().flat_map(|answer| answer.values.keys());
    let names: std::collections::BTreeSet<&str> = names.copied().collect();
    let mut quantities: Vec<RunColumn> = names
        .into_iter()
        .map(|name| RunColumn {
            title: name.into(),
            at_mps: None,
            by_run: known(&|answer| Some((*answer.values.get(name)?, *answer.std.get(name)?))),
        })
        .collect();
    if let Some(speed_mps) = common_speed_mps(&answers) {
        let at = |answer: &EstimatorAnswer| {
            let point = answer.resistance.iter().find(|point| point.speed_mps == speed_mps)?;
            Some((point.w0_n_per_kn, point.std))
        };
        let (title, at_mps) = (format!("w0 at {speed_mps} m/s"), Some(speed_mps));
        quantities.push(RunColumn { title, at_mps, by_run: known(&at) });
    }
    quantities
}

/// Returns the middle of the speeds that every run with an estimate drove.
fn common_speed_mps(answers: &[&EstimatorAnswer]) -> Option<f64> {
    let known = answers.iter().filter(|answer| answer.is_known());
    let (low, high) = known.filter(|answer| !answer.resistance.is_empty()).fold(
        (f64::NEG_INFINITY, f64::INFINITY),
        |(low, high), answer| {
            let points = &answer.resistance;
            (low.max(points[0].speed_mps), high.min(points[points.len() - 1].speed_mps))
        },
    );
    (low.is_finite() && low <= high).then(|| (0.5 * (low + high)).floor())
}

/// Returns how much the runs differ, estimator by estimator.
pub(super) fn spreads(runs: &[RunAnswer]) -> Vec<EstimatorSpread> {
    let Some(first) = runs.first() else { return Vec::new() };
    let of = |(index, answer): (usize, &EstimatorAnswer)| EstimatorSpread {
        name: answer.name,
        parameters: quantities(runs, index)
            .into_iter()
            .filter_map(|quantity| Some((quantity.title.clone(), quantity.spread()?)))
            .collect(),
    };
    first.estimators.iter().enumerate().map(of).collect()
}

/// Returns a table for each estimator, a row for each run.
pub(super) fn report(runs: &[RunAnswer], speed_unit: Unit) -> String {
    let mut text = String::new();
    let Some(first) = runs.first() else { return text };
    for (place, estimator) in first.estimators.iter().enumerate() {
        let quantities = quantities(runs, place);
        let mut header = vec!["run", "file", "role", "declared t", "status", "used"];
        let titles: Vec<String> = quantities.iter().map(|it| it.shown(speed_unit)).collect();
        header.extend(titles.iter().map(String::as_str));
        let mut table = TextTable::new(&header, &[1, 2, 4]);
        for (index, run) in runs.iter().enumerate() {
            let answer = &run.estimators[place];
            let mut row = vec![
                run.number.to_string(),
                run.file.clone(),
                run.role.name().into(),
                format!("{:.3}", run.declared_mass_t),
                answer.status.into(),
                answer.samples.used.to_string(),
            ];
            row.extend(quantities.iter().map(|quantity| match quantity.by_run[index] {
                Some((value, std)) => with_half_width(value, HALF_95 * std),
                None => "-".into(),
            }));
            table.push(row);
        }
        // Writing to a string cannot fail.
        let _ = write!(text, "\n{}, from each run alone\n{table}", estimator.name);
        for (quantity, title) in quantities.iter().zip(&titles) {
            let Some(Spread { runs, mean, std_between, std_stated }) = quantity.spread() else {
                continue;
            };
            let decimals = decimals(std_between.min(std_stated));
            let _ = writeln!(
                text,
                "  {title}: mean {mean:.decimals$} of {runs} runs; standard deviation between them \
                 {std_between:.decimals$}, by their own intervals {std_stated:.decimals$}"
            );
        }
    }
    text
}

/// Returns a value and the half width of its interval, both to two digits of the latter.
fn with_half_width(value: f64, half: f64) -> String {
    let decimals = decimals(half);
    format!("{value:.decimals$} ± {half:.decimals$}")
}

/// Decimals that show two digits of a positive number.
fn decimals(value: f64) -> usize {
    if value > 0.0 { (1.0 - value.log10().floor()).clamp(0.0, 8.0) as usize } else { 3 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_shows_scatter_between_runs_from_their_own_intervals() {
        let found = spread([(1.0, 0.3), (2.0, 0.4), (3.0, 0.5)].iter()).unwrap();
        assert_eq!((found.runs, found.mean, found.std_between), (3, 2.0, 1.0));
        assert!((found.std_stated - (0.5_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(spread([(1.0, 0.3)].iter()), None);
    }

    #[test]
    fn values_are_shown_to_two_digits_of_their_interval() {
        assert_eq!(with_half_width(1.73213, 0.014516), "1.732 ± 0.015");
        assert_eq!(with_half_width(14.5, 3.21), "14.5 ± 3.2");
        assert_eq!(with_half_width(1234.5, 321.0), "1234 ± 321");
        assert_eq!(with_half_width(2.0, 0.0), "2.000 ± 0.000");
    }
}
