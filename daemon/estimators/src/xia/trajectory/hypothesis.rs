//! A Kalman filter of [a, b, c, v] under one hypothesis about the last jump of (a, b, c).

use dynocar_core::filter::bank::Mixture;
use dynocar_core::filter::covariance::CovarianceFactor;
use dynocar_core::pipeline::motion::OutlierRow;
use dynocar_model::train::Davis;
use nalgebra::{Matrix3, SVector, Vector3};

use super::noise::{LearnedNoise, NoiseModel};
use super::step::{StepRule, TrajectoryStep, UnitDisturbance};
use super::{A, B, C, SPEED};

/// How often measured speeds are outliers, and their distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlierModel {
    /// Share of outliers.
    pub share: f64,
    /// Density of an outlier's innovation in s/m, flat.
    pub density: f64,
}

/// State and covariance under one hypothesis.
///
/// Over a step the state is linearised by the step's derivatives; the covariance factor stays triangular without a
/// factorisation, since a step moves the speed alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JumpHypothesis {
    /// a, b, c and v in the order of [`crate::xia::trajectory`].
    pub state: SVector<f64, 4>,
    /// Factor of their covariance.
    pub factor: CovarianceFactor<4>,
    /// Noise as it was learned under the hypothesis.
    pub noise: LearnedNoise,
    /// Covariance that a disturbance of unit density would have left with the gains used.
    unit: UnitDisturbance,
    /// Time in s since its jump.
    pub age_s: f64,
    /// Measurements left out in a row.
    outliers: OutlierRow,
}

/// The normal density of unit variance at its mean, 1 / √(2π).
const NORMAL_DENSITY: f64 = 0.398_942_280_401_432_7;

/// Innovation of a measured speed under a hypothesis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedInnovation {
    /// Measured minus predicted speed in m/s.
    pub innovation_mps: f64,
    /// Its predicted standard deviation in m/s.
    pub deviation_mps: f64,
    /// Density in s/m of the measured speed, as it was predicted with outliers.
    pub likelihood: f64,
    /// False when the measurement was taken for an outlier and left out.
    pub is_used: bool,
}

impl JumpHypothesis {
    /// Returns the coefficients of given mean and standard deviations, with a speed of no meaning yet.
    pub fn new(davis: &Davis, std: &Vector3<f64>, noise: LearnedNoise) -> Self {
        JumpHypothesis {
            state: SVector::<f64, 4>::new(davis.a, davis.b, davis.c, 0.0),
            factor: CovarianceFactor::diagonal(&SVector::<f64, 4>::new(
                std[A], std[B], std[C], 1.0,
            )),
            noise,
            unit: UnitDisturbance::default(),
            age_s: 0.0,
            outliers: OutlierRow::default(),
        }
    }

    /// Returns the coefficients.
    pub fn davis(&self) -> Davis {
        Davis { a: self.state[A], b: self.state[B], c: self.state[C] }
    }

    /// Returns the covariance of the coefficients.
    pub fn davis_covariance(&self) -> Matrix3<f64> {
        let lower = self.factor.0.fixed_view::<3, 3>(0, 0);
        lower * lower.transpose()
    }

    /// Returns the covariance that a disturbance of unit density would have left with the gains used.
    pub fn unit_disturbance(&self) -> &UnitDisturbance {
        &self.unit
    }

    /// Returns the covariance of the coefficients averaged over the uncertain density of the disturbance: the filter's
    /// own covariance holds for the likeliest density.
    pub fn davis_covariance_over_noise(&self, model: &NoiseModel) -> Matrix3<f64> {
        self.davis_covariance() + self.unit.of_davis() * self.noise.density_surplus(model)
    }

    /// Takes the speed from a measurement alone; the knowledge of the coefficients stays.
    pub fn anchor(&mut self, speed_mps: f64) {
        self.state[SPEED] = speed_mps;
        for column in [A, B, C] {
            self.factor.0[(SPEED, column)] = 0.0;
        }
        self.factor.0[(SPEED, SPEED)] = self.noise.measured_variance().sqrt();
        self.noise.anchor();
        self.unit.anchor();
        self.outliers = OutlierRow::default();
    }

    /// Lets the coefficients jump by an unknown amount of given covariance diagonal; `false`
    /// when the covariance cannot be factored.
    pub fn jump(&mut self, variance: &Vector3<f64>) -> bool {
        let mut covariance = self.factor.covariance();
        for i in [A, B, C] {
            covariance[(i, i)] += variance[i];
        }
        match CovarianceFactor::from_covariance(&covariance) {
            Some(factor) => {
                self.factor = factor;
                self.age_s = 0.0;
                true
            }
            None => false,
        }
    }

    /// Moves the state over a step of a given time, which misses the speed by `missed_variance` in
    /// (m/s)².
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    #[inline]
    pub fn predict(
        &mut self,
        rule: StepRule,
        step: &TrajectoryStep,
        duration_s: f64,
        missed_variance: f64,
    ) {
        let (advance, _) = rule.advance_or_crawl(step, &self.davis(), self.state[SPEED]);
        self.state[SPEED] = advance.speed_mps;
        let lower = &mut self.factor.0;
        for column in [A, B, C] {
            let mut entry = advance.by_speed * lower[(SPEED, column)];
            for row in column..SPEED {
                entry += advance.by_davis[row] * lower[(row, column)];
            }
            lower[(SPEED, column)] = entry;
        }
        let own = advance.by_speed * lower[(SPEED, SPEED)];
        let added = self.noise.disturbance_density * duration_s + missed_variance;
        lower[(SPEED, SPEED)] = (own * own + added).sqrt();
        self.noise.predict(advance.by_speed, duration_s);
        self.unit.predict(&advance.by_davis, advance.by_speed, duration_s);
        self.age_s += duration_s;
    }

    /// Takes in a measured speed, or leaves it out when it more likely is an outlier; a caller that compares hypotheses
    /// weights them by the likelihood.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    #[inline]
    pub fn measure(
        &mut self,
        measured_mps: f64,
        model: &NoiseModel,
        outliers: &OutlierModel,
    ) -> SpeedInnovation {
        let own_variance = self.factor.0.row(SPEED).norm_squared();
        let noise_variance = self.noise.measured_variance();
        let variance = own_variance + noise_variance;
        let inverse = 1.0 / variance;
        let deviation_mps = variance.sqrt();
        let innovation_mps = measured_mps - self.state[SPEED];
        let square = innovation_mps * innovation_mps * inverse;
        let normal = NORMAL_DENSITY * (-0.5 * square).exp() * inverse * deviation_mps;
        let inlier = (1.0 - outliers.share) * normal;
        let outlier = outliers.share * outliers.density;
        let is_used = inlier >= outlier;
        self.noise.learn(innovation_mps, own_variance, is_used, model);
        let is_believed = self.outliers.push(!is_used);
        if is_used {
            let gain = self.factor.measure_last(noise_variance);
            self.state += gain * innovation_mps;
            self.unit.measure(&gain);
        } else if is_believed {
            self.anchor(measured_mps);
        }
        SpeedInnovation { innovation_mps, deviation_mps, likelihood: inlier + outlier, is_used }
    }

    /// Returns whether state and covariance are numbers.
    #[inline]
    pub fn is_sound(&self) -> bool {
        self.state.sum().is_finite() && self.factor.is_sound()
    }
}

/// Returns the mean and covariance of two hypotheses by their weights, with the weight of both; the rest is
/// the likelier's.
///
/// The spread between them stays in the covariance: neither knows exactly when the jump was, and
/// samples from before it would bias the coefficients.
pub fn united(one: (&JumpHypothesis, f64), other: (&JumpHypothesis, f64)) -> (JumpHypothesis, f64) {
    let ((more, greater), (less, smaller)) =
        if one.1 >= other.1 { (one, other) } else { (other, one) };
    let mut both = Mixture::default();
    both.add(greater, &more.state, &more.factor.covariance());
    both.add(smaller, &less.state, &less.factor.covariance());
    let mut united = *more;
    if let Some(factor) = CovarianceFactor::from_covariance(&both.belief.covariance) {
        united.state = both.belief.mean;
        united.factor = factor;
        united.unit = more.unit.mixed(&less.unit, smaller / both.weight);
    }
    (united, both.weight)
}

#[cfg(test)]
mod tests {
    use super::super::fit::{DavisPrior, FitSettings, MotionSegment, TrajectoryFitter};
    use super::super::tests::{FAST, normal, random, speeds, steps};
    use super::*;
    use dynocar_core::filter::levenberg_marquardt::ParameterBox;
    use dynocar_model::force::mps2_per_n_per_kn;

    const NOISE_MPS: f64 = 0.1;

    /// R and q as given, and kept.
    fn noise(disturbance: f64) -> NoiseModel {
        NoiseModel {
            speed_noise_mps: NOISE_MPS,
            speed_noise_range_mps: (1e-3, 1.0),
            disturbance,
            disturbance_range: (0.0, 1.0),
            memory: 1000.0,
            learns_speed_noise: false,
            learns_disturbance: false,
        }
    }

    fn outliers() -> OutlierModel {
        OutlierModel { share: 1e-6, density: 0.5 }
    }

    fn prior_std() -> Vector3<f64> {
        Vector3::new(0.3, 0.01, 0.0004)
    }

    fn first(model: &NoiseModel) -> JumpHypothesis {
        JumpHypothesis::new(&FAST, &prior_std(), LearnedNoise::new(model))
    }

    #[test]
    fn the_filter_ends_where_its_batch_twin_does() {
        for (rule, disturbance) in [(StepRule::Distance, 0.0), (StepRule::Time, 0.01)] {
            let steps = steps(rule, 400);
            let truth = Davis { a: 1.0, b: 0.02, c: 0.0015 };
            let mut random = random(8);
            let mut speeds = speeds(rule, &steps, &truth, 30.0);
            speeds.iter_mut().for_each(|speed| *speed += NOISE_MPS * normal(&mut random));
            let model = noise(disturbance);
            let mut filter = first(&model);
            filter.anchor(speeds[0]);
            for (step, &speed_mps) in steps.iter().zip(&speeds[1..]) {
                let duration_s = match rule {
                    StepRule::Time => step.size,
                    StepRule::Distance => step.size / filter.state[SPEED],
                };
                filter.predict(rule, step, duration_s, 0.0);
                assert!(filter.measure(speed_mps, &model, &outliers()).is_used);
            }
            let ratio = (disturbance / NOISE_MPS).powi(2);
            let settings = FitSettings {
                prior: Some(DavisPrior { davis: FAST, std: prior_std() }),
                bounds: ParameterBox { low: Vector3::repeat(-9.0), high: Vector3::repeat(9.0) },
                speed_noise_mps: Some(NOISE_MPS),
                disturbance_ratio: ratio,
                outlier_threshold: f64::INFINITY,
                ..FitSettings::new(rule)
            };
            let segments = [MotionSegment { steps: &steps, speeds_mps: &speeds }];
            let batch = TrajectoryFitter::default().fit(&segments, None, &settings).unwrap();
            let covariance = batch.covariance / batch.inflation;
            for speed_mps in [20.0, 50.0, 75.0] {
                let powers = Vector3::new(1.0, speed_mps, speed_mps * speed_mps);
                let std = |covariance: &Matrix3<f64>| (powers.dot(&(covariance * powers))).sqrt();
                let apart =
                    filter.davis().w0_n_per_kn(speed_mps) - batch.davis.w0_n_per_kn(speed_mps);
                let batch_std = std(&covariance);
                assert!(apart.abs() < 0.1 * batch_std, "{rule:?} {speed_mps}: {apart:e}");
                let ratio = std(&filter.davis_covariance()) / batch_std;
                assert!((0.95..1.05).contains(&ratio), "{rule:?} {speed_mps}: {ratio}");
            }
        }
    }

    #[test]
    fn a_prediction_moves_the_covariance_by_the_jacobian() {
        let model = noise(0.02);
        let mut filter = first(&model);
        filter.anchor(40.0);
        let step = steps(StepRule::Time, 8)[2];
        for _ in 0..3 {
            let before = filter.factor.covariance();
            let speed_mps = filter.state[SPEED];
            let advance = StepRule::Time.advance(&step, &filter.davis(), speed_mps).unwrap();
            let mut jacobian = nalgebra::Matrix4::identity();
            for column in [A, B, C] {
                jacobian[(SPEED, column)] = advance.by_davis[column];
            }
            jacobian[(SPEED, SPEED)] = advance.by_speed;
            let mut expected = jacobian * before * jacobian.transpose();
            expected[(SPEED, SPEED)] += 0.02 * 0.02 * 2.5;
            filter.predict(StepRule::Time, &step, 2.5, 0.0);
            assert!((filter.factor.covariance() - expected).norm() < 1e-12 * expected.norm());
        }
    }

    #[test]
    fn a_wild_speed_is_left_out_and_a_lasting_one_believed() {
        let model = noise(0.0);
        let mut filter = first(&model);
        filter.anchor(40.0);
        let gain = mps2_per_n_per_kn(0.06);
        let drive_mps2 = gain * FAST.w0_n_per_kn(40.0);
        let hold = TrajectoryStep { size: 0.2, drive_mps2, resistance_gain: gain };
        for round in 0..60 {
            filter.predict(StepRule::Time, &hold, 0.2, 0.0);
            let speed_mps = if round == 30 { 43.0 } else { 40.0 };
            let innovation = filter.measure(speed_mps, &model, &outliers());
            assert_eq!(innovation.is_used, round != 30);
        }
        assert!((filter.state[SPEED] - 40.0).abs() < 0.05);
        let davis = filter.davis();
        for _ in 0..14 {
            filter.predict(StepRule::Time, &hold, 0.2, 0.0);
            filter.measure(45.0, &model, &outliers());
        }
        assert!((filter.state[SPEED] - 45.0).abs() < 0.05);
        // A jump of the speed says nothing of the resistance.
        let apart = filter.davis().w0_n_per_kn(40.0) - davis.w0_n_per_kn(40.0);
        assert!(apart.abs() < 0.01, "{apart}");
    }

    #[test]
    fn united_hypotheses_keep_mean_spread_and_weight() {
        let model = noise(0.0);
        let one = first(&model);
        let mut other = one;
        other.state[A] += 1.0;
        let (both, weight) = united((&one, 0.25), (&other, 0.75));
        assert!((both.state[A] - (FAST.a + 0.75)).abs() < 1e-12);
        let variance = both.davis_covariance()[(A, A)];
        assert!((variance - (0.09 + 0.75 * 0.25)).abs() < 1e-12);
        assert_eq!(weight, 1.0);
    }
}
