//! Deceleration over speed of all stops, how much stops differ, and how long the next one is.

use serde::Serialize;

use super::curve::{Curve, Point};

/// Step of the speeds in m/s at which the law is reported.
const GRID_MPS: f64 = 1.0;
/// What the assumed repeatability counts for: as much as that of so many stops more than one.
const ASSUMED_FREEDOM: f64 = 4.0;
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

/// Deceleration over speed, and how much stops differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Law {
    /// The speeds, growing.
    pub points: Vec<LawPoint>,
    /// Time in s that a stop loses while the brake builds up, as if it then came at once.
    pub response_s: f64,
    /// Standard deviation of a stop's deceleration over the law's: from the stops, and what was
    /// assumed beforehand.
    pub repeatability: f64,
    /// Degrees of freedom of the repeatability.
    pub freedom: f64,
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

impl Law {
    /// The law of some stops, where stops are assumed to repeat within a relative standard
    /// deviation until there are enough to estimate it; `None` without a stop whose brake builds up.
    pub fn of(curves: &[Curve], assumed_repeatability: f64) -> Option<Self> {
        let built: Vec<(&Curve, &Point)> = curves
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
        let squares = factors.iter().filter(|it| it.1 > 0.0).map(|(f, n)| (f / n - 1.0).powi(2));
        let freedom = ASSUMED_FREEDOM + built.len() as f64 - 1.0;
        let assumed = ASSUMED_FREEDOM * assumed_repeatability * assumed_repeatability;
        let repeatability = ((assumed + squares.sum::<f64>()) / freedom).sqrt();
        for point in &mut points {
            let own = repeatability * point.deceleration_mps2;
            let next = own * (1.0 + 1.0 / point.stops as f64).sqrt();
            point.next_std_mps2 = next.hypot(point.std_mps2);
        }
        let responses = built.iter().map(|(curve, from)| {
            from.time_s - (curve.from_mps() - from.speed_mps) / from.deceleration_mps2
        });
        let response_s = responses.sum::<f64>().max(0.0) / built.len() as f64;
        Some(Law { points, response_s, repeatability, freedom, stops: built.len() })
    }

    /// Deceleration in m/s² at a speed within what was driven; below the slowest as there.
    fn deceleration_mps2(&self, speed_mps: f64) -> f64 {
        let after = self.points.partition_point(|point| point.speed_mps <= speed_mps);
        let clamp = |index: usize| &self.points[index.min(self.points.len() - 1)];
        let (low, high) = (clamp(after.saturating_sub(1)), clamp(after));
        let span = high.speed_mps - low.speed_mps;
        let share = if span > 0.0 { (speed_mps - low.speed_mps) / span } else { 0.0 };
        let share = share.clamp(0.0, 1.0);
        low.deceleration_mps2 + share * (high.deceleration_mps2 - low.deceleration_mps2)
    }

    /// The fastest speed in m/s that a stop was seen from.
    pub fn fastest_mps(&self) -> f64 {
        self.points[self.points.len() - 1].speed_mps
    }

    /// How long the next stop from a speed is; `None` above the speeds of the stops.
    pub fn stopping_distance(&self, from_mps: f64) -> Option<StoppingDistance> {
        // While the brake builds up, a stop loses a few steps of the grid.
        if !(0.0..self.fastest_mps() + 3.0 * GRID_MPS).contains(&from_mps) {
            return None;
        }
        let steps = (from_mps / (0.05 * GRID_MPS)).ceil().max(1.0);
        let step_mps = from_mps / steps;
        let (mut distance_m, mut time_s) = (0.0, 0.0);
        for k in 0..steps as u32 {
            let speed_mps = step_mps * (f64::from(k) + 0.5);
            let over_s = step_mps / self.deceleration_mps2(speed_mps);
            time_s += over_s;
            distance_m += speed_mps * over_s;
        }
        distance_m += from_mps * self.response_s;
        let spread = self.repeatability * (1.0 + 1.0 / self.stops as f64).sqrt();
        let distance_bound_m = distance_m * (1.0 + student(BOUND, self.freedom) * spread);
        let time_s = time_s + self.response_s;
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
