//! The directory of models.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::TrainId;

use super::origin::{MaintenanceEvent, Origin};
use super::records::{
    self, Action, Decision, ModelChoice, ModelsError, NewDecision, Numbered, in_force_after,
    names_in, read_record, text_of,
};
use super::text::{ModelHash, ModelText, TRACK_FILE, TRAIN_FILE};
use crate::stamp::UtcSecond;
use crate::storage::{Disk, Storage, make_once, part_of};

/// Where a model came from, in its folder.
pub const ORIGIN_FILE: &str = "origin.toml";
/// The answer of `explain`, in a model's folder.
pub const ANSWER_FILE: &str = "answer.json";
/// The report of `explain`, in a model's folder.
pub const REPORT_FILE: &str = "report.html";
/// Folder of the decisions on a train's models.
const DECISIONS: &str = "decisions";
/// Folder of a train's maintenance events.
const EVENTS: &str = "events";
/// File of the measurements in the trials of candidates, written by the daemon.
pub const TRIALS_FILE: &str = "trials.json";

/// A store of models.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Store {
    directory: PathBuf,
}

/// A train's part of the store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrainModels {
    train: TrainId,
    folder: PathBuf,
}

/// A model that is to be put into the store.
#[derive(Clone, Debug, PartialEq)]
pub struct NewModel {
    /// Its files.
    pub text: ModelText,
    /// Where it came from.
    pub origin: Origin,
    /// Answer of `explain`, for machines.
    pub answer_json: Option<String>,
    /// Answer of `explain`, as a page.
    pub report_html: Option<String>,
}

/// A model of the store.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    /// Its hash.
    pub hash: ModelHash,
    /// Where it came from.
    pub origin: Origin,
    /// Its folder.
    pub folder: PathBuf,
}

/// The models of a train.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Listing {
    /// The oldest first.
    pub models: Vec<Stored>,
    /// Entries among them that are not models of the store, with the reason.
    pub left_out: Vec<(PathBuf, String)>,
}

impl Store {
    /// Returns the store in a directory, which is made with the first model.
    pub fn at(directory: &Path) -> Self {
        Store { directory: directory.into() }
    }

    /// Returns its directory.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Returns a train's part of it.
    pub fn train(&self, train: TrainId) -> TrainModels {
        TrainModels { train, folder: self.directory.join(train.0.to_string()) }
    }

    /// Returns the trains of which it holds something, by number.
    ///
    /// # Errors
    ///
    /// When the directory cannot be read.
    pub fn trains(&self) -> Result<Vec<TrainId>, ModelsError> {
        let is_canonical = |name: &String, number: &u64| *name == number.to_string();
        let number = |name: String| name.parse().ok().filter(|number| is_canonical(&name, number));
        let mut trains: Vec<u64> =
            names_in(&self.directory)?.into_iter().filter_map(number).collect();
        trains.sort_unstable();
        Ok(trains.into_iter().map(TrainId).collect())
    }
}

impl TrainModels {
    /// Returns the train.
    pub fn train(&self) -> TrainId {
        self.train
    }

    /// Returns where the train's models lie.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Puts a model into the store; one that is there already stays as it is.
    ///
    /// # Errors
    ///
    /// When it cannot be written, or its name is taken by another model.
    pub fn put(&self, model: &NewModel) -> Result<ModelHash, ModelsError> {
        let hash = model.text.hash();
        let folder = self.folder_of(hash);
        if folder.exists() {
            return self.text(hash).map(|_| hash);
        }
        match write_model(&Disk, &folder, model) {
            // Another writer was faster.
            Err(ModelsError::Storage(error)) if is_taken(error.source.kind()) => {
                self.text(hash).map(|_| hash)
            }
            written => written.map(|()| hash),
        }
    }

    /// Puts the model that a configuration declares into the store, so that models that grow from it have a parent
    /// there.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn put_declared(
        &self,
        text: &ModelText,
        made: UtcSecond,
    ) -> Result<ModelHash, ModelsError> {
        let origin = Origin::written("What the configuration declares.", None, made);
        self.put(&NewModel { text: text.clone(), origin, answer_json: None, report_html: None })
    }

    /// Returns the models, the oldest first, with the entries among them that are not models.
    ///
    /// # Errors
    ///
    /// When the folder cannot be read; one model that cannot be is left out.
    pub fn list(&self) -> Result<Listing, ModelsError> {
        let mut listing = Listing::default();
        for name in names_in(&self.folder)? {
            let folder = self.folder.join(&name);
            match name.parse::<ModelHash>() {
                Ok(hash) => match self.stored(hash) {
                    Ok(stored) => listing.models.push(stored),
                    Err(error) => listing.left_out.push((folder, error.to_string())),
                },
                Err(_) if [DECISIONS, EVENTS, TRIALS_FILE].contains(&name.as_str()) => {}
                Err(error) => listing.left_out.push((folder, error.to_string())),
            }
        }
        listing.models.sort_by_key(|stored| (stored.origin.made, stored.hash));
        Ok(listing)
    }

    /// Returns a model with its origin.
    ///
    /// # Errors
    ///
    /// When it is not there, or was changed.
    pub fn stored(&self, hash: ModelHash) -> Result<Stored, ModelsError> {
        self.text(hash)?;
        let folder = self.folder_of(hash);
        Ok(Stored { hash, origin: read_record(&folder.join(ORIGIN_FILE))?, folder })
    }

    /// Returns the files of a model, which are those that were put there.
    ///
    /// # Errors
    ///
    /// When it is not there, or was changed.
    pub fn text(&self, hash: ModelHash) -> Result<ModelText, ModelsError> {
        let folder = self.folder_of(hash);
        if !folder.is_dir() {
            return Err(ModelsError::NoModel { hash, train: self.train });
        }
        let track = folder.join(TRACK_FILE);
        let text = ModelText {
            train: text_of(&folder.join(TRAIN_FILE))?,
            track: track.exists().then(|| text_of(&track)).transpose()?,
        };
        let found = text.hash();
        if found == hash { Ok(text) } else { Err(ModelsError::Changed { path: folder, found }) }
    }

    /// Returns a model as the daemon uses it.
    ///
    /// # Errors
    ///
    /// If it is not there, was changed, or cannot be read by this version.
    pub fn load(&self, hash: ModelHash) -> Result<(TrainModel, Option<Track>), ModelsError> {
        let folder = self.folder_of(hash);
        Ok(self.text(hash)?.parse(&folder.join(TRAIN_FILE), &folder.join(TRACK_FILE))?)
    }

    /// Returns the decisions, in order.
    ///
    /// # Errors
    ///
    /// When one cannot be read.
    pub fn decisions(&self) -> Result<Vec<Numbered<Decision>>, ModelsError> {
        records::read_all(&self.folder.join(DECISIONS))
    }

    /// Returns the model in force after the last decision; `None` for the declared model.
    ///
    /// # Errors
    ///
    /// When a decision cannot be read.
    pub fn in_force(&self) -> Result<Option<ModelHash>, ModelsError> {
        let decisions = self.decisions()?;
        Ok(in_force_after(decisions.iter().map(|(_, decision)| decision)).pop())
    }

    /// Takes a decision; gives its number.
    ///
    /// # Errors
    ///
    /// When no name is given, the model is not in the store or in force already, or the decision cannot be written.
    pub fn decide(&self, new: &NewDecision) -> Result<u64, ModelsError> {
        if new.by.trim().is_empty() {
            return Err(ModelsError::NoName);
        }
        loop {
            let decisions = self.decisions()?;
            let decision = self.decision(new, &decisions)?;
            let number = decisions.last().map_or(1, |(number, _)| number + 1);
            if records::write(&Disk, &self.folder.join(DECISIONS), number, &decision)? {
                return Ok(number);
            }
            // Somebody else decided meanwhile: the decision is checked anew.
        }
    }

    fn decision(
        &self,
        new: &NewDecision,
        before: &[Numbered<Decision>],
    ) -> Result<Decision, ModelsError> {
        let mut stack = in_force_after(before.iter().map(|(_, decision)| decision));
        let from = stack.last().copied();
        let (action, model) = match new.what {
            ModelChoice::Adopt(hash) | ModelChoice::Reject(hash) if from == Some(hash) => {
                return Err(ModelsError::InForce { hash });
            }
            ModelChoice::Adopt(hash) => (Action::Adopted, Some(hash)),
            ModelChoice::Reject(hash) => (Action::Rejected, Some(hash)),
            ModelChoice::RollBack => {
                stack.pop().ok_or(ModelsError::NothingAdopted { train: self.train })?;
                (Action::RolledBack, stack.pop())
            }
        };
        if let Some(hash) = model {
            self.load(hash)?;
        }
        let (by, reason) = (new.by.trim().to_owned(), new.reason.clone());
        Ok(Decision { action, model, from, by, reason, at: new.at })
    }

    /// Models that grew from the one in force and on which nothing was decided, the newest first.
    ///
    /// # Errors
    ///
    /// When models or decisions cannot be read.
    pub fn candidates(&self, in_force: ModelHash) -> Result<Vec<ModelHash>, ModelsError> {
        let decisions = self.decisions()?;
        let is_decided =
            |hash: ModelHash| decisions.iter().any(|(_, decision)| decision.model == Some(hash));
        let models = self.list()?.models.into_iter().rev();
        Ok(models
            .filter(|it| it.origin.parent == Some(in_force) && !is_decided(it.hash))
            .map(|it| it.hash)
            .collect())
    }

    /// When models, decisions and events last came, for those who look often.
    pub fn changed(&self) -> Vec<SystemTime> {
        let folders = [self.folder.clone(), self.folder.join(DECISIONS), self.folder.join(EVENTS)];
        let modified = |folder: &PathBuf| std::fs::metadata(folder).and_then(|it| it.modified());
        folders.iter().filter_map(|folder| modified(folder).ok()).collect()
    }

    /// Writes a maintenance event down; gives its number.
    ///
    /// # Errors
    ///
    /// When it cannot be written.
    pub fn put_event(&self, event: &MaintenanceEvent) -> Result<u64, ModelsError> {
        let folder = self.folder.join(EVENTS);
        loop {
            let last = self.events()?.last().map_or(0, |(number, _)| *number);
            if records::write(&Disk, &folder, last + 1, event)? {
                return Ok(last + 1);
            }
        }
    }

    /// Returns the maintenance events, in the order in which they were found.
    ///
    /// # Errors
    ///
    /// When one cannot be read.
    pub fn events(&self) -> Result<Vec<Numbered<MaintenanceEvent>>, ModelsError> {
        records::read_all(&self.folder.join(EVENTS))
    }

    fn folder_of(&self, hash: ModelHash) -> PathBuf {
        self.folder.join(hash.to_string())
    }
}

/// Two writers of the same name: the second finds it taken.
fn is_taken(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::AlreadyExists | ErrorKind::DirectoryNotEmpty)
}

/// Writes a model into a folder that is not there yet.
///
/// # Errors
///
/// The system's answer.
pub fn write_model(
    storage: &impl Storage,
    folder: &Path,
    model: &NewModel,
) -> Result<(), ModelsError> {
    let origin = toml::to_string(&model.origin).map_err(|error| ModelsError::Malformed {
        path: folder.join(ORIGIN_FILE),
        message: error.to_string(),
    })?;
    let files = [
        (TRAIN_FILE, Some(&model.text.train)),
        (TRACK_FILE, model.text.track.as_ref()),
        (ORIGIN_FILE, Some(&origin)),
        (ANSWER_FILE, model.answer_json.as_ref()),
        (REPORT_FILE, model.report_html.as_ref()),
    ];
    let files: Vec<(&str, &[u8])> =
        files.iter().filter_map(|(name, text)| Some((*name, text.as_ref()?.as_bytes()))).collect();
    let beside = part_of(folder);
    let made = make_once(storage, folder, &beside, &files);
    if made.is_err() {
        // The files made so far are of no use; a failure to remove them changes nothing.
        let _ = std::fs::remove_dir_all(&beside);
    }
    Ok(made?)
}

#[cfg(test)]
mod tests;
