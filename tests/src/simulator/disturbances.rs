//! Changes of the physics and the sensors of one run by the effects.

use dynocar_model::terms::{
    Resistance, adhesion, ambient, bearings, brake, curve, place, tunnel, wind,
};
use dynocar_model::track::{GradientError, LinearProfile, StepProfile};

use super::common_deviations::CommonDeviations;
use super::effects::{TrueEffect, TrueMassSection, TrueRunWindow};
use super::line_maker::SimulatedLine;
use super::random::{SimulatorRandom, Stream};
use super::run_maker::RunPlan;
use super::settings::SimulatorSettings;
use super::train_maker::TrueTrain;
use super::unlisted::{Around, Unlisted};

/// A cap on the achieved brake force.
#[derive(Clone, Debug, PartialEq)]
pub struct AdhesionCap {
    /// Greatest brake force over weight.
    pub adhesion: f64,
    /// (from, to) in m of the train's centre; everywhere when empty.
    pub intervals_m: Vec<(f64, f64)>,
}

/// Everything undeclared in one run; [`Disturbances::none`] leaves the declared model true.
#[derive(Clone, Debug, PartialEq)]
pub struct Disturbances {
    /// +1 while the chainage grows in the direction of travel, -1 while it falls.
    pub direction: f64,
    /// The true gradient in ‰ by chainage.
    pub gradient: StepProfile,
    /// How far in m the true gradient lies towards +chainage of the map's.
    pub gradient_shift_m: f64,
    /// Error of the map's gradient in ‰ by chainage.
    pub gradient_error: Option<GradientError>,
    /// Basic resistance of this run over the train's ordinary one.
    pub resistance_factor: f64,
    /// Reading of the force sensors of this run over the reported forces.
    pub force_reading_factor: f64,
    /// True over declared mass of this run, from the start on and then from each stop in m.
    pub loads: Vec<(f64, f64)>,
    /// k of the curve resistance k/R in N/kN m.
    pub curve_constant_n_per_kn_m: f64,
    /// Factor on c v² in tunnels.
    pub tunnel_c_factor: f64,
    /// Mean headwind in m/s along the travel.
    pub headwind_mps: f64,
    /// Spread of the gusts in m/s.
    pub gust_sd_mps: f64,
    /// Dragging brake in N.
    pub drag_force_n: f64,
    /// When it drags.
    pub drag_windows: Vec<TrueRunWindow>,
    /// Cylinder pressure in Pa that remains while it drags.
    pub residual_pressure_pa: f64,
    /// Measured over true speed.
    pub speed_scale: f64,
    /// Other masses by place.
    pub mass_sections: Vec<TrueMassSection>,
    /// Other masses by time.
    pub mass_windows: Vec<(TrueRunWindow, f64)>,
    /// Reported over true traction force.
    pub traction_gain: f64,
    /// Reported over true brake force.
    pub brake_gain: f64,
    /// Dead time and lag in s between reported and true brake force alone.
    pub brake_late_s: [f64; 2],
    /// Dead time in s between reported and true forces.
    pub delay_s: f64,
    /// Lag in s between reported and true forces.
    pub lag_s: f64,
    /// Dead time in s between true and measured speed.
    pub speed_delay_s: f64,
    /// Lag in s between true and measured speed.
    pub speed_lag_s: f64,
    /// True rotating-mass factor.
    pub rotating_mass_factor: f64,
    /// Extra a in N/kN at the start and its time constant in s.
    pub cold_bearings: Option<(f64, f64)>,
    /// Relative change of basic resistance per K and the reference in K.
    pub ambient: Option<(f64, f64)>,
    /// Extra resistance in N/kN by chainage.
    pub local: Option<StepProfile>,
    /// A cap on the achieved brake force.
    pub adhesion: Option<AdhesionCap>,
    /// A resistance outside every library.
    pub unlisted: Option<Unlisted>,
}

/// State at an instant on which the disturbances act.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisturbanceInput {
    /// Time in s from the run's first sample, when bearings are cold.
    pub time_s: f64,
    /// Mean of 1/R along the train in 1/m.
    pub curvature_per_m: f64,
    /// Share of the train inside tunnels.
    pub tunnel_share: f64,
    /// Headwind in m/s along the travel.
    pub headwind_mps: f64,
    /// Outside temperature in °C.
    pub degc: Option<f64>,
    /// Resistance in N/kN of places.
    pub local_n_per_kn: f64,
}

impl Disturbances {
    /// Returns nothing undeclared.
    ///
    /// # Panics
    ///
    /// When the line has no gradient, which generated lines have.
    pub fn none(train: &TrueTrain, line: &SimulatedLine) -> Self {
        Disturbances {
            direction: 1.0,
            gradient: line.track.gradient().expect("a generated line has a gradient").clone(),
            gradient_shift_m: 0.0,
            gradient_error: None,
            resistance_factor: 1.0,
            force_reading_factor: 1.0,
            loads: Vec::new(),
            curve_constant_n_per_kn_m: train.declared.curve_constant_n_per_kn_m,
            tunnel_c_factor: 1.0,
            headwind_mps: 0.0,
            gust_sd_mps: 0.0,
            drag_force_n: 0.0,
            drag_windows: Vec::new(),
            residual_pressure_pa: 0.0,
            speed_scale: 1.0,
            mass_sections: Vec::new(),
            mass_windows: Vec::new(),
            traction_gain: 1.0,
            brake_gain: 1.0,
            brake_late_s: [0.0; 2],
            delay_s: 0.0,
            lag_s: 0.0,
            speed_delay_s: 0.0,
            speed_lag_s: 0.0,
            rotating_mass_factor: train.declared.rotating_mass_factor,
            cold_bearings: None,
            ambient: None,
            local: None,
            adhesion: None,
            unlisted: None,
        }
    }

    /// Returns a dataset's effects in one run of it.
    pub fn new(
        effects: &[TrueEffect],
        train: &TrueTrain,
        line: &SimulatedLine,
        plan: &RunPlan,
        settings: &SimulatorSettings,
    ) -> Self {
        let mut disturbances = Disturbances::none(train, line);
        disturbances.vary(plan, settings);
        disturbances.deviate(train, line, plan, settings);
        for effect in effects {
            disturbances.apply(effect, plan, settings.seed);
        }
        disturbances
    }

    /// Small differences that no effect describes.
    fn vary(&mut self, plan: &RunPlan, settings: &SimulatorSettings) {
        let deviations = &settings.deviations;
        let mut of_run = SimulatorRandom::new(settings.seed, Stream::Variation(plan.number));
        self.resistance_factor = 1.0 + deviations.run_resistance_share * of_run.gaussian();
        self.force_reading_factor = 1.0 + deviations.run_force_share * of_run.gaussian();
        let mass = 1.0 + deviations.mass_share * of_run.gaussian();
        let stops_m = std::iter::once(plan.start_m).chain(plan.stops_m.iter().copied());
        self.loads = stops_m
            .map(|stop_m| (stop_m, mass * (1.0 + deviations.load_share * of_run.gaussian())))
            .collect();
        self.headwind_mps = deviations.day_wind_mps
            * SimulatorRandom::new(settings.seed, Stream::Day(plan.number)).gaussian();
        self.gust_sd_mps = deviations.gust_mps;
        let mut survey = SimulatorRandom::new(settings.seed, Stream::Survey);
        let surveyed: Vec<(f64, f64)> = self
            .gradient
            .entries()
            .map(|(m, permille)| (m, permille + deviations.survey_permille * survey.gaussian()))
            .collect();
        self.gradient = StepProfile::new(&surveyed).expect("the chainages are the map's");
    }

    /// Adds the deviations that all runs share.
    fn deviate(
        &mut self,
        train: &TrueTrain,
        line: &SimulatedLine,
        plan: &RunPlan,
        settings: &SimulatorSettings,
    ) {
        let common = CommonDeviations::draw(&settings.deviations, settings.seed);
        self.direction = plan.direction;
        self.curve_constant_n_per_kn_m *= common.curve_constant;
        [self.traction_gain, self.brake_gain] = common.force_gains;
        self.delay_s = common.force_late_s;
        self.speed_scale = common.speed_scale;
        self.rotating_mass_factor += common.rotating_mass;
        let (share, tau_s) = common.warming;
        if share > 0.0 {
            self.cold_bearings = Some((share * train.ordinary_w0_n_per_kn(), tau_s));
        }
        let profile = common.map_error(line.length_m);
        if !profile.is_empty() {
            let error = LinearProfile::new(profile.clone()).expect("ascending chainages");
            self.gradient = with_error(&self.gradient, &profile, &error);
        }
        if common.vertical_curve_m > 0.0 {
            self.gradient = rounded_steps(&self.gradient, common.vertical_curve_m);
        }
    }

    fn apply(&mut self, effect: &TrueEffect, plan: &RunPlan, seed: u64) {
        let of_run = |window: &&TrueRunWindow| window.run == plan.number;
        let in_runs = |runs: &[usize]| runs.is_empty() || runs.contains(&plan.number);
        match effect {
            TrueEffect::TunnelDrag { c_factor } => self.tunnel_c_factor = *c_factor,
            TrueEffect::CurveResistance { k_n_per_kn_m } => {
                self.curve_constant_n_per_kn_m = *k_n_per_kn_m;
            }
            TrueEffect::Wind { wind_plus_mps, run_sd_mps, gust_sd_mps } => {
                let of_the_day = SimulatorRandom::new(seed, Stream::Gusts(plan.number)).gaussian();
                self.headwind_mps += plan.direction * wind_plus_mps + run_sd_mps * of_the_day;
                self.gust_sd_mps = self.gust_sd_mps.max(*gust_sd_mps);
            }
            TrueEffect::DraggingBrake { force_n, windows, residual_pressure_pa } => {
                self.drag_force_n = *force_n;
                self.drag_windows = windows.iter().filter(of_run).copied().collect();
                self.residual_pressure_pa = *residual_pressure_pa;
            }
            TrueEffect::WheelDiameter { speed_scale } => self.speed_scale = *speed_scale,
            TrueEffect::GradientShift { shift_m } => {
                let moved: Vec<(f64, f64)> =
                    self.gradient.entries().map(|(m, permille)| (m + shift_m, permille)).collect();
                self.gradient = StepProfile::new(&moved).expect("a moved profile keeps its order");
                self.gradient_shift_m = *shift_m;
            }
            TrueEffect::GradientError { profile } => {
                let error = LinearProfile::new(profile.clone()).expect("ascending chainages");
                self.gradient = with_error(&self.gradient, profile, &error);
                self.gradient_error = Some(GradientError { profile: error, falling: None });
            }
            TrueEffect::MassChangeSections(sections) => {
                let of_direction =
                    sections.iter().filter(|section| section.direction == plan.direction);
                self.mass_sections = of_direction.copied().collect();
            }
            TrueEffect::MassChangeWindows(windows) => {
                let of_run = windows.iter().filter(|(window, _)| window.run == plan.number);
                self.mass_windows = of_run.copied().collect();
            }
            TrueEffect::TractionGain { gain } => self.traction_gain = *gain,
            TrueEffect::BrakeGain { gain } => self.brake_gain = *gain,
            TrueEffect::BrakeDelay { delay_s, lag_s } => self.brake_late_s = [*delay_s, *lag_s],
            TrueEffect::ActuatorDelay { delay_s, lag_s } => {
                (self.delay_s, self.lag_s) = (*delay_s, *lag_s);
            }
            TrueEffect::SpeedDelay { delay_s, lag_s } => {
                (self.speed_delay_s, self.speed_lag_s) = (*delay_s, *lag_s);
            }
            TrueEffect::RotatingMass { rotating_mass_factor } => {
                self.rotating_mass_factor = *rotating_mass_factor;
            }
            TrueEffect::BearingTemperature { delta_a_n_per_kn, tau_s } => {
                self.cold_bearings = Some((*delta_a_n_per_kn, *tau_s));
            }
            TrueEffect::AmbientTemperature { w0_per_k, reference_k } => {
                self.ambient = Some((*w0_per_k, *reference_k));
            }
            TrueEffect::LocalResistance { extra_n_per_kn, intervals_m, runs } => {
                self.local = in_runs(runs).then(|| interval_profile(intervals_m, *extra_n_per_kn));
            }
            TrueEffect::LowAdhesion { adhesion, intervals_m, runs } => {
                let cap = AdhesionCap { adhesion: *adhesion, intervals_m: intervals_m.clone() };
                self.adhesion = in_runs(runs).then_some(cap);
            }
            TrueEffect::Unlisted(unlisted) => self.unlisted = Some(*unlisted),
        }
    }

    /// Returns the force that no library holds, in N/kN.
    pub fn unlisted_n_per_kn(&self, speed_mps: f64, time_s: f64, degc: Option<f64>) -> f64 {
        let around = Around { speed_mps, time_s, degc: degc.unwrap_or(0.0) };
        self.unlisted.map_or(0.0, |unlisted| unlisted.resistance_n_per_kn(around))
    }

    /// Returns the resistance at an instant by the laws of the terms, including basic and curve resistance.
    pub fn resistance(&self, seen: DisturbanceInput) -> Resistance {
        let mut resistance = Resistance::BASIC;
        let share = Some(seen.tunnel_share);
        curve::act(self.curve_constant_n_per_kn_m, Some(seen.curvature_per_m), &mut resistance);
        tunnel::enter(share, &mut resistance);
        tunnel::act_by_factor(self.tunnel_c_factor, share, &mut resistance);
        wind::act(seen.headwind_mps, 1.0, &mut resistance);
        place::act(seen.local_n_per_kn, &mut resistance);
        if let Some((delta_a, tau_s)) = self.cold_bearings {
            bearings::act(delta_a, tau_s, seen.time_s, &mut resistance);
        }
        if let Some((w0_per_k, reference_k)) = self.ambient {
            ambient::act(w0_per_k, reference_k, seen.degc, &mut resistance);
        }
        resistance
    }

    /// True over declared mass at a time in s from the start and a chainage in m.
    pub fn mass_factor(&self, time_s: f64, centre_m: f64) -> f64 {
        let is_behind = |(stop_m, _): &&(f64, f64)| self.direction * (centre_m - stop_m) > 0.0;
        let last = self.loads.iter().take_while(is_behind).last().or(self.loads.first());
        last.map_or(1.0, |(_, load)| *load) * self.effect_mass_factor(time_s, centre_m)
    }

    /// Returns the part of it that is an undeclared effect.
    pub fn effect_mass_factor(&self, time_s: f64, centre_m: f64) -> f64 {
        let by_time = self
            .mass_windows
            .iter()
            .find(|(window, _)| (window.start_s..window.end_s).contains(&time_s))
            .map(|(_, factor)| *factor);
        let by_place = || {
            let sections = self.mass_sections.iter();
            let around =
                |section: &&TrueMassSection| (section.from_m..section.to_m).contains(&centre_m);
            sections.clone().find(around).map(|section| section.mass_factor)
        };
        by_time.or_else(by_place).unwrap_or(1.0)
    }

    /// Returns the force in N of a dragging brake at a time in s from the start; it builds up over 10 s.
    pub fn drag_n(&self, time_s: f64) -> f64 {
        let share = self
            .drag_windows
            .iter()
            .filter(|window| (window.start_s..=window.end_s).contains(&time_s))
            .map(|window| brake::build_up(time_s - window.start_s))
            .fold(0.0, f64::max);
        share * self.drag_force_n
    }
}

impl AdhesionCap {
    /// Returns the brake force in N that the rail carries at a chainage in m.
    pub fn carried_n(&self, brake_n: f64, weight_n: f64, centre_m: f64) -> f64 {
        let is_inside = self.intervals_m.is_empty()
            || self.intervals_m.iter().any(|&(from_m, to_m)| (from_m..=to_m).contains(&centre_m));
        if is_inside { adhesion::carried_n(brake_n, self.adhesion, weight_n) } else { brake_n }
    }
}

/// Returns a step profile with an error added, in steps as fine as the error is given.
fn with_error(
    map: &StepProfile,
    error_entries: &[(f64, f64)],
    error: &LinearProfile,
) -> StepProfile {
    let mut starts: Vec<f64> =
        map.entries().map(|(m, _)| m).chain(error_entries.iter().map(|(m, _)| *m)).collect();
    starts.sort_by(f64::total_cmp);
    starts.dedup();
    let middle = |k: usize| 0.5 * (starts[k] + starts.get(k + 1).unwrap_or(&starts[k]));
    let entries: Vec<(f64, f64)> = (0..starts.len())
        .map(|k| (starts[k], map.value_at(starts[k]) + error.at(middle(k))))
        .collect();
    StepProfile::new(&entries).expect("sorted chainages")
}

/// Returns a step profile whose steps are rounded over a length in m, in small steps.
fn rounded_steps(profile: &StepProfile, length_m: f64) -> StepProfile {
    const PIECE_M: f64 = 10.0;
    let entries: Vec<(f64, f64)> = profile.entries().collect();
    let mut starts = vec![entries[0].0];
    for (start_m, _) in &entries[1..] {
        let pieces = (length_m / PIECE_M).ceil();
        let at = |k: f64| start_m + length_m * (k / pieces - 0.5);
        starts.extend((0..=pieces as usize).map(|k| at(k as f64)));
    }
    starts.retain(|&m| m >= entries[0].0);
    starts.sort_by(f64::total_cmp);
    starts.dedup();
    let middle = |k: usize| 0.5 * (starts[k] + starts.get(k + 1).unwrap_or(&starts[k]));
    let rounded = (0..starts.len()).map(|k| (starts[k], profile.mean_around(middle(k), length_m)));
    StepProfile::new(&rounded.collect::<Vec<_>>()).expect("sorted chainages")
}

/// Returns a profile of `value` within ordered intervals and zero elsewhere.
pub(super) fn interval_profile(intervals_m: &[(f64, f64)], value: f64) -> StepProfile {
    let mut entries = vec![(f64::MIN / 4.0, 0.0)];
    for &(from_m, to_m) in intervals_m {
        entries.extend([(from_m, value), (to_m, 0.0)]);
    }
    entries[0].0 = entries.get(1).map_or(0.0, |first| first.0 - 1.0);
    StepProfile::new(&entries).expect("intervals are ordered and apart")
}
