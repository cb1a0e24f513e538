//! The sliding window of Xia 2023: points at even distances, steps between them, and the mean squared deviation with
//! its analytic gradient and Hessian.
//!
//! Equations 7-8 and 11-23, corrected (finite differences below verify each correction):
//!
//! - eq. 8, 11, 16: the norm forms lack the factor 1/I that the sum forms have;
//! - eq. 13: k = \[v_{i-1} - λ (b + 2 c v_{i-1})\] / v_i, with the brackets;
//! - eq. 14: the first term is k ∂v_{i-1}/∂b, not k ∂v_{i-1}/∂a;
//! - eq. 16: + (v_i - ṽ_i) ∇²v_i, where the norm form prints minus;
//! - eq. 18 (lines 2, 3) to 23: + q with q = (1 - 2 λ c) / v_i, not - q.

use dynocar_core::pipeline::motion::jump_variance;
use dynocar_model::train::Davis;
use nalgebra::{Matrix3, Vector3};

use super::trajectory::fit::MotionSegment;
use super::trajectory::motion::MotionStep;
use super::trajectory::step::{StepRule, TrajectoryStep};

/// The newest steps of unbroken motion, each about as long as the sampling distance.
///
/// The paper samples every 100 m; a controller samples in time. Samples are therefore gathered until the distance is
/// reached: the step's driving force is the mean of their forces over distance for eq. 7 (the same work) and over time
/// for the time rule (the same impulse), and the speed at its end is the last sample's own.
#[derive(Clone, Debug)]
pub struct StepWindow {
    rule: StepRule,
    interval_m: f64,
    steps: Vec<TrajectoryStep>,
    speeds_mps: Vec<f64>,
    /// Time in s of each step, and variance in (m/s)² of its error because forces may jump.
    missed: Vec<(f64, f64)>,
    open: OpenStep,
}

/// A slow train closes a step after this time in s, before its speed has changed much.
const DURATION_MAX_S: f64 = 10.0;

#[derive(Clone, Copy, Debug, Default)]
struct OpenStep {
    distance_m: f64,
    duration_s: f64,
    missed: f64,
    /// Integral of the driving acceleration over the step's measure.
    drive: f64,
    /// Integral of κ over the step's measure.
    gain: f64,
}

impl StepWindow {
    /// Returns an empty window of `steps` steps of at least a distance in m each.
    pub fn new(rule: StepRule, steps: usize, interval_m: f64) -> Self {
        StepWindow {
            rule,
            interval_m,
            steps: Vec::with_capacity(steps),
            speeds_mps: Vec::with_capacity(steps + 1),
            missed: Vec::with_capacity(steps),
            open: OpenStep::default(),
        }
    }

    /// Forgets everything; motion was broken.
    pub fn clear(&mut self) {
        self.steps.clear();
        self.speeds_mps.clear();
        self.missed.clear();
        self.open = OpenStep::default();
    }

    /// Starts anew from a measured speed.
    pub fn begin(&mut self, speed_mps: f64) {
        self.clear();
        self.speeds_mps.push(speed_mps);
    }

    /// Takes in the way to a sample and its speed; true when it closed a step.
    ///
    /// # Real-time
    ///
    /// Moves the window by one step at most, no allocation.
    pub fn push(&mut self, motion: &MotionStep, speed_mps: f64) -> bool {
        let measure = match self.rule {
            StepRule::Distance => motion.distance_m,
            StepRule::Time => motion.duration_s,
        };
        self.open.distance_m += motion.distance_m;
        self.open.duration_s += motion.duration_s;
        self.open.missed += jump_variance(motion.drive_change_mps2, motion.duration_s);
        self.open.drive += motion.drive_mps2 * measure;
        self.open.gain += motion.resistance_gain * measure;
        if self.open.distance_m < self.interval_m && self.open.duration_s < DURATION_MAX_S {
            return false;
        }
        let size = match self.rule {
            StepRule::Distance => self.open.distance_m,
            StepRule::Time => self.open.duration_s,
        };
        if self.steps.len() == self.steps.capacity() {
            self.steps.remove(0);
            self.speeds_mps.remove(0);
            self.missed.remove(0);
        }
        self.steps.push(TrajectoryStep {
            size,
            drive_mps2: self.open.drive / size,
            resistance_gain: self.open.gain / size,
        });
        self.speeds_mps.push(speed_mps);
        self.missed.push((self.open.duration_s, self.open.missed));
        self.open = OpenStep::default();
        true
    }

    /// Returns the variance in (m/s)² that the steps miss for each second because forces jump.
    pub fn missed_density(&self) -> f64 {
        let sum =
            |(time, variance): (f64, f64), step: &(f64, f64)| (time + step.0, variance + step.1);
        let (time_s, variance) = self.missed.iter().fold((0.0, 0.0), sum);
        if time_s > 0.0 { variance / time_s } else { 0.0 }
    }

    /// Steps in the window.
    pub fn count(&self) -> usize {
        self.steps.len()
    }

    /// Returns the window as a segment.
    pub fn segment(&self) -> MotionSegment<'_> {
        MotionSegment { steps: &self.steps, speeds_mps: &self.speeds_mps }
    }
}

/// f(θ) of eq. 8 with derivatives with respect to (a, b, c).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// f: mean of (v_i - ṽ_i)² over the steps, in (m/s)².
    pub mean_square: f64,
    /// ∇f, eq. 11.
    pub gradient: Vector3<f64>,
    /// ∇²f, eq. 16.
    pub hessian: Matrix3<f64>,
}

/// Deviation of the trajectory computed by eq. 7 from the measured speeds.
///
/// `speeds_mps` holds one more entry than `steps`; the first is the speed before the first
/// step, which the paper takes for exact. `None` when the computed train stops (v² < 0), which
/// happens for up to 95 % of random parameters on long data with braking.
pub fn deviation(steps: &[TrajectoryStep], speeds_mps: &[f64], davis: &Davis) -> Option<Deviation> {
    debug_assert_eq!(steps.len() + 1, speeds_mps.len());
    let (&first_mps, measured_mps) = speeds_mps.split_first()?;
    let mut speed_mps = first_mps;
    let mut slope = Vector3::zeros();
    let mut curvature = Matrix3::zeros();
    let mut sum =
        Deviation { mean_square: 0.0, gradient: Vector3::zeros(), hessian: Matrix3::zeros() };
    for (step, measured_mps) in steps.iter().zip(measured_mps) {
        let advance = StepRule::Distance.advance(step, davis, speed_mps)?;
        let reach = step.resistance_gain * step.size;
        let k = advance.by_speed;
        let u = 1.0 / advance.speed_mps;
        let p = reach * u;
        let q = (1.0 - 2.0 * reach * davis.c) * u;
        let next_slope = slope * k + advance.by_davis;
        // -p times the derivative of the regressors (1, v, v²) with respect to the speed.
        let mixed = Vector3::new(0.0, -p, -2.0 * p * speed_mps);
        curvature = curvature * k + slope * slope.transpose() * q
            - next_slope * next_slope.transpose() * u
            + mixed * slope.transpose()
            + slope * mixed.transpose();
        slope = next_slope;
        speed_mps = advance.speed_mps;
        let residual = speed_mps - measured_mps;
        sum.mean_square += residual * residual;
        sum.gradient += slope * residual;
        sum.hessian += slope * slope.transpose() + curvature * residual;
    }
    let per_step = 1.0 / steps.len() as f64;
    sum.mean_square *= per_step;
    sum.gradient *= 2.0 * per_step;
    sum.hessian *= 2.0 * per_step;
    sum.mean_square.is_finite().then_some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(drive_mps2: f64) -> MotionStep {
        MotionStep {
            duration_s: 1.0,
            distance_m: 30.0,
            drive_mps2,
            drive_change_mps2: 0.0,
            resistance_gain: 0.009,
        }
    }

    #[test]
    fn samples_are_gathered_until_the_distance_is_reached() {
        let mut window = StepWindow::new(StepRule::Distance, 3, 100.0);
        window.begin(30.0);
        let closed: Vec<bool> =
            (0..8).map(|i| window.push(&motion(f64::from(i)), 30.0 + f64::from(i))).collect();
        assert_eq!(closed, [false, false, false, true, false, false, false, true]);
        let segment = window.segment();
        assert_eq!(segment.speeds_mps, [30.0, 33.0, 37.0]);
        assert_eq!((segment.steps[0].size, segment.steps[0].drive_mps2), (120.0, 1.5));
        assert!((segment.steps[1].resistance_gain - 0.009).abs() < 1e-15);
    }

    #[test]
    fn a_full_window_drops_its_oldest_step() {
        let mut window = StepWindow::new(StepRule::Time, 2, 30.0);
        window.begin(30.0);
        for i in 0..5 {
            assert!(window.push(&motion(f64::from(i)), f64::from(i)));
        }
        let segment = window.segment();
        assert_eq!(segment.speeds_mps, [2.0, 3.0, 4.0]);
        assert_eq!((segment.steps[0].size, segment.steps[0].drive_mps2), (1.0, 3.0));
        assert_eq!(window.count(), 2);
    }
}

#[cfg(test)]
mod deviation_tests {
    use super::*;
    use dynocar_model::force::mps2_per_n_per_kn;

    const TRUTH: Davis = Davis { a: 0.79, b: 0.0229, c: 0.001493 };
    const SCALES: [f64; 3] = [1.0, 0.02, 0.001];

    /// Returns the traction, coasting and braking over hills; the measured speeds carry a wave as noise.
    fn example() -> (Vec<TrajectoryStep>, Vec<f64>) {
        let gain = mps2_per_n_per_kn(0.06);
        let steps: Vec<TrajectoryStep> = (0..60)
            .map(|i| {
                let drive = [0.35, 0.12, 0.0, -0.25][(i / 15) % 4];
                let drive_mps2 = drive + 0.05 * (f64::from(i as u32) * 0.7).sin();
                TrajectoryStep { size: 100.0, drive_mps2, resistance_gain: gain }
            })
            .collect();
        let mut speeds = vec![40.0];
        for step in &steps {
            let last = *speeds.last().unwrap();
            speeds.push(StepRule::Distance.advance(step, &TRUTH, last).unwrap().speed_mps);
        }
        for (i, speed) in speeds.iter_mut().enumerate() {
            *speed += 0.2 * (i as f64 * 1.3).sin();
        }
        (steps, speeds)
    }

    fn moved(davis: &Davis, parameter: usize, by: f64) -> Davis {
        let Davis { a, b, c } = *davis;
        match parameter {
            0 => Davis { a: a + by, b, c },
            1 => Davis { a, b: b + by, c },
            _ => Davis { a, b, c: c + by },
        }
    }

    /// Fourth-order central difference of a function of one scaled parameter.
    fn difference(at: impl Fn(f64) -> f64, width: f64) -> f64 {
        (8.0 * (at(width) - at(-width)) - (at(2.0 * width) - at(-2.0 * width))) / (12.0 * width)
    }

    #[test]
    fn gradient_and_hessian_match_finite_differences_to_1e_minus_8() {
        let (steps, speeds) = example();
        for davis in [TRUTH, Davis { a: 1.9, b: 0.05, c: 0.0006 }] {
            let here = deviation(&steps, &speeds, &davis).unwrap();
            let mut largest: f64 = 0.0;
            for i in 0..3 {
                let at =
                    |x: f64| deviation(&steps, &speeds, &moved(&davis, i, x * SCALES[i])).unwrap();
                let width = 2e-3;
                let slope = difference(|x| at(x).mean_square, width);
                let scale = here.gradient.component_mul(&Vector3::from(SCALES)).norm();
                largest = largest.max((slope - here.gradient[i] * SCALES[i]).abs() / scale);
                for j in 0..3 {
                    let slope = difference(|x| at(x).gradient[j] * SCALES[j], width);
                    let exact = here.hessian[(i, j)] * SCALES[i] * SCALES[j];
                    let diagonal = |k: usize| (here.hessian[(k, k)]).abs().sqrt() * SCALES[k];
                    largest = largest.max((slope - exact).abs() / (diagonal(i) * diagonal(j)));
                }
            }
            assert!(largest < 1e-8, "{largest:e}");
        }
    }

    #[test]
    fn the_printed_equations_14_and_18_are_refuted() {
        let (steps, speeds) = example();
        let end = |davis: Davis| {
            steps.iter().fold(speeds[0], |speed, step| {
                StepRule::Distance.advance(step, &davis, speed).unwrap().speed_mps
            })
        };
        let by_b = difference(|x| end(moved(&TRUTH, 1, x)), 1e-5);
        let second = |width: f64| {
            let at = |x: f64| end(moved(&TRUTH, 0, x));
            (at(width) - 2.0 * at(0.0) + at(-width)) / (width * width)
        };
        let by_a_twice = second(1e-2);
        let mut speed = speeds[0];
        let (mut by_a, mut by_b_printed) = (0.0, 0.0);
        let (mut twice, mut twice_printed) = (0.0, 0.0);
        for step in &steps {
            let advance = StepRule::Distance.advance(step, &TRUTH, speed).unwrap();
            let u = 1.0 / advance.speed_mps;
            let q = (1.0 - 2.0 * step.resistance_gain * step.size * TRUTH.c) * u;
            by_b_printed = advance.by_speed * by_a + advance.by_davis[1];
            let next_by_a = advance.by_speed * by_a + advance.by_davis[0];
            let rest = -u * next_by_a * next_by_a;
            twice = advance.by_speed * twice + q * by_a * by_a + rest;
            twice_printed = advance.by_speed * twice_printed - q * by_a * by_a + rest;
            (by_a, speed) = (next_by_a, advance.speed_mps);
        }
        // Equation 14 with the derivative with respect to a in it.
        assert!((by_b_printed / by_b - 1.0).abs() > 0.9, "{by_b_printed} {by_b}");
        // Equation 18 with + q, and with the printed - q.
        assert!((twice / by_a_twice - 1.0).abs() < 1e-4, "{twice} {by_a_twice}");
        assert!((twice_printed / by_a_twice - 1.0).abs() > 5.0, "{twice_printed} {by_a_twice}");
    }

    #[test]
    fn a_train_that_stops_has_no_deviation() {
        let (mut steps, speeds) = example();
        steps[30].drive_mps2 = -20.0;
        assert_eq!(deviation(&steps, &speeds, &TRUTH), None);
    }
}
