//! Effects in words, for the statement.

use std::collections::BTreeMap;

use dynocar_model::terms::place::in_words;
use dynocar_shared::HALF_95;

use super::answer::{EffectAnswer, HeldOutAnswer, Location, ParameterValue, PlaceUncertainty};
use super::over_time::CHANCE_MAX;
use super::selection::{EffectTrial, SearchOutcome};

/// Intervals of a place at most in a sentence.
const PLACES_SHOWN: usize = 4;

/// An effect with its numbers, where it acts, and how surely that is known.
pub(super) fn describe(effect: &EffectAnswer) -> String {
    let formula = effect.parameters.values().find_map(|value| match value {
        ParameterValue::Formula(formula) => Some(formula.clone()),
        _ => None,
    });
    let mut parts: Vec<String> = formula.into_iter().collect();
    parts.extend(numbers(&effect.parameters, &effect.std));
    parts.extend(effect.parameters.values().find_map(mass_factors));
    parts.extend(describe_place(&effect.place));
    parts.extend(effect.place.uncertainty_95.as_ref().and_then(precision));
    format!("{} ({})", effect.kind, parts.join(", "))
}

/// The numbers among values, each with its 95 % interval.
fn numbers<'a>(
    values: &'a BTreeMap<String, ParameterValue>,
    std: &'a BTreeMap<String, ParameterValue>,
) -> impl Iterator<Item = String> + 'a {
    values.iter().filter_map(|(name, value)| {
        let ParameterValue::Number(value) = value else { return None };
        let Some(ParameterValue::Number(deviation)) = std.get(name) else { return None };
        Some(match HALF_95 * deviation {
            // A reference that was chosen and not estimated.
            0.0 => format!("{name} = {value}"),
            half_width => format!("{name} = {value:.4} ± {half_width:.4}"),
        })
    })
}

/// States what the runs held out say of an effect by themselves; `None` where they hardly show it.
pub(super) fn by_held_out_runs(effect: &EffectAnswer) -> Option<String> {
    let HeldOutAnswer { runs, parameters, std, p_value } = effect.held_out.as_ref()?;
    let numbers: Vec<String> = numbers(parameters, std).collect();
    let judged = match *p_value < CHANCE_MAX {
        true => format!(
            "which is not what the fit runs say (chance of as much: {p_value:.0e}): it is not the same in all runs, \
             or not what acts"
        ),
        false => "which agrees with the fit runs".into(),
    };
    Some(format!(
        " The {runs} runs held out by themselves give {} {}, {judged}.",
        effect.kind,
        numbers.join(", ")
    ))
}

/// Where something acts.
pub(super) fn describe_place(place: &Location) -> Vec<String> {
    let mut parts = Vec::new();
    if let Some(intervals) = &place.intervals_m {
        let shown = &intervals[..intervals.len().min(PLACES_SHOWN)];
        let more = if intervals.len() > PLACES_SHOWN { " …" } else { "" };
        parts.push(format!("at {}{more}", in_words(shown)));
    }
    if let Some(windows) = &place.windows {
        let shown =
            windows.iter().map(|w| format!("{} {:.0}–{:.0} s", w.run, w.t_start_s, w.t_end_s));
        parts.push(format!("in {}", shown.collect::<Vec<_>>().join(", ")));
    }
    if let Some(runs) = &place.runs {
        parts.push(format!("in {}", runs.join(", ")));
    }
    if let Some(covariate) = &place.covariate {
        let [low, high] = covariate.range;
        parts.push(format!("{} from {low:.1} to {high:.1}", covariate.name));
    }
    parts
}

/// How well the ends of a place are known: half of the widest 95 % interval.
pub fn precision(known: &PlaceUncertainty) -> Option<String> {
    let half = |interval: [f64; 2]| 0.5 * (interval[1] - interval[0]);
    let widest = |ends: &mut dyn Iterator<Item = [f64; 2]>| ends.map(half).reduce(f64::max);
    let ends_m = widest(&mut known.intervals_m.iter().flatten().flatten().copied());
    let windows = known.windows.iter().flatten();
    let ends_s = widest(&mut windows.flat_map(|it| [Some(it.t_start_s), it.t_end_s]).flatten());
    let range = widest(&mut known.range.iter().flatten().flatten().copied());
    let shown = [
        ends_m.map(|half| format!("{half:.0} m")),
        ends_s.map(|half| format!("{half:.0} s")),
        range.filter(|_| ends_m.is_none()).map(|half| format!("{half:.1}")),
    ];
    let shown: Vec<String> = shown.into_iter().flatten().collect();
    if ends_m.or(ends_s) == Some(0.0) {
        return Some("ends certain".into());
    }
    (!shown.is_empty()).then(|| format!("ends known to ± {} or better", shown.join(", ± ")))
}

/// Describes a list of mass factors; a section in both directions once.
fn mass_factors(value: &ParameterValue) -> Option<String> {
    let mut factors: Vec<f64> = match value {
        ParameterValue::Sections(list) => list.iter().map(|section| section.mass_factor).collect(),
        ParameterValue::Windows(list) => list.iter().map(|window| window.mass_factor).collect(),
        _ => return None,
    };
    factors.dedup();
    let listed: Vec<String> = factors.iter().map(|factor| format!("{factor:.3}")).collect();
    Some(format!("mass_factor = {}", listed.join(", ")))
}

/// Describes a certain and small effect: its kind with its numbers in the model, or in the trial that took it in
/// where nothing is named.
pub(super) fn small(outcome: &SearchOutcome, trial: &EffectTrial) -> String {
    let effect = &trial.fit.model.effects[trial.last()];
    let tried = trial.fit.effect_parameters(trial.last());
    let values = outcome.values(trial.kind).unwrap_or(tried);
    let parameters = effect.parameters().iter().zip(values);
    let each = parameters.map(|(spec, value)| format!("{} = {value:.4}", spec.name));
    let numbers = each.collect::<Vec<_>>().join(", ");
    format!("{} ({numbers})", trial.kind.name())
}
