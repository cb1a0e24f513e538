//! Uncertainty of the estimate, including the part that no number of samples of one train on one line reduces, and
//! its form in a snapshot.

use dynocar_model::track::{GRADIENT_ERROR_FREE_M, gradient_error_of_mean};
use dynocar_shared::{ParameterSnapshot, Quantity};
use nalgebra::{Matrix4, Vector4};

use super::motion_bank::Published;
use super::motion_filter::COEFFICIENTS;
use crate::pipeline::momentum::{regressors, unscaling};
use crate::pipeline::motion::SpeedRange;
use crate::pipeline::output::{DAVIS_AND_MASS, excitation, write_parameters};

/// Index of the load factor among the published values.
const LOAD: usize = COEFFICIENTS;

/// A judgement with hysteresis: a known quantity becomes unknown only well beyond the limit at which it became known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    enter_below: f64,
    leave_above: f64,
    /// The judgement.
    pub is_known: bool,
}

impl Level {
    /// Returns a level that becomes known below one relative standard deviation, and unknown above another.
    pub const fn new(enter_below: f64, leave_above: f64) -> Self {
        Level { enter_below, leave_above, is_known: false }
    }

    /// Takes in a relative standard deviation.
    pub fn see(&mut self, relative_std: f64) {
        let bound = if self.is_known { self.leave_above } else { self.enter_below };
        self.is_known = relative_std <= bound;
    }
}

/// The estimate as it is published.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainKalmanReport {
    /// a, b, c (scaled, N/kN) and the declared mass over the true one.
    mean: Vector4<f64>,
    covariance: Matrix4<f64>,
    /// Disturbance in N/kN with its standard deviation.
    disturbance: (f64, f64),
    resistance: Level,
    mass: Level,
    /// True once the mass was known.
    was_mass_known: bool,
}

/// Standard deviation of w0 at the speeds driven, as a share of it: known below the first, unknown
/// again above the second.
const RESISTANCE_LEVEL: Level = Level::new(0.15, 0.22);
/// Standard deviation of the mass as a share of it. A load that changed at a stop does not make the
/// mass unknown: its interval says how much may have boarded.
const MASS_LEVEL: Level = Level::new(0.025, 0.12);
/// Standard deviations beyond which a mass surely lies outside of a range.
const SURE_STDS: f64 = 2.0;
/// Share of w0 that a coefficient's standard deviation may reach while it counts as excited.
const EXCITED_SHARE: f64 = 0.25;

impl TrainKalmanReport {
    /// Before any sample.
    pub fn new(published: &Published) -> Self {
        TrainKalmanReport {
            mean: published.mean,
            covariance: published.covariance,
            disturbance: published.disturbance,
            resistance: RESISTANCE_LEVEL,
            mass: MASS_LEVEL,
            was_mass_known: false,
        }
    }

    /// Before any sample, where these quantities, one bit each, were known a moment ago.
    pub fn resumed(published: &Published, known: u32) -> Self {
        let mut report = TrainKalmanReport::new(published);
        report.resistance.is_known = known & Quantity::Resistance.bit() != 0;
        report.mass.is_known = known & Quantity::Mass.bit() != 0;
        report
    }

    /// Takes over the present estimate, its covariance times a factor and widened by the systematic errors, and judges
    /// it at the speeds driven.
    pub fn take(
        &mut self,
        published: &Published,
        inflation: f64,
        systematic: &Systematic,
        speeds: &SpeedRange,
    ) {
        self.mean = published.mean;
        self.covariance = published.covariance * inflation;
        systematic.widen(&self.mean, &mut self.covariance);
        self.disturbance = published.disturbance;
        self.resistance.see(self.resistance_std_share(speeds));
        self.mass.see(self.mass_std_share());
        self.was_mass_known |= self.mass.is_known;
    }

    fn mass_std_share(&self) -> f64 {
        self.covariance[(LOAD, LOAD)].max(0.0).sqrt() / self.mean[LOAD]
    }

    /// True from where a load that was known may have become another one until it is known again.
    pub fn is_load_open(&self) -> bool {
        self.was_mass_known && self.mass_std_share() > self.mass.enter_below
    }

    /// Returns whether a known mass in kg surely lies outside of a range; `declared_kg` is the mass that the load factor
    /// refers to.
    pub fn is_mass_outside(&self, declared_kg: f64, (least_kg, most_kg): (f64, f64)) -> bool {
        let (load, std) = (self.mean[LOAD], self.load_variance().max(0.0).sqrt());
        let [low, high] = [load - SURE_STDS * std, load + SURE_STDS * std];
        self.mass.is_known && (declared_kg < least_kg * low || declared_kg > most_kg * high)
    }

    /// The greatest standard deviation of w0 as a share of it, at the middle and near the top of the
    /// speeds driven.
    fn resistance_std_share(&self, speeds: &SpeedRange) -> f64 {
        let Some((low, high)) = speeds.get() else { return f64::INFINITY };
        [0.5, 0.9].map(|share| self.w0(low + share * (high - low))).into_iter().fold(
            0.0,
            |greatest: f64, (w0, std)| match w0 > 0.0 {
                true => greatest.max(std / w0),
                false => f64::INFINITY,
            },
        )
    }

    /// w0 in N/kN at a speed in m/s with its standard deviation.
    fn w0(&self, speed_mps: f64) -> (f64, f64) {
        let [one, linear, square] = regressors(speed_mps);
        let row = Vector4::new(one, linear, square, 0.0);
        (row.dot(&self.mean), row.dot(&(self.covariance * row)).max(0.0).sqrt())
    }

    /// The quantities whose intervals are narrow enough.
    pub fn known(&self) -> u32 {
        let bit = |level: &Level, quantity: Quantity| u32::from(level.is_known) * quantity.bit();
        bit(&self.resistance, Quantity::Resistance) | bit(&self.mass, Quantity::Mass)
    }

    /// Variance of the declared mass over the true one.
    pub fn load_variance(&self) -> f64 {
        self.covariance[(LOAD, LOAD)]
    }

    /// Writes values, covariance, excitation and the unexplained force; `declared_kg` is the mass
    /// that the load factor refers to.
    pub fn write(&self, declared_kg: f64, speeds: &SpeedRange, snapshot: &mut ParameterSnapshot) {
        let factors = unscaling();
        let mass_kg = declared_kg / self.mean[LOAD];
        let to_units = Vector4::new(factors[0], factors[1], factors[2], -mass_kg / self.mean[LOAD]);
        let mut values = self.mean.component_mul(&to_units);
        values[LOAD] = mass_kg;
        let scale = Matrix4::from_diagonal(&to_units);
        write_parameters(snapshot, DAVIS_AND_MASS, &values, &(scale * self.covariance * scale));
        self.write_excitation(speeds, snapshot);
        let weight_kn = dynocar_model::train::TrainModel::weight_kn(mass_kg);
        snapshot.unexplained_force_n = self.disturbance.0 * weight_kn;
        snapshot.unexplained_force_std_n = self.disturbance.1 * weight_kn;
        speeds.write(snapshot);
    }

    fn write_excitation(&self, speeds: &SpeedRange, snapshot: &mut ParameterSnapshot) {
        let top_mps = speeds.get().map_or(0.0, |(_, high)| high);
        let powers = regressors(top_mps);
        let w0 = self.w0(top_mps).0;
        let is_excited = |i: usize| match i {
            LOAD => self.mass.is_known,
            _ => self.covariance[(i, i)].max(0.0).sqrt() * powers[i] < EXCITED_SHARE * w0,
        };
        (snapshot.excited, snapshot.missing_manoeuvres) =
            excitation([0, 1, 2, LOAD].map(is_excited));
    }
}

/// The segment of line that was driven, and the scales that cannot be found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Systematic {
    /// Standard deviation in ‰ of gradients where no survey states one.
    gradient_std_permille: f64,
    /// See [`gradient_error_of_mean`].
    map_share: f64,
    /// Standard deviation of the scale of accelerations.
    scale_std: f64,
    /// Lowest and highest chainage in m.
    driven_m: Option<(f64, f64)>,
    /// Highest speed in m/s.
    top_mps: f64,
    /// Starts from a standstill, and the distance in m driven altogether.
    starts: f64,
    travelled_m: f64,
}

impl Systematic {
    /// Before the first sample of a train of a length in m.
    pub fn new(gradient_std_permille: f64, scale_std: f64, train_length_m: f64) -> Self {
        Systematic {
            gradient_std_permille,
            map_share: gradient_error_of_mean(train_length_m),
            scale_std,
            driven_m: None,
            top_mps: 0.0,
            starts: 0.0,
            travelled_m: 0.0,
        }
    }

    /// Takes in a step of a way in m, where it ends, and the speed there.
    pub fn see(&mut self, travelled_m: f64, position_m: Option<f64>, speed_mps: f64) {
        self.travelled_m += travelled_m;
        self.top_mps = self.top_mps.max(speed_mps);
        if let Some(position_m) = position_m {
            let (low, high) = self.driven_m.unwrap_or((position_m, position_m));
            self.driven_m = Some((low.min(position_m), high.max(position_m)));
        }
    }

    /// The train starts from a standstill.
    pub fn start(&mut self) {
        self.starts += 1.0;
    }

    /// Variance in (N/kN)² that the filter lacks of w0 by the mean error of the map over the line driven, and
    /// over the places where the train is slow: passing a place once more brings the same error again, which
    /// the filter takes for another one. Without chainage every place counts as new.
    fn map_variances(&self) -> (f64, f64) {
        let Some((low, high)) = self.driven_m else { return (0.0, 0.0) };
        let line_m = high - low;
        let between_stops_m = self.travelled_m / self.starts.max(1.0);
        let pieces = (line_m / GRADIENT_ERROR_FREE_M).max(1.0);
        let stops = (line_m / between_stops_m.max(1.0)).clamp(1.0, self.starts.max(1.0));
        let variance = self.gradient_std_permille.powi(2);
        let repeated = 1.0 - (line_m / self.travelled_m.max(1.0)).min(1.0);
        (variance * repeated / pieces, self.map_share.powi(2) * variance * repeated / stops)
    }

    /// Widens the covariance of a, b, c (scaled) and of the load factor.
    pub fn widen(&self, mean: &Vector4<f64>, covariance: &mut Matrix4<f64>) {
        let scale = self.scale_std * self.scale_std;
        let mut by_scale = mean * mean.transpose() * scale;
        // A factor of the accelerations scales resistance and mass alike: u by its inverse.
        for i in 0..3 {
            by_scale[(i, 3)] = -by_scale[(i, 3)];
            by_scale[(3, i)] = -by_scale[(3, i)];
        }
        *covariance += by_scale;
        let (of_line, of_stops) = self.map_variances();
        // The effect of the map where the train is slow fades towards the highest speed.
        let mut slow = Vector4::zeros();
        let [one, linear, _] = regressors(self.top_mps.max(1.0));
        (slow[0], slow[1]) = (one, -one / linear);
        *covariance += slow * slow.transpose() * of_stops;
        covariance[(0, 0)] += of_line;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passing_a_line_again_makes_nothing_better_known() {
        let widened = |lengths_m: &[f64]| {
            let mut systematic = Systematic::new(0.1, 0.0, 0.0);
            for length_m in lengths_m {
                systematic.start();
                systematic.see(*length_m, Some(0.0), 20.0);
                systematic.see(0.0, Some(*length_m), 20.0);
            }
            let mut covariance = Matrix4::zeros();
            systematic.widen(&Vector4::zeros(), &mut covariance);
            // w0 at the highest speed, where only the line counts.
            let top = Vector4::new(1.0, 1.0, 1.0, 0.0);
            top.dot(&(covariance * top))
        };
        // The filter takes the passages for independent: of the error of one it has a seventh after seven.
        let by_one = 0.01 / 50.0;
        assert!((widened(&[10e3; 7]) + by_one / 7.0 - by_one).abs() < 1e-12);
        assert!((widened(&[40e3; 7]) - widened(&[10e3; 7]) / 4.0).abs() < 1e-12);
        assert_eq!(widened(&[10e3]), 0.0, "the filter has all of it");
    }
}
