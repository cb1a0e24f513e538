//! OSRD's rolling stock: a train with its Davis coefficients and effort curves.
//!
//! Some files state A, B and C in N, N/(m/s) and N/(m/s)² for the whole train, others the same for each
//! kg, and none says which. The two differ by the mass in kg, so that the size distinguishes them.

use dynocar_model::train::{Davis, TrainModel};

use super::error::{ImportError, ImportProblem};
use super::imported::{Account, ImportedTrain, Reading};
use super::item::Item;
use crate::dataset::{Choices, Problem, SourcePosition};

const TAKEN: [&str; 6] =
    ["name", "mass", "length", "inertia_coefficient", "rolling_resistance", "effort_curves"];
const BRAKE: &str = "a deceleration, no force: write [brake] by hand";
const START: &str = "train.toml holds no way of starting up";
const OWN: &str = "of OSRD's own bookkeeping";
const WITHOUT_PLACE: [(&str, &str); 24] = [
    ("const_gamma", BRAKE),
    ("gamma", BRAKE),
    ("max_speed", "no limit of speed has a place"),
    ("startup_time", START),
    ("startup_acceleration", START),
    ("comfort_acceleration", "train.toml holds no limit of acceleration"),
    ("electrical_power_startup_time", START),
    ("raise_pantograph_time", START),
    ("etcs_brake_params", BRAKE),
    ("energy_sources", "train.toml holds no sources of energy"),
    ("power_restrictions", "train.toml holds no restrictions of power"),
    ("base_power_class", "train.toml holds no restrictions of power"),
    ("loading_gauge", "train.toml holds no gauge"),
    ("supported_signaling_systems", "train.toml holds no signalling"),
    ("primary_category", OWN),
    ("other_categories", OWN),
    ("liveries", OWN),
    ("metadata", OWN),
    ("railjson_version", OWN),
    ("version", OWN),
    ("locked", OWN),
    ("id", OWN),
    ("features", OWN),
    ("label", OWN),
];
/// Resistances in N/kN that a train may have at half of its greatest speed, with room to spare.
const RESISTANCE_N_PER_KN: (f64, f64) = (0.1, 60.0);
/// Where a file gives no greatest speed, one that every train reaches.
const SPEED_MPS: f64 = 20.0;

/// The train of a file.
pub(super) fn train(root: &Item, reading: &Reading) -> Result<ImportedTrain, ImportError> {
    let mut account = Account::default();
    let mass = "a mass in kg from 1000 to 1e8";
    let mass_kg = root.need("mass", mass)?.number(mass, |kg| (1e3..=1e8).contains(&kg))?;
    account.taken("mass", "mass_t", "kg / 1000");
    let length = "a length in m from 1 to 10000";
    let length_m = root.optional("length", length, |it| (1.0..=1e4).contains(&it))?;
    match length_m {
        Some(_) => account.taken("length", "length_m", "m"),
        None => account.unknown("length_m", "no length"),
    }
    let inertia = "a coefficient from 1 to 2";
    let inertia = root.optional("inertia_coefficient", inertia, |it| (1.0..=2.0).contains(&it))?;
    match inertia {
        Some(_) => account.taken("inertia_coefficient", "rotating_mass_factor", "less 1"),
        None => account.unknown("rotating_mass_factor", "no inertia_coefficient"),
    }
    account.unknown("cars", "the format has none");
    let top = "a speed in m/s above 0, at most 200";
    let top_mps = root.optional("max_speed", top, |it| it > 0.0 && it <= 200.0)?;
    let resistance = resistance(root, mass_kg, top_mps, &mut account)?;
    let traction = match root.get("effort_curves") {
        Some(curves) => Some(effort(&curves, reading, &mut account)?),
        None => {
            account.unknown("effort", "no effort_curves");
            None
        }
    };
    account.rest("", root.keys(), &TAKEN, &WITHOUT_PLACE);
    let name = match root.get("name") {
        Some(name) => name.text("a name")?,
        None => "unnamed train",
    };
    Ok(ImportedTrain {
        id: name.into(),
        place: SourcePosition::line(root.label(), root.line()),
        name: name.into(),
        mass_kg,
        length_m,
        cars: None,
        rotating_mass_factor: inertia.map(|inertia| inertia - 1.0),
        resistance: Some(resistance),
        traction,
        account,
    })
}

fn resistance(
    root: &Item,
    mass_kg: f64,
    top_mps: Option<f64>,
    account: &mut Account,
) -> Result<Davis, ImportError> {
    let item = root.need("rolling_resistance", "Davis coefficients")?;
    let kind = item.need("type", "\"davis\"")?;
    if kind.text("\"davis\"")? != "davis" {
        return Err(kind.out_of_range(kind.text("")?, "\"davis\""));
    }
    let allowed = "a number from 0 to 1e7";
    let number =
        |key: &str| item.need(key, allowed)?.number(allowed, |value| (0.0..=1e7).contains(&value));
    let stated = Davis { a: number("A")?, b: number("B")?, c: number("C")? };
    let weight_kn = TrainModel::weight_kn(mass_kg);
    let times =
        |factor: f64| Davis { a: factor * stated.a, b: factor * stated.b, c: factor * stated.c };
    let (whole, each_kg) = (times(1.0 / weight_kn), times(mass_kg / weight_kn));
    let speed_mps = top_mps.map_or(SPEED_MPS, |top_mps| 0.5 * top_mps);
    let (by_force, by_mass) = (whole.w0_n_per_kn(speed_mps), each_kg.w0_n_per_kn(speed_mps));
    let can_be = |w0: f64| (RESISTANCE_N_PER_KN.0..=RESISTANCE_N_PER_KN.1).contains(&w0);
    let (taken, of, w0, other) = match (can_be(by_force), can_be(by_mass)) {
        (true, false) => (whole, "for the whole train", by_force, by_mass),
        (false, true) => (each_kg, "for each kg", by_mass, by_force),
        _ => {
            let key = item.path.clone();
            return Err(item.wrong(ImportProblem::Davis {
                key,
                speed_mps,
                by_force,
                by_mass,
                mass_kg,
            }));
        }
    };
    let how = format!(
        "read as N, N/(m/s), N/(m/s)² {of}: {w0:.2} N/kN at {speed_mps:.1} m/s, and {other:.1e} if not"
    );
    account.taken("rolling_resistance", "a, b, c", how);
    Ok(taken)
}

/// The default curve of the mode that is wanted, or of the file's default mode.
fn effort(
    item: &Item,
    reading: &Reading,
    account: &mut Account,
) -> Result<Vec<(f64, f64)>, ImportError> {
    let modes = item.need("modes", "effort curves by mode")?;
    let names: Vec<&str> = modes.keys().collect();
    let stated = match &reading.mode {
        Some(wanted) => wanted.as_str(),
        None => item.need("default_mode", "the name of a mode")?.text("the name of a mode")?,
    };
    let Some(mode) = modes.get(stated) else {
        let choices = Choices::new(stated, names.iter().copied());
        let (name, context) = (stated.into(), format!(" in {}", modes.path));
        return Err(modes.wrong(Problem::UnknownName { what: "mode", name, context, choices }));
    };
    let others: Vec<&str> = names.into_iter().filter(|name| *name != stated).collect();
    let curve = mode.need("default_curve", "speeds and max_efforts")?;
    let speeds = curve.need("speeds", "a list of speeds in m/s")?.list("speeds", 1)?;
    let forces = curve.need("max_efforts", "a list of forces in N")?;
    let stated_forces = forces.list("forces", 1)?;
    if speeds.len() != stated_forces.len() {
        let found = format!("a list of {}", stated_forces.len());
        return Err(
            forces.out_of_range(&found, &format!("one for each of {} speeds", speeds.len()))
        );
    }
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (index, (speed, force)) in speeds.iter().zip(&stated_forces).enumerate() {
        let speed_mps =
            speed.number("a speed in m/s from 0 to 200", |it| (0.0..=200.0).contains(&it))?;
        let force_n = force.number("a force in N from 0 to 1e7", |it| (0.0..=1e7).contains(&it))?;
        if let Some(&(before, _)) = points.last()
            && speed_mps <= before
        {
            let (key, index, found) = (curve.full("speeds"), index + 1, speed_mps);
            return Err(speed.wrong(Problem::EffortOrder { key, index, found, before }));
        }
        points.push((speed_mps, force_n));
    }
    let field = format!("effort_curves.modes.{stated}.default_curve");
    account.taken(&field, "effort", "m/s, N / 1000");
    if !others.is_empty() {
        let why = format!("other curves, which --mode takes instead: {}", others.join(", "));
        account.left("effort_curves.modes", why);
    }
    if mode.get("curves").is_some_and(|it| it.list("", 1).is_ok()) {
        let why = "curves under conditions (comfort, electrical profile): the default one is taken";
        account.left(&format!("effort_curves.modes.{stated}.curves"), why);
    }
    Ok(points)
}
