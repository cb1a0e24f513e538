//! Blocks of momentum to independent rows of unit variance, with a column for each suspect.

use nalgebra::{SMatrix, SVector, Vector2};

use super::covariates::Covariates;
use super::onsets::Onsets;
use super::settings::MonitorSettings;
use super::suspects::{BASE, FIRST_ONSET, ONSETS, PARAMETERS, SUSPECTS};
use crate::filter::{Propagation, Sighting, Whitener};
use crate::pipeline::resistance::regression::MomentumBlock;
use crate::train::Davis;

const MOMENTUM: usize = 0;
const DISTURBANCE: usize = 1;
const STATES: usize = 2;
const COLUMNS: usize = 1 + PARAMETERS;
/// Innovations beyond so many standard deviations count for less (Huber).
const HUBER: f64 = 4.0;

/// One value for each parameter.
pub type Parameters = SVector<f64, PARAMETERS>;

/// `observed = features . parameters + error`, the error of unit variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Regressors.
    pub features: Parameters,
    /// What they should add up to.
    pub observed: f64,
    /// Weight by Huber's function.
    pub weight: f64,
}

/// Makes rows of blocks.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    floor_n_per_kn: f64,
    share: f64,
    time_s: f64,
    declared: Davis,
    whitener: Whitener<STATES, COLUMNS>,
    last_time_ns: Option<i64>,
}

impl Rows {
    /// Before the first block.
    pub fn new(settings: &MonitorSettings, declared: Davis) -> Self {
        Rows {
            floor_n_per_kn: settings.disturbance_n_per_kn,
            share: settings.disturbance_share,
            time_s: settings.disturbance_time_s,
            declared,
            whitener: Whitener::new(SMatrix::zeros(), SMatrix::zeros()),
            last_time_ns: None,
        }
    }

    /// Takes in a block; gives its row, but for the first of a chain. `predicted` judges how far
    /// it is out.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(
        &mut self,
        block: &MomentumBlock,
        suspects: &Covariates,
        onsets: &Onsets,
        predicted: impl Fn(&Parameters) -> f64,
    ) -> Option<Row> {
        let gap_s = self
            .last_time_ns
            .replace(block.time_ns)
            .map(|last_ns| block.time_ns.saturating_sub(last_ns) as f64 * 1e-9)
            .filter(|&gap_s| gap_s > 0.0);
        if block.is_first {
            let mut step = self.decay(block, gap_s.unwrap_or(f64::INFINITY));
            step.input[(MOMENTUM, 0)] = block.momentum;
            step.noise[(MOMENTUM, MOMENTUM)] = block.momentum_variance;
            self.whitener.propagate(&step);
            return None;
        }
        let duration_s = block.impulse[1];
        let mut step = self.decay(block, duration_s);
        step.transition[(MOMENTUM, MOMENTUM)] = 1.0;
        step.transition[(MOMENTUM, DISTURBANCE)] = -duration_s;
        for i in 0..=BASE {
            step.input[(MOMENTUM, i)] = block.impulse[i];
        }
        for i in 0..SUSPECTS {
            step.input[(MOMENTUM, 1 + BASE + i)] = suspects[i];
        }
        for place in (0..ONSETS).filter(|&place| onsets.age(place).is_some()) {
            step.input[(MOMENTUM, 1 + FIRST_ONSET + place)] = duration_s;
        }
        step.noise[(MOMENTUM, MOMENTUM)] = block.impulse_variance;
        self.whitener.propagate(&step);
        self.see(block, predicted)
    }

    fn see(
        &mut self,
        block: &MomentumBlock,
        predicted: impl Fn(&Parameters) -> f64,
    ) -> Option<Row> {
        let mut observed = SVector::<f64, COLUMNS>::zeros();
        observed[0] = block.momentum;
        let sighting =
            |variance: f64| Sighting { direction: Vector2::new(1.0, 0.0), observed, variance };
        let (columns, variance) = self.whitener.innovation(&sighting(block.momentum_variance));
        if !(variance > 0.0 && variance.is_finite()) {
            return None;
        }
        let root = variance.sqrt();
        let features = columns.fixed_rows::<PARAMETERS>(1) / root;
        let observed = columns[0] / root;
        let weight = (HUBER / (observed - predicted(&features)).abs()).min(1.0);
        self.whitener.correct(&sighting(block.momentum_variance)).ok()?;
        Some(Row { features, observed, weight })
    }

    /// The small forces that are no effect, over a time.
    fn decay(&self, block: &MomentumBlock, duration_s: f64) -> Propagation<STATES, COLUMNS> {
        let mut step = Propagation {
            transition: SMatrix::<f64, STATES, STATES>::zeros(),
            input: SMatrix::zeros(),
            noise: SMatrix::zeros(),
        };
        let kept = (-duration_s / self.time_s).exp();
        let std =
            self.floor_n_per_kn.hypot(self.share * self.declared.w0_n_per_kn(block.speed_mps));
        step.transition[(DISTURBANCE, DISTURBANCE)] = kept;
        step.noise[(DISTURBANCE, DISTURBANCE)] = std * std * (1.0 - kept * kept);
        step
    }

    /// Forgets a parameter: its place is taken by another.
    pub fn clear(&mut self, parameter: usize) {
        self.whitener.clear_column(1 + parameter);
    }

    /// The disturbance now: known part, what each parameter takes off it, variance.
    pub fn disturbance(&self) -> (f64, Parameters, f64) {
        let state = self.whitener.state();
        let taken = Parameters::from_fn(|i, _| state[(DISTURBANCE, 1 + i)]);
        let variance = self.whitener.covariance()[(DISTURBANCE, DISTURBANCE)];
        (state[(DISTURBANCE, 0)], taken, variance)
    }
}
