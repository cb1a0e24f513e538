//! The estimator behind every braking pipeline: intake, engine, report.

use dynocar_model::force::ResolvedSample;
use dynocar_shared::{Manoeuvre, ParameterSnapshot, PipelineKind, Reason, RejectionReason};

use super::engine::{Engine, Estimate, Observation, Step};
use super::intake::{BrakingCoefficient, BrakingIntake, Intake};
use super::motion::StepInputs;
use super::report::{self, Circumstances, ReportSettings};
use crate::pipeline::motion::{PositionNoise, SpeedRange};
use crate::pipeline::output::write_innovations;
use crate::pipeline::{Estimator, InnovationMonitor, Outcome};

/// Memory of the innovation statistics, in innovations.
const INNOVATION_MEMORY: u32 = 100;

/// Learns a braking coefficient with one engine.
#[derive(Clone, Debug)]
pub struct BrakingEstimator<E> {
    kind: PipelineKind,
    quantity: BrakingCoefficient,
    intake: BrakingIntake,
    engine: E,
    report: ReportSettings,
    /// Age in s at which an estimate is stale.
    stale_after_s: f64,
    innovations: InnovationMonitor,
    reason: Reason,
    /// The last estimate that counts, else the last of all.
    held: Option<Estimate>,
    /// False while the held estimate is of an earlier braking or of the time before a change.
    is_current: bool,
    updated_ns: i64,
    now_ns: i64,
    resets: u64,
    speeds: SpeedRange,
    /// Variance in m² of a position as declared, and what the positions show.
    declared_position_m2: f64,
    positions: PositionNoise,
}

impl<E: Engine> BrakingEstimator<E> {
    /// An estimator of one quantity.
    pub fn new(
        kind: PipelineKind,
        quantity: BrakingCoefficient,
        intake: BrakingIntake,
        engine: E,
        report: ReportSettings,
        (stale_after_s, position_std_m): (f64, f64),
    ) -> Self {
        BrakingEstimator {
            kind,
            quantity,
            intake,
            engine,
            report,
            stale_after_s,
            innovations: InnovationMonitor::new(INNOVATION_MEMORY),
            reason: Reason::TooFewSamples,
            held: None,
            is_current: false,
            updated_ns: 0,
            now_ns: 0,
            resets: 0,
            speeds: SpeedRange::default(),
            declared_position_m2: position_std_m * position_std_m,
            positions: PositionNoise::default(),
        }
    }

    fn step(&mut self, inputs: &StepInputs, observed: &Observation) -> Outcome {
        match self.engine.step(inputs, observed) {
            Ok(Step::Collected) => Outcome::Used,
            Ok(Step::Updated { normalised_innovation }) => {
                if let Some(normalised) = normalised_innovation {
                    self.innovations.push(normalised);
                }
                self.hold(observed.speed_mps);
                Outcome::Updated
            }
            Ok(Step::Outlier) => Outcome::Rejected(RejectionReason::Outlier),
            Ok(Step::Restarted) => {
                self.resets += 1;
                self.is_current = false;
                self.innovations.break_here();
                Outcome::Used
            }
            Err(_) => {
                // The reset is not hidden: the reason stays until the next update, and the
                // generation counts it.
                self.resets += 1;
                self.engine.start(observed);
                self.innovations = InnovationMonitor::new(INNOVATION_MEMORY);
                self.held = None;
                self.reason = Reason::NumericalFailure;
                Outcome::Used
            }
        }
    }

    /// Takes over the engine's estimate, unless one that counts would give way to one that does
    /// not yet.
    fn hold(&mut self, speed_mps: f64) {
        let Some(estimate) = self.engine.estimate() else { return };
        let counts = self.report.counts(&estimate);
        let held_counts = self.held.is_some_and(|held| self.report.counts(&held));
        if counts || self.is_current || !held_counts {
            if !self.is_current {
                self.speeds = SpeedRange::default();
            }
            self.held = Some(estimate);
            self.is_current = counts;
            self.updated_ns = self.now_ns;
            self.reason = Reason::None;
        }
        self.speeds.push(speed_mps);
    }

    fn is_stale(&self) -> bool {
        let age_s = self.now_ns.saturating_sub(self.updated_ns) as f64 * 1e-9;
        !self.is_current || age_s > self.stale_after_s
    }
}

impl<E: Engine> Estimator for BrakingEstimator<E> {
    fn kind(&self) -> PipelineKind {
        self.kind
    }

    fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        self.now_ns = sample.time_ns;
        self.positions.see(sample);
        let position_m2 = self.positions.variance_m2(self.declared_position_m2);
        self.engine.set_distance_variance(position_m2);
        match self.intake.take(sample) {
            Intake::NotBraking | Intake::Collected => Outcome::Used,
            Intake::Missing(reason) => {
                if self.held.is_none() {
                    self.reason = reason;
                }
                Outcome::Rejected(RejectionReason::Missing)
            }
            Intake::Refused(reason) => Outcome::Rejected(reason),
            Intake::Start(first) => {
                self.innovations.break_here();
                self.engine.start(&first);
                self.is_current = false;
                if self.held.is_none() {
                    self.reason = Reason::TooFewSamples;
                }
                Outcome::Used
            }
            Intake::Step(inputs, observed) => self.step(&inputs, &observed),
        }
    }

    fn write(&self, snapshot: &mut ParameterSnapshot) {
        let circumstances = Circumstances {
            reason: self.reason,
            is_stale: self.is_stale(),
            are_innovations_too_large: self.innovations.are_too_large(),
        };
        report::write(snapshot, self.quantity, &self.report, self.held.as_ref(), &circumstances);
        write_innovations(snapshot, &self.innovations);
        snapshot.generation = self.resets;
        snapshot.excited = (1u32 << snapshot.parameter_count) - 1;
        let is_missing = self.held.is_none() || circumstances.is_stale;
        snapshot.missing_manoeuvres = if is_missing { Manoeuvre::Brake.bit() } else { 0 };
        self.speeds.write(snapshot);
    }
}
