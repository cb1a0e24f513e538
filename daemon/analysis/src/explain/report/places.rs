//! Where effects act, and how surely that is known.

use super::{Estimate, words};
use crate::explain::Explanation;
use crate::explain::answer::{EffectAnswer, PlaceUncertainty};

/// One end of a place.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceRow {
    /// The kind of effect, in words.
    pub group: String,
    /// What ends here.
    pub end: String,
    /// Its unit.
    pub unit: &'static str,
    /// Where, with the 95 % interval.
    pub at: Estimate,
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
    /// The places in an answer.
    pub fn of(explanation: &Explanation) -> Self {
        let mut table = PlaceTable::default();
        for effect in &explanation.answer.effects {
            if let Some(known) = &effect.place.uncertainty_95 {
                table.add(effect, known);
            }
        }
        table
    }

    /// True when no place was estimated.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty() && self.runs.is_empty()
    }

    fn add(&mut self, effect: &EffectAnswer, known: &PlaceUncertainty) {
        let group = words::kind_name(effect.kind).to_string();
        let mut push = |end: String, unit: &'static str, value: f64, interval: [f64; 2]| {
            let at = Estimate { value, interval: Some(interval) };
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
