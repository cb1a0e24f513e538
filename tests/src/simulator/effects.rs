//! The undeclared effects that a dataset may have.

use dynocar_shared::vocabulary::EffectKind;
use serde_json::{Map, Value, json};

use super::unlisted::Unlisted;

/// An interval of time in one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueRunWindow {
    /// Number of the run, from 0.
    pub run: usize,
    /// Start in s from the run's first sample.
    pub start_s: f64,
    /// End in s from the run's first sample.
    pub end_s: f64,
}

/// Another mass between two places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueMassSection {
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
pub enum TrueEffect {
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
        windows: Vec<TrueRunWindow>,
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
    MassChangeSections(Vec<TrueMassSection>),
    /// Another mass in certain intervals of time, with true over declared mass.
    MassChangeWindows(Vec<(TrueRunWindow, f64)>),
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

impl TrueEffect {
    /// Returns the kind by which `dynocar explain` should name it.
    pub fn kind(&self) -> EffectKind {
        match self {
            TrueEffect::TunnelDrag { .. } => EffectKind::TunnelDrag,
            TrueEffect::CurveResistance { .. } => EffectKind::CurveResistance,
            TrueEffect::Wind { .. } => EffectKind::Wind,
            TrueEffect::DraggingBrake { .. } => EffectKind::DraggingBrake,
            TrueEffect::WheelDiameter { .. } => EffectKind::WheelDiameter,
            TrueEffect::GradientShift { .. } => EffectKind::GradientShift,
            TrueEffect::GradientError { .. } => EffectKind::GradientError,
            TrueEffect::MassChangeSections(_) | TrueEffect::MassChangeWindows(_) => {
                EffectKind::MassChange
            }
            TrueEffect::TractionGain { .. } => EffectKind::TractionGain,
            TrueEffect::BrakeGain { .. } => EffectKind::BrakeGain,
            TrueEffect::BrakeDelay { .. } => EffectKind::BrakeDelay,
            TrueEffect::ActuatorDelay { .. } => EffectKind::ActuatorDelay,
            TrueEffect::SpeedDelay { .. } => EffectKind::SpeedDelay,
            TrueEffect::RotatingMass { .. } => EffectKind::RotatingMass,
            TrueEffect::BearingTemperature { .. } => EffectKind::BearingTemperature,
            TrueEffect::AmbientTemperature { .. } => EffectKind::AmbientTemperature,
            TrueEffect::LocalResistance { .. } => EffectKind::LocalResistance,
            TrueEffect::LowAdhesion { .. } => EffectKind::LowAdhesion,
            TrueEffect::Unlisted(_) => EffectKind::Unknown,
        }
    }

    /// Returns the same with windows that end with their runs, given each run's length in s.
    #[must_use]
    pub fn ended_with_runs(mut self, lengths_s: &[f64]) -> Self {
        let end =
            |window: &mut TrueRunWindow| window.end_s = window.end_s.min(lengths_s[window.run]);
        match &mut self {
            TrueEffect::DraggingBrake { windows, .. } => windows.iter_mut().for_each(end),
            TrueEffect::MassChangeWindows(windows) => {
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
            TrueEffect::TunnelDrag { c_factor } => json!({ "c_factor": c_factor }),
            TrueEffect::CurveResistance { k_n_per_kn_m } => json!({ "k_n_per_kn_m": k_n_per_kn_m }),
            TrueEffect::Wind { wind_plus_mps, .. } => json!({ "wind_plus_mps": wind_plus_mps }),
            TrueEffect::DraggingBrake { force_n, .. } => json!({ "force_n": force_n }),
            TrueEffect::WheelDiameter { speed_scale } => json!({ "speed_scale": speed_scale }),
            TrueEffect::GradientShift { shift_m } => json!({ "shift_m": shift_m }),
            TrueEffect::GradientError { profile } => json!({ "profile": profile }),
            TrueEffect::MassChangeSections(sections) => json!({
                "sections": sections.iter().map(|section| json!({
                    "from_m": section.from_m,
                    "to_m": section.to_m,
                    "direction": section.direction,
                    "mass_factor": section.mass_factor,
                })).collect::<Vec<_>>()
            }),
            TrueEffect::MassChangeWindows(windows) => json!({
                "windows": windows.iter().map(|(window, mass_factor)| {
                    let mut entry = window_json(window, time_offset_s);
                    entry.insert("mass_factor".into(), json!(mass_factor));
                    Value::Object(entry)
                }).collect::<Vec<_>>()
            }),
            TrueEffect::TractionGain { gain } | TrueEffect::BrakeGain { gain } => {
                json!({ "gain": gain })
            }
            TrueEffect::ActuatorDelay { delay_s, lag_s }
            | TrueEffect::BrakeDelay { delay_s, lag_s }
            | TrueEffect::SpeedDelay { delay_s, lag_s } => {
                json!({ "delay_s": delay_s, "lag_s": lag_s })
            }
            TrueEffect::RotatingMass { rotating_mass_factor } => {
                json!({ "rotating_mass_factor": rotating_mass_factor })
            }
            TrueEffect::BearingTemperature { delta_a_n_per_kn, tau_s } => {
                json!({ "delta_a_n_per_kn": delta_a_n_per_kn, "tau_s": tau_s })
            }
            TrueEffect::AmbientTemperature { w0_per_k, reference_k } => {
                json!({ "w0_per_k": w0_per_k, "reference_k": reference_k })
            }
            TrueEffect::LocalResistance { extra_n_per_kn, .. } => {
                json!({ "extra_n_per_kn": extra_n_per_kn })
            }
            TrueEffect::LowAdhesion { adhesion, .. } => json!({ "adhesion": adhesion }),
            TrueEffect::Unlisted(unlisted) => json!({ "extra_n_per_kn": unlisted.n_per_kn }),
        }
    }

    /// Returns where it acts, by the names that `dynocar explain --json` uses.
    pub fn place(&self, time_offset_s: f64) -> Value {
        match self {
            TrueEffect::DraggingBrake { windows, .. } => json!({
                "windows": windows
                    .iter()
                    .map(|window| window_json(window, time_offset_s))
                    .collect::<Vec<_>>()
            }),
            TrueEffect::LocalResistance { intervals_m, runs, .. }
            | TrueEffect::LowAdhesion { intervals_m, runs, .. } => {
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
            TrueEffect::Unlisted(unlisted) => match unlisted.speed_range_mps() {
                Some(range) => json!({ "speed_range_mps": range }),
                None => json!({}),
            },
            _ => json!({}),
        }
    }
}

fn window_json(window: &TrueRunWindow, time_offset_s: f64) -> Map<String, Value> {
    let mut entry = Map::new();
    entry.insert("run".into(), json!(run_file(window.run)));
    entry.insert("t_start_s".into(), json!(time_offset_s + window.start_s));
    entry.insert("t_end_s".into(), json!(time_offset_s + window.end_s));
    entry
}

/// Returns the name of a run's file, by the run's number from 0.
pub fn run_file(number: usize) -> String {
    format!("runs/{:02}.csv", number + 1)
}
