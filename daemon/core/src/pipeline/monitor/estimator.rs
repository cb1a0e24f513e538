//! The residual monitor as a pipeline.

use dynocar_model::force::ResolvedSample;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{Parameter, ParameterSnapshot, PipelineKind, Reason, RejectionReason, Status};
use nalgebra::{Vector1, Vector3};

use super::covariates::{CovariateImpulse, PlaceMemory, RunClock, covariates};
use super::information::{BaseVector, MonitorInformation, usual};
use super::rows::{DesignRow, ParameterVector, Rows, units};
use super::verdict::{MonitorVerdict, ResidualEvidence};
use super::wheel_scale::WheelScale;
use super::{
    BANK, BASE, DAY_WIND, FIRST_ONSET, LOAD, MonitorSettings, ONSETS, Onsets, ReleasedPressure,
    SUSPECTS, suspect_of,
};
use crate::pipeline::judge::{InputState, Judgement, StatusInputs};
use crate::pipeline::momentum::blocks::MomentumBlocks;
use crate::pipeline::momentum::{
    BRAKE_SCALE, MomentumBlock, PARAMETERS as DAVIS, TRACTION_SCALE, UnitSample, regressors,
    unscaling,
};
use crate::pipeline::motion::{STANDING_MPS, SpeedRange, is_same_mass};
use crate::pipeline::output::{write_innovations, write_parameters};
use crate::pipeline::settings::SettingError;
use crate::pipeline::{Estimator, InnovationMonitor, Outcome};

/// Rows before any value is called estimated.
const ROWS_MIN: f64 = 12.0;
/// Innovations that their statistics look back over.
const MONITOR_ROWS: u32 = 150;
/// The same for a search of an effect that no suspect explains: an effect that has ended is soon forgotten.
const CUT_ROWS: u32 = 60;
/// Largest size at which an innovation counts in the search of an effect that no suspect explains: larger ones are
/// outliers.
const CUT: f64 = 3.0;
/// Standard deviations of the wheels' diameter up to which it is usual.
const WHEEL_STDS: f64 = 3.5;
/// Samples over which the time between samples is averaged.
const PERIOD_SAMPLES: f64 = 100.0;
/// Watches the residual between model and measurement.
#[derive(Clone, Debug)]
pub struct ResidualMonitor {
    settings: MonitorSettings,
    declared: Davis,
    /// The declared a, b, c, scaled, as base parameters; the regression estimates the differences from them.
    declared_base: BaseVector,
    base_std: BaseVector,
    kept_per_row: f64,
    clock: RunClock,
    has_stopped: bool,
    /// Mass in kg of the newest sample.
    given_kg: f64,
    /// Middle in kg of tare and full where the mass is anything between them, and no sample says which.
    open_load_kg: Option<f64>,
    places: PlaceMemory,
    pressure: ReleasedPressure,
    wheels: WheelScale,
    period_s: f64,
    blocks: MomentumBlocks,
    impulse: CovariateImpulse,
    rows: Rows,
    onsets: Onsets,
    information: MonitorInformation,
    verdict: MonitorVerdict,
    innovations: InnovationMonitor,
    cut_innovations: InnovationMonitor,
    /// Since when the suspected effect has been suspected.
    suspected_since: Option<(EffectKind, i64)>,
    newest_ns: i64,
    /// The model as it is believed: base parameters about the declared ones, and the suspect's.
    model: ParameterVector,
    known: Davis,
    /// Where and with which momentum the newest block ended.
    last_block: Option<(Option<f64>, f64)>,
    /// The force that nothing explains in N/kN, and its standard deviation.
    unexplained: (f64, f64),
    weight_kn: f64,
    speeds: SpeedRange,
    resets: u64,
}

impl ResidualMonitor {
    /// Returns a monitor of a train.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn new(settings: MonitorSettings, train: &TrainModel) -> Result<Self, SettingError> {
        settings.check_ranges()?;
        let declared = train.resistance;
        let (declared_base, base_std) = usual(&settings, train)?;
        let kept_per_row = 1.0 - settings.data.block_s / (3600.0 * settings.memory_h);
        Ok(ResidualMonitor {
            settings,
            declared,
            declared_base,
            base_std,
            kept_per_row,
            clock: RunClock::default(),
            has_stopped: false,
            given_kg: train.mass_kg,
            open_load_kg: train.load_range().map(|(middle_kg, _)| middle_kg),
            places: PlaceMemory::new(),
            pressure: ReleasedPressure::new(),
            wheels: WheelScale::default(),
            period_s: 0.0,
            blocks: MomentumBlocks::new(settings.data),
            impulse: CovariateImpulse::new(),
            rows: Rows::new(&settings, declared),
            onsets: Onsets::new(),
            information: MonitorInformation::new(&base_std),
            verdict: MonitorVerdict::new(&settings, kept_per_row),
            innovations: InnovationMonitor::new(MONITOR_ROWS),
            cut_innovations: InnovationMonitor::new(CUT_ROWS),
            suspected_since: None,
            newest_ns: i64::MIN,
            model: ParameterVector::zeros(),
            known: declared,
            last_block: None,
            unexplained: (0.0, settings.davis_std_share * declared.w0_n_per_kn(20.0)),
            weight_kn: TrainModel::weight_kn(train.mass_kg),
            speeds: SpeedRange::default(),
            resets: 0,
        })
    }

    /// A run starts: brakes are released, and a brake that dragged has ended.
    fn start_run(&mut self) {
        let dragged = self.verdict.naming.onset();
        (0..ONSETS).for_each(|place| self.retire(FIRST_ONSET + place, dragged == Some(place)));
        self.onsets = Onsets::new();
        for scale in [TRACTION_SCALE, BRAKE_SCALE] {
            self.information.loosen(scale, self.settings.force_run_std);
        }
        if self.open_load_kg.is_none() {
            self.reopen(LOAD);
        }
        self.reopen(DAY_WIND);
        self.places.next_pass();
        self.pressure.restart();
        self.start_leg();
    }

    /// Another mass is given: it is as sure as any.
    fn weigh(&mut self, sample: &ResolvedSample) {
        let before_kg = std::mem::replace(&mut self.given_kg, sample.mass_kg);
        if !is_same_mass(before_kg, sample.mass_kg) {
            self.reopen(LOAD);
        }
    }

    /// The train has stopped and moves again: effects that may change at stops are unknown anew.
    fn start_leg(&mut self) {
        if self.open_load_kg.is_some() {
            self.reopen(LOAD);
        }
        self.onsets.start_leg();
        self.verdict.start_leg();
        for place in (0..SUSPECTS).filter(|&place| BANK[place].changes_at_stops) {
            let parameter = BASE + place;
            self.verdict.hold_over_stop(parameter);
            self.retire(parameter, self.verdict.naming.is_clearly(parameter));
        }
    }

    /// Widens a parameter of the base model, which may differ from now on.
    fn reopen(&mut self, parameter: usize) {
        self.retire(parameter, true);
        self.verdict.clear(parameter);
    }

    /// Returns how far a parameter may be from nothing; of the base model's a named one further than usual.
    fn prior_std(&self, parameter: usize) -> f64 {
        let prior_std = suspect_of(parameter).prior_std;
        match self.base_std.get(parameter) {
            None => prior_std,
            Some(&usual) if self.verdict.naming.parameter() != Some(parameter) => usual,
            Some(&usual) => usual.hypot(prior_std),
        }
    }

    fn retire(&mut self, parameter: usize, is_real: bool) {
        let prior_std = is_real.then(|| self.prior_std(parameter));
        self.information.retire(parameter, prior_std);
        self.rows.clear(parameter);
        if parameter >= FIRST_ONSET {
            self.verdict.clear(parameter);
        }
        self.model[parameter] = 0.0;
    }

    fn take_block(&mut self, block: &MomentumBlock, sample: &ResolvedSample) -> bool {
        let impulse = self.impulse.close();
        if let Some(place) = self.onsets.open(self.verdict.naming.onset()) {
            self.retire(FIRST_ONSET + place, false);
        }
        self.onsets.advance();
        let units = units(block, &impulse, &self.onsets);
        self.remember_place(block, &units, sample);
        let (model, declared) = (&self.model, &self.declared_base);
        let predicted = |features: &ParameterVector| {
            features.dot(model) + features.fixed_rows::<BASE>(0).dot(declared)
        };
        let Some(mut row) = self.rows.push(block, &units, predicted) else {
            self.innovations.break_here();
            return false;
        };
        row.observed -= row.features.fixed_rows::<BASE>(0).dot(declared);
        let innovation = row.observed - row.features.dot(model);
        if self.information.count >= ROWS_MIN {
            self.innovations.push(innovation);
            self.cut_innovations.push(innovation.clamp(-CUT, CUT));
        }
        self.watch_end(&row, innovation);
        self.information.push(&row, self.kept_per_row);
        self.wheels.forget(self.kept_per_row);
        self.speeds.push(block.speed_mps);
        let resistance = self.declared.w0_n_per_kn(block.speed_mps) * block.impulse[1];
        self.verdict.note_forces(&units, resistance);
        let passes = sample.position_m.map(|m| self.places.earlier(m, sample.direction).passes);
        self.judge(&(units / block.impulse[1]), block.speed_mps, passes == Some(0.0));
        true
    }

    /// Whether the cause of the suspicion has ended, by a row.
    fn watch_end(&mut self, row: &DesignRow, innovation: f64) {
        let Some(parameter) = self.verdict.naming.parameter() else { return };
        let without = innovation + row.features[parameter] * self.model[parameter];
        let weight = row.weight;
        if self.verdict.has_ended(weight * innovation.powi(2), weight * without.powi(2)) {
            self.retire(parameter, true);
            self.verdict.clear(parameter);
        }
    }

    /// Notes the residual force of the base model at this place, unless another suspect explains it.
    fn remember_place(
        &mut self,
        block: &MomentumBlock,
        units: &ParameterVector,
        sample: &ResolvedSample,
    ) {
        let before = self.last_block.replace((sample.position_m, block.momentum));
        let has_other_suspect = self.verdict.naming.is_no_place();
        if block.is_first || has_other_suspect {
            return;
        }
        // The row is centred where the block before ended.
        let Some((Some(position_m), momentum)) = before else { return };
        let base = self.declared_base + self.model.fixed_rows::<BASE>(0);
        let known = units.fixed_rows::<BASE>(0).dot(&base);
        let unexplained = block.impulse[0] - known - (block.momentum - momentum);
        self.places.push(position_m, sample.direction, unexplained / block.impulse[1]);
    }

    fn judge(&mut self, units: &ParameterVector, speed_mps: f64, is_new_place: bool) {
        let Ok(base) = self.information.base() else { return self.reset() };
        self.verdict.judge(&ResidualEvidence {
            information: &self.information,
            base: &base,
            onsets: &self.onsets,
            is_pressure_raised: self.pressure.is_raised(),
            is_new_place,
            wheel: self.wheels.evidence(WHEEL_STDS * self.settings.wheel_std).1,
            period_s: self.period_s,
            cut_innovations: &self.cut_innovations,
        });
        self.note_since();
        let suspect = self.verdict.naming.parameter();
        let suspect_given = suspect.filter(|&parameter| parameter >= BASE);
        let believed = base.believed(suspect_given.map(|it| (it, suspect_of(it).prior_std)));
        self.model = believed.values;
        let davis = (self.declared_base + self.model.fixed_rows::<BASE>(0))
            .fixed_rows::<DAVIS>(0)
            .component_mul(&unscaling());
        self.known = Davis { a: davis[0], b: davis[1], c: davis[2] };

        let (known, taken, variance) = self.rows.disturbance();
        let mut weights = -taken;
        let mut of_davis = weights.fixed_rows_mut::<DAVIS>(0);
        of_davis -= Vector3::from(regressors(speed_mps));
        let mut value =
            known - taken.dot(&self.model) - taken.fixed_rows::<BASE>(0).dot(&self.declared_base);
        if let Some(parameter) = suspect {
            value += units[parameter] * self.model[parameter];
            weights[parameter] += units[parameter];
        }
        let total = self.verdict.scale * (variance + believed.variance_of(&weights));
        self.unexplained = (value, total.max(0.0).sqrt());
    }

    fn note_since(&mut self) {
        let effect = self.verdict.naming.named().map(|named| named.effect);
        if effect != self.suspected_since.map(|(effect, _)| effect) {
            self.suspected_since = effect.map(|effect| (effect, self.newest_ns));
        }
    }

    /// Starts anew after a numerical failure.
    fn reset(&mut self) {
        self.information = MonitorInformation::new(&self.base_std);
        self.rows = Rows::new(&self.settings, self.declared);
        self.verdict = MonitorVerdict::new(&self.settings, self.kept_per_row);
        self.onsets = Onsets::new();
        self.model = ParameterVector::zeros();
        self.known = self.declared;
        self.blocks.break_chain();
        self.resets += 1;
    }
}

impl Estimator for ResidualMonitor {
    fn kind(&self) -> PipelineKind {
        PipelineKind::ResidualMonitor
    }

    fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        self.open_load_kg = self.open_load_kg.filter(|_| !sample.is_mass_measured);
        let sample = &self.open_load_kg.map_or(*sample, |kg| sample.with_mass(kg));
        self.weight_kn = sample.weight_kn;
        self.newest_ns = sample.time_ns;
        if sample.step_s > 0.0 {
            self.period_s += (sample.step_s - self.period_s) / PERIOD_SAMPLES;
        }
        if self.clock.push(sample.time_ns) {
            self.start_run();
        }
        self.weigh(sample);
        self.pressure.push(sample);
        self.has_stopped |= sample.speed_mps <= STANDING_MPS;
        let unit = match UnitSample::from_sample(sample) {
            Ok(unit) => unit,
            Err(reason) => {
                if reason == RejectionReason::WheelSlide {
                    self.blocks.break_chain();
                }
                return Outcome::Rejected(reason);
            }
        };
        if unit.speed_mps < self.settings.data.speed_min_mps {
            self.blocks.break_chain();
            self.wheels.push(sample);
            return Outcome::Used;
        }
        if std::mem::take(&mut self.has_stopped) {
            self.start_leg();
        }
        let closed = match self.blocks.push(&unit, &self.known) {
            Ok(closed) => closed,
            Err(reason) => return Outcome::Rejected(reason),
        };
        self.wheels.push(sample);
        let Some(chain_start_ns) = self.blocks.chain_start_ns() else { return Outcome::Used };
        let values = covariates(sample, &unit, &self.declared, &self.places);
        self.impulse.push(chain_start_ns, unit.time_ns, &values);
        match closed {
            Some(block) if self.take_block(&block, sample) => Outcome::Updated,
            _ => Outcome::Used,
        }
    }

    fn write(&self, _input: &InputState, snapshot: &mut ParameterSnapshot) -> Judgement {
        let force_n = self.unexplained.0 * self.weight_kn;
        let std_n = self.unexplained.1 * self.weight_kn;
        let (values, covariance) = (Vector1::new(force_n), Vector1::new(std_n * std_n));
        write_parameters(snapshot, [Parameter::UnexplainedForce], &values, &covariance);
        let named = self.verdict.naming.named();
        let has_rows = self.information.count >= ROWS_MIN;
        let case = StatusInputs {
            fault: None,
            input: None,
            is_ready: has_rows,
            is_known: true,
            lacking: Status::Unestimated,
            contradiction: named.map(|_| Reason::InnovationsNotWhite),
            caveat: Reason::None,
        };
        write_innovations(snapshot, &self.innovations);
        snapshot.generation = self.resets;
        snapshot.excited = u32::from(has_rows);
        snapshot.unexplained_force_n = force_n;
        snapshot.unexplained_force_std_n = std_n;
        snapshot.suspected_effect = named.map_or(EffectKind::None, |named| named.effect) as u32;
        snapshot.suspicion_evidence = named.map_or(0.0, |named| named.evidence);
        snapshot.suspected_alternatives = named.map_or(0, |named| named.alternatives);
        let since_ns = self.suspected_since.filter(|_| named.is_some()).map(|(_, ns)| ns);
        let age_ns = since_ns.map_or(0, |ns| self.newest_ns.saturating_sub(ns));
        snapshot.suspicion_age_s = u32::try_from(age_ns / 1_000_000_000).unwrap_or(0);
        self.speeds.write(snapshot);
        case.verdict().into()
    }
}
