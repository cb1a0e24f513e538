//! Uncertainty of an estimate: bounds, excitation, status.

use dynocar_core::filter::bounded_minimum;
use dynocar_core::pipeline::InnovationMonitor;
use dynocar_core::pipeline::admission::limits::UNFIT_SHARE;
use dynocar_core::pipeline::judge::StatusInputs;
use dynocar_core::pipeline::momentum::{PARAMETERS, SPEED_SCALE_MPS, regressors, unscaling};
use dynocar_core::pipeline::motion::SpeedRange;
use dynocar_core::pipeline::output::excitation;
use dynocar_model::train::Davis;
use dynocar_shared::{Manoeuvre, Reason, Status};
use nalgebra::{Matrix3, Vector3};

use super::noise_bank::Disturbed;
use super::regression::RegressionSolution;

/// Rows before anything is called estimated.
const ROWS_MIN: f64 = 12.0;
/// Standard deviation of w0 at the mean speed, as a share of w0, up to which it is estimated.
const SHARE_STD_MAX: f64 = 0.15;
/// Share of w0 that a coefficient's standard deviation may reach while it counts as excited.
const EXCITED_SHARE: f64 = 0.25;
/// A slow unknown force above this share of w0 shows that the model lacks something.
const DISTURBANCE_SHARE_MAX: f64 = 0.1;
/// Twice the log-likelihood ratio beyond which such a force is not chance.
const DISTURBANCE_EVIDENCE_MIN: f64 = 10.0;
/// Standard deviations beyond which the present force is not chance.
const DISTURBANCE_STDS_MAX: f64 = 4.0;

/// Mean and range of the speeds behind the rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DrivenSpeeds {
    /// Lowest and highest.
    pub range: SpeedRange,
    sum_mps: f64,
    count: f64,
}

impl DrivenSpeeds {
    /// Takes in the mean speed of a row in m/s.
    pub fn push(&mut self, speed_mps: f64) {
        self.range.push(speed_mps);
        self.sum_mps += speed_mps;
        self.count += 1.0;
    }

    /// Returns the highest in m/s; 0 before the first.
    pub fn max_mps(&self) -> f64 {
        self.range.get().map_or(0.0, |(_, max_mps)| max_mps)
    }

    /// Returns the mean; 0 before the first.
    pub fn mean_mps(&self) -> f64 {
        if self.count > 0.0 { self.sum_mps / self.count } else { 0.0 }
    }
}

/// Standard deviation of the integrals over samples, as a share of w0: between two samples force
/// and speed are taken as straight.
const INTEGRATION_SHARE_STD: f64 = 1e-4;

/// Evidence for and against a solution.
#[derive(Clone, Copy, Debug)]
pub struct SolutionEvidence<'a> {
    /// The slow force that the model does not know, over all rows.
    pub disturbed: Disturbed,
    /// That force now, retarding, in N/kN.
    pub disturbance_n_per_kn: f64,
    /// Its standard deviation now.
    pub disturbance_std_n_per_kn: f64,
    /// Innovation statistics.
    pub innovations: &'a InnovationMonitor,
    /// Speeds behind the rows.
    pub speeds: &'a DrivenSpeeds,
    /// Rows taken in.
    pub rows: f64,
    /// Share of the rows lately that did not fit.
    pub refused_share: f64,
}

/// Resistance as a snapshot reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResistanceReport {
    /// Status of the estimate for a controller.
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

impl ResistanceReport {
    /// Before any estimate: the declared resistance, hardly trusted.
    pub fn unestimated(declared: &RegressionSolution, reason: Reason) -> Self {
        ResistanceReport {
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
    pub fn judge(solution: &RegressionSolution, evidence: &SolutionEvidence) -> Option<Self> {
        let free = solution.estimate.fixed_rows::<PARAMETERS>(0).into_owned();
        let covariance =
            solution.covariance.fixed_view::<PARAMETERS, PARAMETERS>(0, 0).into_owned();
        let information = covariance.cholesky()?.inverse();
        let bounded = bounded_minimum(&information, &free, &Vector3::zeros()).ok()?;
        let estimate = bounded.estimate;
        // The free covariance: at a bound it is wider than need be, never narrower.
        let covariance =
            covariance + estimate * estimate.transpose() * INTEGRATION_SHARE_STD.powi(2);
        let at = |speed_mps: f64| {
            let powers = Vector3::from(regressors(speed_mps));
            (powers.dot(&estimate), powers.dot(&(covariance * powers)).max(0.0).sqrt())
        };
        let speeds = evidence.speeds;
        let excited = excited(&covariance, at(speeds.max_mps()).0, speeds.max_mps());
        let case = case(evidence, at(speeds.mean_mps()), excited, bounded.at_bound != 0);
        let (status, reason) = case.verdict();
        let (excited, missing_manoeuvres) = excitation(excited);
        Some(ResistanceReport { status, reason, estimate, covariance, excited, missing_manoeuvres })
    }

    /// Davis coefficients.
    pub fn davis(&self) -> Davis {
        let values = self.estimate.component_mul(&unscaling());
        Davis { a: values[0], b: values[1], c: values[2] }
    }
}

/// All that the judge asks for, by w0 at the mean speed with its standard deviation.
fn case(
    evidence: &SolutionEvidence,
    (w0, w0_std): (f64, f64),
    excited: [bool; PARAMETERS],
    is_at_bound: bool,
) -> StatusInputs {
    let SolutionEvidence { disturbed, innovations, .. } = evidence;
    let now = evidence.disturbance_n_per_kn.abs();
    let has_structure = disturbed.std_n_per_kn > DISTURBANCE_SHARE_MAX * w0
        && disturbed.evidence > DISTURBANCE_EVIDENCE_MIN;
    let is_disturbed = now > DISTURBANCE_SHARE_MAX * w0
        && now > DISTURBANCE_STDS_MAX * evidence.disturbance_std_n_per_kn;
    let is_too_large = innovations.are_too_large() || is_disturbed;
    StatusInputs {
        fault: None,
        input: (evidence.refused_share > UNFIT_SHARE.high).then_some(Reason::BadInput),
        is_ready: evidence.rows >= ROWS_MIN,
        // Structure makes the intervals wide, and says why.
        is_known: has_structure || w0_std <= SHARE_STD_MAX * w0,
        lacking: Status::Unestimated,
        contradiction: has_structure
            .then_some(Reason::InnovationsNotWhite)
            .or(is_too_large.then_some(Reason::InnovationsTooLarge)),
        caveat: if excited.contains(&false) {
            Reason::WeakExcitation
        } else if is_at_bound {
            Reason::AtBound
        } else {
            Reason::None
        },
    }
}

/// Returns which coefficients contribute an error that is small against w0 at the highest driven speed.
fn excited(covariance: &Matrix3<f64>, w0: f64, speed_mps: f64) -> [bool; PARAMETERS] {
    let powers = regressors(speed_mps.max(0.25 * SPEED_SCALE_MPS));
    std::array::from_fn(|i| covariance[(i, i)].sqrt() * powers[i] < EXCITED_SHARE * w0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SMatrix;

    fn judged(
        estimate: [f64; 3],
        stds: [f64; 3],
        change: impl FnOnce(&mut SolutionEvidence<'_>),
    ) -> ResistanceReport {
        let mut solution = RegressionSolution {
            estimate: nalgebra::zero(),
            covariance: SMatrix::identity() * 1e-4,
        };
        for i in 0..PARAMETERS {
            solution.estimate[i] = estimate[i];
            solution.covariance[(i, i)] = stds[i] * stds[i];
        }
        let innovations = InnovationMonitor::new(60);
        let mut speeds = DrivenSpeeds::default();
        speeds.push(5.0);
        speeds.push(30.0);
        let mut evidence = SolutionEvidence {
            disturbed: Disturbed { std_n_per_kn: 0.02, evidence: 50.0 },
            disturbance_n_per_kn: 0.0,
            disturbance_std_n_per_kn: 0.1,
            innovations: &innovations,
            speeds: &speeds,
            rows: 200.0,
            refused_share: 0.0,
        };
        change(&mut evidence);
        ResistanceReport::judge(&solution, &evidence).unwrap()
    }

    const GOOD: [f64; 3] = [1.5, 0.4, 1.2];
    const SMALL: [f64; 3] = [0.05, 0.05, 0.05];

    #[test]
    fn every_reservation_has_its_reason() {
        let reason = |report: ResistanceReport| (report.status, report.reason);
        assert_eq!(reason(judged(GOOD, SMALL, |_| {})), (Status::Estimated, Reason::None));
        let few = judged(GOOD, SMALL, |evidence| evidence.rows = 5.0);
        assert_eq!(reason(few), (Status::Unestimated, Reason::TooFewSamples));
        let wide = judged(GOOD, [3.0, 0.1, 0.1], |_| {});
        assert_eq!(reason(wide), (Status::Unestimated, Reason::WeakExcitation));
        let structured = judged(GOOD, SMALL, |evidence| evidence.disturbed.std_n_per_kn = 0.9);
        assert_eq!(reason(structured), (Status::Degraded, Reason::InnovationsNotWhite));
        let dragging = judged(GOOD, SMALL, |evidence| evidence.disturbance_n_per_kn = 1.5);
        assert_eq!(reason(dragging), (Status::Degraded, Reason::InnovationsTooLarge));
        let refusing = judged(GOOD, SMALL, |evidence| evidence.refused_share = 0.5);
        assert_eq!(reason(refusing), (Status::Degraded, Reason::BadInput));
    }

    #[test]
    fn a_negative_coefficient_is_brought_to_its_bound_and_named() {
        let report = judged([1.5, -0.02, 1.2], SMALL, |_| {});
        assert_eq!((report.status, report.reason), (Status::Estimated, Reason::AtBound));
        assert_eq!(report.estimate[1], 0.0);
    }

    #[test]
    fn an_unexcited_coefficient_names_the_manoeuvre_that_would_excite_it() {
        let report = judged(GOOD, [0.05, 0.05, 1.5], |_| {});
        assert_eq!(report.excited, 0b011);
        assert_eq!(report.missing_manoeuvres, Manoeuvre::CoastFast.bit());
    }
}
