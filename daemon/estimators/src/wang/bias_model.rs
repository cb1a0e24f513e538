//! Models over time of an acceleration that the forces do not explain.

use dynocar_core::pipeline::motion::jump_variance;
use dynocar_model::track::gradient_error_kept;

use super::known_motion::KnownMotion;

/// Speed in m/s at which the bias of a behaviour that grows with speed is stated.
const GROWTH_REFERENCE_MPS: f64 = 20.0;
/// Least shape at which an error of the map counts as such a bias.
const SHAPE_MIN: f64 = 0.25;

/// Effect of the error of the map's gradients over a step: see [`gradient_error_kept`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapError {
    /// Standard deviation of the effect in m/s²; 0 where no error is declared.
    pub std_mps2: f64,
    /// Share of the effect that is still there after the step.
    pub keep: f64,
}

impl MapError {
    /// Returns the effect over a step in s that begins with a motion; `mps2_per_permille` turns gradients into
    /// accelerations.
    pub fn over(motion: &KnownMotion, step_s: f64, mps2_per_permille: f64) -> Self {
        if motion.gradient_std_permille <= 0.0 {
            return MapError { std_mps2: 0.0, keep: 1.0 };
        }
        MapError {
            std_mps2: mps2_per_permille * motion.gradient_std_permille,
            keep: gradient_error_kept(motion.speed_mps * step_s),
        }
    }
}

/// An Ornstein-Uhlenbeck process: how a bias behaves in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiasModel {
    /// Standard deviation in m/s².
    pub std_mps2: f64,
    /// Correlation time in s; infinite for a constant.
    pub time_s: f64,
    /// True when the bias is proportional to speed, as the drag of a headwind is; the
    /// deviation then holds at 20 m/s.
    pub grows_with_speed: bool,
}

impl BiasModel {
    /// Returns a behaviour.
    pub fn new(std_mps2: f64, time_s: f64, grows_with_speed: bool) -> Self {
        BiasModel { std_mps2, time_s, grows_with_speed }
    }

    /// Returns whether the behaviour lets forces jump between samples; one that lasts for ever takes them for straight
    /// there.
    pub fn knows_of_jumps(&self) -> bool {
        self.time_s.is_finite()
    }

    /// Returns the variance in (m/s)² of the error of a step because the acceleration changes by so much over it.
    pub fn jump_variance(&self, change_mps2: f64, step_s: f64) -> f64 {
        if self.knows_of_jumps() { jump_variance(change_mps2, step_s) } else { 0.0 }
    }

    /// Returns the share of the bias that is left after a time in s.
    pub fn keep(&self, step_s: f64) -> f64 {
        (-step_s / self.time_s).exp()
    }

    /// Returns the variance in (m/s²)² of the noise that renews the bias while a share of it stays.
    pub fn noise_variance(&self, keep: f64) -> f64 {
        self.std_mps2 * self.std_mps2 * (1.0 - keep * keep)
    }

    /// Returns the standard deviation of the bias where nothing is known of it, in addition to a map's error of a
    /// standard deviation in m/s² at a speed in m/s.
    pub fn std_given_others_mps2(&self, map_std_mps2: f64, speed_mps: f64) -> f64 {
        self.std_mps2.hypot(self.of_map(map_std_mps2, speed_mps))
    }

    /// Returns the share of the bias that stays over a step and the variance of the noise that renews it, where a share
    /// `keep` of it would stay but for the map's error.
    ///
    /// Bias and error are one process here: its variance is the sum of the two, its correlation over the
    /// step their mean weighted by the variances.
    pub fn drift(&self, keep: f64, map: &MapError, speed_mps: f64) -> (f64, f64) {
        if map.std_mps2 <= 0.0 {
            return (keep, self.noise_variance(keep));
        }
        let own = self.std_mps2 * self.std_mps2;
        let both = own + self.of_map(map.std_mps2, speed_mps).powi(2);
        let keep = (own * keep + (both - own) * map.keep) / both;
        (keep, both * (1.0 - keep * keep))
    }

    /// Returns the map's error in units of the bias, which may be stated at another speed.
    fn of_map(&self, map_std_mps2: f64, speed_mps: f64) -> f64 {
        map_std_mps2 / self.shape(speed_mps).max(SHAPE_MIN)
    }

    /// Bias in m/s² at a speed in m/s for a stated bias of 1 m/s².
    pub fn shape(&self, speed_mps: f64) -> f64 {
        if self.grows_with_speed { speed_mps / GROWTH_REFERENCE_MPS } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bias_next_to_an_error_of_the_map_has_the_variance_and_correlation_of_their_sum() {
        let bias = BiasModel::new(0.01, 60.0, false);
        let map = MapError { std_mps2: 0.02, keep: gradient_error_kept(5.0) };
        let (keep, noise_variance) = bias.drift(bias.keep(0.5), &map, 10.0);
        let both = bias.std_given_others_mps2(0.02, 10.0).powi(2);
        assert!((both - 5e-4).abs() < 1e-15);
        let product = 1e-4 * (-0.5_f64 / 60.0).exp() + 4e-4 * (-0.05_f64).exp();
        assert!((both * keep - product).abs() < 1e-15, "what is common to both ends of the step");
        assert!((keep * keep * both + noise_variance - both).abs() < 1e-15, "stationary");
    }

    #[test]
    fn a_line_without_stated_uncertainty_changes_no_behaviour() {
        let map = MapError { std_mps2: 0.0, keep: 1.0 };
        for (time_s, grows) in [(f64::INFINITY, false), (60.0, true), (10.0, false)] {
            let bias = BiasModel::new(0.01, time_s, grows);
            let keep = bias.keep(0.2);
            assert_eq!(bias.drift(keep, &map, 3.0), (keep, bias.noise_variance(keep)));
            assert_eq!(bias.std_given_others_mps2(0.0, 3.0), bias.std_mps2);
        }
    }
}
