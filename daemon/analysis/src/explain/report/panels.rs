//! The residual force against one covariate each, in bins with their errors.

use dynocar_model::force::ResolvedSample;
use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::{DMatrix, DVector};

use super::covariates::{COMMON, Covariate};
use super::windows::FitWindow;
use crate::dataset::Dataset;
use crate::explain::Explanation;
use crate::explain::answer::{EffectAnswer, ParameterValue, RunWindow};
use crate::explain::evidence::RunData;
use crate::explain::selection::Deviations;
use crate::statistics::{greatest_first, least_first};

/// Greatest number of panels, in addition to those of single runs.
const PANELS_MAX: usize = 8;
/// Greatest number of single runs shown.
const RUN_PANELS_MAX: usize = 4;
/// Least number of windows in a bin.
const WINDOWS_MIN: usize = 4;

/// Windows whose covariate lies in one range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PanelBin {
    /// Mean of the covariate, in its unit.
    pub at: f64,
    /// Number of windows.
    pub count: usize,
    /// Mean residual in N/kN without the effects, and 1.96 standard errors.
    pub before_n_per_kn: (f64, f64),
    /// The same with the effects.
    pub after_n_per_kn: (f64, f64),
    /// Contribution of the effects (with a, b, c refitted) in N/kN, and 1.96 standard deviations by the uncertainty
    /// of the fitted parameters.
    pub effect_n_per_kn: (f64, f64),
}

/// The residual against one covariate.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// The covariate.
    pub covariate: Covariate,
    /// The run's file when the panel shows one run.
    pub file: Option<String>,
    /// Bins in order of the covariate.
    pub bins: Vec<PanelBin>,
    /// Ranges of the covariate, in its unit, in which an effect acts.
    pub acting: Vec<[f64; 2]>,
}

/// Where the effects of an answer act.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Zones {
    /// Chainages in m.
    pub intervals_m: Vec<[f64; 2]>,
    /// Stretches of time in runs.
    pub windows: Vec<RunWindow>,
    /// Whole runs, by file.
    pub runs: Vec<String>,
    /// Ranges of covariates in SI units.
    pub ranges: Vec<(Covariate, [f64; 2])>,
}

/// Returns where the effects of an explanation act.
pub fn zones(explanation: &Explanation) -> Zones {
    let mut zones = Zones::default();
    explanation.answer.effects.iter().for_each(|effect| zones.add(effect));
    zones
}

impl Zones {
    /// Returns where one effect acts.
    pub fn from_effect(effect: &EffectAnswer) -> Self {
        let mut zones = Zones::default();
        zones.add(effect);
        zones
    }

    fn add(&mut self, effect: &EffectAnswer) {
        let place = &effect.place;
        self.intervals_m.extend(place.intervals_m.iter().flatten());
        self.windows.extend(place.windows.iter().flatten().cloned());
        self.runs.extend(place.runs.iter().flatten().cloned());
        self.ranges.extend(place.speed_range_mps.map(|range| (Covariate::Speed, range)));
        let named = place.covariate.as_ref();
        let known = named.and_then(|it| Some((Covariate::of_name(&it.name)?, it.range)));
        // A brake force counts as negative control force, a run by its number from 1.
        self.ranges.extend(known.filter(|(covariate, _)| match covariate {
            Covariate::ControlForce | Covariate::Run | Covariate::Speed => false,
            Covariate::Chainage => place.intervals_m.is_none(),
            _ => true,
        }));
        for value in effect.parameters.values() {
            match value {
                ParameterValue::Sections(sections) => {
                    self.intervals_m.extend(sections.iter().map(|s| [s.from_m, s.to_m]));
                }
                ParameterValue::Windows(windows) => {
                    self.windows.extend(windows.iter().map(|it| it.window.clone()));
                }
                _ => {}
            }
        }
    }

    /// Returns the stretches of time in s, in the recording's own count, in which all that is known of one effect's
    /// runs, windows, chainages and speeds holds; the whole run where nothing is known of them.
    pub fn acting_s(&self, run: &RunData) -> Vec<[f64; 2]> {
        let within = |range: &[f64; 2], value: f64| (range[0]..=range[1]).contains(&value);
        let is_inside = |position_m: f64| self.intervals_m.iter().any(|it| within(it, position_m));
        let of_speed: Vec<&[f64; 2]> = self
            .ranges
            .iter()
            .filter(|(covariate, _)| *covariate == Covariate::Speed)
            .map(|(_, range)| range)
            .collect();
        let acts = |sample: &ResolvedSample, time_s: f64| {
            let in_window =
                |it: &RunWindow| it.run == run.file && within(&[it.t_start_s, it.t_end_s], time_s);
            (self.runs.is_empty() || self.runs.contains(&run.file))
                && (self.windows.is_empty() || self.windows.iter().any(in_window))
                && (self.intervals_m.is_empty() || sample.position_m.is_some_and(is_inside))
                && of_speed.iter().all(|it| within(it, sample.speed_mps))
        };
        sections(run, acts)
    }

    /// Returns the stretches of time in s, in the recording's own count, in which an effect acts on a run.
    pub fn times_s(&self, run: &RunData) -> Vec<[f64; 2]> {
        let own = self.windows.iter().filter(|window| window.run == run.file);
        let mut times: Vec<[f64; 2]> = own.map(|w| [w.t_start_s, w.t_end_s]).collect();
        let is_inside = |position_m: f64| {
            self.intervals_m.iter().any(|[from, to]| (*from..=*to).contains(&position_m))
        };
        times.extend(sections(run, |sample, _| sample.position_m.is_some_and(is_inside)));
        times
    }

    fn on(&self, covariate: Covariate, runs: &[RunData], numbers: &[f64]) -> Vec<[f64; 2]> {
        let of_ranges = self.ranges.iter().filter(|(other, _)| *other == covariate);
        let mut acting: Vec<[f64; 2]> = of_ranges.map(|(_, range)| *range).collect();
        match covariate {
            Covariate::Chainage => acting.extend(&self.intervals_m),
            Covariate::TimeInRun(index) => {
                let own = self.windows.iter().filter(|window| window.run == runs[index].file);
                acting.extend(own.map(|window| [window.t_start_s, window.t_end_s]));
            }
            Covariate::Run => {
                let has = |run: &RunData| {
                    self.runs.contains(&run.file) || self.windows.iter().any(|w| w.run == run.file)
                };
                let inside = numbers.iter().zip(runs).filter(|(_, run)| has(run));
                acting.extend(inside.map(|(number, _)| [number - 0.4, number + 0.4]));
            }
            _ => {}
        }
        let per_unit = covariate.per_unit();
        acting.iter().map(|range| range.map(|value| value / per_unit)).collect()
    }
}

/// Returns the stretches of a run's time in s, in the recording's own count, in which something holds.
fn sections(run: &RunData, holds: impl Fn(&ResolvedSample, f64) -> bool) -> Vec<[f64; 2]> {
    let mut times = Vec::new();
    let mut open: Option<[f64; 2]> = None;
    for (sample, time_s) in run.samples().iter().zip(run.recording.time_s()) {
        let time_s = run.offset_s + time_s;
        match (holds(sample, time_s), &mut open) {
            (true, Some(section)) => section[1] = time_s,
            (true, None) => open = Some([time_s, time_s]),
            (false, _) => times.extend(open.take()),
        }
    }
    times.extend(open);
    times
}

/// Returns the panels: first the covariate on which the effect is seen best, then those that are always
/// shown, then those on which the residual is most uneven.
pub fn panels(dataset: &Dataset, explanation: &Explanation, windows: &[FitWindow]) -> Vec<Panel> {
    let (runs, zones) = (&explanation.problem.runs, zones(explanation));
    let covariance = covariance(explanation);
    let number = |file: &str| dataset.runs.iter().find(|run| run.file == file).map(|it| it.number);
    let numbers: Vec<f64> =
        runs.iter().map(|run| f64::from(number(&run.file).unwrap_or(0))).collect();
    let panel = |covariate: Covariate, file: Option<String>| {
        let mut bins = bins(covariate, windows.iter(), runs, &covariance);
        if covariate == Covariate::Run {
            bins.iter_mut().for_each(|bin| bin.at = numbers[bin.at as usize - 1]);
        }
        let acting = zones.on(covariate, runs, &numbers);
        (bins.len() > 1).then_some(Panel { covariate, file, bins, acting })
    };
    let mut list: Vec<Panel> = COMMON.iter().filter_map(|row| panel(row.covariate, None)).collect();
    let leading = leading(explanation);
    let rank = |panel: &Panel| {
        if leading.contains(&panel.covariate) {
            f64::INFINITY
        } else if Covariate::ALWAYS.contains(&panel.covariate) {
            f64::MAX
        } else {
            unevenness(panel)
        }
    };
    greatest_first(&mut list, rank);
    list.truncate(PANELS_MAX);
    let in_windows = (0..runs.len())
        .filter(|&index| zones.windows.iter().any(|window| window.run == runs[index].file))
        .take(RUN_PANELS_MAX)
        .filter_map(|index| panel(Covariate::TimeInRun(index), Some(runs[index].file.clone())));
    let at = list.iter().filter(|panel| leading.contains(&panel.covariate)).count();
    list.splice(at..at, in_windows.collect::<Vec<_>>());
    list
}

fn leading(explanation: &Explanation) -> Vec<Covariate> {
    let of_effect = |effect: &EffectAnswer| {
        let named = effect.place.covariate.as_ref();
        named
            .and_then(|it| Covariate::of_name(&it.name))
            .or_else(|| effect.place.speed_range_mps.map(|_| Covariate::Speed))
            .or_else(|| Covariate::of_kind(EffectKind::from_name(effect.kind)?))
    };
    explanation.answer.effects.iter().filter_map(of_effect).collect()
}

/// Returns the mean squared residual without the effects in units of its error.
fn unevenness(panel: &Panel) -> f64 {
    let sum: f64 = panel
        .bins
        .iter()
        .map(|bin| (bin.before_n_per_kn.0 / bin.before_n_per_kn.1.max(1e-9)).powi(2))
        .sum();
    sum / panel.bins.len() as f64
}

/// Returns the covariance of the updated model's parameters, with the deviations that are reported.
pub(super) fn covariance(explanation: &Explanation) -> DMatrix<f64> {
    let Deviations { std: deviations, covariance, .. } = &explanation.deviations;
    let count = deviations.len();
    DMatrix::from_fn(count, count, |i, j| {
        let scale = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
        let value = covariance[(i, j)] / scale * deviations[i] * deviations[j];
        if value.is_finite() { value } else { 0.0 }
    })
}

/// Returns the windows in order of a covariate, in bins.
pub(super) fn bins<'w>(
    covariate: Covariate,
    windows: impl Iterator<Item = &'w FitWindow>,
    runs: &[RunData],
    covariance: &DMatrix<f64>,
) -> Vec<PanelBin> {
    let mut known: Vec<(f64, &FitWindow)> = windows
        .filter_map(|window| Some((covariate.value(window, &runs[window.run])?, window)))
        .filter(|(value, _)| value.is_finite())
        .collect();
    least_first(&mut known, |it| it.0);
    let (Some(first), Some(last)) = (known.first(), known.last()) else { return Vec::new() };
    let range = last.0 - first.0;
    if !(range > 1e-9 * last.0.abs().max(first.0.abs())) {
        return Vec::new();
    }
    let (width, least) = match covariate {
        Covariate::Chainage => (range / 40.0, WINDOWS_MIN),
        Covariate::TimeInRun(_) => (0.0, 1),
        _ if covariate.is_category() => (0.5, 1),
        _ => (range / 16.0, WINDOWS_MIN),
    };
    let mut groups: Vec<&[(f64, &FitWindow)]> = Vec::new();
    let mut from = 0;
    for to in 1..=known.len() {
        let is_full =
            to - from >= least && (to == known.len() || known[to].0 - known[from].0 > width);
        if is_full {
            groups.push(&known[from..to]);
            from = to;
        }
    }
    groups.into_iter().map(|group| panel_bin(covariate, group, covariance)).collect()
}

fn panel_bin(
    covariate: Covariate,
    group: &[(f64, &FitWindow)],
    covariance: &DMatrix<f64>,
) -> PanelBin {
    let count = group.len() as f64;
    let mean = |value: &dyn Fn(&FitWindow) -> f64| {
        group.iter().map(|(_, window)| value(window)).sum::<f64>() / count
    };
    let with_error = |value: &dyn Fn(&FitWindow) -> f64| {
        let mean = mean(value);
        let square = group.iter().map(|(_, w)| (value(w) - mean).powi(2)).sum::<f64>();
        let error = if count > 1.0 { (square / (count - 1.0) / count).sqrt() } else { 0.0 };
        (mean, HALF_95 * error)
    };
    let slopes = DVector::from_fn(covariance.nrows(), |i, _| mean(&|window| window.slopes[i]));
    let variance = slopes.dot(&(covariance * &slopes));
    PanelBin {
        at: group.iter().map(|(value, _)| value).sum::<f64>() / count / covariate.per_unit(),
        count: group.len(),
        before_n_per_kn: with_error(&|window| window.before_n_per_kn),
        after_n_per_kn: with_error(&|window| window.after_n_per_kn),
        effect_n_per_kn: (
            mean(&|window| window.before_n_per_kn - window.after_n_per_kn),
            HALF_95 * variance.max(0.0).sqrt(),
        ),
    }
}
