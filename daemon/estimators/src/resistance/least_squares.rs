//! The pipelines `ls`, `rls`, `regularised_rls`, `mils` and `v_mils`.

use dynocar_core::filter::RunningMedian;
use dynocar_core::pipeline::judge::{InputState, Judgement, missing};
use dynocar_core::pipeline::momentum::{DataSettings, PARAMETERS, UnitSample, scaled, unscaling};
use dynocar_core::pipeline::output::{DAVIS, write_innovations, write_parameters};
use dynocar_core::pipeline::{Estimator, InnovationMonitor, KeptEstimate, Outcome};
use dynocar_model::force::ResolvedSample;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{ParameterSnapshot, PipelineKind, Reason, RejectionReason};
use nalgebra::{Matrix3, SMatrix};

use super::noise_bank::NoiseBank;
use super::observation_source::RowSource;
use super::regression::{
    AffineMotion, RegressionObservation, RegressionSolution, Unknowns, WhiteRow,
};
use super::report::{DrivenSpeeds, ResistanceReport, SolutionEvidence};
use crate::liu::{Solver, bank_penalty};

/// Rows that the innovation statistics look back over.
const MONITOR_ROWS: u32 = 60;
/// Rows whose median gives the robust scale of the innovations.
const SCALE_ROWS: usize = 31;
/// Rows before the median is used.
const SCALE_ROWS_MIN: usize = 8;
/// The median of |x| for a standard normal x.
const NORMAL_MEDIAN: f64 = 0.6745;
/// Robust standard deviations beyond which a row is refused.
const REFUSED_BEYOND: f64 = 5.0;
/// Rows refused one after the other before a force is taken to have come to stay.
const REFUSALS_BEFORE_JUMP: u32 = 3;
/// Rows before the solution replaces the declared resistance in detecting outliers.
const ROWS_BEFORE_OWN: f64 = 12.0;

/// Davis coefficients by one of the least-squares recursions of Liu 2018.
///
/// Samples become observations (`RowSource`), the `NoiseBank` makes
/// them independent and says how noisy they are, a `Solver` takes them in.
#[derive(Clone, Debug)]
pub struct ResistanceLeastSquares {
    kind: PipelineKind,
    pub(super) source: RowSource,
    pub(super) bank: NoiseBank,
    fresh: Solver,
    solver: Solver,
    /// The declared resistance as a start.
    pub(super) declared: RegressionSolution,
    solution: Option<RegressionSolution>,
    known: Davis,
    monitor: InnovationMonitor,
    deviations: RunningMedian<SCALE_ROWS>,
    refused_share: f64,
    speeds: DrivenSpeeds,
    /// The report on its own solution.
    pub(super) report: ResistanceReport,
    obstacle: Option<Reason>,
    refused_in_a_row: u32,
    /// How far the disturbance has been let go by the newest sample.
    pub(super) jump_n_per_kn: Option<f64>,
    disturbance: (f64, f64),
    /// Weight of the newest sample's train.
    pub(super) weight_kn: f64,
    resets: u64,
}

impl ResistanceLeastSquares {
    /// Returns an estimator for a train; `lambda` is the noise bank's, `forgetting` its weight kept per
    /// row.
    pub fn new(
        kind: PipelineKind,
        train: &TrainModel,
        settings: DataSettings,
        solver: Solver,
        lambda: f64,
        forgetting: f64,
    ) -> Self {
        let bank = NoiseBank::new(&bank_penalty(&settings, lambda), forgetting);
        let declared = declared_solution(train, &settings);
        ResistanceLeastSquares {
            kind,
            source: RowSource::new(settings),
            bank,
            fresh: solver.clone(),
            solver,
            declared,
            solution: None,
            known: train.resistance,
            monitor: InnovationMonitor::new(MONITOR_ROWS),
            deviations: RunningMedian::default(),
            refused_share: 0.0,
            speeds: DrivenSpeeds::default(),
            report: ResistanceReport::unestimated(&declared, Reason::TooFewSamples),
            obstacle: None,
            refused_in_a_row: 0,
            jump_n_per_kn: None,
            disturbance: (0.0, 0.0),
            weight_kn: TrainModel::weight_kn(train.mass_kg),
            resets: 0,
        }
    }

    /// Returns the innovation of a row over its standard deviation.
    fn normalised(&self, row: &WhiteRow) -> f64 {
        let own = self.solution.filter(|_| self.is_warm());
        let RegressionSolution { estimate, covariance } = own.unwrap_or(self.declared);
        let variance = 1.0 + row.features.dot(&(covariance * row.features));
        (row.observed - row.features.dot(&estimate)) / variance.sqrt()
    }

    fn take(&mut self, observation: &RegressionObservation, speed_mps: f64) -> Outcome {
        if observation.is_first() {
            self.monitor.break_here();
            self.solver.skip();
        }
        let Some(row) = self.bank.predict(observation) else { return Outcome::Used };
        let normalised = self.normalised(&row);
        if !normalised.is_finite() {
            self.reset();
            return Outcome::Rejected(RejectionReason::NotFinite);
        }
        self.deviations.push(normalised.abs());
        let is_bad = normalised.abs() > self.solver.bad_beyond(REFUSED_BEYOND) * self.robust_std();
        self.refused_share += (f64::from(is_bad) - self.refused_share) / f64::from(MONITOR_ROWS);
        if is_bad {
            self.refuse(observation, &row);
            return Outcome::Rejected(RejectionReason::Outlier);
        }
        self.refused_in_a_row = 0;
        let is_other_noise = self.bank.accept(observation);
        if self.solver.take(&row).is_err() {
            self.reset();
            return Outcome::Used;
        }
        if is_other_noise {
            self.solver.restart(&self.bank);
        }
        if self.is_warm() {
            self.monitor.push(normalised);
        }
        self.speeds.push(speed_mps);
        self.judge();
        Outcome::Updated
    }

    /// Leaves a row out. After a few in a row it is a force that has come to stay: the
    /// disturbance is let go, and the next rows show how large it is.
    fn refuse(&mut self, observation: &RegressionObservation, row: &WhiteRow) {
        self.bank.refuse(observation);
        self.solver.skip();
        self.monitor.break_here();
        self.refused_in_a_row += 1;
        let estimate = self.solution.unwrap_or(self.declared).estimate;
        let rest = row.observed - row.features.dot(&estimate);
        let jump_n_per_kn = rest / row.features[0];
        if self.refused_in_a_row >= REFUSALS_BEFORE_JUMP && jump_n_per_kn.is_finite() {
            self.refused_in_a_row = 0;
            self.bank.loosen(jump_n_per_kn);
            self.jump_n_per_kn = Some(jump_n_per_kn);
        }
    }

    /// Robust standard deviation of the normalised innovations, never below 1.
    ///
    /// It grows when all rows deviate, so that a train that has truly changed is believed after
    /// a few rows.
    fn robust_std(&self) -> f64 {
        match self.deviations.median() {
            Some(median) if self.deviations.count() >= SCALE_ROWS_MIN => {
                (median / NORMAL_MEDIAN).max(1.0)
            }
            _ => 1.0,
        }
    }

    /// Returns the speed and disturbance at the newest sample, which closed a block that was taken in;
    /// `None` when the source has no blocks.
    pub(super) fn motion(&self) -> Option<AffineMotion> {
        let since = self.source.since_block()?;
        Some(self.bank.likeliest_motion(&since))
    }

    /// Returns whether the newest row was refused.
    pub(super) fn has_refused_row(&self) -> bool {
        self.refused_in_a_row > 0 || self.jump_n_per_kn.is_some()
    }

    /// Returns whether there are rows enough for an own solution.
    pub(super) fn is_warm(&self) -> bool {
        self.bank.count() >= ROWS_BEFORE_OWN
    }

    /// Judges a solution from the same samples, with the disturbance now and its standard
    /// deviation in N/kN.
    pub(super) fn judged(
        &self,
        solution: &RegressionSolution,
        monitor: &InnovationMonitor,
        disturbance: (f64, f64),
    ) -> Option<ResistanceReport> {
        let evidence = SolutionEvidence {
            disturbed: self.bank.disturbed(),
            disturbance_n_per_kn: disturbance.0,
            disturbance_std_n_per_kn: disturbance.1,
            innovations: monitor,
            speeds: &self.speeds,
            rows: self.bank.count(),
            refused_share: self.refused_share,
        };
        ResistanceReport::judge(solution, &evidence)
    }

    fn judge(&mut self) {
        self.solution = self.solver.solution(&self.bank);
        let Some(solution) = self.solution else { return };
        self.disturbance = self.bank.disturbance(&solution.estimate);
        match self.judged(&solution, &self.monitor, self.disturbance) {
            Some(report) => {
                self.report = report;
                if self.is_warm() {
                    self.known = report.davis();
                }
            }
            // Not yet determined; once it was, something is broken.
            None if self.bank.count() >= 2.0 * ROWS_BEFORE_OWN => self.reset(),
            None => {}
        }
    }

    /// Starts anew after a numerical failure, and says so until there is an estimate again.
    fn reset(&mut self) {
        self.bank.clear();
        self.solver.clone_from(&self.fresh);
        self.solution = None;
        self.source.break_chain();
        self.resets += 1;
        self.report = ResistanceReport::unestimated(&self.declared, Reason::NumericalFailure);
    }
}

impl ResistanceLeastSquares {
    /// Writes a report on these samples; returns the judgement.
    pub(super) fn write_with(
        &self,
        report: &ResistanceReport,
        monitor: &InnovationMonitor,
        snapshot: &mut ParameterSnapshot,
    ) -> Judgement {
        let reason = match self.obstacle {
            // Without a single row, the missing quantity is more informative than the small number of rows.
            Some(obstacle) if self.bank.count() == 0.0 => obstacle,
            _ => report.reason,
        };
        let factors = unscaling();
        let covariance =
            Matrix3::from_diagonal(&factors) * report.covariance * Matrix3::from_diagonal(&factors);
        write_parameters(snapshot, DAVIS, &report.estimate.component_mul(&factors), &covariance);
        write_innovations(snapshot, monitor);
        snapshot.generation = self.resets;
        snapshot.excited = report.excited;
        snapshot.missing_manoeuvres = report.missing_manoeuvres;
        // The disturbance acts against the motion as resistance does.
        snapshot.unexplained_force_n = self.disturbance.0 * self.weight_kn;
        snapshot.unexplained_force_std_n = self.disturbance.1 * self.weight_kn;
        self.speeds.range.write(snapshot);
        (report.status, reason).into()
    }
}

impl Estimator for ResistanceLeastSquares {
    fn kind(&self) -> PipelineKind {
        self.kind
    }

    fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        self.weight_kn = sample.weight_kn;
        self.jump_n_per_kn = None;
        let observed =
            UnitSample::from_sample(sample).and_then(|now| self.source.push(&now, &self.known));
        match observed {
            Ok(observation) => {
                self.obstacle = None;
                match observation {
                    Some((observation, speed_mps)) => self.take(&observation, speed_mps),
                    None => Outcome::Used,
                }
            }
            Err(reason) => {
                if reason != RejectionReason::Outlier {
                    self.source.break_chain();
                }
                if reason == RejectionReason::Missing {
                    self.obstacle = Some(missing(sample));
                }
                Outcome::Rejected(reason)
            }
        }
    }

    fn write(&self, _input: &InputState, snapshot: &mut ParameterSnapshot) -> Judgement {
        self.write_with(&self.report, &self.monitor, snapshot)
    }

    /// Returns the kept coefficients take the place of the declared ones, and are known to every noise
    /// model with their covariance. A reset for numerical failure forgets the latter.
    fn warm_start(&mut self, kept: &KeptEstimate) -> bool {
        let Some((davis, covariance)) = kept.moments(DAVIS) else { return false };
        let factors = unscaling();
        let scale = Matrix3::from_diagonal(&factors.map(|factor| 1.0 / factor));
        let (mean, covariance) = (scale * davis, scale * covariance * scale);
        let root = covariance.cholesky().map(|it| it.unpack());
        let Some(rows) = root.and_then(|root| root.solve_lower_triangular(&Matrix3::identity()))
        else {
            return false;
        };
        for row in rows.row_iter() {
            let features = Unknowns::from_fn(|i, _| if i < PARAMETERS { row[i] } else { 0.0 });
            self.bank.know(&features, row.dot(&mean.transpose()));
        }
        self.solver.restart(&self.bank);
        self.declared.estimate.fixed_rows_mut::<PARAMETERS>(0).copy_from(&mean);
        let mut block = self.declared.covariance.fixed_view_mut::<PARAMETERS, PARAMETERS>(0, 0);
        block.copy_from(&covariance);
        self.known = Davis { a: davis[0], b: davis[1], c: davis[2] };
        self.report = ResistanceReport::unestimated(&self.declared, Reason::TooFewSamples);
        true
    }
}

/// Returns the declared resistance as a start, trusted to half its value and 1 N/kN; the forces as the
/// settings trust them.
fn declared_solution(train: &TrainModel, settings: &DataSettings) -> RegressionSolution {
    let declared = scaled(&train.resistance);
    let forces = bank_penalty(settings, 0.0);
    let estimate = Unknowns::from_fn(|i, _| if i < PARAMETERS { declared[i] } else { 0.0 });
    let variances = Unknowns::from_fn(|i, _| match i < PARAMETERS {
        true => (1.0 + 0.5 * declared[i].abs()).powi(2),
        false => 1.0 / forces[i],
    });
    RegressionSolution { estimate, covariance: SMatrix::from_diagonal(&variances) }
}
