//! The online filter of `trajectory_kalman`: a bank of hypotheses about when (a, b, c) last jumped.
//!
//! Rain, wind or a tunnel change the resistance at once. A single filter either forgets, and pays with noise all the
//! time, or it does not, and is wrong for long after a jump. The bank follows several filters instead, each of which
//! freed its coefficients at another time, and weights them by the likelihood of the speeds (Andersson 1985, adaptive
//! forgetting by multiple models; Adams, MacKay 2007, run lengths). Ages are kept about evenly on a logarithmic scale:
//! when the bank is full, the two hypotheses closest in relative age become one.

use dynocar_core::filter::Gaussian;
use dynocar_core::filter::bank::{Bank, Mixture};
use dynocar_model::train::Davis;
use nalgebra::{Matrix3, Vector3};

use super::hypothesis::{JumpHypothesis, OutlierModel, SpeedInnovation, united};
use super::noise::{LearnedNoise, NoiseModel};
use super::quality::LongRunVariance;
use super::step::{StepRule, TrajectoryStep};

/// The most hypotheses of a bank.
const HYPOTHESES_MAX: usize = 16;
/// Least time in s between two hypotheses.
const SPACING_S: f64 = 1.0;
/// Outliers: one sample in a hundred, anywhere within ±1 m/s of the prediction.
const OUTLIERS: OutlierModel = OutlierModel { share: 0.01, density: 0.5 };
/// Blocks of 30 s that the long-run variance of the innovations looks back over.
const LONG_RUN_BLOCKS: f64 = 60.0;

/// Prior and expectations of the online filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnlineSettings {
    /// Coefficients before any data.
    pub davis: Davis,
    /// Their standard deviations, before any data and of a jump.
    pub davis_std: Vector3<f64>,
    /// Evidence in nats (logarithm of the likelihood ratio) that it takes to accept a jump
    /// within a given second; minus the logarithm of the mean time in s between jumps.
    pub jump_evidence: f64,
    /// The most hypotheses about the last jump, from 1 to 16.
    pub hypotheses: usize,
    /// Noise of the measured speed and of the forces.
    pub noise: NoiseModel,
}

impl OnlineSettings {
    fn first(&self, davis: &Davis) -> JumpHypothesis {
        JumpHypothesis::new(davis, &self.davis_std, LearnedNoise::new(&self.noise))
    }
}

/// Uncertainty of a single step's errors, the same under every hypothesis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepDoubt {
    /// Variance in (m/s)² of the error of the step because forces may jump within it.
    pub impulse_variance: f64,
    /// Variance in (m/s)² of the rounding of the speed after it.
    pub rounding_variance: f64,
}

/// Kalman filters of [a, b, c, v] with different times of the last jump.
#[derive(Clone, Debug, PartialEq)]
pub struct OnlineFilter {
    settings: OnlineSettings,
    /// By age, the oldest first.
    bank: Bank<JumpHypothesis, HYPOTHESES_MAX>,
    since_spawn_s: f64,
    long_run: LongRunVariance,
    /// Resets for numerical failure so far.
    pub resets: u64,
}

/// Hypotheses less probable than this do not enter the published estimate: a jump within the
/// last second is always possible, and would widen every interval by its whole size.
const WEIGHT_PUBLISHED_MIN: f64 = 0.05;
/// Share of the greatest weight below which a hypothesis is dropped: 40 nats.
const WEIGHT_MIN: f64 = 4.248_354_255_291_589e-18;
/// The most that a jump may be probable by itself: 0.7 nats less than none.
const JUMP_PROBABILITY_MAX: f64 = 0.496_585_303_791_409_5;

impl OnlineFilter {
    /// Returns a filter that knows no speed yet.
    pub fn new(settings: OnlineSettings) -> Self {
        OnlineFilter {
            settings,
            bank: Bank::even([settings.first(&settings.davis)], 1.0),
            since_spawn_s: 0.0,
            long_run: LongRunVariance::new(LONG_RUN_BLOCKS),
            resets: 0,
        }
    }

    /// Takes coefficients with a full covariance as its start, before the first step; false when
    /// the covariance cannot be factored. A reset goes back to the settings.
    pub fn warm_start(&mut self, davis: &Davis, covariance: &Matrix3<f64>) -> bool {
        let Some(factor) = covariance.cholesky() else { return false };
        let mut first = self.settings.first(davis);
        first.factor.0.fixed_view_mut::<3, 3>(0, 0).copy_from(&factor.unpack());
        self.start_from(first);
        true
    }

    fn start_from(&mut self, first: JumpHypothesis) {
        self.bank = Bank::even([first], 1.0);
        self.since_spawn_s = 0.0;
    }

    /// Returns the hypotheses, the oldest first.
    pub fn hypotheses(&self) -> &[JumpHypothesis] {
        self.bank.hypotheses()
    }

    /// Returns the most probable hypothesis.
    pub fn likeliest(&self) -> &JumpHypothesis {
        self.bank.likeliest()
    }

    /// Takes a speed as the start of a trajectory; the knowledge of the coefficients stays.
    pub fn begin(&mut self, measured_mps: f64) {
        self.bank.hypotheses_mut().iter_mut().for_each(|it| it.anchor(measured_mps));
        self.long_run.break_here();
    }

    /// Takes in a step and the speed measured after it, believed as far as `doubt` says; the
    /// innovation is that of the hypothesis that was likeliest before. `None` after a reset for
    /// numerical failure.
    ///
    /// # Real-time
    ///
    /// Work bounded by the number of hypotheses, no allocation.
    pub fn advance(
        &mut self,
        (rule, step): (StepRule, &TrajectoryStep),
        duration_s: f64,
        measured_mps: f64,
        doubt: &StepDoubt,
    ) -> Option<SpeedInnovation> {
        self.spawn(duration_s);
        let likeliest = self.bank.likeliest_index();
        let mut of_likeliest = None;
        for (index, (hypothesis, weight)) in self.bank.weighed_mut().enumerate() {
            hypothesis.predict(rule, step, duration_s, doubt.impulse_variance);
            hypothesis.noise.rounding_variance = doubt.rounding_variance;
            let innovation = hypothesis.measure(measured_mps, &self.settings.noise, &OUTLIERS);
            *weight *= if hypothesis.is_sound() { innovation.likelihood } else { 0.0 };
            if index == likeliest {
                of_likeliest = Some(innovation);
            }
        }
        self.bank.settle_odds();
        // Also drops hypotheses whose weight became NaN because no weight is above 0.
        self.bank.drop_up_to(WEIGHT_MIN);
        let Some(innovation) = of_likeliest.filter(|_| !self.hypotheses().is_empty()) else {
            self.start_from(self.settings.first(&self.settings.davis));
            self.resets += 1;
            self.begin(measured_mps);
            return None;
        };
        if innovation.is_used {
            let normalised = innovation.innovation_mps / innovation.deviation_mps;
            self.long_run.push(normalised, duration_s);
        }
        Some(innovation)
    }

    /// Adds the hypothesis that the coefficients jump now.
    fn spawn(&mut self, duration_s: f64) {
        self.since_spawn_s += duration_s;
        let is_due = self.since_spawn_s >= SPACING_S;
        let capacity = self.settings.hypotheses.clamp(1, HYPOTHESES_MAX);
        if capacity < 2 || !is_due {
            return;
        }
        let mut child = *self.likeliest();
        let variance = self.settings.davis_std.component_mul(&self.settings.davis_std);
        let probability = self.since_spawn_s * (-self.settings.jump_evidence).exp();
        self.since_spawn_s = 0.0;
        if child.jump(&variance) {
            let likeliest = self.bank.weights()[self.bank.likeliest_index()];
            let weight = likeliest * probability.min(JUMP_PROBABILITY_MAX);
            if self.hypotheses().len() == capacity {
                self.unite_closest();
            }
            self.bank.join(child, weight);
        }
    }

    /// Makes one of the two neighbours whose ages differ least in proportion.
    fn unite_closest(&mut self) {
        let age_s = |index: usize| self.hypotheses()[index].age_s;
        let gap = |i: usize| (age_s(i) - age_s(i + 1)) / age_s(i).max(f64::MIN_POSITIVE);
        let places = 0..self.hypotheses().len() - 1;
        let Some(older) = places.min_by(|&i, &j| gap(i).total_cmp(&gap(j))) else { return };
        let of = |index: usize| (&self.hypotheses()[index], self.bank.weights()[index]);
        let both = united(of(older), of(older + 1));
        self.bank.unite(older, both);
    }

    /// Returns the mean and covariance of (a, b, c) over the hypotheses that count, widened for disturbances
    /// that last.
    pub fn davis(&self) -> (Davis, Matrix3<f64>) {
        let total: f64 = self.bank.weights().iter().sum();
        let mut mixture = Mixture::<3>::default();
        for (hypothesis, weight) in self.hypotheses().iter().zip(self.bank.weights()) {
            if *weight >= WEIGHT_PUBLISHED_MIN * total {
                let own = hypothesis.davis_covariance_over_noise(&self.settings.noise);
                mixture.add(*weight, &hypothesis.state.fixed_rows::<3>(0).into(), &own);
            }
        }
        let Gaussian { mean, covariance } = mixture.belief;
        (Davis { a: mean[0], b: mean[1], c: mean[2] }, covariance * self.inflation())
    }

    /// Returns the factor on the covariance for disturbances that last; 1 when innovations are white.
    pub fn inflation(&self) -> f64 {
        self.long_run.inflation()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{FAST, normal, random};
    use super::*;
    use dynocar_model::force::mps2_per_n_per_kn;

    const NOISE_MPS: f64 = 0.05;
    const NONE: StepDoubt = StepDoubt { impulse_variance: 0.0, rounding_variance: 0.0 };

    fn bank(capacity: usize) -> OnlineFilter {
        let noise = NoiseModel {
            speed_noise_mps: NOISE_MPS,
            speed_noise_range_mps: (1e-3, 1.0),
            disturbance: 1e-4,
            disturbance_range: (0.0, 1.0),
            memory: 1000.0,
            learns_speed_noise: false,
            learns_disturbance: false,
        };
        let davis_std = Vector3::new(0.5, 0.01, 0.0005);
        let mut bank = OnlineFilter::new(OnlineSettings {
            davis: FAST,
            davis_std,
            jump_evidence: 16.0,
            hypotheses: capacity,
            noise,
        });
        bank.begin(60.0);
        bank
    }

    /// Follows a train whose resistance is that of FAST, times 1.3 from a time on; calls back
    /// with the time in s after each step.
    fn follow(
        bank: &mut OnlineFilter,
        steps: u32,
        jump_s: f64,
        mut each: impl FnMut(f64, &OnlineFilter),
    ) {
        let mut random = random(6);
        let mut speed_mps = 60.0;
        for index in 0..steps {
            let time_s = f64::from(index);
            let factor = if time_s >= jump_s { 1.3 } else { 1.0 };
            let truth = Davis { a: factor * FAST.a, b: factor * FAST.b, c: factor * FAST.c };
            let drive_mps2 = 0.07 + 0.06 * (0.02 * time_s).sin();
            let step =
                TrajectoryStep { size: 1.0, drive_mps2, resistance_gain: mps2_per_n_per_kn(0.06) };
            speed_mps = StepRule::Time.advance(&step, &truth, speed_mps).unwrap().speed_mps;
            let measured_mps = speed_mps + NOISE_MPS * normal(&mut random);
            assert!(bank.advance((StepRule::Time, &step), 1.0, measured_mps, &NONE).is_some());
            each(time_s + 1.0, bank);
        }
    }

    #[test]
    fn a_jump_is_found_within_seconds_and_dated() {
        let mut bank = bank(8);
        let mut found_s = None;
        follow(&mut bank, 700, 400.0, |time_s, bank| {
            let since_s = time_s - bank.likeliest().age_s;
            if found_s.is_none() && time_s > 400.0 && (since_s - 400.0).abs() < 10.0 {
                found_s = Some(time_s);
            }
            assert!(bank.hypotheses().len() <= 8);
        });
        let found_s = found_s.expect("the jump is found");
        assert!(found_s < 425.0, "{found_s}");
        let (davis, covariance) = bank.davis();
        let powers = Vector3::new(1.0, 62.0, 62.0 * 62.0);
        let std = powers.dot(&(covariance * powers)).sqrt();
        let error = davis.w0_n_per_kn(62.0) - 1.3 * FAST.w0_n_per_kn(62.0);
        assert!(error.abs() < 3.0 * std && std < 0.1, "{error} ± {std}");
    }

    #[test]
    fn without_a_jump_the_first_hypothesis_stays_the_likeliest() {
        let mut bank = bank(8);
        follow(&mut bank, 700, f64::INFINITY, |time_s, bank| {
            assert_eq!(bank.likeliest().age_s, time_s);
        });
    }

    #[test]
    fn a_bank_of_one_looks_for_no_jumps() {
        let mut bank = bank(1);
        follow(&mut bank, 450, 400.0, |_, bank| assert_eq!(bank.hypotheses().len(), 1));
        let error = bank.davis().0.w0_n_per_kn(60.0) - 1.3 * FAST.w0_n_per_kn(60.0);
        assert!(error < -0.5, "one filter is late: {error}");
    }

    #[test]
    fn a_bank_without_a_sound_hypothesis_says_so() {
        let mut bank = bank(4);
        let step = TrajectoryStep { size: 1.0, drive_mps2: 0.0, resistance_gain: 0.009 };
        assert_eq!(bank.advance((StepRule::Time, &step), f64::NAN, 60.0, &NONE), None);
    }
}
