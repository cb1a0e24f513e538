//! The gradient under a train where it differs from the map's, averaged over the train's length: steps that the line
//! rounds in vertical curves, and a mass that is not spread evenly, as with a locomotive ahead. Both are the same in every
//! run and at every step, so that no scatter between the runs shows them. They are no effects, but errors that are in the
//! finished model.
//!
//! Of a rounded step a train feels less than the map states, as if its inertia were greater. Neither the length nor the
//! radius of the curves is known; maps of some lines have curves of one length, of others of one radius.

use std::sync::Arc;

use dynocar_model::terms::Parameter;
use dynocar_model::terms::extra::Covariate;
use dynocar_model::track::{StepProfile, Track};
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::DMatrix;

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
/// Usual length in m over which a step is rounded; the change of the force on a train grows with the square of the
/// length.
const USUAL_LENGTH_M: f64 = 60.0;
/// Greatest distance in m between the parts of a rounded step.
const APART_M: f64 = 15.0;

/// The vertical curves of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VerticalCurves {
    /// All of one length in m.
    OfLength(f64),
    /// All of one radius in m: greater steps are rounded over a greater length.
    OfRadius(f64),
}

impl VerticalCurves {
    /// Curves of the usual length.
    pub const USUAL: VerticalCurves = VerticalCurves::OfLength(USUAL_LENGTH_M);

    /// Returns curves of one radius whose effect over all steps of a line is that of the usual length; `None` without a
    /// step.
    pub fn of_usual_radius(track: &Track) -> Option<Self> {
        let profile = track.gradient()?;
        let values: Vec<f64> = profile.entries().map(|entry| entry.1).collect();
        let steps = || values.windows(2).map(|pair| 1e-3 * (pair[1] - pair[0]).abs());
        let power = |exponent: i32| steps().map(|step| step.powi(exponent)).sum::<f64>();
        // The effect of a step is in proportion to step · length².
        let radius_m = USUAL_LENGTH_M * (power(2) / power(6)).powf(0.25);
        radius_m.is_finite().then_some(VerticalCurves::OfRadius(radius_m))
    }

    /// Returns the same curves with all lengths times a factor.
    pub fn times(self, factor: f64) -> Self {
        match self {
            VerticalCurves::OfLength(length_m) => VerticalCurves::OfLength(factor * length_m),
            VerticalCurves::OfRadius(radius_m) => VerticalCurves::OfRadius(factor * radius_m),
        }
    }

    /// Returns the length in m over which a step in ‰ is rounded.
    fn length_m(self, step_permille: f64) -> f64 {
        match self {
            VerticalCurves::OfLength(length_m) => length_m,
            VerticalCurves::OfRadius(radius_m) => 1e-3 * radius_m * step_permille.abs(),
        }
    }

    /// Returns the gradients with these curves less those of the steps, in ‰ by chainage.
    pub fn added_to(self, steps: &StepProfile) -> Option<StepProfile> {
        let entries: Vec<(f64, f64)> = steps.entries().collect();
        let mut changes: Vec<(f64, f64)> = Vec::new();
        for (index, pair) in entries.windows(2).enumerate() {
            let [(from_m, before), (at_m, after)] = [pair[0], pair[1]];
            let step_permille = after - before;
            // Greater curves would begin before the step ahead of them.
            let next_m = entries.get(index + 2).map_or(f64::INFINITY, |next| next.0);
            let most_m = match self {
                VerticalCurves::OfLength(_) => f64::INFINITY,
                VerticalCurves::OfRadius(_) => (at_m - from_m).min(next_m - at_m),
            };
            let length_m = self.length_m(step_permille).min(most_m);
            let parts = (length_m / APART_M).ceil().max(2.0);
            let place_m = |k: usize| at_m + length_m * ((k as f64 + 0.5) / parts - 0.5);
            changes.extend((0..parts as usize).map(|k| (place_m(k), step_permille / parts)));
            changes.push((at_m, -step_permille));
        }
        changes.sort_by(|one, other| one.0.total_cmp(&other.0));
        let first_m = changes.first()?.0 - 1.0;
        let mut rounded = vec![(first_m, 0.0)];
        let mut permille = 0.0;
        for (at_m, change) in changes {
            permille += change;
            match rounded.last_mut() {
                Some(last) if last.0 >= at_m => last.1 = permille,
                _ => rounded.push((at_m, permille)),
            }
        }
        // The sum of a step and its parts leaves a rounding error.
        rounded.last_mut()?.1 = 0.0;
        StepProfile::new(&rounded).ok()
    }
}

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

    fn line(steps: &[(f64, f64)]) -> Track {
        Track::new("line".into(), None, Some(steps), None, None).unwrap()
    }

    #[test]
    fn a_step_is_rounded_to_both_sides_and_a_slope_stays() {
        let track = line(&[(0.0, 0.0), (1000.0, 8.0)]);
        let added = VerticalCurves::USUAL.added_to(track.gradient().unwrap()).unwrap();
        let under = |centre_m: f64, train_m: f64| added.mean_around(centre_m, train_m);
        // Where the train comes under the step it climbs already, and less where it would be on it.
        assert!(under(960.0, 80.0) > 0.2 && under(1040.0, 80.0) < -0.2);
        assert!(under(985.0, 10.0) > under(985.0, 80.0));
        for chainage_m in [800.0, 1000.0, 1200.0] {
            assert!(under(chainage_m, 80.0).abs() < 1e-9, "{}", under(chainage_m, 80.0));
        }
    }

    #[test]
    fn curves_of_one_radius_are_longer_at_greater_steps_and_end_at_the_next() {
        let track = line(&[(0.0, 0.0), (1000.0, 4.0), (2000.0, 12.0), (2050.0, 0.0)]);
        let steps = track.gradient().unwrap();
        let added = VerticalCurves::OfRadius(10_000.0).added_to(steps).unwrap();
        let reach_m = |at_m: f64| {
            let is_added = |offset: &i32| added.value_at(at_m - f64::from(*offset)).abs() > 1e-9;
            (0..200).filter(is_added).max().unwrap()
        };
        assert!((10..=20).contains(&reach_m(1000.0)), "{}", reach_m(1000.0));
        // 80 m by its radius, 50 m to the next step.
        assert!((15..=25).contains(&reach_m(2000.0)), "{}", reach_m(2000.0));
        let length_m = VerticalCurves::OfLength(60.0).added_to(steps).unwrap();
        let VerticalCurves::OfRadius(radius_m) = VerticalCurves::of_usual_radius(&track).unwrap()
        else {
            panic!("a radius");
        };
        assert!((5000.0..6000.0).contains(&radius_m), "{radius_m}");
        assert!(length_m.value_at(980.0) > 0.0);
    }

    #[test]
    fn a_level_line_has_no_curves() {
        let track = line(&[(0.0, 2.0)]);
        assert_eq!(VerticalCurves::of_usual_radius(&track), None);
        assert_eq!(VerticalCurves::USUAL.added_to(track.gradient().unwrap()), None);
    }

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
