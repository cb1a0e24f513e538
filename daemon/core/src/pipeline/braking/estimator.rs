//! The estimator behind every braking pipeline: intake, engine, and the judgement of an estimate.

use dynocar_model::force::ResolvedSample;
use dynocar_model::train::TrainModel;
use dynocar_shared::{
    Manoeuvre, Parameter, ParameterSnapshot, PipelineKind, Reason, RejectionReason, Status,
};
use nalgebra::{Matrix1, Matrix2, SVector};

use super::engine::{BrakingEstimate, BrakingObservation, BrakingSettings, Engine, EngineStep};
use super::intake::{BrakingCoefficient, BrakingIntake, Intake};
use super::motion::StepInputs;
use crate::pipeline::judge::{InputState, Judgement, StatusInputs};
use crate::pipeline::motion::{PositionNoise, SpeedRange};
use crate::pipeline::output::{write_innovations, write_parameters};
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
    settings: BrakingSettings,
    innovations: InnovationMonitor,
    reason: Reason,
    /// The last estimate that counts, else the last of all.
    held: Option<BrakingEstimate>,
    /// Part of its demand that a slow brake had not built up.
    held_lacking: f64,
    /// False while the held estimate is of an earlier braking or of the time before a change.
    is_current: bool,
    updated_ns: i64,
    now_ns: i64,
    resets: u64,
    speeds: SpeedRange,
    /// Noise of the positions, inferred from them.
    positions: PositionNoise,
}

/// Standard deviations by which the achieved brake force must lie below the demanded one before
/// the rail counts as the smaller one.
const RAIL_LIMIT_SIGMAS: f64 = 2.0;

impl BrakingSettings {
    /// Returns the estimator of a kind around an engine.
    pub fn estimator<E: Engine + 'static>(
        &self,
        kind: PipelineKind,
        quantity: BrakingCoefficient,
        train: &TrainModel,
        engine: E,
    ) -> Box<dyn Estimator> {
        Box::new(BrakingEstimator {
            kind,
            quantity,
            intake: BrakingIntake::new(quantity, *self, train),
            engine,
            settings: *self,
            innovations: InnovationMonitor::new(INNOVATION_MEMORY),
            reason: Reason::TooFewSamples,
            held: None,
            held_lacking: 0.0,
            is_current: false,
            updated_ns: 0,
            now_ns: 0,
            resets: 0,
            speeds: SpeedRange::default(),
            positions: PositionNoise::default(),
        })
    }
}

impl<E: Engine> BrakingEstimator<E> {
    fn step(&mut self, inputs: &StepInputs, observed: &BrakingObservation) -> Outcome {
        match self.engine.step(inputs, observed) {
            Some(EngineStep::Collected) => Outcome::Used,
            Some(EngineStep::Updated { normalised_innovation }) => {
                if let Some(normalised) = normalised_innovation {
                    self.innovations.push(normalised);
                }
                self.hold(observed.speed_mps);
                Outcome::Updated
            }
            Some(EngineStep::Outlier) => Outcome::Rejected(RejectionReason::Outlier),
            Some(EngineStep::Restarted) => {
                self.resets += 1;
                self.is_current = false;
                self.innovations.break_here();
                Outcome::Used
            }
            None => {
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
        let counts = self.settings.counts(&estimate);
        let held_counts = self.held.is_some_and(|held| self.settings.counts(&held));
        if counts || self.is_current || !held_counts {
            if !self.is_current {
                self.speeds = SpeedRange::default();
            }
            self.held = Some(estimate);
            self.held_lacking =
                self.engine.lacking_share() * self.intake.lacking(self.engine.lag_s());
            self.is_current = counts;
            self.updated_ns = self.now_ns;
            self.reason = Reason::None;
        }
        self.speeds.push(speed_mps);
    }

    fn is_stale(&self) -> bool {
        let age_s = self.now_ns.saturating_sub(self.updated_ns) as f64 * 1e-9;
        !self.is_current || age_s > self.settings.stale_after_s
    }

    /// Returns whether the rail carries less than the brake would need, so that the coefficient is that
    /// of the rail and not only a lower bound of it.
    fn is_rail_limited(&self, estimate: &BrakingEstimate) -> bool {
        // A brake that does more than it reports, or a lighter train than is known, leaves no rail that limits it; nor
        // is one known while a slow brake would do no more.
        if estimate.coefficient.value + self.held_lacking >= estimate.demand {
            return false;
        }
        if let Some(probability) = estimate.brake_limited {
            return probability <= 0.5;
        }
        let demand_std = self.settings.demand_relative_std * estimate.demand;
        let std = estimate.coefficient.std.hypot(demand_std);
        estimate.coefficient.value < estimate.demand - RAIL_LIMIT_SIGMAS * std
    }

    fn write_estimate(
        &self,
        estimate: &BrakingEstimate,
        is_stale: bool,
        snapshot: &mut ParameterSnapshot,
    ) -> (Status, Reason) {
        let is_adhesion = self.quantity == BrakingCoefficient::Adhesion;
        let is_number = !is_adhesion || self.is_rail_limited(estimate);
        let parameter = match self.quantity {
            BrakingCoefficient::Adhesion if is_number => Parameter::Adhesion,
            BrakingCoefficient::Adhesion => Parameter::AdhesionLowerBound,
            BrakingCoefficient::Friction => Parameter::DiscFriction,
            BrakingCoefficient::Ratio => Parameter::BrakingRatio,
        };
        let BrakingEstimate { coefficient, scale, covariance, .. } = *estimate;
        let variance = coefficient.std * coefficient.std;
        if self.kind == PipelineKind::AdhesionLaw && is_number {
            write_parameters(
                snapshot,
                [parameter, Parameter::AdhesionLawScale],
                &SVector::from([coefficient.value, scale.value]),
                &Matrix2::new(variance, covariance, covariance, scale.std * scale.std),
            );
        } else {
            let value = SVector::from([coefficient.value]);
            write_parameters(snapshot, [parameter], &value, &Matrix1::new(variance));
        }
        self.case(estimate, is_stale, is_number).verdict()
    }

    fn case(&self, estimate: &BrakingEstimate, is_stale: bool, is_number: bool) -> StatusInputs {
        let counts = self.settings.counts(estimate);
        let is_impossible = counts && estimate.coefficient.value <= 0.0;
        let is_too_large = self.innovations.are_too_large();
        // The event that would say more has not come: nothing is wrong, and nothing may be used yet.
        let awaited = [(is_stale, Reason::EstimateStale), (!is_number, Reason::OnlyLowerBound)];
        let awaited = awaited.into_iter().find(|(is_so, _)| counts && !is_too_large && *is_so);
        let fault = match is_impossible {
            true => Some((Status::Invalid, Reason::AtBound)),
            false => awaited.map(|(_, reason)| (Status::Unestimated, reason)),
        };
        StatusInputs {
            fault,
            input: None,
            is_ready: counts,
            is_known: true,
            lacking: Status::Unestimated,
            contradiction: is_too_large.then_some(Reason::InnovationsTooLarge),
            // Only friction times ratio acts on the train, and the other factor is held as declared: a reader who
            // uses both has the force that acts.
            caveat: match self.quantity {
                BrakingCoefficient::Adhesion => Reason::None,
                BrakingCoefficient::Friction | BrakingCoefficient::Ratio => Reason::NotIdentifiable,
            },
        }
    }
}

impl<E: Engine> Estimator for BrakingEstimator<E> {
    fn kind(&self) -> PipelineKind {
        self.kind
    }

    fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        self.now_ns = sample.time_ns;
        self.positions.see(sample);
        let position_m2 = self.positions.variance_m2(self.settings.position_std_m.powi(2));
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

    fn write(&self, _input: &InputState, snapshot: &mut ParameterSnapshot) -> Judgement {
        let is_stale = self.is_stale();
        let verdict = match &self.held {
            Some(estimate) => self.write_estimate(estimate, is_stale, snapshot),
            None => {
                snapshot.parameter_count = 0;
                (Status::Unestimated, self.reason)
            }
        };
        write_innovations(snapshot, &self.innovations);
        snapshot.generation = self.resets;
        snapshot.excited = (1u32 << snapshot.parameter_count) - 1;
        let is_missing = self.held.is_none() || is_stale;
        snapshot.missing_manoeuvres = if is_missing { Manoeuvre::Brake.bit() } else { 0 };
        self.speeds.write(snapshot);
        verdict.into()
    }
}
