//! From blocks of momentum to independent rows of unit variance, with a column for each suspect.

use dynocar_model::terms::wind;
use dynocar_model::train::Davis;
use nalgebra::{SMatrix, SVector};

use super::covariates::Covariates;
use super::{COVARIATES, FIRST_ONSET, MonitorSettings, ONSETS, Onsets, PARAMETERS};
use crate::filter::Whitener;
use crate::pipeline::momentum::{
    DISTURBANCE, Disturbance, MomentumBlock, STATES, UNKNOWNS, gap_s, momentum_seen,
};

const COLUMNS: usize = 1 + PARAMETERS;
/// Innovations beyond this many standard deviations count for less (Huber).
const HUBER: f64 = 4.0;

/// One value for each parameter.
pub type ParameterVector = SVector<f64, PARAMETERS>;

/// `observed = features . parameters + error`, the error of unit variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DesignRow {
    /// Regressors.
    pub features: ParameterVector,
    /// Observed sum.
    pub observed: f64,
    /// Weight by Huber's function.
    pub weight: f64,
}

/// Returns the design row: momentum removed over a block per unit of each parameter, including open onsets.
pub fn units(block: &MomentumBlock, covariates: &Covariates, onsets: &Onsets) -> ParameterVector {
    let mut units = ParameterVector::zeros();
    units.fixed_rows_mut::<UNKNOWNS>(0).copy_from(&block.impulse.fixed_rows::<UNKNOWNS>(1));
    units.fixed_rows_mut::<COVARIATES>(UNKNOWNS).copy_from(covariates);
    for index in (0..ONSETS).filter(|&index| onsets.age(index).is_some()) {
        units[FIRST_ONSET + index] = block.impulse[1];
    }
    units
}

/// Makes rows of blocks.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// Part of the error that does not depend on the speed: small forces and the map.
    floor_n_per_kn: f64,
    share: f64,
    gust_mps: f64,
    time_s: f64,
    declared: Davis,
    whitener: Whitener<STATES, COLUMNS>,
    last_time_ns: Option<i64>,
}

impl Rows {
    /// Before the first block.
    pub fn new(settings: &MonitorSettings, declared: Davis) -> Self {
        Rows {
            floor_n_per_kn: settings.disturbance_n_per_kn.hypot(settings.map_std_permille),
            share: settings.disturbance_share,
            gust_mps: wind::GUST_SHARE * settings.wind_std_mps,
            time_s: settings.disturbance_time_s,
            declared,
            whitener: Whitener::new(SMatrix::zeros(), SMatrix::zeros()),
            last_time_ns: None,
        }
    }

    /// Takes in a block and its `units`; gives its row, but for the first of a chain. `predicted` judges how far
    /// it is out.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn push(
        &mut self,
        block: &MomentumBlock,
        units: &ParameterVector,
        predicted: impl Fn(&ParameterVector) -> f64,
    ) -> Option<DesignRow> {
        let gap_s = gap_s(&mut self.last_time_ns, block.time_ns);
        let small = self.small_forces(block);
        if block.is_first {
            let (momentum, variance) = (block.momentum, block.momentum_variance);
            self.whitener.propagate(&small.across_gap(gap_s, momentum, variance));
            return None;
        }
        let duration_s = block.impulse[1];
        let mut impulse = SVector::<f64, COLUMNS>::zeros();
        impulse[0] = block.impulse[0];
        impulse.fixed_rows_mut::<PARAMETERS>(1).copy_from(units);
        self.whitener.propagate(&small.over_impulse(duration_s, &impulse, block.impulse_variance));
        self.see(block, predicted)
    }

    fn see(
        &mut self,
        block: &MomentumBlock,
        predicted: impl Fn(&ParameterVector) -> f64,
    ) -> Option<DesignRow> {
        let sighting = momentum_seen(block.momentum, block.momentum_variance);
        let row = self.whitener.take(&sighting).ok()?.columns;
        let (observed, features) = (row[0], row.fixed_rows::<PARAMETERS>(1).into_owned());
        let weight = (HUBER / (observed - predicted(&features)).abs()).min(1.0);
        Some(DesignRow { features, observed, weight })
    }

    /// Returns the small forces that are no effect.
    fn small_forces(&self, block: &MomentumBlock) -> Disturbance {
        let w0_n_per_kn = self.declared.w0_n_per_kn(block.speed_mps);
        let gust_n_per_kn = 2.0 * self.declared.c * block.speed_mps * self.gust_mps;
        let std_n_per_kn = self.floor_n_per_kn.hypot(self.share * w0_n_per_kn).hypot(gust_n_per_kn);
        Disturbance { std_n_per_kn, time_s: self.time_s }
    }

    /// Forgets a parameter: its place is taken by another.
    pub fn clear(&mut self, parameter: usize) {
        self.whitener.clear_column(1 + parameter);
    }

    /// Returns the disturbance now: known part, the amount that one unit of each parameter subtracts from it, variance.
    pub fn disturbance(&self) -> (f64, ParameterVector, f64) {
        let state = self.whitener.state;
        let taken = ParameterVector::from_fn(|i, _| state[(DISTURBANCE, 1 + i)]);
        let variance = self.whitener.covariance[(DISTURBANCE, DISTURBANCE)];
        (state[(DISTURBANCE, 0)], taken, variance)
    }
}
