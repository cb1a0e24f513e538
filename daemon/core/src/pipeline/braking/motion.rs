//! The motion of a braking train over one step.
//!
//! ```text
//! v' = v - T (gain * law(v) * scale + resistance(v))
//! s' = s + T (v + v') / 2
//! ```
//!
//! Xie 2019, eq. (2)-(3), and Jin 2020, eq. (1), with the position corrected: the printed increment T (v_{t-1} - v_t) /
//! 7.2 telescopes to nothing. The deceleration is the achieved one, without the papers' cap min(F(mu), B): above the
//! cap the motion no longer depends on the coefficient, and an estimate that starts above it never moves.

use nalgebra::{SMatrix, SVector};

use super::law::BrakingLaw;

/// Place in the state of the distance in m since the brakes came on.
pub const DISTANCE: usize = 0;
/// Place in the state of the speed in m/s.
pub const SPEED: usize = 1;
/// Place in the state of the scale of the law, dimensionless.
pub const SCALE: usize = 2;
/// Place in the state of the drift of the scale in 1/s.
pub const DRIFT: usize = 3;
/// Number of components of the state.
pub const STATES: usize = 4;

/// The known part of the motion over a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepInputs {
    /// Length of the step in s.
    pub step_s: f64,
    /// Deceleration in m/s² per unit of the coefficient.
    pub gain_mps2: f64,
    /// The coefficient that the brake would need to act in full.
    pub demand: f64,
    /// Deceleration in m/s² by gradient, curve and tunnel, less traction.
    pub tied_mps2: f64,
    /// Deceleration by basic resistance: coefficients of 1, v and v².
    pub basic_mps2: [f64; 3],
}

impl StepInputs {
    /// Returns the deceleration by everything but the brake in m/s², and its derivative by speed.
    #[inline]
    pub fn resistance_mps2(&self, speed_mps: f64) -> (f64, f64) {
        let [a, b, c] = self.basic_mps2;
        let value = self.tied_mps2 + a + speed_mps * (b + speed_mps * c);
        (value, b + 2.0 * c * speed_mps)
    }
}

/// How much the true motion wanders about the model, and how well it is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionNoise {
    /// Variance in m² that the distance gains per second.
    pub distance_m2_per_s: f64,
    /// Variance in (m/s)² that the speed gains per second.
    pub speed_m2_per_s3: f64,
    /// Variance of a measured distance in m².
    pub measured_distance_m2: f64,
    /// Variance of a measured speed in (m/s)²; `None` while the speed is not used.
    pub measured_speed_m2_per_s2: Option<f64>,
}

/// How the scale of the law wanders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Walk {
    /// Random walk: variance that the scale gains per second.
    Scale(f64),
    /// A drift that comes and goes: a first-order Gauss-Markov process (Singer 1970), which tends
    /// to an integrated random walk as its time grows.
    Drift {
        /// Standard deviation of the drift in 1/s.
        std_per_s: f64,
        /// Time in s after which the drift is forgotten.
        time_s: f64,
    },
}

impl Walk {
    /// Returns the share of the drift that is left after a step, and the time in s over which it acted.
    #[inline]
    fn drift_transition(self, step_s: f64) -> (f64, f64) {
        match self {
            Walk::Scale(_) => (1.0, step_s),
            Walk::Drift { time_s, .. } => {
                let lost = -(-step_s / time_s).exp_m1();
                (1.0 - lost, time_s * lost)
            }
        }
    }

    /// Returns the standard deviation of the drift beforehand, in 1/s.
    pub fn drift_std_per_s(self) -> f64 {
        match self {
            Walk::Scale(_) => 0.0,
            Walk::Drift { std_per_s, .. } => std_per_s,
        }
    }
}

/// Speed after a step, distance travelled, and the derivatives of the speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Distance travelled in m.
    pub travelled_m: f64,
    /// Speed in m/s at the end.
    pub speed_mps: f64,
    /// Derivative of the final speed by the first.
    pub speed_by_speed: f64,
    /// Derivative of the final speed by the scale, in m/s.
    pub speed_by_scale: f64,
}

/// Moves the train over one step.
pub fn advance(inputs: &StepInputs, law: &BrakingLaw, speed_mps: f64, scale: f64) -> Move {
    advance_under(inputs, law.at(speed_mps, inputs.demand), speed_mps, scale)
}

/// As [`advance`], under a law of a given value and slope at the speed.
#[inline]
pub fn advance_under(
    inputs: &StepInputs,
    (shape, shape_slope): (f64, f64),
    speed_mps: f64,
    scale: f64,
) -> Move {
    let (resistance, resistance_slope) = inputs.resistance_mps2(speed_mps);
    let step_s = inputs.step_s;
    let speed_after = speed_mps - step_s * (inputs.gain_mps2 * shape * scale + resistance);
    Move {
        travelled_m: 0.5 * step_s * (speed_mps + speed_after),
        speed_mps: speed_after,
        speed_by_speed: 1.0 - step_s * (inputs.gain_mps2 * shape_slope * scale + resistance_slope),
        speed_by_scale: -step_s * inputs.gain_mps2 * shape,
    }
}

/// Returns the mean of the state after a step, and the Jacobian.
pub fn predict(
    inputs: &StepInputs,
    law: &BrakingLaw,
    walk: Walk,
    mean: &SVector<f64, STATES>,
) -> (SVector<f64, STATES>, SMatrix<f64, STATES, STATES>) {
    let step_s = inputs.step_s;
    let moved = advance(inputs, law, mean[SPEED], mean[SCALE]);
    let mut after = *mean;
    after[DISTANCE] += moved.travelled_m;
    after[SPEED] = moved.speed_mps;
    let (drift_kept, drift_reach_s) = walk.drift_transition(step_s);
    after[SCALE] += drift_reach_s * mean[DRIFT];
    after[DRIFT] *= drift_kept;
    let mut jacobian = SMatrix::<f64, STATES, STATES>::identity();
    jacobian[(DISTANCE, SPEED)] = 0.5 * step_s * (1.0 + moved.speed_by_speed);
    jacobian[(DISTANCE, SCALE)] = 0.5 * step_s * moved.speed_by_scale;
    jacobian[(SPEED, SPEED)] = moved.speed_by_speed;
    jacobian[(SPEED, SCALE)] = moved.speed_by_scale;
    jacobian[(SCALE, DRIFT)] = drift_reach_s;
    jacobian[(DRIFT, DRIFT)] = drift_kept;
    (after, jacobian)
}

/// F P Fᵀ + Q for the Jacobian F of [`predict`], exactly symmetric: F is the identity but for six
/// places, and nothing else is multiplied.
#[inline]
pub fn move_covariance(
    jacobian: &SMatrix<f64, STATES, STATES>,
    covariance: &SMatrix<f64, STATES, STATES>,
    added: &SMatrix<f64, STATES, STATES>,
) -> SMatrix<f64, STATES, STATES> {
    let times_jacobian = |matrix: SMatrix<f64, STATES, STATES>| {
        let (distance, speed) = (matrix.column(DISTANCE), matrix.column(SPEED));
        let (scale, drift) = (matrix.column(SCALE), matrix.column(DRIFT));
        SMatrix::<f64, STATES, STATES>::from_columns(&[
            distance + speed * jacobian[(DISTANCE, SPEED)] + scale * jacobian[(DISTANCE, SCALE)],
            speed * jacobian[(SPEED, SPEED)] + scale * jacobian[(SPEED, SCALE)],
            scale + drift * jacobian[(SCALE, DRIFT)],
            drift * jacobian[(DRIFT, DRIFT)],
        ])
    };
    let mut moved = times_jacobian(times_jacobian(*covariance).transpose()) + added;
    for j in 0..STATES {
        for i in 0..j {
            moved[(j, i)] = moved[(i, j)];
        }
    }
    moved
}

/// Returns the covariance that a step adds.
pub fn process_noise(noise: &MotionNoise, walk: Walk, step_s: f64) -> SMatrix<f64, STATES, STATES> {
    let mut added = SMatrix::<f64, STATES, STATES>::zeros();
    added[(DISTANCE, DISTANCE)] = noise.distance_m2_per_s * step_s;
    added[(SPEED, SPEED)] = noise.speed_m2_per_s3 * step_s;
    match walk {
        Walk::Scale(rate) => added[(SCALE, SCALE)] = rate * step_s,
        Walk::Drift { std_per_s, time_s } => {
            // With e = exp(-T / time): the exact covariance of the process over a step.
            let variance = std_per_s * std_per_s;
            let (kept, reach_s) = walk.drift_transition(step_s);
            let lost = 1.0 - kept;
            added[(DRIFT, DRIFT)] = variance * (1.0 - kept * kept);
            added[(SCALE, DRIFT)] = variance * time_s * lost * lost;
            added[(DRIFT, SCALE)] = added[(SCALE, DRIFT)];
            let scale = 2.0 * (step_s - reach_s) - time_s * lost * lost;
            added[(SCALE, SCALE)] = (variance * time_s * scale).max(0.0);
        }
    }
    added
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_shared::RailCondition;

    const WALK: Walk = Walk::Drift { std_per_s: 0.02, time_s: 8.0 };

    fn inputs() -> StepInputs {
        StepInputs {
            step_s: 0.2,
            gain_mps2: 9.2,
            demand: 0.09,
            tied_mps2: 0.03,
            basic_mps2: [0.008, 2e-4, 1.4e-5],
        }
    }

    #[test]
    fn the_jacobian_is_the_derivative() {
        let state = SVector::from([120.0, 60.0, 0.9, -0.01]);
        for law in [BrakingLaw::Constant, BrakingLaw::Demand, BrakingLaw::Rail(RailCondition::Wet)]
        {
            let (_, jacobian) = predict(&inputs(), &law, WALK, &state);
            for column in 0..STATES {
                let step = 1e-5;
                let mut high = state;
                let mut low = state;
                high[column] += step;
                low[column] -= step;
                let difference = (predict(&inputs(), &law, WALK, &high).0
                    - predict(&inputs(), &law, WALK, &low).0)
                    / (2.0 * step);
                assert!((jacobian.column(column) - difference).norm() < 1e-8, "{law:?} {column}");
            }
        }
    }

    #[test]
    fn the_covariance_is_moved_as_by_full_products() {
        let state = SVector::from([120.0, 60.0, 0.9, -0.01]);
        let root = SMatrix::<f64, STATES, STATES>::from_fn(|i, j| {
            0.3 + 0.2 * i as f64 - 0.4 * (j as f64) * (i as f64 - 1.3)
        });
        let covariance = root * root.transpose();
        let noise = MotionNoise {
            distance_m2_per_s: 0.02,
            speed_m2_per_s3: 0.01,
            measured_distance_m2: 1.0,
            measured_speed_m2_per_s2: None,
        };
        for walk in [WALK, Walk::Scale(1e-4)] {
            let (_, jacobian) =
                predict(&inputs(), &BrakingLaw::Rail(RailCondition::Wet), walk, &state);
            let added = process_noise(&noise, walk, inputs().step_s);
            let moved = move_covariance(&jacobian, &covariance, &added);
            let full = jacobian * covariance * jacobian.transpose() + added;
            assert!((moved - full).norm() < 1e-12 * full.norm());
            assert_eq!(moved, moved.transpose());
        }
    }

    #[test]
    fn a_train_without_brake_and_resistance_keeps_its_speed() {
        let free = StepInputs { tied_mps2: 0.0, basic_mps2: [0.0; 3], ..inputs() };
        let moved = advance(&free, &BrakingLaw::Constant, 50.0, 0.0);
        assert_eq!((moved.speed_mps, moved.travelled_m), (50.0, 10.0));
    }

    #[test]
    fn the_printed_position_never_moves_on() {
        // Xie 2019, eq. (2): s_{t+1} = s_t + T (v_{t-1} - v_t) / 7.2, v in km/h. Over a stop
        // from 300 km/h the increments sum to T (v_first - v_last) / 7.2, a few metres.
        let (mut printed_m, mut corrected_m) = (0.0, 0.0);
        let (mut before_kmh, mut now_kmh) = (300.0, 300.0);
        while now_kmh > 3.0 {
            let next_kmh = now_kmh - 0.6;
            printed_m += 0.2 * (before_kmh - now_kmh) / 7.2;
            corrected_m += 0.2 * (now_kmh + next_kmh) / 7.2;
            (before_kmh, now_kmh) = (now_kmh, next_kmh);
        }
        assert!(printed_m < 10.0, "{printed_m}");
        assert!(corrected_m > 3_000.0, "{corrected_m}");
    }
}
