//! The noise of the measured speed and the density of disturbing forces, learned from the innovations.
//!
//! Recursive maximum likelihood (Ljung, Söderström 1983, section 3.6) for ln R and ln q: the
//! innovation e of a filter and its variance S have derivatives with respect to both, which
//! follow scalar recursions next to the filter's own. The step is the score over the Fisher
//! information of the samples remembered. While the coefficients are uncertain, the innovations say little of q: their
//! derivatives are small, and q hardly changes.

use nalgebra::{Matrix2, Vector2};

/// Model of the noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseModel {
    /// Standard deviation of the measured speed in m/s before any data.
    pub speed_noise_mps: f64,
    /// Its lowest and highest value.
    pub speed_noise_range_mps: (f64, f64),
    /// Root of the density q of the disturbing acceleration in m/s² √s before any data.
    pub disturbance: f64,
    /// Its lowest and highest value.
    pub disturbance_range: (f64, f64),
    /// Samples that the estimates look back over.
    pub memory: f64,
    /// False keeps R as it is.
    pub learns_speed_noise: bool,
    /// False keeps q as it is.
    pub learns_disturbance: bool,
}

/// Index of ln R.
const SPEED: usize = 0;
/// Index of ln q.
const DISTURBANCE: usize = 1;

/// Innovations beyond this many standard deviations say nothing precise.
const CLIP_DEVIATIONS: f64 = 4.0;
/// After this many innovations in a row beyond the clip they are no outliers: the noise has grown.
const UPDATED_AFTER: u32 = 3;
/// Samples that the newest mean square looks back over.
const NEWEST: f64 = 32.0;
/// The newest mean square of normalised innovations below which the noise has shrunk; white
/// noise hardly ever comes here.
const SHRUNK_BELOW: f64 = 0.25;
/// Information on ln R and ln q from before any data: standard deviations of 3.
const PRIOR_INFORMATION: f64 = 0.1;
/// Information on ln q beyond the first unit that the mean of q is computed with at least.
const LEAST_FREE_INFORMATION: f64 = 1.0;
/// Largest step of ln R and ln q for one innovation.
const STEP_MAX: f64 = 0.5;

/// R and q under one hypothesis, with the derivatives that learning needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearnedNoise {
    /// Variance R of the measured speed in (m/s)².
    pub speed_variance: f64,
    /// Density q of the disturbing acceleration in (m/s)²/s.
    pub disturbance_density: f64,
    /// Variance of the speed's rounding in (m/s)², below which the measured speed's does not lie:
    /// rounding errors of a speed that hardly moves are alike, and innovations do not show them.
    pub rounding_variance: f64,
    /// Derivatives of the predicted speed.
    by_speed: Vector2<f64>,
    /// Derivatives of the speed's variance.
    by_variance: Vector2<f64>,
    information: Matrix2<f64>,
    newest_square: f64,
    exceeded: u32,
    exceeded_square: f64,
}

impl LearnedNoise {
    /// Returns the noise before any data.
    pub fn new(model: &NoiseModel) -> Self {
        LearnedNoise {
            speed_variance: model.speed_noise_mps * model.speed_noise_mps,
            disturbance_density: model.disturbance * model.disturbance,
            rounding_variance: 0.0,
            by_speed: Vector2::zeros(),
            by_variance: Vector2::zeros(),
            information: Matrix2::from_diagonal_element(PRIOR_INFORMATION),
            newest_square: 1.0,
            exceeded: 0,
            exceeded_square: 0.0,
        }
    }

    /// Returns the excess of the mean of q over the learned q, in (m/s)²/s; 0 when q is given.
    ///
    /// With the information I on ln q, q is about as well known as the variance of 2 I normal
    /// numbers from their squares, and the mean of such a variance is I / (I - 1) times the
    /// likeliest one.
    pub fn density_surplus(&self, model: &NoiseModel) -> f64 {
        if !model.learns_disturbance {
            return 0.0;
        }
        let [[rr, _], [rq, qq]] = self.information.data.0;
        self.disturbance_density / (qq - rq * rq / rr - 1.0).max(LEAST_FREE_INFORMATION)
    }

    /// Returns the variance in (m/s)² that a measured speed is taken in with.
    #[inline]
    pub fn measured_variance(&self) -> f64 {
        self.speed_variance.max(self.rounding_variance)
    }

    /// Returns the derivative of that with respect to ln R.
    #[inline]
    fn measured_by_speed(&self) -> f64 {
        if self.speed_variance >= self.rounding_variance { self.speed_variance } else { 0.0 }
    }

    /// The speed has been taken from a measurement alone.
    pub fn anchor(&mut self) {
        self.by_speed = Vector2::zeros();
        self.by_variance = Vector2::new(self.measured_by_speed(), 0.0);
        self.exceeded = 0;
    }

    /// The filter has moved over a step of a given time; `by_before` is the derivative of the
    /// speed after it with respect to the speed before.
    #[inline]
    pub fn predict(&mut self, by_before: f64, duration_s: f64) {
        self.by_speed *= by_before;
        self.by_variance *= by_before * by_before;
        self.by_variance[DISTURBANCE] += self.disturbance_density * duration_s;
    }

    /// Learns from an innovation in m/s, given the variance of the predicted speed; call it
    /// before the filter takes the measurement. `is_used` says whether it will. Noise that is
    /// given, R and q both, is not learned from.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    #[inline]
    pub fn learn(
        &mut self,
        innovation_mps: f64,
        own_variance: f64,
        is_used: bool,
        model: &NoiseModel,
    ) {
        if !(model.learns_speed_noise || model.learns_disturbance) {
            return;
        }
        let variance = own_variance + self.measured_variance();
        let inverse = 1.0 / variance;
        let square = innovation_mps * innovation_mps * inverse;
        let mut by_total = self.by_variance;
        by_total[SPEED] += self.measured_by_speed();
        if self.watch_for_change(innovation_mps, square, own_variance, model) || !is_used {
            return;
        }
        let by_total_share = by_total * inverse;
        let clip_mps = CLIP_DEVIATIONS * variance.sqrt();
        let clipped = innovation_mps.min(clip_mps).max(-clip_mps);
        let clipped_square = square.min(CLIP_DEVIATIONS * CLIP_DEVIATIONS);
        let score =
            by_total_share * (0.5 * (clipped_square - 1.0)) + self.by_speed * (clipped * inverse);
        let fading = 1.0 - 1.0 / model.memory;
        self.information = self.information * fading
            + by_total_share * by_total_share.transpose() * 0.5
            + self.by_speed * self.by_speed.transpose() * inverse;
        self.step(&score, model);
        let gain = own_variance * inverse;
        let by_gain = (self.by_variance - by_total * gain) * inverse;
        self.by_speed = self.by_speed * (1.0 - gain) + by_gain * innovation_mps;
        let kept = 1.0 - gain;
        self.by_variance *= kept * kept;
        self.by_variance[SPEED] += self.measured_by_speed() * gain * gain;
    }

    /// One step of ln R and ln q along the score.
    fn step(&mut self, score: &Vector2<f64>, model: &NoiseModel) {
        let [[rr, _], [rq, qq]] = self.information.data.0;
        let (rr, qq) = (rr + PRIOR_INFORMATION, qq + PRIOR_INFORMATION);
        let inverse = 1.0 / (rr * qq - rq * rq);
        let for_speed = (qq * score[SPEED] - rq * score[DISTURBANCE]) * inverse;
        let for_disturbance = (rr * score[DISTURBANCE] - rq * score[SPEED]) * inverse;
        if model.learns_speed_noise {
            let (low, high) = model.speed_noise_range_mps;
            let factor = for_speed.clamp(-STEP_MAX, STEP_MAX).exp();
            self.speed_variance = (self.speed_variance * factor).clamp(low * low, high * high);
        }
        if model.learns_disturbance {
            let (low, high) = model.disturbance_range;
            let factor = for_disturbance.clamp(-STEP_MAX, STEP_MAX).exp();
            let density = self.disturbance_density * factor;
            self.disturbance_density = density.clamp(low * low, high * high);
        }
    }

    /// Notices noise that has grown or shrunk out of all proportion, and follows it at once.
    fn watch_for_change(
        &mut self,
        innovation_mps: f64,
        square: f64,
        own_variance: f64,
        model: &NoiseModel,
    ) -> bool {
        let clip = CLIP_DEVIATIONS * CLIP_DEVIATIONS;
        self.newest_square += (square.min(clip) - self.newest_square) / NEWEST;
        if square > clip {
            self.exceeded += 1;
            self.exceeded_square += innovation_mps * innovation_mps;
        } else {
            self.exceeded = 0;
            self.exceeded_square = 0.0;
        }
        let has_grown = self.exceeded >= UPDATED_AFTER;
        let has_shrunk = self.newest_square < SHRUNK_BELOW
            && self.speed_variance > own_variance.max(self.rounding_variance);
        if !(model.learns_speed_noise && (has_grown || has_shrunk)) {
            return false;
        }
        let (low, high) = model.speed_noise_range_mps;
        let variance = if has_grown {
            self.exceeded_square / f64::from(self.exceeded)
        } else {
            self.speed_variance * self.newest_square
        };
        self.speed_variance = variance.clamp(low * low, high * high);
        self.information = Matrix2::from_diagonal_element(PRIOR_INFORMATION);
        self.newest_square = 1.0;
        // The filter's variance comes from the noise before, not from this one.
        self.by_speed = Vector2::zeros();
        self.by_variance = Vector2::zeros();
        self.exceeded = 0;
        self.exceeded_square = 0.0;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::hypothesis::{JumpHypothesis, OutlierModel};
    use super::super::step::{StepRule, TrajectoryStep};
    use super::super::tests::{FAST, normal, random};
    use super::*;
    use dynocar_model::force::mps2_per_n_per_kn;
    use nalgebra::Vector3;

    const OUTLIERS: OutlierModel = OutlierModel { share: 0.01, density: 0.5 };

    fn model() -> NoiseModel {
        NoiseModel {
            speed_noise_mps: 0.03,
            speed_noise_range_mps: (1e-3, 1.0),
            disturbance: 2e-3,
            disturbance_range: (1e-5, 0.1),
            memory: 2000.0,
            learns_speed_noise: true,
            learns_disturbance: true,
        }
    }

    /// Runs a filter of known coefficients over a train at 5 Hz; noise and disturbance by time.
    fn run(samples: u32, noise_mps: impl Fn(u32) -> f64, disturbance: f64) -> JumpHypothesis {
        let mut random = random(12);
        let model = model();
        let certain = Vector3::new(1e-6, 1e-8, 1e-10);
        let mut filter = JumpHypothesis::new(&FAST, &certain, LearnedNoise::new(&model));
        let gain = mps2_per_n_per_kn(0.06);
        let drive_mps2 = gain * FAST.w0_n_per_kn(60.0);
        let step = TrajectoryStep { size: 0.2, drive_mps2, resistance_gain: gain };
        let mut speed_mps = 60.0;
        filter.anchor(speed_mps);
        for index in 0..samples {
            speed_mps = StepRule::Time.advance(&step, &FAST, speed_mps).unwrap().speed_mps;
            speed_mps += disturbance * 0.2_f64.sqrt() * normal(&mut random);
            filter.predict(StepRule::Time, &step, 0.2, 0.0);
            let measured_mps = speed_mps + noise_mps(index) * normal(&mut random);
            filter.measure(measured_mps, &model, &OUTLIERS);
        }
        filter
    }

    #[test]
    fn both_noises_are_learned_from_the_innovations() {
        for (noise_mps, disturbance) in [(0.02, 2e-3), (0.1, 2e-2), (0.01, 1e-2)] {
            let noise = run(6000, |_| noise_mps, disturbance).noise;
            let speed = noise.speed_variance.sqrt() / noise_mps;
            assert!((0.9..1.1).contains(&speed), "noise {noise_mps}: {speed}");
            let force = noise.disturbance_density.sqrt() / disturbance;
            assert!((0.7..1.4).contains(&force), "disturbance {disturbance}: {force}");
        }
    }

    #[test]
    fn noise_that_grows_or_shrinks_tenfold_is_followed_within_seconds() {
        let grown = run(1030, |index| if index < 1000 { 0.01 } else { 0.1 }, 1e-3).noise;
        assert!((0.05..0.2).contains(&grown.speed_variance.sqrt()));
        let shrunk = run(1200, |index| if index < 1000 { 0.1 } else { 0.01 }, 1e-3).noise;
        assert!((0.005..0.02).contains(&shrunk.speed_variance.sqrt()));
    }

    #[test]
    fn noise_stays_within_its_range() {
        let noise = run(3000, |_| 0.0, 0.0).noise;
        assert_eq!(noise.speed_variance, 1e-6);
        assert!(noise.disturbance_density >= 1e-10);
    }
}
