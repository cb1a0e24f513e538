//! Findings of an explanation, and its conclusion for the store: a candidate, events, an open question, or nothing new.

use std::collections::BTreeMap;
use std::path::Path;

use dynocar::models::origin::{EventWindow, HeldOutError, SourceFile};
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar::models::{
    FoundEffect, MaintenanceEvent, ModelFigure, ModelHash, ModelText, NewModel, Origin,
    TrainModels, UtcSecond,
};
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::answer::{EffectAnswer, ExplainAnswer, ParameterValue, Verdict};
use dynocar_analysis::explain::effects::policy_of;
use dynocar_analysis::explain::evidence::{SCORE_MIN, p_value};
use dynocar_model::words::{self, kind_name};
use dynocar_shared::TrainId;
use dynocar_shared::vocabulary::EffectKind;
use tracing::{info, warn};

use super::LearnError;
use super::memory::{LearnerMemory, OpenQuestion};
use super::pool::Pool;
use crate::report;
use crate::report::provenance::{FileDigest, Provenance, hex};
use crate::updated::{UpdatedTexts, updated_texts};

/// Conclusion of an explanation.
#[derive(Clone, Debug, PartialEq)]
pub struct Explained {
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in a sentence or two.
    pub statement: String,
    /// The model that was put into the store.
    pub candidate: Option<ModelHash>,
    /// The model of the store that adds the same already.
    pub same_as: Option<ModelHash>,
    /// Numbers of the maintenance events that are new.
    pub events: Vec<u64>,
    /// New open question.
    pub question: Option<OpenQuestion>,
}

/// An explanation with its inputs.
pub struct Conclusion<'a> {
    /// The train's part of the store.
    pub models: &'a TrainModels,
    /// The model in force.
    pub in_force: ModelHash,
    /// Its files.
    pub text: &'a ModelText,
    /// The runs.
    pub pool: &'a Pool,
    /// Explanation of the runs.
    pub explanation: &'a Explanation,
    /// The command, as the origin of a model names it.
    pub command: &'a str,
    /// When it is.
    pub now: UtcSecond,
}

impl Conclusion<'_> {
    /// Puts the findings of an explanation that the store does not hold yet into the store.
    ///
    /// # Errors
    ///
    /// When the store cannot be read or written, or the report cannot be made.
    pub fn draw(&self, memory: &LearnerMemory) -> Result<Explained, LearnError> {
        let &Conclusion { models, in_force, text, pool, explanation, now, .. } = self;
        let answer = &explanation.answer;
        let open = question(answer, models.train(), (in_force, now));
        let is_new = |it: &OpenQuestion| {
            let known = memory.open_of(models.train());
            !{ known }.any(|other| it.is_same_as(other))
        };
        let mut explained = Explained {
            verdict: answer.verdict,
            statement: answer.statement.clone(),
            candidate: None,
            same_as: None,
            events: Vec::new(),
            question: open.filter(is_new),
        };
        if answer.verdict != Verdict::Effect {
            return Ok(explained);
        }
        let labels = (TRAIN_FILE, TRACK_FILE);
        let declared = (&text.train[..], text.track.as_deref());
        let grown = updated_texts(explanation, declared, labels, &format!("model {in_force}"))
            .map_err(|error| LearnError::Report(error.to_string()))?;
        for effect in answer.effects.iter().filter(|it| is_event(it, &grown.not_expressed)) {
            let event = event(effect, pool, explanation, (in_force, now));
            if is_to_be_reported(&event, explanation) {
                explained.events.extend(put_event(models, event)?);
            }
        }
        let Some(new) = self.candidate(grown)? else {
            return Ok(explained);
        };
        let listing = models.list()?;
        let same = listing.models.iter().find(|it| {
            it.origin.parent == Some(in_force) && it.origin.adds_the_same_as(&new.origin)
        });
        match same {
            Some(stored) => {
                info!(train = models.train().0, "found again, reported before: {}", stored.hash);
                explained.same_as = Some(stored.hash);
            }
            None => {
                let (hash, adds) = (models.put(&new)?, new.origin.adds());
                info!(train = models.train().0, "new candidate {hash}: {adds}");
                explained.candidate = Some(hash);
            }
        }
        Ok(explained)
    }

    /// Returns the model that an explanation makes; `None` where no effect of the train or the line was found, or
    /// the runs held out are not predicted better.
    fn candidate(&self, grown: UpdatedTexts) -> Result<Option<NewModel>, LearnError> {
        let &Conclusion { models, in_force, pool, explanation, now, .. } = self;
        let answer = &explanation.answer;
        let is_held = |kind: &str| !grown.not_expressed.iter().any(|it| it == kind);
        let effects: Vec<_> =
            answer.effects.iter().filter(|it| is_held(it.kind)).map(found_effect).collect();
        // An effect that is certain and takes little from the error improves no prediction.
        let matters = |it: &EffectAnswer| is_held(it.kind) && it.p_value < p_value(SCORE_MIN);
        let is_important = answer.effects.iter().any(matters);
        let Some(error) = improvement(answer).filter(|_| is_important) else {
            return Ok(None);
        };
        let folder = models.folder().join(in_force.to_string());
        let files = digests(&folder, pool);
        let command = self.command.to_owned();
        let provenance = Provenance::of_files(files, command.clone(), now.instant());
        let origin = Origin {
            made: now,
            version: provenance.version.into(),
            command,
            parent: Some(in_force),
            verdict: Some(answer.verdict.name().into()),
            statement: answer.statement.clone(),
            dataset_sha256: Some(provenance.sha256.clone()),
            error: Some(error),
            effects,
            files: provenance
                .files
                .iter()
                .map(|it| SourceFile { path: it.path.clone(), sha256: it.sha256.clone() })
                .collect(),
        };
        let failed = |error: &dyn std::fmt::Display| LearnError::Report(error.to_string());
        let json = serde_json::to_string_pretty(answer).map_err(|error| failed(&error))?;
        let page = report::page(&pool.dataset, explanation, &provenance)
            .map_err(|error| failed(&error))?;
        Ok(Some(NewModel {
            text: ModelText { train: grown.train, track: grown.track },
            origin,
            answer_json: Some(json + "\n"),
            report_html: Some(page),
        }))
    }
}

/// Writes an event unless all of its runs were reported before; the runs that were are left out.
fn put_event(models: &TrainModels, mut event: MaintenanceEvent) -> Result<Option<u64>, LearnError> {
    let known = models.events()?;
    let is_known = |window: &EventWindow| {
        let same_kind = known.iter().filter(|(_, other)| other.kind == event.kind);
        same_kind.flat_map(|(_, other)| &other.windows).any(|it| it.sha256 == window.sha256)
    };
    let (known_windows, new): (Vec<_>, Vec<_>) = event.windows.iter().cloned().partition(is_known);
    if new.is_empty() {
        return Ok(None);
    }
    if !known_windows.is_empty() {
        event.windows = new;
        event.sentence = sentence(&event);
    }
    let number = models.put_event(&event)?;
    warn!(train = models.train().0, number, "maintenance event: {}", event.sentence);
    Ok(Some(number))
}

/// Returns the files of the model in force and the runs.
fn digests(model: &Path, pool: &Pool) -> Vec<FileDigest> {
    let model_files = [TRAIN_FILE, TRACK_FILE].map(|name| model.join(name));
    let of_model = model_files.iter().filter(|path| path.exists()).map(|path| {
        let content = std::fs::read(path).unwrap_or_default();
        let path = path.display().to_string();
        FileDigest { path, bytes: content.len(), sha256: hex(&content) }
    });
    let of_runs = pool.runs.iter().map(|run| FileDigest {
        path: run.path.display().to_string(),
        bytes: std::fs::metadata(&run.path).map_or(0, |known| known.len() as usize),
        sha256: run.sha256.clone(),
    });
    of_model.chain(of_runs).collect()
}

/// Returns whether a kind acts only in the runs in which it is found, even where the answer names no runs.
fn is_passing(kind: &str) -> bool {
    EffectKind::from_name(kind).is_some_and(|kind| policy_of(kind).is_passing)
}

/// Returns an effect in the form in which records hold it.
pub fn found_effect(effect: &EffectAnswer) -> FoundEffect {
    FoundEffect {
        kind: effect.kind.into(),
        intervals_m: effect.place.intervals_m.clone().unwrap_or_default(),
        parameters: figures(effect),
    }
}

/// Returns the numbers of an effect that have a standard deviation, by name; those of a list by place or run.
fn figures(effect: &EffectAnswer) -> BTreeMap<String, ModelFigure> {
    let mut figures = BTreeMap::new();
    for (name, value) in &effect.parameters {
        let values: Vec<(String, f64)> = match value {
            ParameterValue::Number(number) => vec![(name.clone(), *number)],
            ParameterValue::ByRun(by_run) => {
                by_run.iter().map(|(run, number)| (format!("{name} {run}"), *number)).collect()
            }
            ParameterValue::List(list) => listed("", name, list.iter().copied()),
            ParameterValue::Sections(list) => {
                listed("mass_factor ", name, list.iter().map(|it| it.mass_factor))
            }
            ParameterValue::Windows(list) => {
                listed("mass_factor ", name, list.iter().map(|it| it.mass_factor))
            }
            ParameterValue::Profile(_) | ParameterValue::Formula(_) => continue,
        };
        let deviations: Vec<f64> = match effect.std.get(name) {
            Some(ParameterValue::Number(std)) => vec![*std],
            Some(ParameterValue::List(list)) => list.clone(),
            Some(ParameterValue::ByRun(by_run)) => by_run.values().copied().collect(),
            _ => continue,
        };
        let known = values.into_iter().zip(deviations);
        figures.extend(known.map(|((name, value), std)| (name, ModelFigure { value, std })));
    }
    figures
}

fn listed(what: &str, name: &str, list: impl Iterator<Item = f64>) -> Vec<(String, f64)> {
    list.enumerate().map(|(k, number)| (format!("{what}{name}[{k}]"), number)).collect()
}

/// Returns true for an effect of certain runs or windows of time, which no file of a train or a line can express.
pub fn is_event(effect: &EffectAnswer, not_expressed: &[String]) -> bool {
    let place = &effect.place;
    let by_run = |value: &ParameterValue| matches!(value, ParameterValue::ByRun(_));
    not_expressed.iter().any(|kind| kind == effect.kind)
        && (is_passing(effect.kind)
            || place.windows.is_some()
            || place.runs.is_some()
            || effect.parameters.values().any(by_run))
}

/// Returns true for an event that is reported at once or is over: other kinds that act in the newest of the fit runs
/// may be about to last, and are looked at again when there are newer ones.
pub fn is_to_be_reported(event: &MaintenanceEvent, explanation: &Explanation) -> bool {
    let newest = explanation.problem.runs.last().map(|run| run.file.as_str());
    let acts_in_newest = event.windows.iter().any(|window| Some(window.run.as_str()) == newest);
    is_passing(&event.kind) || !acts_in_newest
}

/// Returns the errors on the runs held out, where the model is better on them.
pub fn improvement(answer: &ExplainAnswer) -> Option<HeldOutError> {
    let (before_mps, after_mps) = (answer.rmse_before?, answer.rmse_after?);
    (after_mps < before_mps).then_some(HeldOutError { before_mps, after_mps })
}

/// Returns an event of the runs that a pool holds; `model` was in force.
pub fn event(
    effect: &EffectAnswer,
    pool: &Pool,
    explanation: &Explanation,
    (model, found): (ModelHash, UtcSecond),
) -> MaintenanceEvent {
    let windows = windows(effect, pool, explanation);
    let FoundEffect { kind, intervals_m, parameters } = found_effect(effect);
    let times = |windows: &[EventWindow]| {
        let of = |window: &EventWindow| {
            pool.runs.iter().find(|run| run.sha256 == window.sha256).map(|run| run.recorded)
        };
        let times: Vec<UtcSecond> = windows.iter().filter_map(of).collect();
        Some([*times.iter().min()?, *times.iter().max()?])
    };
    let acted = times(&windows);
    let p_value = effect.p_value;
    let mut event = MaintenanceEvent {
        sentence: String::new(),
        size: parameters,
        kind,
        found,
        acted,
        model,
        intervals_m,
        p_value,
        windows,
    };
    event.sentence = sentence(&event);
    event
}

/// Returns the windows of an effect; whole runs where only these are known, all fit runs where not even they are.
fn windows(effect: &EffectAnswer, pool: &Pool, explanation: &Explanation) -> Vec<EventWindow> {
    let sha256_of = |name: &str| {
        pool.runs
            .iter()
            .find(|run| run.name == name)
            .map(|run| run.sha256.clone())
            .unwrap_or_default()
    };
    if let Some(windows) = &effect.place.windows {
        let window = |it: &dynocar_analysis::explain::answer::RunWindow| EventWindow {
            sha256: sha256_of(&it.run),
            run: it.run.clone(),
            t_start_s: it.t_start_s,
            t_end_s: it.t_end_s,
        };
        return windows.iter().map(window).collect();
    }
    let by_run = effect.parameters.values().find_map(|value| match value {
        ParameterValue::ByRun(by_run) => Some(by_run.keys().cloned().collect()),
        _ => None,
    });
    let fit_runs = || explanation.problem.runs.iter().map(|run| run.file.clone()).collect();
    let names: Vec<String> = effect.place.runs.clone().or(by_run).unwrap_or_else(fit_runs);
    let whole = |name: &String| {
        let mut runs = explanation.problem.runs.iter().chain(&explanation.holdout);
        let run = runs.find(|run| run.file == *name)?;
        Some(EventWindow {
            run: name.clone(),
            sha256: sha256_of(name),
            t_start_s: run.offset_s,
            t_end_s: run.offset_s + run.duration_s(),
        })
    };
    names.iter().filter_map(whole).collect()
}

/// Returns an event in a sentence for people.
pub fn sentence(event: &MaintenanceEvent) -> String {
    let kind = kind_name(&event.kind);
    let mut runs: Vec<&str> = event.windows.iter().map(|window| &window.run[..]).collect();
    runs.dedup();
    let shown = match runs.as_slice() {
        [run] => format!("run {run}"),
        [first, .., last] => format!("{} runs from {first} to {last}", runs.len()),
        [] => "no run".into(),
    };
    let mut text = format!("{kind} in {shown}");
    if let Some([first, last]) = event.acted {
        text += &match first == last {
            true => format!(", recorded {first}"),
            false => format!(", recorded {first} to {last}"),
        };
    }
    if !event.intervals_m.is_empty() {
        text += &format!(", {}", words::stretches(&event.intervals_m));
    }
    let sizes = event.size.iter().filter_map(|(name, it)| it.of_effect(name));
    let sizes: Vec<String> = sizes.take(words::PLACES_MAX).collect();
    if sizes.is_empty() { text } else { format!("{text}: {}", sizes.join(", ")) }
}

/// Returns the open question of the runs; `None` where they determine enough.
pub fn question(
    answer: &ExplainAnswer,
    train: TrainId,
    (model, at): (ModelHash, UtcSecond),
) -> Option<OpenQuestion> {
    if !matches!(answer.verdict, Verdict::Ambiguous | Verdict::Unknown) {
        return None;
    }
    let effects = answer.effects.iter().map(|effect| effect.kind);
    let mut kinds: Vec<String> =
        effects.chain(answer.ambiguous_with.iter().copied()).map(str::to_owned).collect();
    kinds.sort();
    kinds.dedup();
    Some(OpenQuestion {
        train: train.0,
        at,
        model,
        verdict: answer.verdict.name().into(),
        kinds,
        statement: answer.statement.clone(),
        experiment: answer.experiment.clone(),
    })
}
