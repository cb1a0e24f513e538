//! The map's own small error where its shape is known: no effect, but what others are looked for beside.

use dynocar_model::terms::Parameter;
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Handling, Hypothesis, Nature, On, Past, SharedHypothesis};
use crate::explain::evidence::{RunData, SampleForces};

/// The error of the map in the shape in which it was fitted, of any size: one number in the place of its many.
pub fn map_error_as_fitted(error: SharedHypothesis, permille: &[f64]) -> Candidate {
    let parameters = [Parameter::new("share", (-10.0, 10.0), 0.1)];
    Candidate::new(Fitted { error, permille: permille.to_vec(), parameters }, vec![1.0])
}

#[derive(Debug)]
struct Fitted {
    error: SharedHypothesis,
    /// Its parameters.
    permille: Vec<f64>,
    parameters: [Parameter; 1],
}

impl Hypothesis for Fitted {
    fn nature(&self) -> Nature<'_> {
        Nature { handling: Handling::Gradient, ..Nature::of(EffectKind::None, &self.parameters) }
    }

    fn apply(&self, parameters: &[f64], on: On, forces: &mut [SampleForces]) {
        let mut with = forces.to_vec();
        self.error.apply(&self.permille, on, &mut with);
        for (force, with) in forces.iter_mut().zip(with) {
            force.gradient_permille +=
                parameters[0] * (with.gradient_permille - force.gradient_permille);
        }
    }

    fn gradient_permille(&self, _parameter: usize, run: &RunData, permille: &mut Vec<f64>) {
        let mut with: Vec<SampleForces> = run.declared.all().collect();
        let on = On { run, first: 0, past: &mut Past::default() };
        self.error.apply(&self.permille, on, &mut with);
        let added = with.iter().zip(run.declared.all());
        permille.clear();
        permille.extend(added.map(|(with, own)| with.gradient_permille - own.gradient_permille));
    }
}
