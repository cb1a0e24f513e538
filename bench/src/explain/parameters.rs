//! Numbers of an answer against the true ones.

use dynocar_model::terms::delay;
use dynocar_shared::HALF_95;
use dynocar_tests::simulator::disturbances::Disturbances;
use dynocar_tests::simulator::run_file::run_file;
use dynocar_tests::simulator::run_maker::RunPlan;
use dynocar_tests::simulator::{Effect, SimulatedDataset};
use serde_json::Value;

use crate::statistics::mean;

/// One parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterGrade {
    /// Its name.
    pub name: String,
    /// Error over the size of the effect.
    pub error: f64,
    /// Error over the standard deviation.
    pub z: f64,
}

impl ParameterGrade {
    /// True when the 95 % interval holds the truth.
    pub fn is_held(&self) -> bool {
        self.z.abs() < HALF_95
    }
}

/// Parameters that have a single true number; the size of an effect is its distance from none.
pub fn graded(effect: &Effect, own: &Value, simulated: &SimulatedDataset) -> Vec<ParameterGrade> {
    let declared = simulated.declared_train();
    let number = |name: &str| own["parameters"][name].as_f64();
    let deviation = |name: &str| own["std"][name].as_f64();
    let one = |name: &str, truth: f64, none: f64| {
        (truth != none).then_some(())?;
        let (value, deviation) = (number(name)?, deviation(name)?);
        let error = (value - truth) / (truth - none);
        Some(ParameterGrade { name: name.into(), error, z: (value - truth) / deviation })
    };
    let list = match effect {
        Effect::TunnelDrag { c_factor } => vec![one("c_factor", *c_factor, 1.0)],
        Effect::CurveResistance { k_n_per_kn_m } => {
            vec![one("k_n_per_kn_m", *k_n_per_kn_m, declared.curve_constant_n_per_kn_m)]
        }
        Effect::Wind { .. } => vec![one("wind_plus_mps", wind_of_the_days(simulated), 0.0)],
        Effect::DraggingBrake { force_n, .. } => vec![one("force_n", *force_n, 0.0)],
        Effect::WheelDiameter { speed_scale } => vec![one("speed_scale", *speed_scale, 1.0)],
        Effect::GradientShift { shift_m } => vec![one("shift_m", *shift_m, 0.0)],
        Effect::GradientError { profile } => gradient_errors(profile, own, simulated),
        Effect::TractionGain { gain } => vec![one("gain", *gain, 1.0)],
        Effect::ActuatorDelay { delay_s, lag_s } | Effect::SpeedDelay { delay_s, lag_s } => {
            let together_s = *delay_s + *lag_s;
            vec![
                one(delay::TOGETHER, together_s, 0.0),
                one("delay_s", *delay_s, 0.0),
                one("lag_s", *lag_s, 0.0),
            ]
        }
        Effect::RotatingMass { rotating_mass_factor } => {
            vec![one("rotating_mass_factor", *rotating_mass_factor, declared.rotating_mass_factor)]
        }
        Effect::BearingTemperature { delta_a_n_per_kn, tau_s } => {
            vec![one("delta_a_n_per_kn", *delta_a_n_per_kn, 0.0), one("tau_s", *tau_s, 0.0)]
        }
        Effect::AmbientTemperature { w0_per_k, .. } => vec![one("w0_per_k", *w0_per_k, 0.0)],
        Effect::LocalResistance { extra_n_per_kn, .. } => {
            vec![one("extra_n_per_kn", *extra_n_per_kn, 0.0)]
        }
        Effect::LowAdhesion { adhesion, .. } => vec![one("adhesion", *adhesion, 0.0)],
        Effect::MassChangeSections(_) | Effect::MassChangeWindows(_) | Effect::Unlisted(_) => {
            mass_factors(effect, own, simulated)
        }
    };
    list.into_iter().flatten().collect()
}

/// The error of the gradient at every node that was found, over the root mean square of the effect. All that
/// the map lacks is true there: the effect, and what usual surveys leave.
fn gradient_errors(
    profile: &[(f64, f64)],
    own: &Value,
    simulated: &SimulatedDataset,
) -> Vec<Option<ParameterGrade>> {
    let Some(map) = simulated.track().gradient() else { return Vec::new() };
    let truth = disturbances(simulated, &simulated.runs[0].plan).gradient;
    let squares: f64 = profile.iter().map(|(_, permille)| permille * permille).sum();
    let rms = (squares / profile.len() as f64).sqrt();
    let found = own["parameters"]["profile"].as_array().map_or(&[][..], Vec::as_slice);
    let deviations = own["std"]["profile"].as_array().into_iter().flatten();
    let chainage_m = |node: Option<&Value>| node.and_then(|node| node[0].as_f64());
    let apart_m = chainage_m(found.get(1)).zip(chainage_m(found.first())).map(|(b, a)| b - a);
    found
        .iter()
        .zip(deviations)
        .map(|(node, deviation)| {
            let (at_m, apart_m) = (node[0].as_f64()?, apart_m?);
            let lacking = truth.mean_around(at_m, apart_m) - map.mean_around(at_m, apart_m);
            let away = node[1].as_f64()? - lacking;
            let z = away / deviation[1].as_f64()?;
            Some(ParameterGrade { name: "permille".into(), error: away / rms, z })
        })
        .collect()
}

/// What acts on a run of a dataset.
fn disturbances(simulated: &SimulatedDataset, plan: &RunPlan) -> Disturbances {
    let SimulatedDataset { effects, train, line, settings, .. } = simulated;
    Disturbances::of(effects, train, line, plan, settings)
}

/// Mean wind in m/s towards direction -1 that blew in the fit runs: the effect's and each day's own.
fn wind_of_the_days(simulated: &SimulatedDataset) -> f64 {
    let fit_runs = simulated.runs.iter().filter(|run| !run.plan.is_holdout);
    let winds_mps = fit_runs.map(|run| run.plan.direction * run.disturbances.headwind_mps);
    mean(winds_mps.collect::<Vec<f64>>())
}

/// True over declared mass of a run, the effects aside: how it was loaded that day.
fn load_of_the_day(simulated: &SimulatedDataset, run: usize) -> f64 {
    let Some(run) = simulated.runs.iter().find(|it| it.plan.number == run) else { return 1.0 };
    let loads = disturbances(simulated, &run.plan).loads;
    loads.iter().map(|(_, load)| load).sum::<f64>() / loads.len() as f64
}

/// Every true factor against the factor found where it holds longest, if that is in most of its place: next to
/// a place without a factor of its own lies another one's.
fn mass_factors(
    effect: &Effect,
    own: &Value,
    simulated: &SimulatedDataset,
) -> Vec<Option<ParameterGrade>> {
    let graded = |list: &str,
                  keys: [&str; 2],
                  [from, to]: [f64; 2],
                  truth: f64,
                  is_like: &dyn Fn(&Value) -> bool| {
        let overlap = |entry: &Value| {
            let [low, high] = keys.map(|key| entry[key].as_f64().unwrap_or(0.0));
            if is_like(entry) { (high.min(to) - low.max(from)).max(0.0) } else { 0.0 }
        };
        let found = own["parameters"][list].as_array()?.iter().enumerate();
        let (at, best) = found.max_by(|one, other| overlap(one.1).total_cmp(&overlap(other.1)))?;
        (overlap(best) > 0.5 * (to - from)).then_some(())?;
        let (value, deviation) = (best["mass_factor"].as_f64()?, own["std"][list][at].as_f64()?);
        let error = (value - truth) / (truth - 1.0);
        Some(ParameterGrade { name: "mass_factor".into(), error, z: (value - truth) / deviation })
    };
    match effect {
        Effect::MassChangeSections(sections) => sections
            .iter()
            .map(|it| {
                let is_like = |entry: &Value| entry["direction"].as_f64() == Some(it.direction);
                let range_m = [it.from_m, it.to_m];
                graded("sections", ["from_m", "to_m"], range_m, it.mass_factor, &is_like)
            })
            .collect(),
        Effect::MassChangeWindows(windows) => windows
            .iter()
            .map(|(it, factor)| {
                let file = run_file(it.run);
                let is_like = |entry: &Value| entry["run"] == file.as_str();
                let truth = factor * load_of_the_day(simulated, it.run);
                let range_s = [it.start_s, it.end_s];
                graded("windows", ["t_start_s", "t_end_s"], range_s, truth, &is_like)
            })
            .collect(),
        _ => Vec::new(),
    }
}
