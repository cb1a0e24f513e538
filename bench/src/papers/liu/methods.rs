//! The paper's methods as printed, in km/h, with eq. 5 and 6 corrected.

use dynocar_core::filter::{Mils, Penalty, RunningMedian, SquareRootInformation};
use nalgebra::Vector3;

use super::scenario::{MeasuredRun, ROTATING_MASS_FACTOR};
use crate::statistics::{mean, straight_line};

/// p0 of eq. 11.
const START_VARIANCE: f64 = 1e6;
/// Width of a segment in km/h (section 2.2).
const SEGMENT_KMH: f64 = 0.5;
/// V-MILS: innovations beyond this many robust standard deviations are bad data; the paper has
/// no rule.
const BAD_BEYOND: f64 = 3.5;
/// The median of |x| for a standard normal x.
const NORMAL_MEDIAN: f64 = 0.6745;

/// A segment: mean speed in km/h and w0 in N/kN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Mean speed in km/h.
    pub speed_kmh: f64,
    /// Resistance in N/kN on level track.
    pub w0_n_per_kn: f64,
}

impl Segment {
    fn features(&self) -> Vector3<f64> {
        Vector3::new(1.0, self.speed_kmh, self.speed_kmh * self.speed_kmh)
    }
}

/// Half-overlapping segments of figure 2: each is 0.5 km/h of speed wide and the next begins in
/// its middle, at 0.25 km/h less; a bound is reached where a measured speed first lies at or
/// below it, as printed. The acceleration is the least-squares slope.
pub fn segments(runs: &[Vec<MeasuredRun>]) -> Vec<Segment> {
    runs.iter().flat_map(|run| segments_of(run)).collect()
}

fn segments_of(run: &[MeasuredRun]) -> Vec<Segment> {
    let reached = |bound_kmh: f64| {
        // Rounded speeds lie on the bounds but for the last bit.
        run.iter().position(|sample| sample.speed_kmh <= bound_kmh + 1e-6)
    };
    let Some(first) = run.first() else { return Vec::new() };
    let upper_kmh = |index: u32| first.speed_kmh - 0.5 * SEGMENT_KMH * f64::from(index);
    (0..)
        .map_while(|index| Some((reached(upper_kmh(index))?, reached(upper_kmh(index + 2))?)))
        .filter_map(|(start, end)| segment(&run[start..=end]))
        .collect()
}

fn segment(samples: &[MeasuredRun]) -> Option<Segment> {
    if samples.len() < 2 {
        return None;
    }
    let points: Vec<(f64, f64)> = samples.iter().map(|it| (it.time_s, it.speed_kmh)).collect();
    let acceleration_mps2 = straight_line(&points).1 / 3.6;
    let mean_kmh = mean(samples.iter().map(|it| it.speed_kmh));
    let w0_n_per_kn = -1000.0 * (1.0 + ROTATING_MASS_FACTOR) / 9.81 * acceleration_mps2;
    Some(Segment { speed_kmh: mean_kmh, w0_n_per_kn })
}

/// A method of Table 1, or V-MILS of section 4.2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Method {
    /// The paper's name.
    pub name: &'static str,
    /// Innovation length of the recursion of eq. 9-11 and its multi-innovation forms; none for plain least squares.
    length: Option<usize>,
    /// True for the interval-varying form.
    is_gated: bool,
}

/// Every method that is compared.
pub const METHODS: [Method; 6] = [
    Method { name: "LS", length: None, is_gated: false },
    Method { name: "RLS", length: Some(1), is_gated: false },
    Method { name: "MILS p = 2", length: Some(2), is_gated: false },
    Method { name: "MILS p = 4", length: Some(4), is_gated: false },
    Method { name: "MILS p = 6", length: Some(6), is_gated: false },
    Method { name: "V-MILS p = 4", length: Some(4), is_gated: true },
];

impl Method {
    /// a, b, c for speeds in km/h; `None` when the segments do not determine them.
    pub fn estimate(self, segments: &[Segment]) -> Option<[f64; 3]> {
        if let Some(length) = self.length {
            let gate = self.is_gated.then_some(BAD_BEYOND);
            return Some(recursion(segments, length, gate)?.into());
        }
        let none = Vector3::zeros();
        let mut information = SquareRootInformation::<3>::new(&none, &none);
        for segment in segments {
            information.update(&segment.features(), segment.w0_n_per_kn);
        }
        Some(information.solve().ok()?.into())
    }
}

/// Returns the recursion of section 3; with a limit, the instants t_s at which it updates are those
/// whose newest p innovations are all good.
fn recursion(segments: &[Segment], length: usize, bad_beyond: Option<f64>) -> Option<Vector3<f64>> {
    let start = Vector3::repeat(1.0 / START_VARIANCE);
    let variances = Vector3::repeat(START_VARIANCE);
    let mut mils = Mils::<3, 8>::new(start, &variances, length, Penalty::none());
    let mut sizes = RunningMedian::<31>::default();
    for segment in segments {
        let features = segment.features();
        if let Some(beyond) = bad_beyond {
            let size = (segment.w0_n_per_kn - features.dot(mils.estimate())).abs();
            sizes.push(size);
            let median = sizes.median()?;
            if sizes.count() > 8 && size > beyond * median / NORMAL_MEDIAN {
                mils.forget_rows();
                continue;
            }
        }
        mils.update(&features, segment.w0_n_per_kn).ok()?;
    }
    Some(*mils.estimate())
}

/// Variance of the segments' residuals in (N/kN)², Table 1's last column.
pub fn residual_variance(segments: &[Segment], theta_kmh: [f64; 3]) -> f64 {
    let theta = Vector3::from(theta_kmh);
    mean(segments.iter().map(|it| (it.w0_n_per_kn - it.features().dot(&theta)).powi(2)))
}

#[cfg(test)]
mod tests {
    use super::super::scenario::{CONDITIONS, RUNS_KMH, STEP_S, THETA_KMH, measure, truth};
    use super::*;

    #[test]
    fn segments_of_true_speeds_give_the_true_resistance_by_every_method() {
        let runs: Vec<Vec<MeasuredRun>> = RUNS_KMH
            .iter()
            .map(|run| {
                let speeds = super::super::scenario::true_speeds_kmh(*run, &truth());
                speeds
                    .iter()
                    .enumerate()
                    .map(|(i, &speed_kmh)| MeasuredRun { time_s: STEP_S * i as f64, speed_kmh })
                    .collect()
            })
            .collect();
        let segments = segments(&runs);
        assert!(segments.len() > 150);
        for method in METHODS {
            let [a, b, c] = method.estimate(&segments).unwrap();
            for kmh in [45.0, 60.0, 70.0] {
                let w0 = a + b * kmh + c * kmh * kmh;
                let [a, b, c] = THETA_KMH;
                let expected = a + b * kmh + c * kmh * kmh;
                assert!((w0 / expected - 1.0).abs() < 5e-3, "{} at {kmh}", method.name);
            }
        }
    }

    #[test]
    fn the_gate_of_v_mils_lessens_the_harm_of_outliers() {
        let rms_error = |method: Method| {
            let squares = (0..12).map(|seed| {
                let [a, b, c] = method.estimate(&segments(&measure(CONDITIONS[1], seed))).unwrap();
                (a + b * 55.0 + c * 55.0 * 55.0 - 7.5075).powi(2)
            });
            (squares.sum::<f64>() / 12.0).sqrt()
        };
        let (gated, ungated) = (rms_error(METHODS[5]), rms_error(METHODS[3]));
        assert!(gated < 0.5 * ungated, "{gated} against {ungated} N/kN");
    }
}
