//! How a force that no model knows may behave in time.

use dynocar_model::track::gradient_error_kept;

/// A force of mean zero that fades with time and with the distance, and is renewed (Ornstein, Uhlenbeck
/// 1930), in N/kN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Behaviour {
    /// Standard deviation in N/kN.
    pub std_n_per_kn: f64,
    /// Correlation time in s; infinite where only the distance counts.
    pub time_s: f64,
    /// True where it fades with the distance as a map's error does: see [`gradient_error_kept`].
    pub is_of_line: bool,
    /// Logarithm of its probability before any sample.
    pub log_prior: f64,
}

/// Number of behaviours.
pub const BEHAVIOURS: usize = 7;

/// Standard deviation in N/kN, correlation time in s, whether the line brings it, and probability
/// before any sample: nothing but what models always miss; errors of a map; wind; gusts.
const TABLE: [(f64, f64, bool, f64); BEHAVIOURS] = [
    (0.02, 60.0, false, 0.30),
    (0.1, f64::INFINITY, true, 0.20),
    (0.3, f64::INFINITY, true, 0.10),
    (0.1, 120.0, false, 0.20),
    (0.3, 120.0, false, 0.10),
    (1.0, 12.0, false, 0.05),
    (1.0, 120.0, false, 0.05),
];

/// All behaviours that compete.
pub fn behaviours() -> [Behaviour; BEHAVIOURS] {
    TABLE.map(|(std_n_per_kn, time_s, is_of_line, probability)| Behaviour {
        std_n_per_kn,
        time_s,
        is_of_line,
        log_prior: f64::ln(probability),
    })
}

impl Behaviour {
    /// Share of the force that is left after a time in s on a way in m, and the variance in (N/kN)²
    /// of what comes to it, on a line whose gradients are stated to a standard deviation in ‰.
    ///
    /// Force and stated error are one process here: its variance is the sum of the two, its
    /// correlation over the step their mean weighted by the variances.
    pub fn over(&self, time_s: f64, travelled_m: f64, map_std_permille: f64) -> (f64, f64) {
        let own = self.std_n_per_kn.powi(2);
        let map = map_std_permille.powi(2);
        let on_line =
            if self.is_of_line || map > 0.0 { gradient_error_kept(travelled_m) } else { 1.0 };
        let own_kept = if self.is_of_line { on_line } else { (-time_s / self.time_s).exp() };
        let keep = (own * own_kept + map * on_line) / (own + map);
        (keep, (own + map) * (1.0 - keep * keep))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_next_to_an_error_of_the_map_has_variance_and_correlation_of_their_sum() {
        let force =
            Behaviour { std_n_per_kn: 0.1, time_s: 60.0, is_of_line: false, log_prior: 0.0 };
        let (keep, variance) = force.over(0.5, 5.0, 0.2);
        let product = 0.01 * (-0.5_f64 / 60.0).exp() + 0.04 * gradient_error_kept(5.0);
        assert!((keep * 0.05 - product).abs() < 1e-12);
        assert!((keep * keep * 0.05 + variance - 0.05).abs() < 1e-12, "stationary");
    }

    #[test]
    fn the_probabilities_before_any_sample_add_up_to_one() {
        let sum: f64 = behaviours().iter().map(|behaviour| behaviour.log_prior.exp()).sum();
        assert!((sum - 1.0).abs() < 1e-12);
    }
}
