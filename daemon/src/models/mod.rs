//! A store of models: plain files in one directory, made once and never overwritten.
//!
//! ```text
//! models/1/3f0c5a…/train.toml, track.toml   a model of train 1; the folder's name is the model's hash
//! models/1/3f0c5a…/origin.toml              where it came from
//! models/1/3f0c5a…/answer.json, report.html the answer of `explain`; absent for a declared model
//! models/1/decisions/000001.toml …          who put which model in force, and who took it back
//! models/1/events/000001.toml …             maintenance events of certain runs
//! ```
//!
//! Even if a process dies or the power fails, a model is there as a whole or not at all, and two writers never take the
//! same number.
//!
//! # Layout
//!
//! - [`text`]: a model's files as text, and their hash
//! - [`origin`]: where a model came from; maintenance events
//! - [`records`]: records with numbers: decisions on models, with the resulting model in force, and events
//! - [`store`]: the directory
//! - [`history`]: the present state of each model, and the keys in which two models differ

pub mod history;
pub mod origin;
pub mod records;
pub mod store;
pub mod text;

pub use crate::stamp::UtcSecond;
pub use history::{ModelHistory, State};
pub use origin::{FoundEffect, MaintenanceEvent, ModelFigure, Origin};
pub use records::{Action, Decision, ModelsError, NewDecision};
pub use store::{Listing, NewModel, Store, Stored, TrainModels};
pub use text::{ModelHash, ModelText};
