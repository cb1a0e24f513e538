//! Results of the months.

use dynocar::models::ModelHash;

use super::story::LifeSettings;

/// A change of models.
#[derive(Clone, Debug, PartialEq)]
pub struct Adoption {
    /// The day.
    pub day: usize,
    /// Model in force before.
    pub before: ModelHash,
    /// Model in force after.
    pub after: ModelHash,
    /// Whether it takes back the previous adoption.
    pub is_rollback: bool,
    /// Additions of the model in force after to its parent.
    pub adds: String,
    /// Whether it predicted the following days better than the one before; `None` where nothing shows it.
    pub is_right: Option<bool>,
}

/// Outcome of one life.
#[derive(Clone, Debug)]
pub struct LifeOutcome {
    /// Settings of the life.
    pub settings: LifeSettings,
    /// Open-loop error over 60 s of the model in force, by day, in m/s.
    pub errors_mps: Vec<Option<f64>>,
    /// The changes of models.
    pub adoptions: Vec<Adoption>,
    /// Rounds of learning.
    pub rounds: usize,
    /// Kinds of the maintenance events.
    pub events: Vec<String>,
}

impl LifeOutcome {
    /// Of a life that begins.
    pub fn from_settings(settings: LifeSettings) -> Self {
        let (errors_mps, adoptions) = (Vec::new(), Vec::new());
        LifeOutcome { settings, errors_mps, adoptions, rounds: 0, events: Vec::new() }
    }

    /// Returns the mean over some days of the error of the model in force, in m/s.
    pub fn error_mps(&self, days: std::ops::Range<usize>) -> Option<f64> {
        let days = days.start.min(self.errors_mps.len())..days.end.min(self.errors_mps.len());
        let known: Vec<f64> = self.errors_mps[days].iter().flatten().copied().collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    }

    /// Returns the first change on or after a day and before another.
    pub fn first_change(&self, days: std::ops::Range<usize>, is_rollback: bool) -> Option<usize> {
        let fits = |it: &&Adoption| it.is_rollback == is_rollback && days.contains(&it.day);
        self.adoptions.iter().find(fits).map(|it| it.day)
    }

    /// Changes after which the next days were predicted worse.
    pub fn mistakes(&self) -> usize {
        self.adoptions.iter().filter(|it| it.is_right == Some(false)).count()
    }
}

/// The header of [`line()`].
pub const HEADER: &str = "| story | seed | onset to adoption, days | error before, m/s | after, m/s \
    | end to rollback, days | changes | mistakes | events | rounds | found |\n\
    | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";

/// Returns a life as a line of a table.
pub fn line(outcome: &LifeOutcome) -> String {
    let LifeSettings { story, span, seed, days, .. } = outcome.settings;
    let last = if story.ends() { span.end } else { days };
    let adopted = outcome.first_change(span.onset..last, false);
    let days_of =
        |from: usize, to: Option<usize>| to.map_or("-".into(), |to| (to - from).to_string());
    let figure = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.3}"));
    let before = outcome.error_mps(span.onset..adopted.unwrap_or(last).max(span.onset + 1));
    let after = adopted.and_then(|day| outcome.error_mps(day + 1..last));
    let rollback = outcome.first_change(span.end..days, true).filter(|_| story.ends());
    let found: Vec<&str> = outcome.adoptions.iter().map(|it| it.adds.as_str()).collect();
    format!(
        "| {} | {seed} | {} | {} | {} | {} | {} | {} | {} | {} | {} |\n",
        story.name(),
        days_of(span.onset, adopted),
        figure(before),
        figure(after),
        days_of(span.end, rollback),
        outcome.adoptions.len(),
        outcome.mistakes(),
        outcome.events.join(", "),
        outcome.rounds,
        found.join(" → "),
    )
}
