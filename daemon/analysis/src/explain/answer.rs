//! The machine-readable answer of `dynocar explain --json`.

use std::collections::BTreeMap;

use dynocar_core::plausibility::Severity;
use dynocar_model::named;
use dynocar_model::words::{kind_name, number, parameter};
use dynocar_shared::HALF_95;
use serde::{Deserialize, Serialize};

pub use super::location::{
    CovariateRange, Location, PlaceUncertainty, RunWindow, WindowUncertainty,
};
use super::stop_to_stop::{Judged, StopToStop};
use crate::dataset::DatasetDiagnostic;

named! {
    /// Statement of the data, in a word.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    Verdict ("as in answers for machines") {
        /// Nothing undeclared acts, as far as the data show.
        None "none";
        /// One or more effects of the library act.
        Effect "effect";
        /// Several effects explain the data equally well.
        Ambiguous "ambiguous";
        /// The residual is real, but no effect of the library explains it.
        Unknown "unknown";
        /// The data do not suffice for a statement.
        InsufficientData "insufficient_data";
    }
}

impl ExplainAnswer {
    /// Adds a sentence that limits the verdict.
    pub fn add_caveat(&mut self, sentence: &str) {
        self.statement += sentence;
        self.caveats.push(sentence.trim().to_owned());
    }

    /// Returns the diagnostics by which the data cannot be true.
    pub fn impossibilities(&self) -> impl Iterator<Item = &DatasetDiagnostic> {
        self.diagnostics.iter().filter(|diagnostic| diagnostic.severity == Severity::Fundamental)
    }
}

/// A mass that holds between two places.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundMassSection {
    /// Lower chainage in m.
    pub from_m: f64,
    /// Upper chainage in m.
    pub to_m: f64,
    /// Direction of travel, 1 or -1.
    pub direction: i8,
    /// True over declared mass.
    pub mass_factor: f64,
}

/// A mass that holds for some time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MassWindow {
    /// When.
    #[serde(flatten)]
    pub window: RunWindow,
    /// True over declared mass.
    pub mass_factor: f64,
}

/// The value of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ParameterValue {
    /// A number.
    Number(f64),
    /// A number for each run.
    ByRun(BTreeMap<String, f64>),
    /// Numbers in the order of a list.
    List(Vec<f64>),
    /// [chainage in m, value] along the line.
    Profile(Vec<[f64; 2]>),
    /// Masses by place.
    Sections(Vec<FoundMassSection>),
    /// Masses by time.
    Windows(Vec<MassWindow>),
    /// A formula.
    Formula(String),
}

/// The work of an effect, and how far off a prediction ends without and with it, both on the fit runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct EffectMeaning {
    /// Work in kWh that it takes from the train on 100 km; negative where it gives.
    pub energy_kwh_per_100_km: f64,
    /// The same over the work of the traction; absent where nothing pulls.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share_of_traction_energy: Option<f64>,
    /// Root mean square in m by which the train is elsewhere than predicted a minute before: without and
    /// with the effect; absent where no run drives a minute without a gap.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_error_60_s_m: Option<[f64; 2]>,
}

/// An effect that was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectAnswer {
    /// Its kind.
    pub kind: &'static str,
    /// Where it acts.
    #[serde(rename = "where")]
    pub place: Location,
    /// Parameters in SI units.
    pub parameters: BTreeMap<String, ParameterValue>,
    /// Their standard deviations.
    pub std: BTreeMap<String, ParameterValue>,
    /// Probability that the search finds as strong an effect where nothing acts; for an effect that is accepted because
    /// it is certain, at most that of the least score which accepts.
    pub p_value: f64,
    /// Share of the open-loop error on the fit runs that goes when the effect is added last.
    pub error_reduction: f64,
    /// Meaning in kWh and metres.
    pub meaning: EffectMeaning,
    /// Contradiction between the sources of evidence about it; absent where they agree.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contradiction: Option<String>,
    /// Its numbers that are not the same in all runs; empty where all are.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub over_time: Vec<Course>,
    /// Its numbers by the runs held out alone; absent where these hardly show it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOutAnswer>,
    /// For an effect outside the library, forms that explain less of the data, the best first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub runners_up: Vec<RunnerUp>,
}

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
    /// Returns the course as a sentence, with the advice that follows from it; `is_named` where the answer states a mean
    /// of the number.
    pub fn sentence(&self, kind: &str, is_named: bool) -> String {
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
        let (name, parts) = (kind_name(kind), parts.join(", "));
        let mean =
            if is_named { "The stated value is a mean that holds for no run: e" } else { "E" };
        let advice = "xplain the newest runs by themselves to learn what holds now.";
        format!("Over the runs {name} changes: {words} {parts}. {mean}{advice}")
    }
}

/// The numbers of an effect by the runs held out alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldOutAnswer {
    /// Number of these runs.
    pub runs: usize,
    /// Parameters in SI units.
    pub parameters: BTreeMap<String, ParameterValue>,
    /// Their standard deviations.
    pub std: BTreeMap<String, ParameterValue>,
    /// Probability that they differ as much from the stated ones where the effect is the same in all runs.
    pub p_value: f64,
}

/// Another form of an effect outside the library.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunnerUp {
    /// Its formula.
    pub formula: String,
    /// By how much its evidence is less, in units of -2 log likelihood.
    pub evidence_less: f64,
}

impl RunnerUp {
    /// Returns the formula, and whether the data speak less or more for it than for the form that was taken.
    pub fn in_words(&self) -> String {
        let formula = in_plain_words(&self.formula);
        match self.evidence_less.round() {
            0.0 => format!("{formula} (evidence the same)"),
            less @ 0.0.. => format!("{formula} (evidence less by {less:.0})"),
            more => format!("{formula} (evidence more by {:.0})", -more),
        }
    }
}

/// Returns a formula with its powers in words, for people.
pub fn in_plain_words(formula: &str) -> String {
    formula.replace(")^", ") to the power of ")
}

/// Information of the data on one number whose effect is zero.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Identifiability {
    /// The kind of effect.
    pub kind: &'static str,
    /// Its parameter, with the unit.
    pub parameter: &'static str,
    /// Standard deviation, estimated jointly with a, b, c and the effects found; `None` where the data determine
    /// nothing.
    pub std: Option<f64>,
    /// Whether an effect that is large enough to matter would show.
    pub told: bool,
    /// Other kinds jointly with which it would not show: the data cannot distinguish the two.
    pub alike: Vec<&'static str>,
}

impl Identifiability {
    /// Returns the least detectable effect, in the unit of the parameter: half of the 95 % interval.
    pub fn hidden_up_to(&self) -> Option<f64> {
        self.std.map(|std| HALF_95 * std)
    }
}

/// An effect that was considered.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Considered {
    /// Its kind.
    pub kind: &'static str,
    /// Log-likelihood gain beyond a, b, c and the effects found, less the cost of its parameters and choices, in
    /// units of -2 log likelihood; absent when it could not be tested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evidence: Option<f64>,
    /// Why it was not chosen, or could not be tested.
    #[serde(rename = "remark")]
    pub reason: String,
}

/// A value with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WithStd {
    /// The value.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
}

/// A drive whose force comes from its electric power.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DriveAnswer {
    /// Share of the power that reaches the rims, for the declared mass: both scale alike.
    pub efficiency: WithStd,
    /// Power in kW that is fed in addition to the power of the drive; absent where the drive's own power is recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub auxiliary_power_kw: Option<WithStd>,
    /// The declared efficiency, with which forces were read; absent where the usual one was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub declared_efficiency: Option<f64>,
    /// Parameter at a bound of its range: it is not identified, and the declared drive stays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_bound: Option<&'static str>,
}

/// Davis coefficients with their standard deviations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BaseAnswer {
    /// a in N/kN.
    pub a: f64,
    /// b in N/kN per m/s.
    pub b: f64,
    /// c in N/kN per (m/s)².
    pub c: f64,
    /// Their standard deviations.
    pub std: DavisDeviations,
    /// Share of their variance before the data that the data take away: from 0 (nothing) to 1 (all).
    pub told_by_data: DavisDeviations,
}

/// A number for each of a, b, c.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DavisDeviations {
    /// Of a.
    pub a: f64,
    /// Of b.
    pub b: f64,
    /// Of c.
    pub c: f64,
}

/// A verdict in words.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VerdictWords {
    /// Without its effects, for a place above a list of them.
    pub heading: String,
    /// With its effects.
    pub whole: String,
    /// Sentences on the questions that the verdict leaves open, each after a space.
    pub left: String,
}

impl VerdictWords {
    /// Returns a verdict of one text that leaves nothing open.
    pub fn from_text(text: String) -> Self {
        VerdictWords { heading: text.clone(), whole: text, left: String::new() }
    }
}

/// The answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExplainAnswer {
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in a sentence or two, with all caveats.
    pub statement: String,
    /// The verdict in words, without its caveats.
    #[serde(skip)]
    pub words: VerdictWords,
    /// Limits of the statement, a sentence or two each.
    #[serde(skip)]
    pub caveats: Vec<String>,
    /// Diagnostics that may spoil the verdict, the worst first; with a fundamental one there is no verdict.
    #[serde(rename = "notes")]
    pub diagnostics: Vec<DatasetDiagnostic>,
    /// The effects found, the strongest first.
    pub effects: Vec<EffectAnswer>,
    /// Kinds that explain the data as well as the first effect.
    pub ambiguous_with: Vec<&'static str>,
    /// Experiment that would separate or settle the explanations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub experiment: Option<String>,
    /// a, b, c fitted together with the effects.
    pub base: BaseAnswer,
    /// Always `full_run`.
    pub metric: &'static str,
    /// Holdout runs with motion, which judge the model.
    pub scored_runs: usize,
    /// Why nothing was scored, with the errors on the fit runs; absent when the holdout runs were scored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unscored: Option<String>,
    /// The error of the holdout runs that headlines state: from stop to stop where there are stops;
    /// absent when nothing was scored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judged: Option<Judged>,
    /// RMSE in m/s on the holdout runs without the effects.
    pub rmse_before: Option<f64>,
    /// RMSE in m/s on the holdout runs with the effects.
    pub rmse_after: Option<f64>,
    /// 95 % interval of 1 - after / before, by bootstrap over the holdout runs.
    pub error_reduction_interval: Option<[f64; 2]>,
    /// The same errors restarted every 60 s: before and after.
    pub window60: Option<[f64; 2]>,
    /// Errors of the holdout runs from stop to stop, each from its departure; absent where they do
    /// not stop twice, and where forces are unknown near every stop, as forces from power are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stop_to_stop: Option<StopToStop>,
    /// The same errors on the fit runs: before and after.
    pub fit_runs: Option<[f64; 2]>,
    /// The drive, where the force comes from its power.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drive: Option<DriveAnswer>,
    /// Seconds by which forces act before their stamps; absent where samples are dense or it is not
    /// estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_late_s: Option<WithStd>,
    /// Standard deviation in N/kN of the unexplained force, averaged over a minute; absent without motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unexplained_n_per_kn: Option<f64>,
    /// Numbers that change over the runs although no effect of their kind is named, by kind; absent without any.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub over_time: BTreeMap<&'static str, Vec<Course>>,
    /// Other explanations that were considered.
    pub considered: Vec<Considered>,
    /// Information of the data on the numbers of train and line that were not found.
    pub identifiability: Vec<Identifiability>,
    /// Prediction files by run.
    pub predictions: BTreeMap<String, String>,
}
