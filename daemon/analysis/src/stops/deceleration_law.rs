//! Deceleration over speed of all stops, the differences between stops, and the length of the next stop.

use dynocar_shared::{BrakeResponse, EffortPoint, Stop, StoppingEstimate, Uncertain};
use serde::Serialize;

use super::deceleration_curve::{DecelerationCurve, DecelerationPoint};

/// Step of the speeds in m/s at which the law is reported.
const GRID_MPS: f64 = 1.0;
/// Degrees of freedom of the assumed repeatability: it counts as this many stops more than one.
const ASSUMED_FREEDOM: f64 = 4.0;
/// Relative standard deviation of a stop's response, assumed with the same degrees of freedom.
const ASSUMED_RESPONSE: f64 = 0.1;
/// Standard normal quantile of a bound that 95 % of stops keep.
const BOUND: f64 = 1.645;

/// Deceleration at a speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LawPoint {
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Deceleration in m/s², the mean of the stops.
    pub deceleration_mps2: f64,
    /// Standard deviation in m/s² of that mean as a description of these stops.
    pub std_mps2: f64,
    /// Standard deviation in m/s² of the next stop about it.
    pub next_std_mps2: f64,
    /// Stops that passed the speed with the brake built up.
    pub stops: usize,
}

/// How the brake came after its command.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MeasuredResponse {
    /// Time in s without brake.
    pub dead_time_s: f64,
    /// Time in s over which the deceleration then grows to its full value.
    pub build_up_s: f64,
    /// Standard deviation in s from stop to stop of the time that a stop loses until then.
    pub std_s: f64,
}

impl MeasuredResponse {
    /// Returns the response over some stops, each by the time it loses and the moment of that loss, as a ramp has them.
    fn from_points(built: &[(&DecelerationCurve, &DecelerationPoint)]) -> Self {
        let count = built.len() as f64;
        let losses: Vec<[f64; 2]> = built.iter().map(|(curve, from)| lost(curve, from)).collect();
        let mean = |k: usize| losses.iter().map(|it| it[k]).sum::<f64>() / count;
        let lost_s = mean(0).max(0.0);
        let squares = losses.iter().map(|it| (it[0] - lost_s).powi(2)).sum::<f64>();
        // A ramp of T s after d s: the loss is d + T/2, its first moment (d + T/2)²/2 + T²/24.
        let build_up_s = (24.0 * (mean(1) - 0.5 * lost_s * lost_s)).max(0.0).sqrt();
        let build_up_s = build_up_s.min(2.0 * lost_s);
        let assumed = ASSUMED_FREEDOM * (ASSUMED_RESPONSE * lost_s).powi(2);
        MeasuredResponse {
            dead_time_s: lost_s - 0.5 * build_up_s,
            build_up_s,
            std_s: ((assumed + squares) / (ASSUMED_FREEDOM + count - 1.0)).sqrt(),
        }
    }

    /// Returns the same for a stop that is asked about.
    pub fn shared(&self) -> BrakeResponse {
        let MeasuredResponse { dead_time_s, build_up_s, std_s } = *self;
        BrakeResponse { dead_time_s, build_up_s, std_s, ..BrakeResponse::IMMEDIATE }
    }

    /// Returns the time in s that a stop loses, as if the brake then came at once.
    pub fn lost_s(&self) -> f64 {
        self.dead_time_s + 0.5 * self.build_up_s
    }
}

/// Returns the time in s that a stop lost until its brake had built up, and the first moment of that loss in s².
fn lost(curve: &DecelerationCurve, from: &DecelerationPoint) -> [f64; 2] {
    let lost_s = from.time_s - (curve.from_mps() - from.speed_mps) / from.deceleration_mps2;
    let pairs = curve.points.windows(2).take_while(|it| it[1].time_s <= from.time_s);
    let moment = pairs.map(|it| {
        let share =
            0.5 * (it[0].deceleration_mps2 + it[1].deceleration_mps2) / from.deceleration_mps2;
        0.5 * (it[1].time_s.powi(2) - it[0].time_s.powi(2)) * (1.0 - share)
    });
    [lost_s, moment.sum()]
}

/// Deceleration over speed, and how much stops differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DecelerationLaw {
    /// The speeds, growing.
    pub points: Vec<LawPoint>,
    /// How the brake comes after its command.
    pub response: MeasuredResponse,
    /// Standard deviation of a stop's deceleration over the law's: from the stops, and from the assumption before them.
    pub repeatability: f64,
    /// Degrees of freedom of the repeatability.
    pub freedom: f64,
    /// Each stop's deceleration over the law's, the mean over the speeds, from weak to strong.
    pub factors: Vec<f64>,
    /// Number of stops.
    pub stops: usize,
}

/// How long the next stop is, from the command to standstill.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StoppingDistance {
    /// Speed in m/s at the command.
    pub from_mps: f64,
    /// Expected distance in m.
    pub distance_m: f64,
    /// Expected time in s.
    pub time_s: f64,
    /// 95 % of stops are no longer, in m.
    pub distance_bound_m: f64,
}

/// Where a stop is asked about; the default is the line of the stops that the law is of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gradient {
    /// Gradient in ‰, climbing positive, above that of the law's stops.
    pub permille: f64,
    /// gamma: how much less it acts than on a train without rotating parts.
    pub rotating_mass_factor: f64,
}

impl DecelerationLaw {
    /// Returns the law of some stops, where stops are assumed to repeat within a relative standard
    /// deviation until there are enough to estimate it; `None` without a stop whose brake builds up.
    pub fn new(curves: &[DecelerationCurve], assumed_repeatability: f64) -> Option<Self> {
        let built: Vec<(&DecelerationCurve, &DecelerationPoint)> = curves
            .iter()
            .filter_map(|curve| Some((curve, &curve.points[curve.built_up?])))
            .collect();
        let fastest = built.iter().map(|(_, from)| from.speed_mps).fold(0.0, f64::max);
        let speeds = (1..).map(|k| GRID_MPS * f64::from(k)).take_while(|&it| it <= fastest);
        let passed = |speed_mps: f64| {
            let reaches = built.iter().enumerate().filter(move |it| it.1.1.speed_mps >= speed_mps);
            reaches.filter_map(move |(k, (curve, _))| Some((k, curve.at_speed(speed_mps)?)))
        };
        let mut factors = vec![(0.0, 0.0); built.len()];
        let mut points: Vec<LawPoint> = speeds
            .map(|speed_mps| {
                let (mut stops, mut sum, mut variance) = (0, 0.0, 0.0);
                for (_, point) in passed(speed_mps) {
                    stops += 1;
                    sum += point.deceleration_mps2;
                    variance += point.std_mps2 * point.std_mps2;
                }
                let count = stops as f64;
                let deceleration_mps2 = sum / count;
                for (k, point) in passed(speed_mps) {
                    factors[k].0 += point.deceleration_mps2 / deceleration_mps2;
                    factors[k].1 += 1.0;
                }
                let std_mps2 = variance.sqrt() / count;
                LawPoint { speed_mps, deceleration_mps2, std_mps2, next_std_mps2: 0.0, stops }
            })
            .collect();
        if points.is_empty() || points.iter().any(|point| point.deceleration_mps2 <= 0.0) {
            return None;
        }
        let means = factors.iter().filter(|it| it.1 > 0.0).map(|(sum, count)| sum / count);
        let mut factors: Vec<f64> = means.collect();
        factors.sort_by(f64::total_cmp);
        let squares = factors.iter().map(|factor| (factor - 1.0).powi(2));
        let freedom = ASSUMED_FREEDOM + built.len() as f64 - 1.0;
        let assumed = ASSUMED_FREEDOM * assumed_repeatability * assumed_repeatability;
        let repeatability = ((assumed + squares.sum::<f64>()) / freedom).sqrt();
        for point in &mut points {
            let own = repeatability * point.deceleration_mps2;
            let next = own * (1.0 + 1.0 / point.stops as f64).sqrt();
            point.next_std_mps2 = next.hypot(point.std_mps2);
        }
        let response = MeasuredResponse::from_points(&built);
        Some(DecelerationLaw {
            points,
            response,
            repeatability,
            freedom,
            factors,
            stops: built.len(),
        })
    }

    /// Takes a deceleration in m/s² over speed out of the law, as that by the resistance.
    pub fn take_out(&mut self, deceleration_mps2: impl Fn(f64) -> f64) {
        for point in &mut self.points {
            point.deceleration_mps2 -= deceleration_mps2(point.speed_mps);
        }
    }

    /// Returns the fastest speed in m/s that a stop was seen from.
    pub fn fastest_mps(&self) -> f64 {
        self.points[self.points.len() - 1].speed_mps
    }

    /// Returns how long the next stop from a speed on a gradient is; `None` above the speeds of the stops, and where it
    /// does not stop.
    pub fn stopping_distance(
        &self,
        from_mps: f64,
        gradient: &Gradient,
    ) -> Option<StoppingDistance> {
        // While the brake builds up, a stop loses a few steps of the grid.
        if !(0.0..self.fastest_mps() + 3.0 * GRID_MPS).contains(&from_mps) {
            return None;
        }
        let inertia = 1.0 + gradient.rotating_mass_factor;
        let effort: Vec<EffortPoint> = self
            .points
            .iter()
            .map(|it| EffortPoint {
                speed_mps: it.speed_mps,
                force_n: inertia * it.deceleration_mps2,
            })
            .collect();
        let stop = Stop {
            rotating_mass_factor: gradient.rotating_mass_factor,
            gradient_permille: gradient.permille,
            response: BrakeResponse { std_s: 0.0, ..self.response.shared() },
            ..Stop::level(from_mps, 1.0, [0.0; 3], &effort)
        };
        let StoppingEstimate { distance_m, time_s, .. } = stop.estimate(0.95).ok()?;
        let next = (1.0 + 1.0 / self.stops as f64).sqrt();
        let weaker = student(BOUND, self.freedom) * self.repeatability * next;
        let weaker = Stop { brake_scale: Uncertain::exact(1.0 - weaker), ..stop };
        let later_m = student(BOUND, self.freedom) * self.response.std_s * next * from_mps;
        let bound_m = weaker.estimate(0.95).ok()?.distance_m - distance_m;
        let distance_bound_m = distance_m + bound_m.hypot(later_m);
        Some(StoppingDistance { from_mps, distance_m, time_s, distance_bound_m })
    }
}

/// Quantile of Student's t from that of the normal distribution (Fisher and Cornish 1960), good to
/// a thousandth from 4 degrees of freedom on.
fn student(normal: f64, freedom: f64) -> f64 {
    let z = normal;
    let power = |n: i32| z.powi(n);
    let first = (power(3) + z) / (4.0 * freedom);
    let second = (5.0 * power(5) + 16.0 * power(3) + 3.0 * z) / (96.0 * freedom.powi(2));
    let third = 3.0 * power(7) + 19.0 * power(5) + 17.0 * power(3) - 15.0 * z;
    z + first + second + third / (384.0 * freedom.powi(3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_student_are_those_of_the_tables() {
        for (freedom, table) in [(4.0, 2.132), (10.0, 1.812), (30.0, 1.697)] {
            assert!((student(BOUND, freedom) - table).abs() < 3e-3, "{freedom}");
        }
    }
}
