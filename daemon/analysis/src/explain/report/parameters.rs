//! Fitted values with their uncertainty: parameters, and the places where effects act.

use dynocar_model::words::{self, stretch};
use dynocar_shared::HALF_95;

use crate::dataset::Dataset;
use crate::explain::Explanation;
use crate::explain::answer::{EffectAnswer, ParameterValue, PlaceUncertainty, RunWindow};
use crate::explain::selection::deviations;

/// A parameter of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterRow {
    /// Group: the basic resistance or a kind of effect.
    pub group: String,
    /// Its name in files and answers.
    pub name: String,
    /// Meaning of the parameter.
    pub meaning: String,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// Its declared value.
    pub declared: Option<f64>,
    /// Its value in the model without the effects.
    pub before: Option<IntervalEstimate>,
    /// Its value in the model with the effects.
    pub after: IntervalEstimate,
}

/// a, b, c and the parameters of all effects.
pub fn rows(dataset: &Dataset, explanation: &Explanation) -> Vec<ParameterRow> {
    let declared = dataset.train.resistance;
    let before = deviations(&explanation.outcome.base).std;
    let davis = [
        ("a", "constant part", "N/kN", declared.a),
        ("b", "part that grows with speed", "N/kN per m/s", declared.b),
        ("c", "part that grows with its square", "N/kN per (m/s)²", declared.c),
    ];
    let of_base = davis.iter().enumerate().map(|(i, &(name, meaning, unit, value))| {
        let estimate =
            |theta: &[f64], deviations: &[f64]| IntervalEstimate::normal(theta[i], deviations[i]);
        ParameterRow {
            group: "basic resistance".into(),
            name: name.into(),
            meaning: meaning.into(),
            unit,
            declared: Some(value),
            before: Some(estimate(&explanation.outcome.base.theta, &before)),
            after: estimate(&explanation.outcome.fit.theta, &explanation.deviations.std),
        }
    });
    let of_effects = explanation.answer.effects.iter().flat_map(|e| effect_rows(dataset, e));
    of_base.chain(of_effects).collect()
}

/// A number of an effect: its meaning, its value, its standard deviation.
struct Figure {
    meaning: String,
    value: f64,
    std: Option<f64>,
}

fn effect_rows(dataset: &Dataset, effect: &EffectAnswer) -> Vec<ParameterRow> {
    let row = |name: &str, unit: &'static str, figure: Figure| ParameterRow {
        group: words::kind_name(effect.kind).into(),
        name: name.into(),
        meaning: figure.meaning,
        unit,
        declared: declared(dataset, name),
        before: None,
        after: IntervalEstimate::normal(figure.value, figure.std.unwrap_or(0.0))
            .at_least(words::least(name)),
    };
    let rows = effect.parameters.iter().flat_map(|(name, value)| {
        let (meaning, unit) = words::parameter(name);
        let std = effect.std.get(name).or_else(|| effect.std.get("mass_factor"));
        figures(meaning, value, std).into_iter().map(move |figure| row(name, unit, figure))
    });
    rows.collect()
}

/// Returns the numbers of a parameter, each with its meaning.
fn figures(meaning: &str, value: &ParameterValue, std: Option<&ParameterValue>) -> Vec<Figure> {
    let listed = |index: usize| match std {
        Some(ParameterValue::List(list)) => list.get(index).copied(),
        Some(ParameterValue::Number(value)) => Some(*value),
        Some(ParameterValue::Profile(profile)) => profile.get(index).map(|entry| entry[1]),
        _ => None,
    };
    let of_run = |run: &String| match std {
        Some(ParameterValue::ByRun(by_run)) => by_run.get(run).copied(),
        _ => None,
    };
    let each = |figures: &mut dyn Iterator<Item = (String, f64)>| -> Vec<Figure> {
        let figure = |(i, (meaning, value))| Figure { meaning, value, std: listed(i) };
        figures.enumerate().map(figure).collect()
    };
    match value {
        ParameterValue::Number(value) => each(&mut std::iter::once((meaning.into(), *value))),
        ParameterValue::ByRun(values) => {
            let figure = |(run, value): (&String, &f64)| Figure {
                meaning: format!("{meaning} in {run}"),
                value: *value,
                std: of_run(run),
            };
            values.iter().map(figure).collect()
        }
        ParameterValue::Sections(sections) => each(&mut sections.iter().map(|s| {
            let place = stretch([s.from_m, s.to_m]);
            (format!("mass factor {place}, direction {:+}", s.direction), s.mass_factor)
        })),
        ParameterValue::Windows(windows) => each(&mut windows.iter().map(|w| {
            let RunWindow { run, t_start_s, t_end_s } = &w.window;
            (format!("mass factor in {run}, {t_start_s:.0} to {t_end_s:.0} s"), w.mass_factor)
        })),
        // The formula stands with the effect; its numbers stand here.
        ParameterValue::Formula(_) => Vec::new(),
        ParameterValue::Profile(entries) => each(
            &mut entries
                .iter()
                .map(|[at_m, value]| (format!("{meaning} at km {:.2}", at_m / 1000.0), *value)),
        ),
        ParameterValue::List(values) => {
            let number =
                |(i, value): (usize, &f64)| (format!("{meaning}, number {}", i + 1), *value);
            each(&mut values.iter().enumerate().map(number))
        }
    }
}

/// Returns the declared value of an effect's parameter.
fn declared(dataset: &Dataset, name: &str) -> Option<f64> {
    match name {
        "k_n_per_kn_m" => Some(dataset.train.curve_constant_n_per_kn_m),
        "rotating_mass_factor" => Some(dataset.train.rotating_mass_factor),
        "speed_scale" | "gain" | "c_factor" | "mass_factor" | "achieved_ratio" => Some(1.0),
        "shift_m" | "delay_and_lag_s" | "delay_s" | "lag_s" => Some(0.0),
        _ => None,
    }
}

/// One end of a place.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceRow {
    /// The kind of effect, in words.
    pub group: String,
    /// Element that ends here.
    pub end: String,
    /// Its unit.
    pub unit: &'static str,
    /// Where, with the 95 % interval.
    pub at: IntervalEstimate,
}

/// In which fit runs an effect acts, where the runs were chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceRuns {
    /// The kind of effect, in words.
    pub group: String,
    /// Every fit run with the probability that it acts there.
    pub runs: Vec<(String, f64)>,
}

/// The places of all effects, as far as they were estimated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlaceTable {
    /// Their ends.
    pub ends: Vec<PlaceRow>,
    /// Their runs.
    pub runs: Vec<PlaceRuns>,
}

impl PlaceTable {
    /// Returns the places in an answer.
    pub fn from_explanation(explanation: &Explanation) -> Self {
        let mut table = PlaceTable::default();
        for effect in &explanation.answer.effects {
            if let Some(known) = &effect.place.uncertainty_95 {
                table.add(effect, known);
            }
        }
        table
    }

    /// Returns whether no place was estimated.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty() && self.runs.is_empty()
    }

    fn add(&mut self, effect: &EffectAnswer, known: &PlaceUncertainty) {
        let group = words::kind_name(effect.kind).to_string();
        let mut push = |end: String, unit: &'static str, value: f64, interval: [f64; 2]| {
            let at = IntervalEstimate { value, interval: Some(interval) };
            self.ends.push(PlaceRow { group: group.clone(), end, unit, at });
        };
        let intervals = effect.place.intervals_m.iter().flatten();
        let many = effect.place.intervals_m.as_ref().is_some_and(|all| all.len() > 1);
        for (k, (at_m, of_ends)) in intervals.zip(known.intervals_m.iter().flatten()).enumerate() {
            let which = if many { format!(", place {}", k + 1) } else { String::new() };
            push(format!("lower end{which}"), "m", at_m[0], of_ends[0]);
            push(format!("upper end{which}"), "m", at_m[1], of_ends[1]);
        }
        for (window, of_ends) in
            effect.place.windows.iter().flatten().zip(known.windows.iter().flatten())
        {
            push(format!("start in {}", window.run), "s", window.t_start_s, of_ends.t_start_s);
            if let Some(interval) = of_ends.t_end_s {
                push(format!("end in {}", window.run), "s", window.t_end_s, interval);
            }
        }
        if let (Some(covariate), Some(of_ends)) = (&effect.place.covariate, &known.range) {
            for (which, (at, interval)) in
                ["least", "greatest"].into_iter().zip(covariate.range.into_iter().zip(of_ends))
            {
                if let Some(interval) = interval {
                    push(format!("{which} {}", covariate.name), "", at, *interval);
                }
            }
        }
        if let Some(probability) = &known.run_probability {
            let runs = probability.iter().map(|(run, known)| (run.clone(), *known)).collect();
            self.runs.push(PlaceRuns { group: group.clone(), runs });
        }
    }
}

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntervalEstimate {
    /// The value.
    pub value: f64,
    /// The interval; `None` where there is no standard deviation.
    pub interval: Option<[f64; 2]>,
}

impl IntervalEstimate {
    /// Returns a value with 1.96 standard deviations to either side; without an interval when these are no number.
    pub fn normal(value: f64, deviation: f64) -> Self {
        let half = HALF_95 * deviation;
        let is_known = half.is_finite() && half > 0.0;
        IntervalEstimate { value, interval: is_known.then_some([value - half, value + half]) }
    }

    /// Returns the same for a value that cannot be less than `least`.
    pub fn at_least(self, least: f64) -> Self {
        let interval = self.interval.map(|ends| ends.map(|it| it.max(least)));
        IntervalEstimate { interval, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_interval_reaches_below_what_a_number_can_be() {
        let lag_s = IntervalEstimate::normal(0.1, 1.0);
        let [low, high] = lag_s.at_least(0.0).interval.expect("an interval");
        assert_eq!((low, high), (0.0, 0.1 + HALF_95));
        assert_eq!(lag_s.at_least(f64::NEG_INFINITY).interval, lag_s.interval);
    }
}
