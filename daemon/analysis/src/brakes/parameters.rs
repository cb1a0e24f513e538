//! The parameters of the gamma model of ETCS from studied stops and declared components, in steps of speed below a curve
//! of deceleration (SUBSET-026, 3.13).

use dynocar_model::train::BrakeComponents;
use serde::Serialize;
use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF, StudentsT};

use super::components::weakest;
use crate::stops::{CutOff, DecelerationLaw, Manner, RecordedStop, StopStatistics};

/// Number of levels of confidence that a balise may ask for (EBCL): at level n, all stops but one in 10ⁿ reach the
/// steps.
pub const LEVELS: u32 = 10;
/// Number of draws for a level.
const DRAWS: usize = 1 << 14;
/// Seed of the draws.
const SEED: u64 = 26;

/// Shortfall of stops below the steps at a level of confidence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Correction {
    /// The level, 0 to 9.
    pub ebcl: u32,
    /// Share of stops that are weaker.
    pub probability: f64,
    /// Factor that the measured stops reach; `None` where there are too few for the level.
    pub measured: Option<f64>,
    /// Its 95 % interval by the order of the stops; an end is `None` beyond the weakest and strongest.
    pub measured_95: [Option<f64>; 2],
    /// Factor that the declared components reach, conditioned on the stops; `None` without components.
    pub modelled: Option<f64>,
}

impl Correction {
    /// Returns the factor for the train: the smaller of both; `None` where neither data nor components reach.
    pub fn k_dry(&self) -> Option<f64> {
        let given = [self.measured, self.modelled].into_iter().flatten();
        given.reduce(f64::min).map(|it| it.min(1.0))
    }
}

/// The parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BrakeParameters {
    /// Number of stops that the emergency steps come from.
    pub stops: usize,
    /// Whether a record of the brake shows that it was applied in full in them.
    pub is_commanded: bool,
    /// A_brake_emergency in m/s²: by all of the brake.
    pub emergency: SpeedSteps,
    /// A_brake_service in m/s²; `None` without full service stops.
    pub service: Option<SpeedSteps>,
    /// A_brake_normal_service in m/s²: the deceleration that drivers use; `None` without stops by less than all of the
    /// brake.
    pub normal_service: Option<SpeedSteps>,
    /// Number of stops that the normal service steps come from.
    pub usual_stops: usize,
    /// The lower bound of the mean deceleration, that the emergency steps lie below: speed in m/s and m/s².
    pub bound: Vec<[f64; 2]>,
    /// T_brake_build_up in s: dead time and increase.
    pub build_up_s: f64,
    /// The same of the service brake; `None` without full service stops.
    pub service_build_up_s: Option<f64>,
    /// T_traction_cut_off; `None` where no stop shows it.
    pub cut_off: Option<CutOff>,
    /// Kdry_rst by level.
    pub k_dry: Vec<Correction>,
    /// Kwet_rst over speed; `None` without wet stops.
    pub k_wet: Option<SpeedSteps>,
}

/// Returns the curve that the mean deceleration of a law lies above with a confidence.
pub fn lower_bound(law: &DecelerationLaw, confidence: f64) -> Vec<[f64; 2]> {
    let quantile =
        StudentsT::new(0.0, 1.0, law.freedom).map_or(2.0, |it| it.inverse_cdf(confidence));
    let common = law.repeatability / (law.stops as f64).sqrt();
    let points = law.points.iter().map(|it| {
        let std = common.hypot(it.std_mps2 / it.deceleration_mps2);
        [it.speed_mps, it.deceleration_mps2 * (1.0 - quantile * std)]
    });
    points.collect()
}

/// Returns the decelerations that half of the stops by less than all of the brake exceed, and how many these are.
pub fn usual(stops: &[RecordedStop]) -> (Option<SpeedSteps>, usize) {
    let is_usual = |it: &&RecordedStop| it.manner == Manner::Modulated && !it.has_slid;
    let usual: Vec<RecordedStop> = stops.iter().filter(is_usual).cloned().collect();
    let day = StopStatistics::from_stops(&usual);
    let enough = day.decelerations.iter().filter(|it| it.stops >= 3);
    let curve: Vec<[f64; 2]> =
        enough.map(|it| [it.speed_mps, it.deceleration_mps2.median]).collect();
    (SpeedSteps::below(&curve), usual.len())
}

/// Returns the deceleration on a wet rail over that on a dry one.
pub fn wet_share(dry: &DecelerationLaw, wet: &DecelerationLaw) -> Option<SpeedSteps> {
    let pairs = dry.points.iter().zip(&wet.points);
    let curve: Vec<[f64; 2]> = pairs
        .map(|(dry, wet)| [dry.speed_mps, (wet.deceleration_mps2 / dry.deceleration_mps2).min(1.0)])
        .collect();
    SpeedSteps::below(&curve)
}

/// Returns the corrections of all levels.
pub fn corrections(law: &DecelerationLaw, declared: Option<&BrakeComponents>) -> Vec<Correction> {
    let brake = declared.map(|it| conditioned(it, law));
    let level = |ebcl: u32| {
        let probability =
            if ebcl == 0 { 0.5 } else { 0.1_f64.powi(i32::try_from(ebcl).unwrap_or(9)) };
        let (measured, measured_95) = by_order(&law.factors, probability);
        let modelled = brake.map(|brake| weakest(&brake, probability, DRAWS, SEED).share);
        Correction { ebcl, probability, measured, measured_95, modelled }
    };
    (0..LEVELS).map(level).collect()
}

/// Returns the components given the stops: the stops narrow the error that all units share, and their scatter beyond
/// that of the units is added to it.
fn conditioned(declared: &BrakeComponents, law: &DecelerationLaw) -> BrakeComponents {
    let units = f64::from(declared.units);
    let alive = 1.0 - declared.failure_probability;
    let each = declared.friction_std.powi(2)
        + declared.pressure_std.powi(2)
        + declared.efficiency_std.powi(2)
        + declared.failure_probability * alive;
    let of_stop = each / units + declared.mass_std.powi(2);
    let measured = law.repeatability.powi(2);
    let unexplained = (measured - of_stop).max(0.0);
    let known = (law.stops as f64) / measured.max(of_stop).max(1e-12);
    let prior = declared.common_std.powi(2);
    let common = if prior > 0.0 { 1.0 / (1.0 / prior + known) } else { 0.0 };
    BrakeComponents { common_std: (common + unexplained).sqrt(), ..*declared }
}

/// Returns the value that all but a share of some values, from small to great, reach, with its 95 % interval; `None`
/// for fewer values than show the share.
fn by_order(values: &[f64], probability: f64) -> (Option<f64>, [Option<f64>; 2]) {
    let count = values.len();
    if (count as f64) * probability < 1.0 - 1e-9 {
        return (None, [None; 2]);
    }
    let rank = ((count as f64 * probability).ceil() as usize).clamp(1, count);
    let Ok(below) = Binomial::new(probability, count as u64) else { return (None, [None; 2]) };
    // The quantile lies between two values whose ranks enclose it in 95 of 100 cases.
    let low =
        (0..count).rev().find(|&rank| below.cdf(rank as u64) <= 0.025).map(|rank| values[rank]);
    let high = (0..count).find(|&rank| below.cdf(rank as u64) >= 0.975).map(|rank| values[rank]);
    (Some(values[rank - 1]), [low, high])
}

/// Greatest number of steps of a curve.
pub const STEPS_MAX: usize = 7;

/// Values over intervals of speed: one more value than boundaries, which grow strictly; the form of OSRD.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SpeedSteps {
    /// Speeds in m/s at which the value changes.
    pub boundaries: Vec<f64>,
    /// The values, from standstill on.
    pub values: Vec<f64>,
}

impl SpeedSteps {
    /// One value at every speed.
    pub fn constant(value: f64) -> Self {
        SpeedSteps { boundaries: Vec::new(), values: vec![value] }
    }

    /// Returns the value at a speed in m/s.
    pub fn at(&self, speed_mps: f64) -> f64 {
        self.values[self.boundaries.partition_point(|it| *it <= speed_mps)]
    }

    /// Returns the lowest values between other boundaries.
    pub fn between(&self, boundaries: &[f64]) -> Self {
        let starts = std::iter::once(0.0).chain(boundaries.iter().copied());
        let ends = boundaries.iter().copied().chain([f64::INFINITY]);
        let lowest = starts.zip(ends).map(|(start_mps, end_mps)| {
            let from = self.boundaries.partition_point(|it| *it <= start_mps);
            let to = self.boundaries.partition_point(|it| *it < end_mps);
            self.values[from..=to].iter().copied().fold(f64::INFINITY, f64::min)
        });
        SpeedSteps { values: lowest.collect(), boundaries: boundaries.to_vec() }
    }

    /// Returns the distance in m to standstill from a speed in m/s by these decelerations.
    pub fn distance_m(&self, from_mps: f64) -> f64 {
        let mut low_mps = 0.0;
        let ends = self.boundaries.iter().copied().chain([f64::INFINITY]);
        let steps = ends.zip(&self.values).map(|(end_mps, value)| {
            let high_mps = end_mps.min(from_mps).max(low_mps);
            let distance_m = 0.5 * (high_mps * high_mps - low_mps * low_mps) / value;
            low_mps = high_mps;
            distance_m
        });
        steps.sum()
    }

    /// The steps, at most [`STEPS_MAX`], that lie nowhere above a curve (speed in m/s, deceleration in m/s², the
    /// speeds growing; linear between, constant beyond) and stop from its fastest speed in the shortest distance.
    ///
    /// `None` for a curve without points, or one that is not above 0.
    pub fn below(curve: &[[f64; 2]]) -> Option<Self> {
        if curve.is_empty() || curve.iter().any(|it| it[1].is_nan() || it[1] <= 0.0) {
            return None;
        }
        // Interval k reaches from the point before point k, or standstill, to it.
        let count = curve.len();
        let start_mps = |k: usize| if k == 0 { 0.0 } else { curve[k - 1][0] };
        let lowest = |k: usize| curve[k][1].min(curve[k.saturating_sub(1)][1]);
        // best[s][k]: the shortest distance over the first k intervals in s steps, and where the last begins.
        let mut best = vec![vec![(f64::INFINITY, 0); count + 1]; STEPS_MAX + 1];
        best[0][0].0 = 0.0;
        for steps in 1..=STEPS_MAX {
            for end in 1..=count {
                let (mut value, mut found) = (f64::INFINITY, best[steps - 1][end]);
                for from in (0..end).rev() {
                    value = value.min(lowest(from));
                    let (low, high) = (start_mps(from), curve[end - 1][0]);
                    let distance_m =
                        best[steps - 1][from].0 + 0.5 * (high * high - low * low) / value;
                    if distance_m < found.0 - 1e-9 {
                        found = (distance_m, from);
                    }
                }
                best[steps][end] = found;
            }
        }
        // As few steps as stop nearly as soon.
        let enough_m = best[STEPS_MAX][count].0 * 1.002;
        let mut steps = (1..=STEPS_MAX).find(|&steps| best[steps][count].0 <= enough_m)?;
        let (mut end, mut found) = (count, SpeedSteps::default());
        while end > 0 {
            let from = best[steps][end].1;
            found.values.push((from..end).map(lowest).fold(f64::INFINITY, f64::min));
            if from > 0 {
                found.boundaries.push(start_mps(from));
            }
            (end, steps) = (from, steps - 1);
        }
        found.values.reverse();
        found.boundaries.reverse();
        Some(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_stops_show_no_rarer_ones_than_they_are_many() {
        let values: Vec<f64> = (0..20).map(|k| 0.9 + 0.01 * f64::from(k)).collect();
        assert!(by_order(&values, 0.5).0.is_some_and(|it| (0.98..=1.01).contains(&it)));
        assert_eq!(by_order(&values, 0.1).0, Some(0.91));
        assert_eq!(by_order(&values, 0.1).1[0], None, "the quantile may lie below the weakest");
        assert_eq!(by_order(&values, 0.01), (None, [None; 2]));
    }
}

#[cfg(test)]
mod speed_steps_tests {
    use super::*;

    #[test]
    fn steps_lie_below_the_curve_and_stop_hardly_later() {
        let at = |speed: f64| 0.3 + 0.7 / (1.0 + speed / 12.0);
        let curve: Vec<[f64; 2]> = (1..=40).map(|k| [f64::from(k), at(f64::from(k))]).collect();
        let steps = SpeedSteps::below(&curve).unwrap();
        assert!(
            steps.values.len() <= STEPS_MAX && steps.values.len() == steps.boundaries.len() + 1
        );
        assert!(steps.boundaries.windows(2).all(|it| it[0] < it[1]), "{steps:?}");
        let mut exact_m = 0.0;
        for k in 0..4000 {
            let speed = 0.01 * (f64::from(k) + 0.5);
            assert!(steps.at(speed) <= at(speed.max(1.0)) + 1e-12, "{speed}: {steps:?}");
            exact_m += 0.01 * speed / at(speed);
        }
        let later = steps.distance_m(40.0) / exact_m;
        assert!((1.0..1.06).contains(&later), "{later}");
        assert_eq!(SpeedSteps::below(&[[10.0, 0.8], [20.0, 0.8]]), Some(SpeedSteps::constant(0.8)));
        assert_eq!(SpeedSteps::below(&[[10.0, 0.0]]), None);
        let two = SpeedSteps { boundaries: vec![10.0], values: vec![0.9, 0.7] };
        assert_eq!(two.between(&[10.0]), two);
        assert_eq!(two.between(&[5.0, 15.0]).values, [0.9, 0.7, 0.7]);
    }
}
