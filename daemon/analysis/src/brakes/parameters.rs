//! The parameters of the gamma model of ETCS from studied stops and declared components.

use dynocar_model::train::BrakeComponents;
use serde::Serialize;
use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF, StudentsT};

use super::components::weakest;
use super::speed_steps::SpeedSteps;
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
