//! What a trapezoid misses of a force between two samples.

/// Variance of the impulse per mass that a force brings which changes by so much from one sample to
/// the next: in (m/s)² for a change in m/s², likewise in other units.
///
/// Where within the step h the force changed by a is not known: at once at any moment, the trapezoid
/// errs by up to a h / 2 either way, with a mean square of a² h² / 12. No sample shows that a force
/// never jumps, however straight it has run so far, nor that a reading half way is not a mean.
pub fn jump_variance(change: f64, step_s: f64) -> f64 {
    (step_s * change).powi(2) / 12.0
}

/// Variance in (m/s)² that a force brings whose slope jumps between two samples, from the second
/// difference of its acceleration in m/s².
///
/// A gradient acts over the length of the train, so that its rate is a polygon. Where the slope
/// of the rate jumps by s, at a share f of a step h, the trapezoid errs by s h² f (1 - f) / 2,
/// and the second differences of the two steps are s h (1 - f) and s h f. Over f from 0 to 1
/// the mean square of the error is s² h⁴ / 120, and h²/80 of the sum of the squared second
/// differences.
pub fn kink_variance(second_difference_mps2: f64, step_s: f64) -> f64 {
    (step_s * second_difference_mps2).powi(2) / 80.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kink_variance_is_the_mean_square_of_the_trapezoids_error_at_a_kink() {
        let (slope, step_s, positions) = (3.0, 0.2, 1000);
        let (mut squares, mut variance) = (0.0, 0.0);
        for k in 0..positions {
            let kink_s = step_s * (k as f64 + 0.5) / positions as f64;
            let rate = |time_s: f64| slope * (time_s - kink_s).max(0.0);
            let rates = [0.0, 0.0, rate(step_s), rate(2.0 * step_s), rate(3.0 * step_s)];
            let exact = 0.5 * slope * (step_s - kink_s).powi(2);
            squares += (0.5 * step_s * rate(step_s) - exact).powi(2);
            for at in 2..5 {
                let (before, now) = (rates[at - 1] - rates[at - 2], rates[at] - rates[at - 1]);
                variance += kink_variance(now - before, step_s);
            }
        }
        assert!((variance / squares - 1.0).abs() < 1e-3, "{variance} and {squares}");
    }
}
