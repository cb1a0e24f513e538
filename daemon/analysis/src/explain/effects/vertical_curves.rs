//! Vertical curves: a line rounds the steps of its gradient, where a map states the steps. They are the same in every
//! run and at every step, so that no scatter between the runs shows them. A train feels less of each step than the map
//! states, as if its inertia were greater. The length of the curves is not known. They are no effect, but an error that
//! is in the finished model.

use std::sync::Arc;

use dynocar_model::terms::Parameter;
use dynocar_model::terms::extra::Covariate;
use dynocar_model::track::Track;
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::DMatrix;

use super::{Candidate, Handling, Hypothesis, Nature, On};
use crate::explain::evidence::{RunData, SampleForces};

/// Usual length in m over which a step is rounded; the change of the force on a train grows with the square of the
/// length.
pub const USUAL_LENGTH_M: f64 = 60.0;
/// Standard deviation of the factor on the usual rounding, its greatest value, and the step of differences: lengths up
/// to 190 m.
const USUAL_STD: f64 = 1.0;
const SHARE_MAX: f64 = 10.0;
const STEP: f64 = 0.1;
/// Greatest distance in m between the places over which the gradient is averaged.
const APART_M: f64 = 15.0;

#[derive(Debug)]
struct Rounded {
    track: Arc<Track>,
    train_length_m: f64,
    /// Length in m over which steps are rounded for a share of 1.
    length_m: f64,
    parameters: [Parameter; 1],
    information: DMatrix<f64>,
}

/// Returns the change of the gradient by steps that are rounded over a length in m, times a share as the parameter,
/// with its start.
pub fn vertical_curves(
    track: Arc<Track>,
    train_length_m: f64,
    length_m: f64,
    share: f64,
) -> Candidate {
    let usual = (USUAL_LENGTH_M / length_m).powi(2);
    let rounded = Rounded {
        track,
        train_length_m,
        length_m,
        parameters: [Parameter::new("vertical_curves", (0.0, SHARE_MAX * usual), STEP * usual)],
        information: DMatrix::from_element(1, 1, (USUAL_STD * usual).powi(-2)),
    };
    Candidate::new(rounded, vec![share])
}

impl Rounded {
    /// Returns the addition of a share of 1 in ‰ along the travel at a chainage in m.
    fn added_permille(&self, centre_m: f64, direction: f64) -> f64 {
        let at = |offset_m: f64| {
            let place_m = centre_m + offset_m;
            self.track.gradient_towards_permille(direction, place_m, self.train_length_m)
        };
        let places = (self.length_m / APART_M).ceil().max(2.0);
        let place_m = |k: usize| self.length_m * ((k as f64 + 0.5) / places - 0.5);
        let around: f64 = (0..places as usize).filter_map(|k| at(place_m(k))).sum();
        direction * (around / places - at(0.0).unwrap_or(0.0))
    }
}

impl Hypothesis for Rounded {
    fn nature(&self) -> Nature<'_> {
        Nature {
            prior: Some(&self.information),
            handling: Handling::Gradient,
            ..Nature::new(EffectKind::None, &self.parameters)
        }
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let places = run.known(Covariate::Chainage, first).zip(&run.directions[first..]);
        for (force, (centre_m, direction)) in forces.iter_mut().zip(places) {
            if let Some(centre_m) = centre_m {
                force.gradient_permille +=
                    parameters[0] * self.added_permille(centre_m, *direction);
            }
        }
    }

    fn gradient_permille(&self, _parameter: usize, run: &RunData, permille: &mut Vec<f64>) {
        let places = run.known(Covariate::Chainage, 0).zip(&run.directions);
        let added = places.map(|(centre_m, direction)| {
            centre_m.map_or(0.0, |centre_m| self.added_permille(centre_m, *direction))
        });
        permille.clear();
        permille.extend(added);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_rounded_to_both_sides_and_a_slope_stays() {
        let steps = [(0.0, 0.0), (1000.0, 8.0)];
        let track = Track::new("line".into(), None, Some(&steps), None, None).unwrap();
        let rounded = |train_length_m| Rounded {
            track: Arc::new(track.clone()),
            train_length_m,
            length_m: USUAL_LENGTH_M,
            parameters: [Parameter::new("vertical_curves", (0.0, SHARE_MAX), STEP)],
            information: DMatrix::identity(1, 1),
        };
        let (short, train) = (rounded(10.0), rounded(80.0));
        // Where the train comes under the step it climbs already, and less where it would be on it.
        assert!(train.added_permille(960.0, 1.0) > 0.2 && train.added_permille(1040.0, 1.0) < -0.2);
        assert_eq!(train.added_permille(960.0, -1.0), -train.added_permille(960.0, 1.0));
        assert!(short.added_permille(985.0, 1.0) > train.added_permille(985.0, 1.0));
        for chainage_m in [800.0, 1000.0, 1200.0] {
            assert!(train.added_permille(chainage_m, 1.0).abs() < 1e-12);
        }
    }
}
