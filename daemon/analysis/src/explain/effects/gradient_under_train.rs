//! The gradient under a train where it differs from the map's, averaged over the train's length: steps that the line
//! rounds in vertical curves, and a mass that is not spread evenly, as with a locomotive ahead. Both are the same in every
//! run and at every step, so that no scatter between the runs shows them. They are no effects, but errors that are in the
//! finished model.
//!
//! Of a rounded step a train feels less than the map states, as if its inertia were greater; the length of the curves is
//! not known.

use std::sync::Arc;

use dynocar_model::terms::Parameter;
use dynocar_model::terms::extra::Covariate;
use dynocar_model::track::{StepProfile, Track};
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::DMatrix;

use super::vertical_curves::VerticalCurves;
use super::{Candidate, Handling, Hypothesis, Nature, On};
use crate::explain::evidence::{RunData, SampleForces};

/// Standard deviation of the share of the usual rounding, its greatest value, and the step of differences: lengths up
/// to three times the usual one.
const USUAL_STD: f64 = 1.0;
const SHARE_MAX: f64 = 10.0;
const STEP: f64 = 0.1;
/// Standard deviation, as a share of the train's length, of the distance from the middle to the centre of mass, its
/// greatest value, and half the distance between the places whose gradients are compared.
const CENTRE_STD_SHARE: f64 = 0.03;
const CENTRE_MAX_SHARE: f64 = 0.25;
const CENTRE_HALF_SHARE: f64 = 0.05;

/// Cause of a gradient of its own, in proportion to the parameter.
#[derive(Clone, Debug)]
enum Cause {
    /// Rounded steps: their addition to the gradient in ‰, and that where trains the other way have another gradient.
    Rounding { added: Option<Box<StepProfile>>, falling: Option<Box<StepProfile>> },
    /// The centre of mass a metre ahead of the train's middle.
    MassCentre,
}

#[derive(Debug)]
struct UnderTrain {
    track: Arc<Track>,
    train_length_m: f64,
    cause: Cause,
    parameters: [Parameter; 1],
    information: DMatrix<f64>,
}

/// Returns the change of the gradient by vertical curves that are a factor longer than some usual ones, times a share as
/// the parameter, with its start.
pub fn rounded_steps(
    track: Arc<Track>,
    train_length_m: f64,
    (usual, factor): (VerticalCurves, f64),
    share: f64,
) -> Candidate {
    let curves = usual.times(factor);
    let added =
        |steps: Option<&StepProfile>| steps.and_then(|it| curves.added_to(it)).map(Box::new);
    let cause = Cause::Rounding {
        added: added(track.gradient()),
        falling: added(track.survey.gradient_falling.as_ref()),
    };
    let own = factor.powi(-2);
    let rounded = UnderTrain {
        track,
        train_length_m,
        cause,
        parameters: [Parameter::new("vertical_curves", (0.0, SHARE_MAX * own), STEP * own)],
        information: DMatrix::from_element(1, 1, (USUAL_STD * own).powi(-2)),
    };
    Candidate::new(rounded, vec![share])
}

/// Returns the change of the gradient by a centre of mass some m ahead of the train's middle as the parameter.
pub fn mass_centre(track: Arc<Track>, train_length_m: f64) -> Candidate {
    let [std_m, most_m] = [CENTRE_STD_SHARE, CENTRE_MAX_SHARE].map(|share| share * train_length_m);
    let ahead = UnderTrain {
        track,
        train_length_m,
        cause: Cause::MassCentre,
        parameters: [Parameter::new("mass_centre", (-most_m, most_m), STEP * std_m)],
        information: DMatrix::from_element(1, 1, std_m.powi(-2)),
    };
    Candidate::new(ahead, vec![0.0])
}

impl UnderTrain {
    /// Returns the addition of a unit of the parameter in ‰ along the travel at a chainage in m.
    fn added_permille(&self, centre_m: f64, direction: f64) -> f64 {
        let at = |offset_m: f64| {
            let place_m = centre_m + offset_m;
            self.track.gradient_towards_permille(direction, place_m, self.train_length_m)
        };
        let added_permille = match &self.cause {
            Cause::Rounding { added, falling } => {
                let is_other_way = direction < 0.0 && self.track.survey.gradient_falling.is_some();
                let added = if is_other_way { falling } else { added };
                let true_m = centre_m - self.track.gradient_shift_m;
                added.as_ref().map_or(0.0, |it| it.mean_around(true_m, self.train_length_m))
            }
            Cause::MassCentre => {
                let half_m = CENTRE_HALF_SHARE * self.train_length_m;
                let ends = at(direction * half_m).zip(at(-direction * half_m));
                ends.map_or(0.0, |(ahead, behind)| (ahead - behind) / (2.0 * half_m))
            }
        };
        direction * added_permille
    }
}

impl Hypothesis for UnderTrain {
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

    fn under_train(track: &Track, train_length_m: f64, cause: Cause) -> UnderTrain {
        UnderTrain {
            track: Arc::new(track.clone()),
            train_length_m,
            cause,
            parameters: [Parameter::new("test", (0.0, SHARE_MAX), STEP)],
            information: DMatrix::identity(1, 1),
        }
    }

    #[test]
    fn a_mass_ahead_feels_a_step_before_the_middle_does_in_both_directions() {
        let steps = [(0.0, 0.0), (1000.0, 8.0)];
        let track = Track::new("line".into(), None, Some(&steps), None, None).unwrap();
        let train = under_train(&track, 100.0, Cause::MassCentre);
        // 8 ‰ come over 100 m; the other way the train leaves them as gently.
        for (chainage_m, direction) in [(1000.0, 1.0), (1000.0, -1.0), (975.0, 1.0)] {
            assert!((train.added_permille(chainage_m, direction) - 0.08).abs() < 1e-9);
        }
        assert_eq!(train.added_permille(1200.0, 1.0), 0.0);
    }

    #[test]
    fn a_rounded_step_is_climbed_earlier_and_left_as_early_the_other_way() {
        let steps = [(0.0, 0.0), (1000.0, 8.0)];
        let track = Track::new("line".into(), None, Some(&steps), None, None).unwrap();
        let added = VerticalCurves::USUAL.added_to(track.gradient().unwrap()).map(Box::new);
        let train = under_train(&track, 80.0, Cause::Rounding { added, falling: None });
        assert!(train.added_permille(960.0, 1.0) > 0.2);
        assert_eq!(train.added_permille(960.0, -1.0), -train.added_permille(960.0, 1.0));
    }
}
