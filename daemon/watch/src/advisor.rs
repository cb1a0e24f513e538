//! Advice on the next manoeuvre, computed now and then.

use std::sync::Arc;

use dynocar_analysis::advice::noise::{NoiseSeen, davis_of};
use dynocar_analysis::advice::{for_mass, for_resistance, in_words, remedy};
use dynocar_model::train::TrainModel;
use dynocar_shared::{Manoeuvre, Parameter, Quantity, Status};

use crate::state::{PipelineState, TrainState};

/// Inputs for the advice on one train.
#[derive(Clone, Debug)]
pub struct Advisor {
    train: Option<Arc<TrainModel>>,
    noise: NoiseSeen,
}

impl Advisor {
    /// Returns an advisor for a train as it is declared, where its declaration is known.
    pub fn new(train: Option<Arc<TrainModel>>) -> Self {
        Advisor { train, noise: NoiseSeen::default() }
    }

    /// Takes in the snapshots; call it with every one or with some of them.
    pub fn see(&mut self, state: &TrainState) {
        if let Some(resistance) = state.answering(Quantity::Resistance) {
            self.noise.see(&resistance.snapshot);
        }
    }

    /// Returns the advice: the next manoeuvre for the resistance first, then other help, quantity by quantity.
    pub fn advise(&self, state: &TrainState) -> Vec<String> {
        let mut sentences = Vec::new();
        for &quantity in Quantity::ALL {
            let Some(pipeline) = state.answering(quantity) else { continue };
            let words = match remedy(pipeline.status, pipeline.reason) {
                Some(words) => Some(format!("{quantity}: {words}")),
                None => self.to_drive(quantity, pipeline, state),
            };
            sentences.extend(words);
        }
        sentences
    }

    fn to_drive(
        &self,
        quantity: Quantity,
        pipeline: &PipelineState,
        state: &TrainState,
    ) -> Option<String> {
        if !matches!(quantity, Quantity::Resistance | Quantity::Mass) {
            return lacking(quantity, pipeline);
        }
        let Some(train) = &self.train else {
            let words = "give --config FILE: what to drive next needs the train's file";
            return (quantity == Quantity::Resistance).then(|| words.to_owned());
        };
        let resistance = state.answering(Quantity::Resistance)?;
        let mass = state.answering(Quantity::Mass).filter(|it| it.status == Status::Estimated);
        let mass = mass.and_then(|it| {
            Some((it.snapshot.value(Parameter::Mass)?, it.snapshot.std(Parameter::Mass)?))
        });
        let mass = mass.unwrap_or((1e-3 * train.mass_kg, 0.0));
        let Some(noise) = self.noise.noise(&resistance.snapshot, train) else {
            return lacking(quantity, pipeline);
        };
        let advice = match quantity {
            Quantity::Mass => {
                let davis = davis_of(&resistance.snapshot)?;
                for_mass(&pipeline.snapshot, train, davis, &noise)
            }
            _ => for_resistance(&pipeline.snapshot, train, mass, &noise),
        };
        advice.map(|advice| advice.in_words())
    }
}

/// Returns the manoeuvre that a pipeline itself says it lacks, without numbers.
fn lacking(quantity: Quantity, pipeline: &PipelineState) -> Option<String> {
    let missing = pipeline.snapshot.missing_manoeuvres;
    let words: Vec<&str> = Manoeuvre::ALL
        .iter()
        .filter(|manoeuvre| missing & manoeuvre.bit() != 0)
        .map(|&manoeuvre| in_words(manoeuvre))
        .collect();
    (!words.is_empty()).then(|| format!("{quantity} needs {}", words.join(", ")))
}
