//! The residuals of computed trajectories, with every initial speed eliminated.
//!
//! Without disturbances the residual is the computed speed minus the measured one (output
//! error, Xia 2023 eq. 8). With a disturbing acceleration, white of density q in (m/s)²/s, the
//! computed speed is led back to the measured one by the gain of the scalar Kalman filter of
//! that disturbance, and the residual is the innovation over its standard deviation
//! (prediction error; Ljung 1999, section 7.4). Output error is its limit q = 0.
//!
//! The initial speed of each segment is a parameter. Its column is eliminated segment by
//! segment by orthogonal reflections, so that the work grows with the samples alone.

use dynocar_core::filter::levenberg_marquardt::{LeastSquares, Linearisation};
use dynocar_core::filter::triangular::{TriangularAccumulator, TriangularSystem};
use dynocar_model::train::Davis;
use nalgebra::Vector3;

use super::quality::LongRunVariance;
use super::step::{MotionSegment, StepRule, TrajectoryStep};

/// How residuals are weighted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighting {
    /// Standard deviation of the measured speed in m/s.
    pub speed_noise_mps: f64,
    /// q / R in 1/s: density of the disturbance over the variance of the measured speed.
    pub disturbance_ratio: f64,
    /// Residuals beyond this many standard deviations count linearly (Huber 1964); infinity makes every residual
    /// count by its square.
    pub outlier_threshold: f64,
}

/// Row that leads from a change of (a, b, c) to the change of a segment's initial speed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct InitialSpeed {
    speed_mps: f64,
    /// R and z of its row in the triangular factor.
    row: [f64; 5],
}

/// Initial speeds of all segments at the current and at the tried parameters.
#[derive(Clone, Debug, Default)]
pub struct InitialSpeeds {
    current: Vec<InitialSpeed>,
    tried: Vec<InitialSpeed>,
}

impl InitialSpeeds {
    /// Returns room for `segments` segments.
    pub fn with_capacity(segments: usize) -> Self {
        InitialSpeeds { current: Vec::with_capacity(segments), tried: Vec::with_capacity(segments) }
    }

    /// Starts from given speeds; allocates only beyond the capacity.
    pub fn reset(&mut self, speeds_mps: impl Iterator<Item = f64>) {
        self.current.clear();
        self.current.extend(speeds_mps.map(|speed_mps| InitialSpeed { speed_mps, row: [0.0; 5] }));
        self.tried.clear();
        self.tried.extend_from_slice(&self.current);
    }
}

/// Sums over all residuals of one pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualSums {
    /// Residuals.
    pub count: usize,
    /// Residuals beyond the outlier threshold.
    pub outliers: usize,
    /// Steps in which the computed train would have stopped.
    pub stalls: usize,
    /// Sum of min(r, threshold)², r in standard deviations.
    pub clipped_square: f64,
    /// Sum of r² in (m/s)², not normalised.
    pub square_mps2: f64,
    /// Long-run variance of the residuals in standard deviations.
    pub long_run: LongRunVariance,
    /// Speed in m/s at the end of the last segment, led back to its measurement.
    pub end_speed_mps: f64,
    /// Variance of the disturbance in it, over that of the measured speed.
    pub end_variance: f64,
}

impl ResidualSums {
    fn new() -> Self {
        ResidualSums {
            count: 0,
            outliers: 0,
            stalls: 0,
            clipped_square: 0.0,
            square_mps2: 0.0,
            long_run: LongRunVariance::new(f64::INFINITY),
            end_speed_mps: 0.0,
            end_variance: 0.0,
        }
    }
}

/// Trajectories of several segments as a least-squares problem over (a, b, c).
pub struct Residuals<'a, 'b> {
    segments: &'a [MotionSegment<'a>],
    rule: StepRule,
    weighting: Weighting,
    prior: Option<TriangularSystem<3>>,
    initial: &'b mut InitialSpeeds,
    current_point: Vector3<f64>,
    tried_point: Vector3<f64>,
    current_pass: ResidualSums,
    tried_pass: ResidualSums,
    /// Residuals over √S̃ in m/s of the newest pass, when wanted.
    record: Option<&'b mut Vec<f64>>,
}

impl<'a, 'b> Residuals<'a, 'b> {
    /// Returns the problem at its start `point`, with one initial speed for each segment in `initial`.
    ///
    /// `prior` is R and z of rows R x + z in standard deviations that are added to the
    /// residuals.
    pub fn new(
        segments: &'a [MotionSegment<'a>],
        rule: StepRule,
        weighting: Weighting,
        prior: Option<TriangularSystem<3>>,
        initial: &'b mut InitialSpeeds,
        point: Vector3<f64>,
    ) -> Self {
        debug_assert_eq!(segments.len(), initial.current.len());
        Residuals {
            segments,
            rule,
            weighting,
            prior,
            initial,
            current_point: point,
            tried_point: point,
            current_pass: ResidualSums::new(),
            tried_pass: ResidualSums::new(),
            record: None,
        }
    }

    /// Keeps the residuals of each pass in a buffer; it grows only beyond its capacity.
    pub fn recording(mut self, record: &'b mut Vec<f64>) -> Self {
        self.record = Some(record);
        self
    }

    /// Sums of the pass at the current parameters.
    pub fn pass(&self) -> &ResidualSums {
        &self.current_pass
    }
}

impl LeastSquares<3> for Residuals<'_, '_> {
    fn linearise(&mut self, point: &Vector3<f64>) -> Option<Linearisation<3>> {
        let davis = Davis { a: point[0], b: point[1], c: point[2] };
        let change = point - self.current_point;
        self.tried_point = *point;
        self.tried_pass = ResidualSums::new();
        if let Some(record) = &mut self.record {
            record.clear();
        }
        let mut joint = TriangularAccumulator::<4>::default();
        let mut cost = 0.0;
        let mut nested_decrease = 0.0;
        for (index, segment) in self.segments.iter().enumerate() {
            let speed_mps = self.initial.current[index].moved(&change);
            let mut rows = SegmentRows {
                weighting: &self.weighting,
                rows: TriangularAccumulator::default(),
                pass: &mut self.tried_pass,
                cost: 0.0,
                record: self.record.as_deref_mut(),
            };
            rows.trace(segment, self.rule, &davis, speed_mps);
            cost += rows.cost;
            let factor = *rows.rows.factor();
            self.initial.tried[index] = InitialSpeed { speed_mps, row: factor[0] };
            nested_decrease += 0.5 * factor[0][4] * factor[0][4];
            for row in &factor[1..] {
                joint.push(&[row[1], row[2], row[3], row[4]]);
            }
        }
        let mut system = TriangularSystem::from_rows(&mut joint);
        if let Some(prior) = &self.prior {
            let residual = prior.factor * point + prior.residual;
            cost += 0.5 * residual.norm_squared();
            for i in 0..3 {
                system.append(prior.factor.row(i).transpose(), residual[i]);
            }
        }
        cost.is_finite().then_some(Linearisation { cost, system, nested_decrease })
    }

    fn accept(&mut self) {
        self.current_point = self.tried_point;
        self.current_pass = self.tried_pass;
        self.initial.current.copy_from_slice(&self.initial.tried);
    }
}

impl InitialSpeed {
    /// Returns the best initial speed after a change of (a, b, c), by the linear model.
    fn moved(&self, change: &Vector3<f64>) -> f64 {
        let [pivot, by_a, by_b, by_c, residual] = self.row;
        if pivot == 0.0 {
            return self.speed_mps;
        }
        let along = residual + by_a * change[0] + by_b * change[1] + by_c * change[2];
        (self.speed_mps - along / pivot).max(super::step::STALL_SPEED_MPS)
    }
}

/// Gathers the rows \[∂r/∂v_0, ∂r/∂a, ∂r/∂b, ∂r/∂c, r\] of one segment.
struct SegmentRows<'a> {
    weighting: &'a Weighting,
    rows: TriangularAccumulator<5>,
    pass: &'a mut ResidualSums,
    cost: f64,
    record: Option<&'a mut Vec<f64>>,
}

impl SegmentRows<'_> {
    fn trace(
        &mut self,
        segment: &MotionSegment<'_>,
        rule: StepRule,
        davis: &Davis,
        initial_mps: f64,
    ) {
        let Some((&first_mps, measured)) = segment.speeds_mps.split_first() else { return };
        let ratio = self.weighting.disturbance_ratio;
        let mut state = Trace {
            speed_mps: initial_mps,
            by_initial: 1.0,
            by_davis: Vector3::zeros(),
            variance: 0.0,
        };
        self.pass.long_run.break_here();
        self.add(&mut state, first_mps, 0.0);
        for (step, &measured_mps) in segment.steps.iter().zip(measured) {
            let duration_s = duration_s(rule, step, state.speed_mps);
            let (advance, is_stalled) = rule.advance_or_crawl(step, davis, state.speed_mps);
            self.pass.stalls += usize::from(is_stalled);
            state.by_initial *= advance.by_speed;
            state.by_davis = state.by_davis * advance.by_speed + advance.by_davis;
            state.speed_mps = advance.speed_mps;
            state.variance += ratio * duration_s;
            self.add(&mut state, measured_mps, duration_s);
        }
        self.pass.end_speed_mps = state.speed_mps;
        self.pass.end_variance = state.variance;
    }

    /// Adds the residual of a measured speed and leads the trace back towards it.
    fn add(&mut self, state: &mut Trace, measured_mps: f64, duration_s: f64) {
        let residual_mps = state.speed_mps - measured_mps;
        let spread = 1.0 + state.variance;
        let per_deviation = 1.0 / (self.weighting.speed_noise_mps * spread.sqrt());
        let normalised = residual_mps * per_deviation;
        let threshold = self.weighting.outlier_threshold;
        let size = normalised.abs();
        let is_outlier = size > threshold;
        let weight = if is_outlier { threshold / size } else { 1.0 };
        let clipped = size.min(threshold);
        self.cost += clipped * (size - 0.5 * clipped);
        self.pass.long_run.push(normalised.clamp(-threshold, threshold), duration_s);
        self.pass.count += 1;
        self.pass.outliers += usize::from(is_outlier);
        self.pass.clipped_square += clipped * clipped;
        self.pass.square_mps2 += residual_mps * residual_mps;
        if let Some(record) = &mut self.record {
            record.push(residual_mps / spread.sqrt());
        }
        let scale = per_deviation * if is_outlier { weight.sqrt() } else { 1.0 };
        self.rows.push(&[
            state.by_initial * scale,
            state.by_davis[0] * scale,
            state.by_davis[1] * scale,
            state.by_davis[2] * scale,
            residual_mps * scale,
        ]);
        if state.variance > 0.0 {
            // Outliers lead the trace too: where the gain is large, the disturbance is, and a
            // large residual is its doing rather than the measurement's.
            let gain = state.variance / spread;
            state.speed_mps -= gain * residual_mps;
            state.by_initial *= 1.0 - gain;
            state.by_davis *= 1.0 - gain;
            state.variance *= 1.0 - gain;
        }
    }
}

/// The computed speed with its derivatives, and the variance of the disturbance in it over
/// that of the measured speed.
struct Trace {
    speed_mps: f64,
    by_initial: f64,
    by_davis: Vector3<f64>,
    variance: f64,
}

fn duration_s(rule: StepRule, step: &TrajectoryStep, speed_mps: f64) -> f64 {
    match rule {
        StepRule::Time => step.size,
        StepRule::Distance => step.size / speed_mps,
    }
}
