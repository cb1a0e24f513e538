//! Mass by Kalman filters [v, 1/m, bias].

use std::sync::Arc;

use dynocar_core::pipeline::judge::{InputState, Judgement, StatusInputs};
use dynocar_core::pipeline::motion::{SpeedNoise, SpeedRange, StopWatch, jump_variance};
use dynocar_core::pipeline::output::{write_innovations, write_parameters};
use dynocar_core::pipeline::settings::SettingError;
use dynocar_core::pipeline::{Estimator, InnovationMonitor, KeptEstimate, Outcome};
use dynocar_model::force::ResolvedSample;
use dynocar_model::train::TrainModel;
use dynocar_shared::{
    Manoeuvre, Parameter, ParameterSnapshot, PipelineKind, Reason, RejectionReason, Status,
};
use nalgebra::{Matrix2, Vector2};

use super::bias_bank::{BiasBank, Dynamics, MassBiasMoments, SPEED};
use super::kalman_settings::MassKalmanSettings;
use super::known_motion::{Inertia, KnownMotion};

/// Number of samples over which the evidence for each assumed behaviour of the bias ([`super::bias_bank`]) is
/// remembered.
const EVIDENCE_MEMORY: f64 = 3000.0;
/// Number of used samples below which no mass is reported, unless they reach over `MOVED_MIN_S`.
const SAMPLES_MIN: u64 = 50;
/// Time in s of motion after which fewer samples are enough: for slow sampling, with a second or so between samples.
const MOVED_MIN_S: f64 = 20.0;
/// Least relative change of a declared mass that is followed; a smaller one may be scatter of the load weighing.
const DECLARED_CHANGE_MIN: f64 = 0.02;

/// Learns a train's mass while it drives or brakes.
///
/// The state is [v, reference mass / mass, bias acceleration]; between two samples
///
/// ```text
/// dv/dt = F u / (m_ref (1 + gamma)) - g (w(v) + gradient) / (1000 (1 + gamma)) + bias
/// ```
///
/// which is linear in u. Resistance and gradient act per weight, so that a train that coasts
/// moves alike at any mass: the published mass changes only under force. At a stop the mass
/// may change, and its variance is opened.
#[derive(Clone, Debug)]
pub struct MassKalman {
    settings: MassKalmanSettings,
    inertia: Inertia,
    initial_bank: BiasBank,
    bank: BiasBank,
    stops: StopWatch,
    last: Option<KnownMotion>,
    /// Inverse mass as known when force last acted, bias as known now.
    moments: MassBiasMoments,
    declared_mass_kg: f64,
    is_warm_started: bool,
    /// True until a motion begins after the mass was opened: nothing is known of the bias.
    is_opened: bool,
    noise: SpeedNoise,
    settling: Settling,
    monitor: InnovationMonitor,
    speeds: SpeedRange,
    moved_s: f64,
    was_known: bool,
    is_fresh_reset: bool,
    generation: u64,
}

impl MassKalman {
    /// Returns an estimator for a train.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn new(
        settings: MassKalmanSettings,
        train: &Arc<TrainModel>,
    ) -> Result<Self, SettingError> {
        settings.check()?;
        let inertia = Inertia::from_train(train);
        let bank = BiasBank::new(
            Dynamics { resistance: settings.line_resistance(train), inertia },
            settings.bias_models(),
            (1.0, 0.01 * settings.mass_std_percent),
            EVIDENCE_MEMORY,
        );
        Ok(MassKalman {
            settings,
            inertia,
            moments: bank.moments(),
            initial_bank: bank.clone(),
            bank,
            stops: StopWatch::new(settings.stop_min_s),
            last: None,
            declared_mass_kg: train.mass_kg,
            is_warm_started: false,
            is_opened: true,
            noise: SpeedNoise::guessed(settings.speed_noise_mps),
            settling: Settling::default(),
            monitor: InnovationMonitor::new(500),
            speeds: SpeedRange::default(),
            moved_s: 0.0,
            was_known: false,
            is_fresh_reset: false,
            generation: 0,
        })
    }

    /// Returns the mass in kg and its standard deviation, as known when force last acted.
    pub fn mass_kg(&self) -> (f64, f64) {
        let inverse = self.moments.inverse_mass;
        let mass_kg = self.inertia.reference_mass_kg / inverse;
        (mass_kg, mass_kg / inverse * self.moments.inverse_mass_variance.sqrt())
    }

    /// Returns the standard deviation of the measured speed in m/s, as learned.
    pub fn speed_noise_mps(&self) -> f64 {
        self.noise.variance().sqrt()
    }

    /// Opens the mass after a stop; a declared mass that changed moves it by as much.
    fn reopen(&mut self, declared_mass_kg: f64) {
        let ratio = declared_mass_kg / self.declared_mass_kg;
        if ratio.is_finite() && ratio > 0.0 && (ratio - 1.0).abs() > DECLARED_CHANGE_MIN {
            self.declared_mass_kg = declared_mass_kg;
            self.moments.inverse_mass /= ratio;
        }
        let relative_std = 0.01 * self.settings.mass_change_std_percent;
        let change = relative_std * self.moments.inverse_mass;
        self.moments.inverse_mass_variance += change * change;
        self.bank.reopen(self.moments.inverse_mass, self.moments.inverse_mass_variance);
        self.is_opened = true;
    }

    /// Takes over the mass that the first sample declares, if it declares another.
    fn begin_with(&mut self, declared_mass_kg: f64) {
        let ratio = declared_mass_kg / self.inertia.reference_mass_kg;
        let is_as_kept = self.is_warm_started && (ratio - 1.0).abs() <= DECLARED_CHANGE_MIN;
        if !(ratio.is_finite() && ratio > 0.0) || is_as_kept {
            return;
        }
        self.declared_mass_kg = declared_mass_kg;
        let std = 0.01 * self.settings.mass_std_percent / ratio;
        self.initial_bank.reopen(1.0 / ratio, std * std);
        self.bank.clone_from(&self.initial_bank);
        self.moments = self.bank.moments();
    }

    fn begin(&mut self, motion: KnownMotion) -> Outcome {
        if std::mem::take(&mut self.is_opened) && motion.gradient_std_permille > 0.0 {
            self.bank.begin_on_map(&motion);
        }
        let noise_variance = self.noise.variance_of_sample(f64::INFINITY);
        self.bank.restart_speed(motion.speed_mps, noise_variance);
        self.monitor.break_here();
        self.last = Some(motion);
        Outcome::Used
    }

    fn advance(&mut self, from: KnownMotion, motion: KnownMotion, step_s: f64) -> Outcome {
        let before_mps = self.bank.best().mean[SPEED];
        self.bank.predict(&from, &motion, step_s);
        let moved_mps = (self.bank.best().mean[SPEED] - before_mps).abs();
        let noise_variance = self.noise.variance_of_sample(moved_mps);
        let measured = self.bank.measure(motion.speed_mps, noise_variance);
        let Some(measured) = measured.ok().filter(|_| self.bank.is_sound()) else {
            self.reset();
            return self.begin(motion);
        };
        let push_mps2 = [&from, &motion].map(|motion| self.inertia.push_mps2(motion));
        self.settling.step(push_mps2[0], push_mps2[1], step_s, noise_variance);
        if measured.is_outlier() {
            // The filters have moved on; only the speed is not believed.
            self.last = Some(motion);
            self.monitor.break_here();
            return Outcome::Rejected(RejectionReason::Outlier);
        }
        self.monitor.push(measured.normalised);
        let filter = self.bank.best();
        let residual_mps = motion.speed_mps - filter.mean[SPEED];
        self.noise.take_residual(residual_mps, filter.covariance[(SPEED, SPEED)], measured.weight);
        self.last = Some(motion);
        self.speeds.push(motion.speed_mps);
        self.moved_s += step_s;
        self.publish(0.5 * (from.force_n + motion.force_n).abs())
    }

    /// Takes the mass over under force, the bias always. Until a force that jumped has settled,
    /// the behaviours speak alone that know of jumps.
    fn publish(&mut self, force_n: f64) -> Outcome {
        let is_settled = self.settling.is_settled();
        let now = if is_settled { self.bank.moments() } else { self.bank.moments_after_a_jump() };
        let weight_kn = TrainModel::weight_kn(self.inertia.reference_mass_kg);
        if force_n >= self.settings.force_min_n_per_kn * weight_kn {
            self.moments = now;
            let is_known = self.is_known();
            self.was_known |= is_known;
            self.is_fresh_reset &= !is_known;
            return Outcome::Updated;
        }
        self.moments.bias_mps2 = now.bias_mps2;
        self.moments.bias_variance = now.bias_variance;
        Outcome::Used
    }

    fn reset(&mut self) {
        self.bank.clone_from(&self.initial_bank);
        self.moments = self.bank.moments();
        self.noise.reset();
        self.is_opened = true;
        self.was_known = false;
        self.is_fresh_reset = true;
        self.generation += 1;
    }

    fn is_known(&self) -> bool {
        let (mass_kg, std_kg) = self.mass_kg();
        std_kg <= 0.01 * self.settings.usable_std_percent * mass_kg
    }

    fn is_ready(&self, input: &InputState) -> bool {
        input.used >= SAMPLES_MIN || self.moved_s >= MOVED_MIN_S
    }

    fn case(&self, input: &InputState) -> StatusInputs {
        let failure = (Status::Invalid, Reason::NumericalFailure);
        StatusInputs {
            fault: self.is_fresh_reset.then_some(failure),
            input: input.doubt,
            is_ready: self.is_ready(input),
            is_known: self.is_known(),
            lacking: if self.was_known { Status::Degraded } else { Status::Unestimated },
            contradiction: self.monitor.contradiction(),
            caveat: Reason::None,
        }
    }
}

impl Estimator for MassKalman {
    fn kind(&self) -> PipelineKind {
        PipelineKind::MassKalman
    }

    fn is_gated(&self) -> bool {
        true
    }

    fn observe(&mut self, sample: &ResolvedSample) {
        if self.stops.is_first() {
            self.begin_with(sample.mass_kg);
        }
        if self.stops.departs(sample.time_ns, sample.segment, sample.speed_mps) {
            self.reopen(sample.mass_kg);
        }
    }

    fn leave_out(&mut self) {
        self.last = None;
    }

    fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        let motion = match KnownMotion::seen(sample, self.settings.speed_min_mps, &mut self.last) {
            Ok(motion) => motion,
            Err(outcome) => return outcome,
        };
        self.noise.rounding.see(motion.speed_mps);
        let last = self.last.filter(|_| sample.step_s > 0.0);
        let step = last.and_then(|last| Some((last, motion.step_from(&last)?)));
        match step {
            Some((last, step_s)) => self.advance(last, motion, step_s),
            None => self.begin(motion),
        }
    }

    fn write(&self, input: &InputState, snapshot: &mut ParameterSnapshot) -> Judgement {
        let (mass_kg, mass_std_kg) = self.mass_kg();
        let (bias_mps2, bias_std) = (self.moments.bias_mps2, self.moments.bias_variance.sqrt());
        // The mass falls as its inverse grows.
        let cross = -self.moments.correlation * mass_std_kg * bias_std;
        write_parameters(
            snapshot,
            [Parameter::Mass, Parameter::AccelerationBias],
            &Vector2::new(mass_kg, bias_mps2),
            &Matrix2::new(mass_std_kg * mass_std_kg, cross, cross, bias_std * bias_std),
        );
        let is_known = self.is_known();
        let is_bias_known = self.is_ready(input);
        snapshot.excited = u32::from(is_known) | (u32::from(is_bias_known) << 1);
        snapshot.missing_manoeuvres = if is_known { 0 } else { Manoeuvre::Accelerate.bit() };
        write_innovations(snapshot, &self.monitor);
        let inertia_kg = self.inertia.inertial_mass_kg(mass_kg);
        snapshot.unexplained_force_n = -bias_mps2 * inertia_kg;
        snapshot.unexplained_force_std_n = bias_std * inertia_kg;
        self.speeds.write(snapshot);
        snapshot.generation = self.generation;
        self.case(input).verdict().into()
    }

    /// Takes up the kept mass, unless the first sample declares another than the train's.
    fn warm_start(&mut self, kept: &KeptEstimate) -> bool {
        let Some((mass_kg, variance)) = kept.moments([Parameter::Mass]) else { return false };
        let inverse = self.inertia.reference_mass_kg / mass_kg[0];
        if !(inverse.is_finite() && inverse > 0.0) {
            return false;
        }
        let relative_variance = variance[(0, 0)] / (mass_kg[0] * mass_kg[0]);
        self.bank.reopen(inverse, relative_variance * inverse * inverse);
        self.moments = self.bank.moments();
        self.is_warm_started = true;
        true
    }
}

/// A force that jumped by a somewhere in a step h leaves up to a h / 2 of the speed open, and a mass
/// wrong by as much over the impulse since. At this impulse over a h that is 5 %, and the speeds
/// have long distinguished a jump from another mass.
const IMPULSE_MIN: f64 = 10.0;

/// The impulse of a force since it last jumped.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settling {
    jump_mps: f64,
    impulse_mps: f64,
}

impl Settling {
    /// Takes in a step in s between two accelerations in m/s² by the force, with the variance in (m/s)² of the measured
    /// speed: a change that leaves a smaller uncertainty than that is no jump.
    pub fn step(&mut self, from_mps2: f64, to_mps2: f64, step_s: f64, noise_variance: f64) {
        let change_mps2 = to_mps2 - from_mps2;
        if jump_variance(change_mps2, step_s) > noise_variance {
            let before_mps = if self.is_settled() { 0.0 } else { self.jump_mps };
            self.jump_mps = before_mps.max(step_s * change_mps2.abs());
            self.impulse_mps = 0.0;
        }
        self.impulse_mps += 0.5 * step_s * (from_mps2 + to_mps2).abs();
    }

    /// Returns whether the uncertainty that a jump left is small against the impulse of the force since.
    pub fn is_settled(&self) -> bool {
        self.impulse_mps >= IMPULSE_MIN * self.jump_mps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_that_jumps_settles_in_ten_steps_and_one_that_only_trembles_is_settled() {
        let mut settling = Settling::default();
        settling.step(0.0, 0.8, 0.2, 1e-6);
        let steps = (1..).find(|_| {
            settling.step(0.8, 0.8, 0.2, 1e-6);
            settling.is_settled()
        });
        assert_eq!(steps, Some(10));
        settling.step(0.8, 0.75, 0.2, 1e-6);
        assert!(settling.is_settled(), "a change of a sixteenth is made up for by its own step");
        settling.step(0.75, 0.0, 0.2, 1.0);
        assert!(settling.is_settled(), "within the noise");
    }
}
