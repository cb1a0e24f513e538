//! Conclusion of an explanation for the store: a candidate, events, or nothing new.

use std::path::Path;

use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::answer::{EffectAnswer, Verdict};
use dynocar_analysis::explain::evidence::{SCORE_MIN, p_value};
use tracing::{info, warn};

use super::LearnError;
use super::finding::{
    event, found_effect, improvement, is_event, is_to_be_reported, question, sentence,
};
use super::memory::{LearnerMemory, OpenQuestion};
use super::pool::Pool;
use crate::report;
use crate::report::provenance::{FileDigest, Provenance, hex};
use crate::updated::{UpdatedTexts, updated_texts};
use dynocar::models::origin::{EventWindow, SourceFile};
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar::models::{
    MaintenanceEvent, ModelHash, ModelText, NewModel, Origin, TrainModels, UtcSecond,
};

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
