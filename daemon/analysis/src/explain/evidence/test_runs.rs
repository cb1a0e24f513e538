//! A sample for the tests of what the runs say.

use std::sync::Arc;

use dynocar_model::force::{ForceResolver, ResolvedSample, ValidSample};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{SampleField, TrainSample};

use crate::dataset::DATASET_TRAIN;

/// A train of 100 t with gamma 0.06 that coasts on the level at 20 m/s.
pub fn coasting() -> ResolvedSample {
    let bare = TrainModel::bare("test", 100e3, Davis { a: 0.0, b: 0.0, c: 0.0 });
    let train = TrainModel { rotating_mass_factor: 0.06, ..bare };
    let mut sample = TrainSample::empty(DATASET_TRAIN);
    for (field, value) in [
        (SampleField::Speed, 20.0),
        (SampleField::TractionForce, 0.0),
        (SampleField::BrakeForce, 0.0),
        (SampleField::Gradient, 0.0),
    ] {
        sample.set(field, value);
    }
    let valid = ValidSample { sample: &sample, step_s: 0.0, segment: 1 };
    ForceResolver::new(Arc::new(train), None).resolve(&valid)
}
