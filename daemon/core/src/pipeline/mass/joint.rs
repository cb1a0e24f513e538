//! Resistance and mass together, by least squares on integrals of motion.

use std::sync::Arc;

use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use dynocar_shared::{Parameter, ParameterSnapshot, PipelineKind, Reason, RejectionReason};
use nalgebra::{Matrix4, SMatrix, SVector, Vector3, Vector4};
use serde::Deserialize;

use super::line_resistance::{DEFAULT_REFERENCE_RADIUS_M, LineResistance};
use super::motion::{Motion, StopWatch};
use super::speed_basis::SpeedBasis;
use crate::filter::DriftingLevel;
use crate::filter::drifting_level::LEVEL;
use crate::force::ResolvedSample;
use crate::pipeline::output::{write_innovations, write_parameters};
use crate::pipeline::settings::{SettingError, require};
use crate::pipeline::{Estimator, InnovationMonitor, Outcome};
use crate::train::{Davis, TrainModel};

/// Number of unknowns: level, inverse mass, z1, z2, z3.
const UNKNOWNS: usize = 11;
/// Place of the reference mass over the mass.
const INVERSE_MASS: usize = 1;
/// Places where the coefficients of z1, z2 and z3 begin.
const BASIC: usize = 2;
const CURVE: usize = 5;
const TUNNEL: usize = 8;

type Row = SVector<f64, UNKNOWNS>;

/// Settings of [`JointLeastSquares`].
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct JointLeastSquaresSettings {
    /// Standard deviation of the declared mass in %.
    pub mass_std_percent: f64,
    /// Standard deviation in % of a change of mass at a stop; 0 when it never changes.
    pub mass_change_std_percent: f64,
    /// Shortest stop in s at which the mass may change.
    pub stop_min_s: f64,
    /// Standard deviation in N/kN of the declared resistances.
    pub resistance_std_n_per_kn: f64,
    /// Standard deviation of the measured speed in m/s to start with; it is learned.
    pub speed_noise_mps: f64,
    /// Lowest speed in m/s that is used.
    pub speed_min_mps: f64,
    /// Radius in m that the curve resistance refers to.
    pub reference_radius_m: f64,
}

impl Default for JointLeastSquaresSettings {
    fn default() -> Self {
        JointLeastSquaresSettings {
            mass_std_percent: 20.0,
            mass_change_std_percent: 10.0,
            stop_min_s: 5.0,
            resistance_std_n_per_kn: 5.0,
            speed_noise_mps: 0.03,
            speed_min_mps: 1.0,
            reference_radius_m: DEFAULT_REFERENCE_RADIUS_M,
        }
    }
}

/// Drift of the level, in measurement variances per second, of each hypothesis.
const DRIFTS_PER_S: [f64; 4] = [0.0, 3e-3, 3e-2, 3e-1];
/// Innovations that the speed noise of the settings counts for.
const NOISE_PRIOR_COUNT: f64 = 4.0;
const OUTLIER: f64 = 8.0;
const HUBER: f64 = 3.0;
const OUTLIERS_BEFORE_RESTART: u32 = 5;

/// One assumption on how unsteady the unexplained acceleration is.
#[derive(Clone, Debug)]
struct Hypothesis {
    drift_per_s: f64,
    regression: DriftingLevel<UNKNOWNS>,
    squares: f64,
    count: f64,
    log_ratios: f64,
}

impl Hypothesis {
    /// Estimated over assumed variance of the measured speed.
    fn scale(&self) -> f64 {
        (NOISE_PRIOR_COUNT + self.squares) / (NOISE_PRIOR_COUNT + self.count)
    }

    /// Logarithm of the likelihood with the noise variance at its estimate.
    fn evidence(&self) -> f64 {
        -0.5 * (self.log_ratios + (NOISE_PRIOR_COUNT + self.count) * self.scale().ln())
    }

    fn absorb(&mut self, row: &Row, value: f64, weight: f64) {
        let innovation = self.regression.absorb(row, value, weight);
        if let Some(normalised) = innovation.normalised {
            self.squares += normalised * normalised;
            self.count += 1.0;
            self.log_ratios += innovation.log_variance_ratio;
        }
    }
}

/// Integrals since the start of an unbroken piece of motion.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Integrals {
    /// Of force over the reference inertia, in m/s.
    push_mps: f64,
    /// Of the gradient's deceleration, in m/s.
    gradient_mps: f64,
    /// Of the nine resistance features, times g / (1000 (1 + gamma)), in m/s per N/kN.
    features: SVector<f64, 9>,
}

impl Integrals {
    fn zero() -> Self {
        Integrals { push_mps: 0.0, gradient_mps: 0.0, features: SVector::zeros() }
    }

    fn add(&mut self, rate: &Integrals, factor: f64) {
        self.push_mps += factor * rate.push_mps;
        self.gradient_mps += factor * rate.gradient_mps;
        self.features += factor * rate.features;
    }

    fn row(&self) -> Row {
        let mut row = Row::zeros();
        row[LEVEL] = 1.0;
        row[INVERSE_MASS] = self.push_mps;
        row.fixed_rows_mut::<9>(BASIC).copy_from(&-self.features);
        row
    }
}

/// Learns z1, z2, z3 and the mass together.
#[derive(Clone, Debug)]
pub struct JointLeastSquares {
    settings: JointLeastSquaresSettings,
    train: Arc<TrainModel>,
    basis: SpeedBasis,
    hypotheses: [Hypothesis; DRIFTS_PER_S.len()],
    best: usize,
    stops: StopWatch,
    last: Option<(Motion, Integrals)>,
    integrals: Integrals,
    outliers_in_a_row: u32,
    monitor: InnovationMonitor,
    speed_range_mps: (f64, f64),
    generation: u64,
}

impl JointLeastSquares {
    /// An estimator for a train.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn new(
        settings: JointLeastSquaresSettings,
        train: &Arc<TrainModel>,
    ) -> Result<Self, SettingError> {
        let basis = SpeedBasis::new(train.speed_max_mps().unwrap_or(40.0));
        let regression = prior(&settings, train, &basis);
        let hypotheses = DRIFTS_PER_S.map(|drift_per_s| Hypothesis {
            drift_per_s,
            regression: regression.clone(),
            squares: 0.0,
            count: 0.0,
            log_ratios: 0.0,
        });
        Ok(JointLeastSquares {
            settings,
            train: Arc::clone(train),
            basis,
            hypotheses,
            best: 0,
            stops: StopWatch::new(settings.stop_min_s),
            last: None,
            integrals: Integrals::zero(),
            outliers_in_a_row: 0,
            monitor: InnovationMonitor::new(500),
            speed_range_mps: (f64::INFINITY, f64::NEG_INFINITY),
            generation: 0,
        })
    }

    fn rates(&self, motion: &Motion) -> Integrals {
        let inertia_factor = 1.0 + self.train.rotating_mass_factor;
        let per_n_per_kn = 1e-3 * STANDARD_GRAVITY_MPS2 / inertia_factor;
        let phi = self.basis.at(motion.speed_mps) * per_n_per_kn;
        let curve = self.settings.reference_radius_m * motion.curvature_per_m;
        let mut features = SVector::<f64, 9>::zeros();
        features.fixed_rows_mut::<3>(0).copy_from(&phi);
        features.fixed_rows_mut::<3>(3).copy_from(&(phi * curve));
        features.fixed_rows_mut::<3>(6).copy_from(&(phi * motion.tunnel_share));
        Integrals {
            push_mps: motion.force_n / (self.train.mass_kg * inertia_factor),
            gradient_mps: per_n_per_kn * motion.gradient_permille,
            features,
        }
    }

    /// s
    pub fn drift(&self) -> (usize, f64) { (self.best, self.hypotheses[self.best].scale().sqrt()*self.settings.speed_noise_mps) }

    /// z1, z2, z3.
    pub fn resistance(&self) -> Option<LineResistance> {
        let solution = self.hypotheses[self.best].regression.solve()?;
        let davis = |at: usize| -> Davis {
            self.basis.to_davis(&Vector3::new(solution[at], solution[at + 1], solution[at + 2]))
        };
        Some(LineResistance {
            basic: davis(BASIC),
            curve: Some(davis(CURVE)),
            tunnel: Some(davis(TUNNEL)),
            reference_radius_m: self.settings.reference_radius_m,
        })
    }

    /// mass
    pub fn mass_kg(&self) -> Option<(f64, f64)> {
        let h = &self.hypotheses[self.best];
        let solution = h.regression.solve()?;
        let root = h.regression.covariance_root()?;
        let sd = (root.row(1).norm_squared() * h.scale()).sqrt();
        let m = self.train.mass_kg / solution[1];
        Some((m, m * sd / solution[1]))
    }

    /// Covariance of coefficient of the curve `which` (0 basic...).
    pub fn covariance(&self, which: usize) -> Option<nalgebra::Matrix3<f64>> {
        let hypothesis = &self.hypotheses[self.best];
        let root = hypothesis.regression.covariance_root()?;
        let all = root * root.transpose() * hypothesis.scale();
        let own = all.fixed_view::<3, 3>(BASIC + 3 * which, BASIC + 3 * which).into_owned();
        let to = self.basis.to_davis_matrix();
        Some(to * own * to.transpose())
    }

    fn begin(&mut self, motion: Motion) -> Outcome {
        self.integrals = Integrals::zero();
        let row = self.integrals.row();
        let weight = self.settings.speed_noise_mps.powi(-2);
        for hypothesis in &mut self.hypotheses {
            hypothesis.regression.free_level();
            hypothesis.absorb(&row, motion.speed_mps, weight);
        }
        self.monitor.break_here();
        self.last = Some((motion, self.rates(&motion)));
        Outcome::Used
    }

    fn advance(&mut self, last: (Motion, Integrals), motion: Motion, step_s: f64) -> Outcome {
        let rates = self.rates(&motion);
        self.integrals.add(&last.1, 0.5 * step_s);
        self.integrals.add(&rates, 0.5 * step_s);
        let row = self.integrals.row();
        let value = motion.speed_mps + self.integrals.gradient_mps;
        let weight = self.settings.speed_noise_mps.powi(-2);
        for hypothesis in &mut self.hypotheses {
            let variance = hypothesis.drift_per_s * step_s / weight;
            hypothesis.regression.drift_level(variance);
        }
        let mut trial = self.hypotheses[self.best].regression.clone();
        let normalised = trial.absorb(&row, value, weight).normalised.unwrap_or(0.0)
            / self.hypotheses[self.best].scale().sqrt();
        if normalised.abs() > OUTLIER {
            self.outliers_in_a_row += 1;
            if self.outliers_in_a_row >= OUTLIERS_BEFORE_RESTART {
                self.outliers_in_a_row = 0;
                return self.begin(motion);
            }
            self.last = Some((motion, rates));
            return Outcome::Rejected(RejectionReason::Outlier);
        }
        self.outliers_in_a_row = 0;
        self.monitor.push(normalised);
        let robust = (HUBER / normalised.abs()).min(1.0);
        for hypothesis in &mut self.hypotheses {
            hypothesis.absorb(&row, value, robust * weight);
        }
        self.best = (1..self.hypotheses.len()).fold(0, |best, i| {
            let is_better = self.hypotheses[i].evidence() > self.hypotheses[best].evidence();
            if is_better { i } else { best }
        });
        self.last = Some((motion, rates));
        Outcome::Updated
    }
}

fn prior(
    settings: &JointLeastSquaresSettings,
    train: &TrainModel,
    basis: &SpeedBasis,
) -> DriftingLevel<UNKNOWNS> {
    let mut mean = Row::zeros();
    mean[INVERSE_MASS] = 1.0;
    mean.fixed_rows_mut::<3>(BASIC).copy_from(&basis.of_davis(&train.resistance));
    mean[CURVE] = train.curve_constant_n_per_kn_m / settings.reference_radius_m;
    let mut std = Row::repeat(settings.resistance_std_n_per_kn);
    std[INVERSE_MASS] = 0.01 * settings.mass_std_percent;
    DriftingLevel::new(&mean, &std)
}

impl Estimator for JointLeastSquares {
    fn kind(&self) -> PipelineKind {
        PipelineKind::JointLeastSquares
    }

    fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        if self.stops.departs(sample.time_ns, sample.stretch, sample.speed_mps) {
            let std = 0.01 * self.settings.mass_change_std_percent;
            for hypothesis in &mut self.hypotheses {
                let variance = std * std / hypothesis.scale();
                hypothesis.regression.widen_first_parameter(variance);
            }
            self.last = None;
        }
        if sample.speed_mps < self.settings.speed_min_mps {
            self.last = None;
            return Outcome::Used;
        }
        let motion = match Motion::of(sample) {
            Ok(motion) => motion,
            Err(reason) => return Outcome::Rejected(reason),
        };
        let step = self.last.and_then(|last| Some((last, motion.step_from(&last.0)?)));
        match step {
            Some((last, step_s)) => self.advance(last, motion, step_s),
            None => self.begin(motion),
        }
    }

    fn write(&self, snapshot: &mut ParameterSnapshot) {
        write_innovations(snapshot, &self.monitor);
    }
}
