//! Numbers and places of an answer against the true ones.

use dynocar_analysis::dataset::Role;
use dynocar_model::terms::delay;
use dynocar_shared::HALF_95;
use dynocar_tests::simulator::disturbances::Disturbances;
use dynocar_tests::simulator::run_maker::RunPlan;
use dynocar_tests::simulator::{SimulatedDataset, SimulatedRun, TrueEffect};
use serde_json::Value;

use crate::statistics::mean;

/// Grade of one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterGrade {
    /// Its name.
    pub name: String,
    /// Error over the size of the effect.
    pub error: f64,
    /// Error divided by the standard deviation that the answer states.
    pub z: f64,
}

impl ParameterGrade {
    /// Returns whether the 95 % interval holds the truth.
    pub fn is_held(&self) -> bool {
        self.z.abs() < HALF_95
    }
}

/// Returns every number of an effect that the answer, or its part about the runs of a role, has by the same name; the
/// size of an effect is its distance from none.
pub fn graded(
    effect: &TrueEffect,
    own: &Value,
    simulated: &SimulatedDataset,
    role: Role,
) -> Vec<ParameterGrade> {
    let declared = simulated.declared_train();
    let mut truths = effect.parameters(0.0);
    match effect {
        // Nobody knows which numbers of a form are those of a law outside the library.
        TrueEffect::Unlisted(_) => return Vec::new(),
        TrueEffect::GradientError { profile } => return gradient_errors(profile, own, simulated),
        TrueEffect::Wind { .. } => {
            truths["wind_plus_mps"] = wind_of_the_days(own, simulated, role).into()
        }
        _ => {}
    }
    let one = |name: &str, truth: f64| {
        let none = match name {
            "c_factor" | "speed_scale" | "gain" => 1.0,
            "k_n_per_kn_m" => declared.curve_constant_n_per_kn_m,
            "rotating_mass_factor" => declared.rotating_mass_factor,
            _ => 0.0,
        };
        (truth != none).then_some(())?;
        let (value, deviation) = (own["parameters"][name].as_f64()?, own["std"][name].as_f64()?);
        // A reference to which the others refer is no estimate.
        (deviation != 0.0).then_some(())?;
        let error = (value - truth) / (truth - none);
        Some(ParameterGrade { name: name.into(), error, z: (value - truth) / deviation })
    };
    let number = |name: &str| truths[name].as_f64();
    let together_s = number("delay_s").zip(number("lag_s")).map(|(delay_s, lag_s)| delay_s + lag_s);
    let together = together_s.and_then(|truth_s| one(delay::TOGETHER, truth_s));
    let named = truths.as_object().into_iter().flatten();
    let singly = named.filter_map(|(name, truth)| one(name, truth.as_f64()?));
    together.into_iter().chain(singly).chain(mass_factors(&truths, own, simulated)).collect()
}

/// Returns the error of the gradient at every node that was found, over the root mean square of the effect. The true
/// error holds all that the map lacks: the effect, and the usual errors of surveys.
fn gradient_errors(
    profile: &[(f64, f64)],
    own: &Value,
    simulated: &SimulatedDataset,
) -> Vec<ParameterGrade> {
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
        .filter_map(|(node, deviation)| {
            let (at_m, apart_m) = (node[0].as_f64()?, apart_m?);
            let lacking = truth.mean_around(at_m, apart_m) - map.mean_around(at_m, apart_m);
            let away = node[1].as_f64()? - lacking;
            let z = away / deviation[1].as_f64()?;
            Some(ParameterGrade { name: "permille".into(), error: away / rms, z })
        })
        .collect()
}

/// Returns the disturbances of a run of a dataset.
fn disturbances(simulated: &SimulatedDataset, plan: &RunPlan) -> Disturbances {
    let SimulatedDataset { effects, train, line, settings, .. } = simulated;
    Disturbances::new(effects, train, line, plan, settings)
}

/// Returns the mean wind in m/s towards direction -1 that blew in the runs whose winds the answer gives, else in all of
/// a role: the effect's and each day's own.
fn wind_of_the_days(own: &Value, simulated: &SimulatedDataset, role: Role) -> f64 {
    let given = own["parameters"]["headwind_mps"].as_object();
    let is_given = |file: &str| given.is_none_or(|given| given.contains_key(file));
    let runs = simulated.runs.iter().filter(|run| run.plan.is_holdout == (role == Role::Holdout));
    let runs = runs.filter(|run| is_given(&run.plan.file()));
    let winds_mps = runs.map(|run| run.plan.direction * run.disturbances.headwind_mps);
    mean(winds_mps.collect::<Vec<f64>>())
}

/// True over declared mass of a run, the effects aside: how it was loaded that day.
fn load_of_the_day(simulated: &SimulatedDataset, file: &str) -> f64 {
    let Some(run) = simulated.runs.iter().find(|it| it.plan.file() == file) else { return 1.0 };
    let loads = disturbances(simulated, &run.plan).loads;
    loads.iter().map(|(_, load)| load).sum::<f64>() / loads.len() as f64
}

/// Lists of masses: the name of the list, of the two ends, and of the key whose value comparable entries share.
const MASS_LISTS: [[&str; 4]; 2] =
    [["sections", "from_m", "to_m", "direction"], ["windows", "t_start_s", "t_end_s", "run"]];

/// Returns every true factor against the factor found where it holds longest, if that is in most of its place: next to
/// a place without a factor of its own lies another one's.
fn mass_factors(truths: &Value, own: &Value, simulated: &SimulatedDataset) -> Vec<ParameterGrade> {
    let of = |it: &Value, key: &str| it[key].as_f64().unwrap_or(0.0);
    let graded = |[list, from, to, common]: [&str; 4], it: &Value| {
        let is_like = |entry: &Value| {
            let [one, other] = [&entry[common], &it[common]];
            one.as_f64() == other.as_f64() && one.as_str() == other.as_str()
        };
        let overlap = |entry: &Value| match is_like(entry) {
            true => (of(entry, to).min(of(it, to)) - of(entry, from).max(of(it, from))).max(0.0),
            false => 0.0,
        };
        let found = own["parameters"][list].as_array()?.iter().enumerate();
        let (at, best) = found.max_by(|one, other| overlap(one.1).total_cmp(&overlap(other.1)))?;
        (overlap(best) > 0.5 * (of(it, to) - of(it, from))).then_some(())?;
        let load = it["run"].as_str().map_or(1.0, |file| load_of_the_day(simulated, file));
        let truth = of(it, "mass_factor") * load;
        let (value, deviation) = (best["mass_factor"].as_f64()?, own["std"][list][at].as_f64()?);
        let error = (value - truth) / (truth - 1.0);
        Some(ParameterGrade { name: "mass_factor".into(), error, z: (value - truth) / deviation })
    };
    let of_list = |keys: [&'static str; 4]| {
        let truths = truths[keys[0]].as_array().into_iter().flatten();
        truths.filter_map(move |it| graded(keys, it))
    };
    MASS_LISTS.into_iter().flat_map(of_list).collect()
}

fn pairs(value: &Value) -> Vec<[f64; 2]> {
    let list = value.as_array().into_iter().flatten();
    list.filter_map(|pair| Some([pair[0].as_f64()?, pair[1].as_f64()?])).collect()
}

/// Returns the windows of a place on one axis for all runs, each far from the next.
fn windows(place: &Value, simulated: &SimulatedDataset) -> Vec<[f64; 2]> {
    let window = |it: &Value| {
        let is_own = |run: &SimulatedRun| !run.plan.is_holdout && it["run"] == run.plan.file();
        let from_s = 1e5 * simulated.runs.iter().position(is_own)? as f64;
        Some([from_s + it["t_start_s"].as_f64()?, from_s + it["t_end_s"].as_f64()?])
    };
    place["windows"].as_array().into_iter().flatten().filter_map(window).collect()
}

/// Intersection over union of the true and the found place, where the effect has one.
pub fn place_iou(effect: &TrueEffect, own: &Value, simulated: &SimulatedDataset) -> Option<f64> {
    let (truth, found) = (effect.place(0.0), &own["where"]);
    if truth["windows"].is_array() {
        return Some(iou(&windows(&truth, simulated), &windows(found, simulated)));
    }
    let truth = truth["intervals_m"].as_array().map(|_| pairs(&truth["intervals_m"]))?;
    Some(iou(&truth, &pairs(&found["intervals_m"])))
}

/// Intersection over union of two sets of disjoint intervals.
fn iou(truth: &[[f64; 2]], found: &[[f64; 2]]) -> f64 {
    let length = |set: &[[f64; 2]]| set.iter().map(|[from, to]| to - from).sum::<f64>();
    let both: f64 = truth
        .iter()
        .flat_map(|[from, to]| {
            found.iter().map(move |[start, end]| (to.min(*end) - from.max(*start)).max(0.0))
        })
        .sum();
    both / (length(truth) + length(found) - both)
}

/// Returns whether the 95 % intervals of the ends of a place hold the true ends. An end of an interval is
/// compared with that of the true one which it overlaps most.
pub fn ends_within(effect: &TrueEffect, own: &Value) -> Vec<bool> {
    let known = &own["where"]["uncertainty_95"];
    let holds = |interval: &Value, truth: f64| {
        let [low, high] = [interval[0].as_f64(), interval[1].as_f64()];
        low.zip(high).is_some_and(|(low, high)| low <= truth && truth <= high)
    };
    let truth = effect.place(0.0);
    let intervals_m = pairs(&truth["intervals_m"]);
    let listed = |list: &str| known[list].as_array().into_iter().flatten();
    let mut held = Vec::new();
    for ([from, to], interval) in
        pairs(&own["where"]["intervals_m"]).into_iter().zip(listed("intervals_m"))
    {
        let overlap = |[low, high]: &[f64; 2]| high.min(to) - low.max(from);
        let nearest = intervals_m
            .iter()
            .max_by(|one, other| overlap(one).total_cmp(&overlap(other)))
            .filter(|nearest| overlap(nearest) > 0.0);
        if let Some(&[low, high]) = nearest {
            held.extend([holds(&interval[0], low), holds(&interval[1], high)]);
        }
    }
    for found in listed("windows") {
        let mut truths = truth["windows"].as_array().into_iter().flatten();
        let start_s =
            truths.find(|it| it["run"] == found["run"]).and_then(|it| it["t_start_s"].as_f64());
        held.extend(start_s.map(|start_s| holds(&found["t_start_s"], start_s)));
    }
    held
}
