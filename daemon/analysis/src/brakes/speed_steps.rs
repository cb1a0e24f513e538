//! Steps of speed below a curve of deceleration, as the gamma model of ETCS has them (SUBSET-026, 3.13).

use serde::Serialize;

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
