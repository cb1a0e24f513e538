//! The descent as Wang 2022 prints it: raw features, one step a sample, learning rate 1e-7.

use dynocar_estimators::wang::motion::Motion;
use dynocar_estimators::wang::section::Section;
use dynocar_model::force::ResolvedSample;
use dynocar_model::train::TrainModel;
use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use nalgebra::Vector3;

/// Learning rate of section 3.1.
const RATE: f64 = 1e-7;
/// A coefficient beyond this has diverged; the printed ones lie below 3.
const DIVERGED: f64 = 1e6;
/// Lowest speed in m/s that is used.
const SPEED_MIN_MPS: f64 = 1.0;

/// z1, z2 and z3 as the weights of the network, in powers of the raw speed.
pub struct PrintedDescent {
    /// How many of the network's unit of speed are 1 m/s: 3.6 for km/h; the paper does not say.
    per_mps: f64,
    /// z1, z2, z3 in N/kN.
    weights: [Vector3<f64>; 3],
    steps: u64,
    diverged_after: Option<u64>,
    last: Option<Motion>,
}

impl PrintedDescent {
    /// Starts at a train's basic resistance and at z2 = z3 = (1, 1, 1), as Table 1.
    pub fn new(per_mps: f64, train: &TrainModel) -> Self {
        let basic = train.resistance;
        let first = Vector3::new(basic.a, basic.b / per_mps, basic.c / (per_mps * per_mps));
        PrintedDescent {
            per_mps,
            weights: [first, Vector3::repeat(1.0), Vector3::repeat(1.0)],
            steps: 0,
            diverged_after: None,
            last: None,
        }
    }

    /// Learns from the step to a sample, the acceleration being the differentiated speed.
    pub fn update(&mut self, sample: &ResolvedSample) {
        let motion = Motion::of(sample).ok().filter(|now| now.speed_mps >= SPEED_MIN_MPS);
        let Some((from, to)) = std::mem::replace(&mut self.last, motion).zip(motion) else {
            return;
        };
        let (Some(step_s), Some(section)) = (to.step_from(&from), Section::of(&from, &to)) else {
            return;
        };
        let mean = |value: fn(&Motion) -> f64| 0.5 * (value(&from) + value(&to));
        let acceleration_mps2 = (to.speed_mps - from.speed_mps) / step_s;
        let specific_mps2 = mean(|at| at.force_n) / to.declared_kg - acceleration_mps2;
        let target = 1e3 * specific_mps2 / STANDARD_GRAVITY_MPS2 - mean(|at| at.known_n_per_kn);
        self.learn(section, mean(|at| at.speed_mps), target);
    }

    /// One step on one sample: eq. (27) with E = (O - target)².
    ///
    /// The network of eq. (19)-(25) computes z · (1, v, v²); with b_j subtracted in (19), the
    /// threshold is -alpha_j, where (22) prints alpha_j. Force and gradient are not among its
    /// inputs: the target is the resistance in N/kN that they leave.
    fn learn(&mut self, section: Section, speed_mps: f64, target_n_per_kn: f64) {
        if self.diverged_after.is_some() {
            return;
        }
        let speed = speed_mps * self.per_mps;
        let features = Vector3::new(1.0, speed, speed * speed);
        let mut weights = self.weights[section as usize];
        let known = match section {
            Section::Basic => 0.0,
            Section::Curve | Section::Tunnel => self.weights[0].dot(&features),
        };
        let error = known + weights.dot(&features) - target_n_per_kn;
        weights -= features * (2.0 * error * RATE);
        self.steps += 1;
        if weights.iter().all(|weight| weight.abs() < DIVERGED) {
            self.weights[section as usize] = weights;
        } else {
            self.diverged_after = Some(self.steps);
        }
    }

    /// alpha_1, the first coefficient of z1 in N/kN; the last one before it diverged.
    pub fn first_coefficient(&self) -> f64 {
        self.weights[0][0]
    }

    /// The number of steps after which a coefficient had diverged.
    pub fn diverged_after(&self) -> Option<u64> {
        self.diverged_after
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_model::train::Davis;

    /// Pulling away on the straight, with a target that the differentiated speed scatters by
    /// 10 N/kN either way.
    fn pulled_away(per_mps: f64, samples: u32) -> PrintedDescent {
        let table_1 = Davis { a: 2.7551, b: 0.014 * 3.6, c: 0.00075 * 12.96 };
        let mut descent = PrintedDescent::new(per_mps, &TrainModel::bare("", 110e3, table_1));
        for k in 0..samples {
            let speed_mps = (0.2 * f64::from(k)).min(27.0);
            let scatter = if k.is_multiple_of(2) { 10.0 } else { -10.0 };
            let target = table_1.w0_n_per_kn(speed_mps) + 0.5 + scatter;
            descent.learn(Section::Basic, speed_mps, target);
        }
        descent
    }

    #[test]
    fn the_printed_rate_diverges_within_a_minute_in_kilometres_per_hour() {
        let descent = pulled_away(3.6, 300);
        let after = descent.diverged_after().expect("diverged");
        assert!((60..300).contains(&after) && descent.first_coefficient().is_finite(), "{after}");
    }

    #[test]
    fn the_printed_rate_moves_nothing_in_metres_per_second() {
        let descent = pulled_away(1.0, 28_000);
        assert_eq!(descent.diverged_after(), None);
        let moved = (descent.first_coefficient() - 2.7551).abs();
        assert!(moved > 0.0 && moved < 0.01, "of the 0.5 N/kN to learn: {moved}");
    }
}
