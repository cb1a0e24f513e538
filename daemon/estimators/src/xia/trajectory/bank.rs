//! A bank of hypotheses about when (a, b, c) last jumped.
//!
//! Rain, wind or a tunnel change the resistance at once. A single filter either forgets, and
//! pays with noise all the time, or it does not, and is wrong for long after a jump. The bank
//! follows several filters instead, each of which opened its coefficients at another time, and
//! weighs them by the likelihood of the speeds (Andersson 1985, adaptive forgetting by multiple
//! models; Adams, MacKay 2007, run lengths). Ages are kept about evenly on a logarithmic scale:
//! when the bank is full, the two hypotheses closest in relative age become one.

use dynocar_core::filter::Gaussian;
use dynocar_core::filter::bank::{Bank, Odds};
use dynocar_core::filter::mixture::Mixture;
use dynocar_model::train::Davis;
use nalgebra::{Matrix3, Vector3};

use super::hypothesis::{Hypothesis, Innovation, OutlierModel, united};
use super::noise::NoiseModel;
use super::step::{Step, StepRule};

/// The most hypotheses of a bank.
pub const HYPOTHESES_MAX: usize = 16;

/// What the bank expects of jumps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JumpModel {
    /// Evidence in nats (logarithm of the likelihood ratio) that it takes to believe in a jump
    /// within a given second; minus the logarithm of the mean time in s between jumps.
    pub evidence: f64,
    /// Standard deviations of a jump of a, b and c.
    pub std: Vector3<f64>,
    /// Least time in s between two hypotheses.
    pub spacing_s: f64,
}

/// What is known of a single step's errors, whatever the hypothesis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepDoubt {
    /// Variance in (m/s)² of what the step misses because forces may jump within it.
    pub impulse_variance: f64,
    /// Variance in (m/s)² of the rounding of the speed after it.
    pub rounding_variance: f64,
}

/// Filters with different times of the last jump.
#[derive(Clone, Debug, PartialEq)]
pub struct JumpBank {
    /// By age, the oldest first.
    hypotheses: Bank<Hypothesis, Odds, HYPOTHESES_MAX>,
    capacity: usize,
    jumps: JumpModel,
    noise: NoiseModel,
    outliers: OutlierModel,
    doubt: StepDoubt,
    since_spawn_s: f64,
}

/// Hypotheses less probable than this do not enter the published estimate: a jump within the
/// last second is always possible, and would widen every interval by its whole size.
const WEIGHT_PUBLISHED_MIN: f64 = 0.05;
/// Share of the greatest weight below which a hypothesis is dropped: 40 nats.
const WEIGHT_MIN: f64 = 4.248_354_255_291_589e-18;
/// The most that a jump may be probable by itself: 0.7 nats less than none.
const JUMP_PROBABILITY_MAX: f64 = 0.496_585_303_791_409_5;

impl JumpBank {
    /// A bank of at most `capacity` hypotheses (1 to [`HYPOTHESES_MAX`]) that starts from one.
    pub fn new(
        first: Hypothesis,
        capacity: usize,
        jumps: JumpModel,
        noise: NoiseModel,
        outliers: OutlierModel,
    ) -> Self {
        JumpBank {
            hypotheses: Bank::even([first]),
            capacity: capacity.clamp(1, HYPOTHESES_MAX),
            jumps,
            noise,
            outliers,
            doubt: StepDoubt::default(),
            since_spawn_s: 0.0,
        }
    }

    /// The hypotheses, the oldest first.
    pub fn hypotheses(&self) -> &[Hypothesis] {
        self.hypotheses.hypotheses()
    }

    /// The most probable hypothesis.
    pub fn likeliest(&self) -> &Hypothesis {
        self.hypotheses.likeliest()
    }

    /// Takes the speed of every hypothesis from a measurement alone.
    pub fn anchor(&mut self, speed_mps: f64) {
        self.hypotheses.hypotheses_mut().iter_mut().for_each(|it| it.anchor(speed_mps));
    }

    /// Says how far the next step can be believed; none is doubted unless this is called.
    pub fn doubt(&mut self, doubt: StepDoubt) {
        self.doubt = doubt;
    }

    /// Moves every hypothesis over a step and weighs it by the speed measured after it; the
    /// innovation is that of the hypothesis that was likeliest before. `None` when no
    /// hypothesis is sound any more.
    ///
    /// # Real-time
    ///
    /// Work bounded by the capacity, no allocation.
    pub fn advance(
        &mut self,
        rule: StepRule,
        step: &Step,
        duration_s: f64,
        measured_mps: f64,
    ) -> Option<Innovation> {
        self.spawn(duration_s);
        let likeliest = self.hypotheses.likeliest_index();
        let mut of_likeliest = None;
        for (index, (hypothesis, weight)) in self.hypotheses.weighed_mut().enumerate() {
            hypothesis.predict(rule, step, duration_s, self.doubt.impulse_variance);
            hypothesis.noise.rounding_variance = self.doubt.rounding_variance;
            let innovation = hypothesis.measure(measured_mps, &self.noise, &self.outliers);
            *weight *= if hypothesis.is_sound() { innovation.likelihood } else { 0.0 };
            if index == likeliest {
                of_likeliest = Some(innovation);
            }
        }
        self.hypotheses.settle();
        // Also drops what became NaN because no weight is above 0.
        self.hypotheses.drop_up_to(WEIGHT_MIN);
        of_likeliest.filter(|_| !self.hypotheses().is_empty())
    }

    /// Adds the hypothesis that the coefficients jump now.
    fn spawn(&mut self, duration_s: f64) {
        self.since_spawn_s += duration_s;
        let is_due = self.since_spawn_s >= self.jumps.spacing_s;
        if self.capacity < 2 || !is_due {
            return;
        }
        let mut child = *self.likeliest();
        let variance = self.jumps.std.component_mul(&self.jumps.std);
        let probability = self.since_spawn_s * (-self.jumps.evidence).exp();
        self.since_spawn_s = 0.0;
        if child.jump(&variance) {
            let likeliest = self.hypotheses.likeliest_index();
            let weight =
                self.hypotheses.weights()[likeliest] * probability.min(JUMP_PROBABILITY_MAX);
            if self.hypotheses().len() == self.capacity {
                self.unite_closest();
            }
            self.hypotheses.join(child, weight);
        }
    }

    /// Makes one of the two neighbours whose ages differ least in proportion.
    fn unite_closest(&mut self) {
        let age_s = |index: usize| self.hypotheses()[index].age_s;
        let gap = |i: usize| (age_s(i) - age_s(i + 1)) / age_s(i).max(f64::MIN_POSITIVE);
        let places = 0..self.hypotheses().len() - 1;
        let Some(older) = places.min_by(|&i, &j| gap(i).total_cmp(&gap(j))) else { return };
        let of = |index: usize| (&self.hypotheses()[index], self.hypotheses.weights()[index]);
        let both = united(of(older), of(older + 1));
        self.hypotheses.unite(older, both);
    }

    /// Mean and covariance of (a, b, c) over the hypotheses that count.
    pub fn davis(&self) -> (Davis, Matrix3<f64>) {
        let total: f64 = self.hypotheses.weights().iter().sum();
        let mut mixture = Mixture::<3>::default();
        for (hypothesis, weight) in self.hypotheses().iter().zip(self.hypotheses.weights()) {
            if *weight >= WEIGHT_PUBLISHED_MIN * total {
                let own = hypothesis.davis_covariance_over_noise(&self.noise);
                mixture.add(*weight, &hypothesis.state.fixed_rows::<3>(0).into(), &own);
            }
        }
        let Gaussian { mean, covariance } = mixture.belief;
        (Davis { a: mean[0], b: mean[1], c: mean[2] }, covariance)
    }
}

#[cfg(test)]
mod tests {
    use super::super::noise::LearnedNoise;
    use super::super::test_runs::{FAST, normal, random};
    use super::*;
    use dynocar_model::force::balance::mps2_per_n_per_kn;

    const NOISE_MPS: f64 = 0.05;

    fn bank(capacity: usize) -> JumpBank {
        let noise = NoiseModel {
            speed_noise_mps: NOISE_MPS,
            speed_noise_range_mps: (1e-3, 1.0),
            disturbance: 1e-4,
            disturbance_range: (0.0, 1.0),
            memory: 1000.0,
            learns_speed_noise: false,
            learns_disturbance: false,
        };
        let std = Vector3::new(0.5, 0.01, 0.0005);
        let first = Hypothesis::new(&FAST, &std, LearnedNoise::new(&noise));
        let jumps = JumpModel { evidence: 16.0, std, spacing_s: 1.0 };
        let mut bank = JumpBank::new(
            first,
            capacity,
            jumps,
            noise,
            OutlierModel { share: 0.01, density: 0.5 },
        );
        bank.anchor(60.0);
        bank
    }

    /// Follows a train whose resistance is that of FAST, times 1.3 from a time on; calls back
    /// with the time in s after each step.
    fn follow(bank: &mut JumpBank, steps: u32, jump_s: f64, mut each: impl FnMut(f64, &JumpBank)) {
        let mut random = random(6);
        let mut speed_mps = 60.0;
        for index in 0..steps {
            let time_s = f64::from(index);
            let factor = if time_s >= jump_s { 1.3 } else { 1.0 };
            let truth = Davis { a: factor * FAST.a, b: factor * FAST.b, c: factor * FAST.c };
            let drive_mps2 = 0.07 + 0.06 * (0.02 * time_s).sin();
            let step = Step { size: 1.0, drive_mps2, resistance_gain: mps2_per_n_per_kn(0.06) };
            speed_mps = StepRule::Time.advance(&step, &truth, speed_mps).unwrap().speed_mps;
            let measured_mps = speed_mps + NOISE_MPS * normal(&mut random);
            assert!(bank.advance(StepRule::Time, &step, 1.0, measured_mps).is_some());
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
        let step = Step { size: 1.0, drive_mps2: 0.0, resistance_gain: 0.009 };
        assert_eq!(bank.advance(StepRule::Time, &step, f64::NAN, 60.0), None);
    }
}
