//! Vertical curves: a line rounds the steps of its gradients, which maps state as steps. Neither the length nor the radius
//! of the curves is known; maps of some lines have curves of one length, of others of one radius.

use dynocar_model::track::{StepProfile, Track};

/// Usual length in m over which a step is rounded; the change of the force on a train grows with the square of the
/// length.
const USUAL_LENGTH_M: f64 = 60.0;
/// Greatest distance in m between the parts of a rounded step.
const APART_M: f64 = 15.0;

/// The curves of a line.
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
}
