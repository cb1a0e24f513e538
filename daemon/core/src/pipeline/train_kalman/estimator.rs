//! The estimator of `train_kalman`, from samples to its report.

mod judgement;

use std::sync::Arc;

use dynocar_model::force::ResolvedSample;
use dynocar_model::train::TrainModel;
use dynocar_shared::{Parameter, ParameterSnapshot, PipelineKind, Quantity, RejectionReason};

use super::TrainKalmanSettings;
use super::brake::BrakeErrors;
use super::learned_state::{JumpShare, LearnedState, LoadWatch, ResistanceBelief};
use super::motion_bank::SpeedLikelihood;
use super::motion_filter::{FORCE_DELAY, SPEED, wind_over};
use super::report::{Systematic, TrainKalmanReport};
use super::step_builder::StepBuilder;
use super::weigher::LoadChange;
use crate::pipeline::judge::{InputState, Judgement, LONG_RUN_MAX};
use crate::pipeline::momentum::UnitSample;
use crate::pipeline::motion::{BRIDGED_MAX_S, STANDING_MPS, SpeedRange};
use crate::pipeline::output::{DAVIS, contract_unit, write_innovations};
use crate::pipeline::settings::SettingError;
use crate::pipeline::{Estimator, KeptEstimate, Outcome, UseBefore};

/// Motion in s before any quantity is called known; after a warm start, before it is confirmed.
const MOVED_MIN_S: f64 = 20.0;
const CONFIRMED_S: f64 = 3.0;
/// Standard deviation in N/kN of the brake force from which speeds say nothing of their noise or of the model.
const JUDGED_BRAKE_STD: f64 = 1.0;
/// Deviations by which a first sample may differ from a kept mass that still counts.
const KEPT_DEVIATIONS: f64 = 3.0;
/// Greatest acceleration and deceleration in m/s² by which a train can have come to a stop and left it.
const STOPPING_MPS2: f64 = 1.5;

/// Resistance and mass of a train by Kalman filters over every sample.
#[derive(Clone, Debug)]
pub struct TrainKalman {
    settings: TrainKalmanSettings,
    train_kg: f64,
    /// Resistance as declared or kept, scaled, with its covariance.
    first: ResistanceBelief,
    learned: LearnedState,
    load: LoadWatch,
    /// Newest sample of the motion.
    last: Option<UnitSample>,
    last_time_ns: Option<i64>,
    /// True when the speed of the newest sample was at least the lowest that is used.
    is_fast: bool,
    steps: StepBuilder,
    systematic: Systematic,
    speeds: SpeedRange,
    moved_s: f64,
    moved_min_s: f64,
    /// Estimate kept from earlier, until the first sample.
    kept: Option<Kept>,
    report: TrainKalmanReport,
    is_fresh_reset: bool,
    resets: u64,
}

/// Part of a kept estimate that counts with the first sample.
#[derive(Clone, Copy, Debug)]
struct Kept {
    /// Mass in kg with its relative variance, and with that before any time had passed.
    mass: Option<(f64, [f64; 2])>,
    use_before: UseBefore,
}

impl TrainKalman {
    /// An estimator for a train.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn new(
        settings: TrainKalmanSettings,
        train: &Arc<TrainModel>,
    ) -> Result<Self, SettingError> {
        settings.check_ranges()?;
        let first = ResistanceBelief::declared(&train.resistance, settings.prior_relative_std);
        let learned = LearnedState::new(&settings, &first);
        Ok(TrainKalman {
            report: TrainKalmanReport::new(&learned.bank.published(0.0, 0.0, 0.0)),
            learned,
            settings,
            train_kg: train.mass_kg,
            steps: StepBuilder::new(&settings, train.length_m),
            first,
            load: LoadWatch::new(&settings, train),
            last: None,
            last_time_ns: None,
            is_fast: false,
            systematic: Systematic::new(
                settings.gradient_std_permille,
                settings.acceleration_scale_std,
                train.length_m,
            ),
            speeds: SpeedRange::default(),
            moved_s: 0.0,
            moved_min_s: MOVED_MIN_S,
            kept: None,
            is_fresh_reset: false,
            resets: 0,
        })
    }

    fn begin(&mut self, now: UnitSample, sample: &ResolvedSample) -> Outcome {
        let gap_s = self
            .last_time_ns
            .map_or(f64::INFINITY, |last| now.time_ns.saturating_sub(last) as f64 * 1e-9);
        let noise_variance = self.learned.noise.variance_of_sample(f64::INFINITY);
        let wind = wind_over(gap_s.max(0.0), self.settings.wind_std_mps);
        let map_error = self.steps.begin(sample);
        let speed = (now.speed_mps, noise_variance);
        self.learned.bank.begin(speed, gap_s.max(0.0), wind, &map_error);
        self.learned.monitor.break_here();
        self.last = Some(now);
        Outcome::Used
    }

    fn advance(&mut self, from: UnitSample, now: UnitSample, sample: &ResolvedSample) -> Outcome {
        let delay_s = self.learned.bank.likeliest().belief.mean[FORCE_DELAY];
        let step = self.steps.to((&from, &now), sample, (delay_s, &self.learned), &self.first);
        let before_mps = self.learned.bank.likeliest().belief.mean[SPEED];
        self.learned.bank.predict(&step);
        let moved_mps = (self.learned.bank.likeliest().belief.mean[SPEED] - before_mps).abs();
        let noise_variance = self.learned.noise.variance_of_sample(moved_mps);
        let measured = self.learned.bank.measure(now.speed_mps, noise_variance, &step);
        let Some(measured) = measured.ok().filter(|_| self.learned.bank.is_sound()) else {
            self.reset();
            return self.begin(now, sample);
        };
        self.last = Some(now);
        if measured.trust.is_outlier() {
            self.learned.monitor.break_here();
            return Outcome::Rejected(RejectionReason::Outlier);
        }
        if step.brake_std < JUDGED_BRAKE_STD * step.duration_s {
            self.learn(&measured, now.speed_mps);
        } else {
            self.learned.monitor.break_here();
        }
        if self.learned.brake.learn(&step, &self.learned.bank.likeliest().belief) {
            let brake = self.learned.brake;
            self.reset();
            self.learned.brake = brake;
            return self.begin(now, sample);
        }
        self.speeds.push(now.speed_mps);
        self.systematic.see(step.travelled_m, sample.position_m, now.speed_mps);
        self.moved_s += step.duration_s;
        self.is_fresh_reset &= self.moved_s < self.moved_min_s;
        self.judge(step.direction, step.by_wind);
        Outcome::Updated
    }

    /// Learns the noise of speeds, and of forces that jump, from a measured speed.
    fn learn(&mut self, measured: &SpeedLikelihood, speed_mps: f64) {
        self.learned.monitor.push(measured.trust.normalised);
        let belief = &self.learned.bank.likeliest().belief;
        let residual_mps = speed_mps - belief.mean[SPEED];
        let filtered_variance = belief.covariance[(SPEED, SPEED)];
        self.learned.noise.take_residual(residual_mps, filtered_variance, measured.trust.weight);
        self.learned.jumps.learn(measured);
    }

    fn judge(&mut self, direction: f64, by_wind: f64) {
        let inflation = self.long_run().clamp(1.0, LONG_RUN_MAX);
        let published =
            self.learned.bank.published(direction, by_wind, self.first.air_resistance());
        self.report.take(&published, inflation, &self.systematic, &self.speeds);
    }

    fn reset(&mut self) {
        self.learned.bank = self.first.bank(&self.settings);
        self.steps.leave_line();
        self.learned.bank.change_load(self.load.renewed());
        self.learned.noise.reset();
        self.learned.jumps = JumpShare::default();
        self.learned.brake =
            BrakeErrors::new(self.settings.brake_scale_std, self.settings.brake_lag_s);
        self.moved_s = 0.0;
        self.moved_min_s = MOVED_MIN_S;
        self.report = TrainKalmanReport::new(&self.learned.bank.published(0.0, 0.0, 0.0));
        self.is_fresh_reset = true;
        self.resets += 1;
    }

    /// True for a sample of a train that moves fast enough, judged by the samples before it: a bound on the newest
    /// speed itself would admit speeds that noise raises and keep out those that noise lowers.
    fn is_under_way(&mut self, sample: &ResolvedSample) -> bool {
        let least_mps = self.settings.speed_min_mps;
        let was_fast = std::mem::replace(&mut self.is_fast, sample.speed_mps >= least_mps);
        match self.last {
            Some(_) => {
                let believed_mps = self.learned.bank.likeliest().belief.mean[SPEED];
                believed_mps >= least_mps && sample.speed_mps > STANDING_MPS
            }
            None => was_fast && sample.speed_mps > STANDING_MPS,
        }
    }

    /// Takes up the kept estimate with the first sample; true when its mass counts. A train that moves again so soon
    /// has not stood long enough for another load.
    fn take_up(&mut self, kept: &Kept, sample: &ResolvedSample) -> bool {
        let interrupted_s = kept.use_before.interrupted_s(sample.time_ns);
        let is_same_load = sample.speed_mps > STANDING_MPS
            && interrupted_s
                .is_some_and(|it| it < self.settings.stop_min_s + sample.speed_mps / STOPPING_MPS2);
        let mass = kept.mass.and_then(|(mass_kg, relative_variances)| {
            let load = sample.mass_kg / mass_kg;
            let variance = load * load * relative_variances[usize::from(is_same_load)];
            let (usual, spread) = self.load.prior();
            let allowed = KEPT_DEVIATIONS.powi(2) * (variance + spread);
            ((load - usual).powi(2) <= allowed).then_some((load, variance))
        });
        let (load, variance) = mass.unwrap_or(self.load.prior());
        self.learned.bank.change_load(LoadChange::Anew(load, variance));
        if interrupted_s.is_some() {
            let mut known = kept.use_before.usable_quantities;
            if mass.is_none() {
                known &= !Quantity::Mass.bit();
            }
            self.speeds = SpeedRange::resumed(kept.use_before.speeds_mps);
            self.moved_min_s = 0.0;
            self.report =
                TrainKalmanReport::resumed(&self.learned.bank.published(0.0, 0.0, 0.0), known);
        }
        mass.is_some()
    }

    /// Follows the load from sample to sample.
    fn follow_load(&mut self, sample: &ResolvedSample) {
        let change = self.load.see(sample);
        if let Some(kept) = self.kept.take()
            && self.take_up(&kept, sample)
        {
            return;
        }
        if let Some(change) = change {
            self.learned.bank.change_load(change);
            self.judge(0.0, 0.0);
        }
        if self.load.has_departed {
            let variance = self.load.weighing_variance();
            self.learned.bank.age_weigher(variance);
            self.systematic.start();
        }
    }
}

impl Estimator for TrainKalman {
    fn kind(&self) -> PipelineKind {
        PipelineKind::TrainKalman
    }

    fn is_gated(&self) -> bool {
        true
    }

    fn observe(&mut self, sample: &ResolvedSample) {
        self.follow_load(sample);
    }

    fn leave_out(&mut self) {
        self.last = None;
    }

    fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        let unit = UnitSample::from_sample(sample);
        if let Ok(unit) = unit {
            self.steps.see_pressure(sample.brake_cylinder_pressure_pa);
            self.steps.see(&unit, &self.learned.brake.lags_s);
        }
        if !self.is_under_way(sample) {
            self.last = None;
            return Outcome::Idle;
        }
        let now = match unit {
            Ok(now) => now,
            Err(reason) => {
                self.last = None;
                return Outcome::Rejected(reason);
            }
        };
        self.learned.noise.rounding.see(now.speed_mps);
        let last = self.last.filter(|last| {
            let since_s = now.seconds_since(last);
            last.segment == now.segment && since_s > 0.0 && since_s <= BRIDGED_MAX_S
        });
        let outcome = match last {
            Some(last) => self.advance(last, now, sample),
            None => self.begin(now, sample),
        };
        self.last_time_ns = Some(now.time_ns);
        outcome
    }

    fn write(&self, input: &InputState, snapshot: &mut ParameterSnapshot) -> Judgement {
        let declared_kg = self.load.declared_kg(self.train_kg);
        self.report.write(declared_kg, &self.speeds, snapshot);
        write_innovations(snapshot, &self.learned.monitor);
        snapshot.mass_source = self.mass_source() as u32;
        snapshot.generation = self.resets;
        self.judgement(input)
    }

    /// Takes up the kept resistance, and the mass unless the first sample contradicts it.
    fn warm_start(&mut self, kept: &KeptEstimate) -> bool {
        let Some((mean, covariance)) = kept.moments(DAVIS) else { return false };
        self.first = ResistanceBelief::kept(&mean, &covariance);
        self.learned.bank = self.first.bank(&self.settings);
        self.steps.leave_line();
        self.report = TrainKalmanReport::new(&self.learned.bank.published(0.0, 0.0, 0.0));
        self.moved_min_s = CONFIRMED_S;
        let mass = kept.moments([Parameter::Mass]).zip(kept.first_variance(Parameter::Mass));
        let mass = mass.and_then(|((mass_kg, aged), first)| {
            let (mass_kg, aged) = (mass_kg[0], aged[(0, 0)]);
            let unit = contract_unit(Parameter::Mass);
            let relative = [aged, first / (unit * unit)].map(|it| it / (mass_kg * mass_kg));
            (mass_kg > 0.0 && relative[0].is_finite()).then_some((mass_kg, relative))
        });
        self.kept = Some(Kept { mass, use_before: kept.use_before });
        true
    }
}
