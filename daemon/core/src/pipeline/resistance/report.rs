//! What an estimate is worth: bounds, excitation, status.

use dynocar_shared::{Manoeuvre, Reason, Status};
use nalgebra::{Matrix3, Vector3};

use super::noise_bank::Disturbed;
use super::regression::{PARAMETERS, SPEED_SCALE_MPS, regressors, unscaling};
use super::solver::Solution;
use crate::filter::bounded_minimum;
use crate::pipeline::InnovationMonitor;
use crate::train::Davis;

/// Rows before anything is called estimated.
const ROWS_MIN: f64 = 12.0;
/// Standard deviation of w0 at the mean speed, as a share of w0, up to which it is estimated.
const SHARE_STD_MAX: f64 = 0.15;
/// Share of w0 that a coefficient's standard deviation may reach while it counts as excited.
const EXCITED_SHARE: f64 = 0.25;
/// A slow force of more than this share of w0 that the model does not know is structure.
const DISTURBANCE_SHARE_MAX: f64 = 0.1;
/// Twice the log-likelihood ratio beyond which that force is no chance.
const DISTURBANCE_EVIDENCE_MIN: f64 = 10.0;
/// Mean square of normalised innovations beyond which they are too large.
const MEAN_SQUARE_MAX: f64 = 4.0;
/// Innovations before their mean square counts.
const INNOVATIONS_MIN: f64 = 15.0;
/// Share of refused rows beyond which the input is bad.
const REFUSED_SHARE_MAX: f64 = 0.3;
/// Standard deviation of weight and gravity, as a share: w0 per kN is never known better.
const WEIGHT_SHARE_STD: f64 = 0.001;

/// Mean and range of the speeds behind the rows, in m/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DrivenSpeeds {
    /// Lowest.
    pub min_mps: f64,
    /// Highest.
    pub max_mps: f64,
    sum_mps: f64,
    count: f64,
}

impl DrivenSpeeds {
    /// Takes in the mean speed of a row.
    pub fn push(&mut self, speed_mps: f64) {
        self.min_mps = if self.count == 0.0 { speed_mps } else { self.min_mps.min(speed_mps) };
        self.max_mps = self.max_mps.max(speed_mps);
        self.sum_mps += speed_mps;
        self.count += 1.0;
    }

    /// Mean; 0 before the first.
    pub fn mean_mps(&self) -> f64 {
        if self.count > 0.0 { self.sum_mps / self.count } else { 0.0 }
    }
}

/// Resistance as a snapshot tells it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// What a controller may do with it.
    pub status: Status,
    /// Why.
    pub reason: Reason,
    /// Scaled parameters within their bounds, in N/kN.
    pub estimate: Vector3<f64>,
    /// Their covariance.
    pub covariance: Matrix3<f64>,
    /// One bit for each coefficient that the data excited.
    pub excited: u32,
    /// Manoeuvres that would excite the others.
    pub missing_manoeuvres: u32,
}

impl Report {
    /// Before any estimate: the declared resistance, hardly trusted.
    pub fn unestimated(declared: &Solution, reason: Reason) -> Self {
        Report {
            status: Status::Unestimated,
            reason,
            estimate: declared.estimate.fixed_rows::<PARAMETERS>(0).into_owned(),
            covariance: declared.covariance.fixed_view::<PARAMETERS, PARAMETERS>(0, 0).into_owned(),
            excited: 0,
            missing_manoeuvres: Manoeuvre::Move.bit(),
        }
    }

    /// Judges a solution; `None` when its covariance is not positive definite.
    ///
    /// # Real-time
    ///
    /// A few factorisations of order 3, no allocation.
    pub fn judge(
        solution: &Solution,
        disturbed: &Disturbed,
        monitor: &InnovationMonitor,
        speeds: &DrivenSpeeds,
        rows: f64,
        refused_share: f64,
    ) -> Option<Self> {
        let free = solution.estimate.fixed_rows::<PARAMETERS>(0).into_owned();
        let covariance =
            solution.covariance.fixed_view::<PARAMETERS, PARAMETERS>(0, 0).into_owned();
        let information = covariance.cholesky()?.inverse();
        let bounded = bounded_minimum(&information, &free, &Vector3::zeros()).ok()?;
        let estimate = bounded.estimate;
        // The free covariance: at a bound it is wider than need be, never narrower.
        let covariance = covariance + estimate * estimate.transpose() * WEIGHT_SHARE_STD.powi(2);
        let at = |speed_mps: f64| {
            let powers = Vector3::from(regressors(speed_mps));
            (powers.dot(&estimate), powers.dot(&(covariance * powers)).max(0.0).sqrt())
        };
        let (w0, w0_std) = at(speeds.mean_mps());
        let excited = excited(&covariance, at(speeds.max_mps).0, speeds.max_mps);
        let (status, reason) = if rows < ROWS_MIN {
            (Status::Unestimated, Reason::TooFewSamples)
        } else if w0_std > SHARE_STD_MAX * w0 {
            (Status::Unestimated, Reason::WeakExcitation)
        } else if disturbed.std_n_per_kn > DISTURBANCE_SHARE_MAX * w0
            && disturbed.evidence > DISTURBANCE_EVIDENCE_MIN
        {
            (Status::Degraded, Reason::InnovationsNotWhite)
        } else if monitor.mean_square() > MEAN_SQUARE_MAX
            && monitor.effective_count() > INNOVATIONS_MIN
        {
            (Status::Degraded, Reason::InnovationsTooLarge)
        } else if refused_share > REFUSED_SHARE_MAX {
            (Status::Degraded, Reason::BadInput)
        } else if excited != (1 << PARAMETERS) - 1 {
            (Status::Estimated, Reason::WeakExcitation)
        } else if bounded.at_bound != 0 {
            (Status::Estimated, Reason::AtBound)
        } else {
            (Status::Estimated, Reason::None)
        };
        let missing_manoeuvres = missing_manoeuvres(excited);
        Some(Report { status, reason, estimate, covariance, excited, missing_manoeuvres })
    }

    /// Davis coefficients.
    pub fn davis(&self) -> Davis {
        let values = self.estimate.component_mul(&unscaling());
        Davis { a: values[0], b: values[1], c: values[2] }
    }
}

/// Coefficients whose own part of w0 at the highest speed is known to a share of w0 there.
fn excited(covariance: &Matrix3<f64>, w0: f64, speed_mps: f64) -> u32 {
    let powers = regressors(speed_mps.max(0.25 * SPEED_SCALE_MPS));
    (0..PARAMETERS)
        .filter(|&i| covariance[(i, i)].sqrt() * powers[i] < EXCITED_SHARE * w0)
        .fold(0, |bits, i| bits | 1 << i)
}

fn missing_manoeuvres(excited: u32) -> u32 {
    let wanted = [Manoeuvre::CoastSlow, Manoeuvre::VarySpeed, Manoeuvre::CoastFast];
    (0..PARAMETERS).filter(|i| excited & (1 << i) == 0).fold(0, |bits, i| bits | wanted[i].bit())
}
