//! Estimates for machines, those from each run alone, and their differences between the runs.
//!
//! A parameter of the train is the same in every run: where the estimates of single runs scatter more than their
//! intervals allow, something differs between the runs (a load, the weather), or the intervals lack a source of error.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use dynocar::cli::text::{TextTable, short};
use dynocar_analysis::dataset::{DatasetDiagnostic, Role, Run};
use dynocar_core::plausibility::Severity;
use dynocar_model::units::Unit;
use dynocar_shared::{
    HALF_95, Parameter, ParameterSnapshot, PipelineKind, Reason, RejectionReason, Status,
};
use serde::Serialize;

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

/// The parameter whose estimate scales with a force.
const MASS: &str = "mass_t";
/// Standard deviation of a load as a share of the declared mass.
const LOAD_STD: f64 = 0.1;
/// Standard deviations between the estimated and the declared mass beyond which no load explains the difference.
const DEVIATIONS_MAX: f64 = 3.0;
/// Approximate greatest number of speeds at which the resistance is shown.
const SHOWN_MAX: f64 = 7.0;

/// Estimates of one estimator.
#[derive(Clone, Debug, Serialize)]
pub(super) struct EstimatorAnswer {
    pub name: &'static str,
    pub status: &'static str,
    pub reason: &'static str,
    pub values: BTreeMap<&'static str, f64>,
    pub std: BTreeMap<&'static str, f64>,
    pub resistance: Vec<ResistancePoint>,
    /// The resistance at round speeds in the unit of the recording, for people.
    #[serde(skip)]
    pub resistance_shown: Vec<ResistancePoint>,
    pub samples: SampleCounts,
    pub updates: u64,
    pub innovation_mean_square: f64,
    pub innovation_correlation: f64,
    pub unexplained_force_n: f64,
    pub unexplained_force_std_n: f64,
}

/// Basic resistance at a speed.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct ResistancePoint {
    pub speed_mps: f64,
    pub w0_n_per_kn: f64,
    pub std: f64,
}

/// Counts of the samples.
#[derive(Clone, Debug, Serialize)]
pub(super) struct SampleCounts {
    pub used: u64,
    pub rejected: BTreeMap<&'static str, u32>,
    pub lost: u64,
}

impl EstimatorAnswer {
    /// Returns the answer of a snapshot.
    pub(super) fn new(kind: PipelineKind, snapshot: &ParameterSnapshot, speed_unit: Unit) -> Self {
        let parameters = || Parameter::ALL.iter().filter(|&&it| snapshot.index_of(it).is_some());
        EstimatorAnswer {
            name: kind.name(),
            status: snapshot.status().name(),
            reason: snapshot.reason().unwrap_or(Reason::None).name(),
            values: parameters().filter_map(|&it| Some((it.name(), snapshot.value(it)?))).collect(),
            std: parameters().filter_map(|&it| Some((it.name(), snapshot.std(it)?))).collect(),
            resistance: resistance_points(snapshot, 1.0),
            resistance_shown: resistance_points(snapshot, shown_step_mps(snapshot, speed_unit)),
            samples: SampleCounts {
                used: snapshot.samples_used,
                rejected: RejectionReason::ALL
                    .iter()
                    .map(|&reason| (reason.name(), snapshot.rejected(reason)))
                    .filter(|&(_, count)| count > 0)
                    .collect(),
                lost: snapshot.samples_lost,
            },
            updates: snapshot.updates,
            innovation_mean_square: snapshot.innovation_mean_square,
            innovation_correlation: snapshot.innovation_correlation,
            unexplained_force_n: snapshot.unexplained_force_n,
            unexplained_force_std_n: snapshot.unexplained_force_std_n,
        }
    }

    /// Says nothing but why: the data cannot be true.
    pub(super) fn refuse(&mut self, code: &'static str) {
        (self.status, self.reason) = (Status::Invalid.name(), code);
        self.values.clear();
        self.std.clear();
        self.resistance.clear();
        self.resistance_shown.clear();
    }

    /// Adds the relative uncertainty of a force to the standard deviation of the mass.
    pub(super) fn widen_mass(&mut self, share: f64) {
        let mass_t = self.values.get(MASS).copied().unwrap_or(0.0);
        if let Some(std) = self.std.get_mut(MASS) {
            *std = std.hypot(share * mass_t);
        }
    }

    /// Returns the note on an estimated mass that no load explains.
    pub(super) fn contradiction(&self, declared_kg: f64) -> Option<DatasetDiagnostic> {
        let (mass_t, declared_t) = (*self.values.get(MASS)?, declared_kg / 1000.0);
        let std_t = self.std.get(MASS)?.hypot(LOAD_STD * declared_t);
        let deviations = (mass_t - declared_t).abs() / std_t;
        (self.is_known() && deviations > DEVIATIONS_MAX).then(|| DatasetDiagnostic {
            code: "against_declared",
            severity: Severity::Warning,
            runs: Vec::new(),
            text: format!(
                "{} estimates {mass_t:.0} t, {deviations:.0} standard deviations from the declared \
                 {declared_t:.0} t, while {:.1} kN stay unexplained: is a force missing, a unit wrong or \
                 one of several columns taken for the whole?",
                self.name,
                self.unexplained_force_n / 1000.0
            ),
        })
    }

    /// Returns whether the values are more than the declared ones.
    pub(super) fn is_known(&self) -> bool {
        !["unestimated", "invalid"].contains(&self.status)
    }
}

/// Returns the resistance over the driven speeds in such steps.
fn resistance_points(snapshot: &ParameterSnapshot, step_mps: f64) -> Vec<ResistancePoint> {
    let (low_mps, high_mps) = (snapshot.speed_min_mps, snapshot.speed_max_mps);
    let (first, last) = ((low_mps / step_mps).ceil() as u32, (high_mps / step_mps).floor() as u32);
    (first..=last)
        .filter_map(|count| {
            let speed_mps = f64::from(count) * step_mps;
            let estimate = snapshot.resistance_at(speed_mps)?;
            Some(ResistancePoint {
                speed_mps,
                w0_n_per_kn: estimate.w0_n_per_kn,
                std: estimate.w0_std_n_per_kn,
            })
        })
        .collect()
}

/// Returns a step between round speeds in a unit that gives a handful of them.
fn shown_step_mps(snapshot: &ParameterSnapshot, speed_unit: Unit) -> f64 {
    let range = speed_unit.from_base(snapshot.speed_max_mps - snapshot.speed_min_mps);
    let steps = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0];
    let step = steps.into_iter().find(|step| range / step <= SHOWN_MAX).unwrap_or(100.0);
    speed_unit.to_base(step)
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
