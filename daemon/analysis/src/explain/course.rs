//! A number that is not the same in all runs, and its words.

use dynocar_model::words::{kind_name, number, parameter};
use dynocar_shared::HALF_95;
use serde::Serialize;

/// Runs that follow each other, and a number in them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CoursePart {
    /// File of the first run.
    pub first_run: String,
    /// File of the last run.
    pub last_run: String,
    /// The value.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
}

/// A number of an effect that differs between runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Course {
    /// Name of the parameter, with the unit.
    pub parameter: &'static str,
    /// The number in groups of consecutive runs, in their order.
    pub parts: Vec<CoursePart>,
    /// Probability of as large a change where there is none.
    pub p_value: f64,
}

impl Course {
    /// Returns the course as a sentence, with the advice that follows from it.
    pub fn sentence(&self, kind: &str) -> String {
        let (words, unit) = parameter(self.parameter);
        let shown = |part: &CoursePart| {
            let runs = match part.first_run == part.last_run {
                true => part.first_run.clone(),
                false => format!("{} to {}", part.first_run, part.last_run),
            };
            let half = HALF_95 * part.std;
            let [value, half] = [part.value, half].map(|it| number(it, Some(half)));
            format!("{value} ± {half} {unit}").trim_end().to_owned() + &format!(" in {runs}")
        };
        let parts: Vec<String> = self.parts.iter().map(shown).collect();
        format!(
            "Over the runs {} changes: {words} {}. The stated value is a mean that holds for no run: \
             explain the newest runs by themselves to learn what holds now.",
            kind_name(kind),
            parts.join(", ")
        )
    }
}
