//! temporary
#![allow(missing_docs)]
use dynocar_core::{track::Track, train::*};
use std::path::Path;
#[derive(Debug, thiserror::Error)]
#[error("x")]
pub struct DatasetError;
pub fn load_train(_: &Path) -> Result<TrainModel, DatasetError> {
    Ok(TrainModel {
        name: "x".into(),
        mass_kg: 2e5,
        length_m: 120.0,
        cars: 6,
        rotating_mass_factor: 0.08,
        resistance: Davis { a: 1.9, b: 0.03, c: 0.0043 },
        curve_constant_n_per_kn_m: 600.0,
        tunnel_constant_n_per_kn_m: 0.0,
        traction: None,
        brake: None,
        brake_gear: Default::default(),
    })
}
pub fn load_track(_: &Path) -> Result<Track, DatasetError> {
    Err(DatasetError)
}
pub struct Run {
    pub file: String,
    pub samples: Vec<dynocar_shared::TrainSample>,
}
pub struct Dataset {
    pub name: String,
    pub train: std::sync::Arc<TrainModel>,
    pub track: Option<std::sync::Arc<Track>>,
    pub runs: Vec<Run>,
}
pub fn load_dataset(_: &Path) -> Result<Dataset, DatasetError> {
    Err(DatasetError)
}
