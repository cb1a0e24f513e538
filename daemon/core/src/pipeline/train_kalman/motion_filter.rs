//! A Kalman filter of speed, disturbance, load and resistance over the steps between samples, and the ways in which a
//! force that the model does not know may behave in time.

use nalgebra::{SMatrix, SVector};

use crate::filter::Gaussian;
use crate::pipeline::momentum::regressors;
use crate::pipeline::motion::jump_variance;

/// Index of the speed in m/s.
pub const SPEED: usize = 0;
/// Index of the force that the model does not know, in N/kN, retarding.
pub const DISTURBANCE: usize = 1;
/// Index of the declared mass over the true one.
pub const LOAD: usize = 2;
/// First index of a, b and c, scaled as [`regressors`] are, in N/kN.
pub const RESISTANCE: usize = 3;
/// Index of the error of the traction force's scale.
pub const TRACTION_SCALE: usize = 6;
/// Index of the brake force beyond its report, over its standard deviation at the time.
pub const BRAKE_ERROR: usize = 7;
/// Index of the delay in s between the report of a force and the force itself.
pub const FORCE_DELAY: usize = 8;
/// Index of the wind along the line in m/s, a headwind where the chainage grows.
pub const WIND: usize = 9;
/// Index of the error of the brake force's scale from braking to braking.
pub const BRAKE_SCALE: usize = 10;
/// Index of the error of the map's gradient in ‰, climbing where the chainage grows.
pub const MAP_ERROR: usize = 11;
/// Number of states.
pub const STATES: usize = 12;

/// A state.
pub type MotionState = SVector<f64, STATES>;
/// Covariance of a state.
pub type StateCovariance = SMatrix<f64, STATES, STATES>;

/// Davis a, b, c.
pub const COEFFICIENTS: usize = 3;

/// Share of w0 that the integral between two samples, which are taken as joined by straight lines,
/// is off by from step to step.
const INTEGRATION_SHARE: f64 = 1e-4;

/// Time in s over which a wind becomes another one.
const WIND_TIME_S: f64 = 7200.0;

/// Returns the share of a wind that is left after a time in s, and the variance of the new wind in its place.
pub fn wind_over(time_s: f64, std_mps: f64) -> (f64, f64) {
    let keep = (-time_s / WIND_TIME_S).exp();
    (keep, std_mps * std_mps * (1.0 - keep * keep))
}

/// Ways in which a brake follows its report: each may take another time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Following {
    /// It builds up.
    Building,
    /// It is released under way.
    Releasing,
    /// Little is left of the force that was released.
    Fading,
    /// Its report fades as the train comes to a stand, which friction may do that is not reported.
    Stopping,
    /// It held the standing train, and is released for the start: by friction, also where an electric brake does the rest.
    Starting,
}

/// Error of the map's gradient under the train after a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapErrorStep {
    /// Standard deviation in ‰, as surveyed or as the settings have it.
    pub std_permille: f64,
    /// Share of the error that is still there.
    pub kept: f64,
}

/// Step between two samples, as every behaviour uses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterStep {
    /// Duration in s.
    pub duration_s: f64,
    /// Distance in m.
    pub travelled_m: f64,
    /// Momentum per weight and speed: s.
    pub inertia: f64,
    /// How long in s forces are taken to act behind their report.
    pub delay_s: f64,
    /// Impulse of the traction force in N/kN s, if it acts so much later.
    pub traction: f64,
    /// Impulse of the brake force, retarding, if it acts so much later, with the expected force of a late brake.
    pub brake: f64,
    /// Impulse of all that is known to retard beyond the basic resistance.
    pub known: f64,
    /// Change of the traction force over the step in N/kN.
    pub traction_change: f64,
    /// Standard deviation of the brake's impulse in N/kN s by how late and how strong it may be.
    pub brake_std: f64,
    /// Share of its square by how late it is.
    pub brake_lateness: f64,
    /// Way in which the brake follows its report.
    pub following: Following,
    /// Variance in (N/kN s)² of the impulse by gusts, and by where on the line a known force acts.
    pub impulse_variance: f64,
    /// Share of [`jump_variance`] that the forces of this train bring.
    pub jump_share: f64,
    /// Fastest change of force lately in N/kN per s.
    pub force_rate: f64,
    /// 1 along growing chainage, else -1.
    pub direction: f64,
    /// The map's error.
    pub map_error: MapErrorStep,
    /// Variance in (N/kN)² that comes to each coefficient of the resistance.
    pub drift_variance: f64,
    /// Addition of 1 m/s of wind along the line in N/kN. It uses the declared air resistance: with the one learned
    /// so far the product of two unknowns would seem better known than it is.
    pub by_wind: f64,
    /// Addition of its square in N/kN, headwind or tailwind.
    pub by_wind_square: f64,
    /// Share of the wind that is left, and the variance in (m/s)² of the new wind in its place.
    pub wind: (f64, f64),
    /// Variance that comes to the scale of the brake force.
    pub brake_drift_variance: f64,
    /// Share of the brake's error that is left, and the variance of the new error in its place.
    pub brake_error: (f64, f64),
}

/// The filter under one behaviour of the disturbance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionFilter {
    /// The behaviour.
    pub behaviour: Behaviour,
    /// State estimate.
    pub belief: Gaussian<STATES>,
    /// Variance in (m/s)² of the speed that the newest step brought by forces that jumped.
    pub jump_variance: f64,
}

impl MotionFilter {
    /// Moves on by a step, by Heun's rule.
    ///
    /// # Real-time
    ///
    /// Work in proportion to the square of [`STATES`], no allocation.
    pub fn predict(&mut self, step: &FilterStep) {
        let state = self.belief.mean;
        let (load, later_s) = (state[LOAD], state[FORCE_DELAY] - step.delay_s);
        let traction = step.traction - later_s * step.traction_change;
        let force = traction - step.brake;
        let change = step.traction_change;
        // Not times the load: a product of two unknowns would seem better known than it is, and with each load a little
        // more, until the scale is believed that the noise of many stops made.
        let unexplained = step.duration_s
            * (state[DISTURBANCE] + step.direction * state[MAP_ERROR])
            + step.brake_std * state[BRAKE_ERROR]
            + step.brake * state[BRAKE_SCALE]
            - traction * state[TRACTION_SCALE];
        let impulse = load * force - step.known - unexplained;
        let resistance = |powers: &[f64; COEFFICIENTS]| -> f64 {
            (0..COEFFICIENTS).map(|i| powers[i] * state[RESISTANCE + i]).sum()
        };
        let per_inertia = 1.0 / step.inertia;
        let start_mps = state[SPEED];
        let at_start = regressors(start_mps);
        let w0_at_start = resistance(&at_start);
        let end_mps = start_mps + per_inertia * (impulse - step.duration_s * w0_at_start);
        let at_end = regressors(end_mps);
        let mean: [f64; COEFFICIENTS] = std::array::from_fn(|i| 0.5 * (at_start[i] + at_end[i]));
        let w0 = resistance(&mean);
        let slope = (resistance(&at_end) - w0_at_start) / (end_mps - start_mps);
        let slope = if slope.is_finite() { slope } else { 0.0 };

        let wind = (step.by_wind + step.by_wind_square * state[WIND]) * state[WIND];
        let seconds = step.duration_s * per_inertia;
        let mut gradient = MotionState::zeros();
        gradient[SPEED] = 1.0 - seconds * slope;
        gradient[DISTURBANCE] = -seconds;
        gradient[MAP_ERROR] = -seconds * step.direction;
        gradient[LOAD] = per_inertia * force;
        for i in 0..COEFFICIENTS {
            gradient[RESISTANCE + i] = -seconds * mean[i];
        }
        gradient[WIND] = -seconds * (step.by_wind + 2.0 * step.by_wind_square * state[WIND]);
        gradient[TRACTION_SCALE] = per_inertia * traction;
        gradient[BRAKE_ERROR] = -per_inertia * step.brake_std;
        gradient[BRAKE_SCALE] = -per_inertia * step.brake;
        let by_scale = state[TRACTION_SCALE];
        gradient[FORCE_DELAY] = -per_inertia * (load + by_scale) * change;

        let jump = step.jump_share * jump_variance((load + by_scale) * change, step.duration_s);
        self.jump_variance = jump * per_inertia * per_inertia;
        let missed = step.impulse_variance + (INTEGRATION_SHARE * step.duration_s * w0).powi(2);
        let variance = self.jump_variance + missed * per_inertia * per_inertia;
        let next_mps = start_mps + per_inertia * (impulse - step.duration_s * (w0 + wind));
        self.belief.rewrite(SPEED, next_mps, &gradient, variance);

        let (keep, renewed) = self.behaviour.over(step.duration_s);
        self.belief.fade(DISTURBANCE, keep, renewed);
        self.pass(&step.map_error);
        for i in 0..COEFFICIENTS {
            self.belief.disturb(RESISTANCE + i, step.drift_variance);
        }
        for (index, (keep, renewed)) in [(WIND, step.wind), (BRAKE_ERROR, step.brake_error)] {
            if keep < 1.0 {
                self.belief.fade(index, keep, renewed);
            }
        }
        self.belief.disturb(BRAKE_SCALE, step.brake_drift_variance);
    }

    /// Passes a distance of the line.
    pub fn pass(&mut self, map: &MapErrorStep) {
        let renewed = 1.0 - map.kept * map.kept;
        let square = self.behaviour.map_std_permille.powi(2) + map.std_permille.powi(2);
        self.belief.fade(MAP_ERROR, map.kept, square * renewed);
    }

    /// Variance in (m/s)² of the speed while a force changes that acts by d later than the step has it: its
    /// impulse is taken as d times the change at once, and is off by half d² times the rate until then.
    pub fn transient_variance(&self, step: &FilterStep) -> f64 {
        let later_s = self.belief.mean[FORCE_DELAY] - step.delay_s;
        let square = later_s * later_s + self.belief.covariance[(FORCE_DELAY, FORCE_DELAY)];
        (0.5 * square * step.force_rate / step.inertia).powi(2)
    }
}

/// A force of mean zero that fades with time and is renewed (Ornstein, Uhlenbeck 1930), next to a map that is worse
/// than stated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Behaviour {
    /// Standard deviation in N/kN.
    pub std_n_per_kn: f64,
    /// Correlation time in s.
    pub time_s: f64,
    /// Standard deviation in ‰ of the map beyond the stated one.
    pub map_std_permille: f64,
    /// Logarithm of its probability before any sample.
    pub log_prior: f64,
}

/// Number of behaviours.
pub const BEHAVIOURS: usize = 7;

/// Standard deviation in N/kN, correlation time in s, standard deviation in ‰ of the map beyond the stated one, and
/// probability before any sample: only the small forces that every model misses; a poor map; wind; gusts.
const TABLE: [(f64, f64, f64, f64); BEHAVIOURS] = [
    (0.02, 60.0, 0.0, 0.30),
    (0.02, 60.0, 0.1, 0.20),
    (0.02, 60.0, 0.3, 0.10),
    (0.1, 120.0, 0.0, 0.20),
    (0.3, 120.0, 0.0, 0.10),
    (1.0, 12.0, 0.0, 0.05),
    (1.0, 120.0, 0.0, 0.05),
];

/// All behaviours that compete.
pub fn behaviours() -> [Behaviour; BEHAVIOURS] {
    TABLE.map(|(std_n_per_kn, time_s, map_std_permille, probability)| Behaviour {
        std_n_per_kn,
        time_s,
        map_std_permille,
        log_prior: f64::ln(probability),
    })
}

impl Behaviour {
    /// Returns the share of the force that is left after a time in s, and the variance in (N/kN)² of the new force in
    /// its place.
    pub fn over(&self, time_s: f64) -> (f64, f64) {
        let keep = (-time_s / self.time_s).exp();
        (keep, self.std_n_per_kn.powi(2) * (1.0 - keep * keep))
    }
}

#[cfg(test)]
mod tests {
    use super::behaviours;
    use super::*;

    fn step() -> FilterStep {
        FilterStep {
            duration_s: 0.2,
            travelled_m: 4.0,
            inertia: 108.0,
            delay_s: 0.1,
            traction: 11.0,
            brake: 3.0,
            known: 0.9,
            traction_change: 4.0,
            brake_std: 0.7,
            brake_lateness: 0.0,
            following: Following::Building,
            impulse_variance: 0.0,
            jump_share: 0.0,
            force_rate: 0.0,
            direction: -1.0,
            map_error: MapErrorStep { std_permille: 0.0, kept: 1.0 },
            drift_variance: 0.0,
            by_wind: 0.07,
            by_wind_square: 0.002,
            wind: (1.0, 0.0),
            brake_drift_variance: 0.0,
            brake_error: (1.0, 0.0),
        }
    }

    fn filter() -> MotionFilter {
        let mean =
            MotionState::from([21.0, 0.3, 0.95, 1.6, 0.4, 0.9, 0.01, -0.02, 0.15, -1.2, 0.1, 0.2]);
        let belief = Gaussian { mean, covariance: StateCovariance::zeros() };
        MotionFilter { behaviour: behaviours()[0], belief, jump_variance: 0.0 }
    }

    /// The speed after a step from a state.
    fn speed_after(mean: MotionState) -> f64 {
        let mut moved = filter();
        moved.belief.mean = mean;
        moved.predict(&step());
        moved.belief.mean[SPEED]
    }

    #[test]
    fn loads_of_which_nothing_is_known_teach_the_scale_of_the_traction_nothing() {
        const SCALE_STD: f64 = 0.007;
        let accelerating = FilterStep { brake: 0.0, delay_s: 0.0, ..step() };
        let (mut truth, mut learned) = (filter(), filter());
        for it in [&mut truth, &mut learned] {
            it.belief.mean[TRACTION_SCALE] = 0.0;
            it.belief.mean[FORCE_DELAY] = 0.0;
        }
        learned.belief.covariance[(TRACTION_SCALE, TRACTION_SCALE)] = SCALE_STD * SCALE_STD;
        let mut sample = 0.0_f64;
        let mut noise_mps = || {
            sample += 1.0;
            0.02 * (12.9898 * sample * sample).sin()
        };
        for stop in 0..400 {
            truth.belief.mean[LOAD] = if stop % 2 == 0 { 0.85 } else { 1.15 };
            truth.belief.mean[SPEED] = 10.0;
            learned.belief.replace(LOAD, 1.0, 1.0);
            learned.belief.replace(SPEED, 10.0 + noise_mps(), 2e-4);
            for _ in 0..30 {
                truth.predict(&accelerating);
                learned.predict(&accelerating);
                let measured_mps = truth.belief.mean[SPEED] + noise_mps();
                learned.belief.measure(SPEED, measured_mps, 2e-4).unwrap();
            }
        }
        let Gaussian { mean, covariance } = &learned.belief;
        assert!(mean[TRACTION_SCALE].abs() < 0.1 * SCALE_STD, "{}", mean[TRACTION_SCALE]);
        let std = covariance[(TRACTION_SCALE, TRACTION_SCALE)].sqrt();
        assert!(std > 0.99 * SCALE_STD, "{std}");
    }

    #[test]
    fn the_covariance_moves_by_the_derivatives_of_the_speed() {
        for index in 0..STATES {
            let mut certain = filter();
            certain.predict(&step());
            let mut uncertain = filter();
            uncertain.belief.covariance[(index, index)] = 1.0;
            uncertain.predict(&step());
            let gained = uncertain.belief.covariance[(SPEED, SPEED)]
                - certain.belief.covariance[(SPEED, SPEED)];
            let mut ahead = filter().belief.mean;
            let mut behind = ahead;
            ahead[index] += 1e-5;
            behind[index] -= 1e-5;
            let slope = (speed_after(ahead) - speed_after(behind)) / 2e-5;
            // Heun's rule takes the resistance half way: its slope is off in the second order.
            assert!((gained.sqrt() - slope.abs()).abs() < 1e-4 + 1e-3 * slope.abs(), "{index}");
        }
    }

    #[test]
    fn only_as_much_of_a_jump_is_doubted_as_forces_of_this_train_bring() {
        let mut doubting = filter();
        doubting.predict(&FilterStep { jump_share: 1.0, ..step() });
        let whole = doubting.jump_variance;
        doubting.predict(&FilterStep { jump_share: 0.25, ..step() });
        assert!(whole > 0.0 && (doubting.jump_variance / whole - 0.25).abs() < 0.01);
    }
}

#[cfg(test)]
mod behaviour_tests {
    use super::*;

    #[test]
    fn the_probabilities_before_any_sample_add_up_to_one() {
        let sum: f64 = behaviours().iter().map(|behaviour| behaviour.log_prior.exp()).sum();
        assert!((sum - 1.0).abs() < 1e-12);
    }
}
