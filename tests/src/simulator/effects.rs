//! The undeclared effects that a dataset may have.

use dynocar_shared::vocabulary::EffectKind;
use serde_json::{Map, Value, json};

use super::run_file::run_file;
use super::unlisted::Unlisted;

/// An interval of time in one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunWindow {
    /// Number of the run, from 0.
    pub run: usize,
    /// Start in s from the run's first sample.
    pub start_s: f64,
    /// End in s from the run's first sample.
    pub end_s: f64,
}

/// Another mass between two places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassSection {
    /// Lower chainage in m.
    pub from_m: f64,
    /// Upper chainage in m.
    pub to_m: f64,
    /// Direction of travel in which it holds.
    pub direction: f64,
    /// True over declared mass.
    pub mass_factor: f64,
}

/// Something true of the train, the line or the sensors that nobody declares; SI units.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// The aerodynamic term of the part of the train in a tunnel is `c_factor` times as large.
    TunnelDrag {
        /// Factor on c v².
        c_factor: f64,
    },
    /// Curve resistance k/R with another k than the declared one.
    CurveResistance {
        /// Total k in N/kN m.
        k_n_per_kn_m: f64,
    },
    /// Wind along the line; trains in tunnels do not feel it.
    Wind {
        /// Headwind in m/s for direction +1.
        wind_plus_mps: f64,
        /// Spread in m/s of the mean wind from run to run.
        run_sd_mps: f64,
        /// Spread in m/s of the gusts, which last about 20 s.
        gust_sd_mps: f64,
    },
    /// A brake that does not release, while the train moves.
    DraggingBrake {
        /// Force in N.
        force_n: f64,
        /// When; the force builds up over 10 s.
        windows: Vec<RunWindow>,
        /// Cylinder pressure in Pa that remains, where it shows.
        residual_pressure_pa: f64,
    },
    /// Wheels of another diameter than declared: speed and odometer are scaled.
    WheelDiameter {
        /// Measured over true speed.
        speed_scale: f64,
    },
    /// The gradient lies elsewhere than the map says.
    GradientShift {
        /// True profile = map moved by this many m towards +chainage.
        shift_m: f64,
    },
    /// The gradient is wrong by a smooth function of the chainage.
    GradientError {
        /// (chainage in m, ‰ that the map lacks), linear between.
        profile: Vec<(f64, f64)>,
    },
    /// Another mass between certain places.
    MassChangeSections(Vec<MassSection>),
    /// Another mass in certain intervals of time, with true over declared mass.
    MassChangeWindows(Vec<(RunWindow, f64)>),
    /// The reported traction force is not the true one.
    TractionGain {
        /// Reported over true force.
        gain: f64,
    },
    /// The reported brake force is not the true one.
    BrakeGain {
        /// Reported over true force.
        gain: f64,
    },
    /// The brake acts later than reported, traction does not.
    BrakeDelay {
        /// Dead time in s.
        delay_s: f64,
        /// First-order lag in s after it.
        lag_s: f64,
    },
    /// Forces act later than reported.
    ActuatorDelay {
        /// Dead time in s.
        delay_s: f64,
        /// First-order lag in s after it.
        lag_s: f64,
    },
    /// The measured speed is late; the odometer is not.
    SpeedDelay {
        /// Dead time in s.
        delay_s: f64,
        /// First-order lag in s after it.
        lag_s: f64,
    },
    /// Another rotating mass than declared.
    RotatingMass {
        /// True gamma.
        rotating_mass_factor: f64,
    },
    /// Cold bearings that warm up from the start of each run.
    BearingTemperature {
        /// Extra a in N/kN at the start.
        delta_a_n_per_kn: f64,
        /// Time constant in s.
        tau_s: f64,
    },
    /// Basic resistance that follows the outside temperature.
    AmbientTemperature {
        /// Relative change per kelvin.
        w0_per_k: f64,
        /// Temperature in K at which the resistance is the nominal one.
        reference_k: f64,
    },
    /// Extra resistance at certain places, in proportion to the part of the train there.
    LocalResistance {
        /// Extra resistance in N/kN.
        extra_n_per_kn: f64,
        /// (from, to) in m.
        intervals_m: Vec<(f64, f64)>,
        /// Numbers of the runs that feel it; all when empty.
        runs: Vec<usize>,
    },
    /// Rails that do not carry the reported brake force.
    LowAdhesion {
        /// Greatest brake force over weight.
        adhesion: f64,
        /// (from, to) in m of the train's centre; everywhere when empty.
        intervals_m: Vec<(f64, f64)>,
        /// Numbers of the runs that feel it; all when empty.
        runs: Vec<usize>,
    },
    /// A resistance by a law that no library holds.
    Unlisted(Unlisted),
}

impl Effect {
    /// The kind by which `dynocar explain` should name it.
    pub fn kind(&self) -> EffectKind {
        match self {
            Effect::TunnelDrag { .. } => EffectKind::TunnelDrag,
            Effect::CurveResistance { .. } => EffectKind::CurveResistance,
            Effect::Wind { .. } => EffectKind::Wind,
            Effect::DraggingBrake { .. } => EffectKind::DraggingBrake,
            Effect::WheelDiameter { .. } => EffectKind::WheelDiameter,
            Effect::GradientShift { .. } => EffectKind::GradientShift,
            Effect::GradientError { .. } => EffectKind::GradientError,
            Effect::MassChangeSections(_) | Effect::MassChangeWindows(_) => EffectKind::MassChange,
            Effect::TractionGain { .. } => EffectKind::TractionGain,
            Effect::BrakeGain { .. } => EffectKind::BrakeGain,
            Effect::BrakeDelay { .. } => EffectKind::BrakeDelay,
            Effect::ActuatorDelay { .. } => EffectKind::ActuatorDelay,
            Effect::SpeedDelay { .. } => EffectKind::SpeedDelay,
            Effect::RotatingMass { .. } => EffectKind::RotatingMass,
            Effect::BearingTemperature { .. } => EffectKind::BearingTemperature,
            Effect::AmbientTemperature { .. } => EffectKind::AmbientTemperature,
            Effect::LocalResistance { .. } => EffectKind::LocalResistance,
            Effect::LowAdhesion { .. } => EffectKind::LowAdhesion,
            Effect::Unlisted(_) => EffectKind::Unknown,
        }
    }

    /// The same with windows that end with their runs, given each run's length in s.
    #[must_use]
    pub fn ended_with_runs(mut self, lengths_s: &[f64]) -> Self {
        let end = |window: &mut RunWindow| window.end_s = window.end_s.min(lengths_s[window.run]);
        match &mut self {
            Effect::DraggingBrake { windows, .. } => windows.iter_mut().for_each(end),
            Effect::MassChangeWindows(windows) => {
                windows.iter_mut().for_each(|(window, _)| end(window));
            }
            _ => {}
        }
        self
    }

    /// Parameters by the names that `dynocar explain --json` uses; times count from
    /// `time_offset_s`, the time of a run's first sample.
    pub fn parameters(&self, time_offset_s: f64) -> Value {
        match self {
            Effect::TunnelDrag { c_factor } => json!({ "c_factor": c_factor }),
            Effect::CurveResistance { k_n_per_kn_m } => json!({ "k_n_per_kn_m": k_n_per_kn_m }),
            Effect::Wind { wind_plus_mps, .. } => json!({ "wind_plus_mps": wind_plus_mps }),
            Effect::DraggingBrake { force_n, .. } => json!({ "force_n": force_n }),
            Effect::WheelDiameter { speed_scale } => json!({ "speed_scale": speed_scale }),
            Effect::GradientShift { shift_m } => json!({ "shift_m": shift_m }),
            Effect::GradientError { profile } => json!({ "profile": profile }),
            Effect::MassChangeSections(sections) => json!({
                "sections": sections.iter().map(|section| json!({
                    "from_m": section.from_m,
                    "to_m": section.to_m,
                    "direction": section.direction,
                    "mass_factor": section.mass_factor,
                })).collect::<Vec<_>>()
            }),
            Effect::MassChangeWindows(windows) => json!({
                "windows": windows.iter().map(|(window, mass_factor)| {
                    let mut entry = window_json(window, time_offset_s);
                    entry.insert("mass_factor".into(), json!(mass_factor));
                    Value::Object(entry)
                }).collect::<Vec<_>>()
            }),
            Effect::TractionGain { gain } | Effect::BrakeGain { gain } => json!({ "gain": gain }),
            Effect::ActuatorDelay { delay_s, lag_s }
            | Effect::BrakeDelay { delay_s, lag_s }
            | Effect::SpeedDelay { delay_s, lag_s } => {
                json!({ "delay_s": delay_s, "lag_s": lag_s })
            }
            Effect::RotatingMass { rotating_mass_factor } => {
                json!({ "rotating_mass_factor": rotating_mass_factor })
            }
            Effect::BearingTemperature { delta_a_n_per_kn, tau_s } => {
                json!({ "delta_a_n_per_kn": delta_a_n_per_kn, "tau_s": tau_s })
            }
            Effect::AmbientTemperature { w0_per_k, reference_k } => {
                json!({ "w0_per_k": w0_per_k, "reference_k": reference_k })
            }
            Effect::LocalResistance { extra_n_per_kn, .. } => {
                json!({ "extra_n_per_kn": extra_n_per_kn })
            }
            Effect::LowAdhesion { adhesion, .. } => json!({ "adhesion": adhesion }),
            Effect::Unlisted(unlisted) => json!({ "extra_n_per_kn": unlisted.n_per_kn }),
        }
    }

    /// Where it acts, by the names that `dynocar explain --json` uses.
    pub fn place(&self, time_offset_s: f64) -> Value {
        match self {
            Effect::DraggingBrake { windows, .. } => json!({
                "windows": windows
                    .iter()
                    .map(|window| window_json(window, time_offset_s))
                    .collect::<Vec<_>>()
            }),
            Effect::LocalResistance { intervals_m, runs, .. }
            | Effect::LowAdhesion { intervals_m, runs, .. } => {
                let mut place = Map::new();
                if !intervals_m.is_empty() {
                    place.insert("intervals_m".into(), json!(intervals_m));
                }
                if !runs.is_empty() {
                    let files: Vec<String> = runs.iter().map(|&run| run_file(run)).collect();
                    place.insert("runs".into(), json!(files));
                }
                Value::Object(place)
            }
            Effect::Unlisted(unlisted) => match unlisted.speed_range_mps() {
                Some(range) => json!({ "speed_range_mps": range }),
                None => json!({}),
            },
            _ => json!({}),
        }
    }
}

fn window_json(window: &RunWindow, time_offset_s: f64) -> Map<String, Value> {
    let mut entry = Map::new();
    entry.insert("run".into(), json!(run_file(window.run)));
    entry.insert("t_start_s".into(), json!(time_offset_s + window.start_s));
    entry.insert("t_end_s".into(), json!(time_offset_s + window.end_s));
    entry
}
