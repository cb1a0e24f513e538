//! The residual along the line, by direction, and the places where effects were found.
//!
//! A resistance at a place retards trains in both directions; an error of the map's gradient has opposite signs in the
//! two.

use dynocar_model::words;
use dynocar_shared::HALF_95;

use super::covariates::Covariate;
use super::panels::{PanelBin, bins, covariance};
use super::windows::FitWindow;
use crate::explain::Explanation;
use crate::explain::answer::{EffectAnswer, ParameterValue, RunWindow, WindowUncertainty};
use crate::explain::evidence::RunData;

/// A section of the line where an effect was found.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkedInterval {
    /// Lower and upper chainage in m.
    pub at_m: [f64; 2],
    /// File of the only run in which it was, where that is known; its train was there then.
    pub run: Option<String>,
    /// 95 % intervals in m of the two, where they were estimated.
    pub ends_m: [Option<[f64; 2]>; 2],
}

/// Where an effect was found.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundPlace {
    /// The kind, in words.
    pub name: String,
    /// Stretches of the line.
    pub sections: Vec<MarkedInterval>,
}

/// Effects along the line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AlongLine {
    /// The residual force over the chainage in km, for each direction of travel (+1, −1) that was
    /// driven.
    pub residual: Vec<(f64, Vec<PanelBin>)>,
    /// The effects that act at places.
    pub places: Vec<FoundPlace>,
    /// Error of the declared gradient that was found: chainage in m, ‰, 1.96 standard deviations.
    pub gradient_error: Vec<[f64; 3]>,
}

impl AlongLine {
    /// Returns the effects of an explanation along the line, with these windows.
    pub fn new(explanation: &Explanation, windows: &[FitWindow]) -> Self {
        let runs = &explanation.problem.runs;
        let covariance = covariance(explanation);
        let towards = |direction: f64| {
            let own = windows.iter().filter(|window| runs[window.run].direction == direction);
            (direction, bins(Covariate::Chainage, own, runs, &covariance))
        };
        let residual = [1.0, -1.0].map(towards).into_iter().filter(|(_, bins)| bins.len() > 1);
        let effects = &explanation.answer.effects;
        let all: Vec<&RunData> = runs.iter().chain(&explanation.holdout).collect();
        let places = effects.iter().map(|effect| FoundPlace {
            name: words::kind_name(effect.kind).into(),
            sections: sections(effect, &all),
        });
        AlongLine {
            residual: residual.collect(),
            places: places.filter(|place| !place.sections.is_empty()).collect(),
            gradient_error: effects.iter().flat_map(gradient_error).collect(),
        }
    }
}

fn sections(effect: &EffectAnswer, runs: &[&RunData]) -> Vec<MarkedInterval> {
    let (place, known) = (&effect.place, effect.place.uncertainty_95.as_ref());
    if let Some(intervals_m) = &place.intervals_m {
        let ends_m = known.and_then(|it| it.intervals_m.as_ref());
        let ends = |k: usize| match ends_m.and_then(|all| all.get(k)) {
            Some(ends) => ends.map(Some),
            None => [None; 2],
        };
        let all = intervals_m.iter().enumerate();
        return all
            .map(|(k, at_m)| MarkedInterval { at_m: *at_m, run: None, ends_m: ends(k) })
            .collect();
    }
    let sections = effect.parameters.values().flat_map(|value| match value {
        ParameterValue::Sections(sections) => &sections[..],
        _ => &[],
    });
    let by_section = sections.map(|it| MarkedInterval {
        at_m: [it.from_m, it.to_m],
        run: None,
        ends_m: [None; 2],
    });
    let by_window = place.windows.iter().flatten().filter_map(|window| {
        let run = runs.iter().find(|run| run.file == window.run)?;
        let mut ends = known.and_then(|it| it.windows.as_ref()).into_iter().flatten();
        let starts = |it: &&WindowUncertainty| {
            it.run == window.run && (it.t_start_s[0]..=it.t_start_s[1]).contains(&window.t_start_s)
        };
        let ends = ends.find(starts);
        driven_over(run, window, ends)
    });
    by_section.chain(by_window).collect()
}

/// Returns where a run's train was in a window of time.
fn driven_over(
    run: &RunData,
    window: &RunWindow,
    known: Option<&WindowUncertainty>,
) -> Option<MarkedInterval> {
    let at_m = |time_s: f64| {
        let times_s = run.recording.time_s();
        let next = times_s.partition_point(|it| run.offset_s + it < time_s);
        run.samples().get(next.min(times_s.len().checked_sub(1)?))?.position_m
    };
    let end = |time_s: f64, interval_s: Option<[f64; 2]>| {
        let interval_m = interval_s.and_then(|[from, to]| Some([at_m(from)?, at_m(to)?]));
        Some((at_m(time_s)?, interval_m.map(|[one, other]| [one.min(other), one.max(other)])))
    };
    let first = end(window.t_start_s, known.map(|it| it.t_start_s))?;
    let last = end(window.t_end_s, known.and_then(|it| it.t_end_s))?;
    let (low, high) = if first.0 <= last.0 { (first, last) } else { (last, first) };
    let run = Some(window.run.clone());
    Some(MarkedInterval { at_m: [low.0, high.0], run, ends_m: [low.1, high.1] })
}

fn gradient_error(effect: &EffectAnswer) -> Vec<[f64; 3]> {
    let list = |value: Option<&ParameterValue>| match value {
        Some(ParameterValue::Profile(entries)) => entries.clone(),
        _ => Vec::new(),
    };
    let (values, deviations) =
        (list(effect.parameters.get("profile")), list(effect.std.get("profile")));
    let both = values.iter().zip(&deviations);
    both.map(|([at_m, value], [_, std])| [*at_m, *value, HALF_95 * std]).collect()
}
