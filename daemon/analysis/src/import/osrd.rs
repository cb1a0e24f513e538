//! OSRD's rolling stock: a train with its Davis coefficients and effort curves.
//!
//! Some files state A, B and C in N, N/(m/s) and N/(m/s)² for the whole train, others for each kg, and no file states
//! which. The two differ by the mass in kg, so that the size distinguishes them.

use dynocar_model::train::numbers::{LENGTH, MASS, ROTATING_MASS_FACTOR};
use dynocar_model::train::{Davis, TrainModel};

use super::imported::{Account, ImportReading, ImportedTrain, force_n};
use crate::brakes::{SpeedSteps, read};
use crate::dataset::document::{Item, above_zero};
use crate::dataset::train_file::{EffortEntry, growing};
use crate::dataset::{DatasetError, unusual_resistance};

/// Reasons why fields have no key, and these fields.
const WITHOUT_PLACE: [(&str, &str); 9] = [
    ("a deceleration, no force: write [brake] by hand", "const_gamma, gamma"),
    ("no limit of speed has a place", "max_speed"),
    (
        "train.toml holds no way of starting up",
        "startup_time, startup_acceleration, electrical_power_startup_time, raise_pantograph_time",
    ),
    ("train.toml holds no limit of acceleration", "comfort_acceleration"),
    ("train.toml holds no sources of energy", "energy_sources"),
    ("train.toml holds no restrictions of power", "power_restrictions, base_power_class"),
    ("train.toml holds no gauge", "loading_gauge"),
    ("train.toml holds no signalling", "supported_signaling_systems"),
    (
        "of OSRD's own bookkeeping",
        "primary_category, other_categories, liveries, metadata, railjson_version, version, locked, id, features, label",
    ),
];
/// Resistances in N/kN that a train may have at half of its greatest speed, with room to spare.
const RESISTANCE_N_PER_KN: (f64, f64) = (0.1, 60.0);
/// Where a file gives no greatest speed, one that every train reaches.
const SPEED_MPS: f64 = 20.0;

/// Returns the train of a file.
pub(super) fn train(root: &Item, reading: &ImportReading) -> Result<ImportedTrain, DatasetError> {
    let mut account = Account::default();
    let mass_kg = root.required("mass", "a mass in kg from 1000 to 1e8", 1e3..=1e8)?;
    account.taken("mass", MASS.name, "kg / 1000");
    let length = root.optional("length", "a length in m from 1 to 10000", 1.0..=1e4)?;
    let length_m = account.given(length, "length", (LENGTH.name, "m"), "no length");
    let (field, key) = ("inertia_coefficient", ROTATING_MASS_FACTOR.name);
    let inertia = root.optional(field, "a coefficient from 1 to 2", 1.0..=2.0)?;
    let inertia = account.given(inertia, field, (key, "less 1"), "no inertia_coefficient");
    account.unknown("cars", "the format has none");
    let top = "a speed in m/s above 0, at most 200";
    let top_mps = root.optional("max_speed", top, above_zero(200.0))?;
    let resistance = resistance(root, mass_kg, top_mps, &mut account)?;
    let curves = root.get("effort_curves");
    if curves.is_none() {
        account.unknown("effort", "no effort_curves");
    }
    let traction = curves.map(|curves| effort(&curves, reading, &mut account)).transpose()?;
    let name = match root.get("name") {
        Some(name) => name.text("a name")?,
        None => "unnamed train",
    };
    let brake_mps2 = match root.get("etcs_brake_params") {
        Some(item) => Some(brake(&item, "etcs_brake_params.", &mut account)?),
        None => None,
    };
    account.rest("", root, &WITHOUT_PLACE);
    Ok(ImportedTrain {
        id: name.into(),
        place: root.place(),
        name: name.into(),
        mass_kg: Some(mass_kg),
        brake_mps2,
        length_m,
        cars: None,
        rotating_mass_factor: inertia.map(|inertia| inertia - 1.0),
        resistance,
        traction,
        account,
    })
}

/// Returns a brake alone, as `dynocar brakes` writes it.
pub(super) fn brake_alone(root: &Item) -> Result<ImportedTrain, DatasetError> {
    let mut account = Account::default();
    let brake_mps2 = Some(brake(root, "", &mut account)?);
    for key in [MASS.name, LENGTH.name, ROTATING_MASS_FACTOR.name, "a, b, c"] {
        account.unknown(key, "the file holds a brake alone");
    }
    account.rest("", root, &[]);
    Ok(ImportedTrain {
        id: "brake".into(),
        place: root.place(),
        name: "unnamed train".into(),
        mass_kg: None,
        length_m: None,
        cars: None,
        rotating_mass_factor: None,
        resistance: None,
        traction: None,
        brake_mps2,
        account,
    })
}

/// Returns the emergency deceleration over speed; a step is one over 0.01 m/s.
fn brake(
    item: &Item,
    prefix: &str,
    account: &mut Account,
) -> Result<Vec<(f64, f64)>, DatasetError> {
    let SpeedSteps { boundaries, values } = read(item)?.gamma_emergency;
    let how = "m/s² times the inertial mass, under [brake]";
    account.taken(&format!("{prefix}gamma_emergency"), "effort", how);
    let others = "gamma_service, gamma_normal_service, k_dry, k_wet, k_n_pos, k_n_neg, \
                  t_traction_cut_off, t_bs1, t_bs2, t_be";
    let why = "read; train.toml holds the brake's greatest force alone";
    for key in others.split(", ").filter(|key| item.has(key)) {
        account.left(&format!("{prefix}{key}"), why);
    }
    let mut points = vec![(0.0, values[0])];
    for (boundary_mps, pair) in boundaries.iter().zip(values.windows(2)) {
        points.extend([(*boundary_mps, pair[0]), (boundary_mps + 0.01, pair[1])]);
    }
    Ok(points)
}

fn resistance(
    root: &Item,
    mass_kg: f64,
    top_mps: Option<f64>,
    account: &mut Account,
) -> Result<Option<Davis>, DatasetError> {
    let item = root.need("rolling_resistance", "Davis coefficients")?;
    let kind = item.need("type", "\"davis\"")?;
    if kind.text("\"davis\"")? != "davis" {
        return Err(kind.out_of_range(kind.text("")?, "\"davis\""));
    }
    let number = |key: &str| item.required(key, "a number from 0 to 1e7", 0.0..=1e7);
    let stated = Davis { a: number("A")?, b: number("B")?, c: number("C")? };
    if stated == (Davis { a: 0.0, b: 0.0, c: 0.0 }) {
        account.unknown("a, b, c", "A, B and C are 0");
        return Ok(None);
    }
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
            return Err(item.wrong(format!(
                "{}: {by_force:.3e} N/kN at {speed_mps:.1} m/s if A, B and C are in N for the whole \
                 train, {by_mass:.3e} N/kN if for each kg, and neither can be: is the mass of \
                 {mass_kg} kg right?",
                item.path
            )));
        }
    };
    let how = format!(
        "read as N, N/(m/s), N/(m/s)² {of}: {w0:.2} N/kN at {speed_mps:.1} m/s, and {other:.1e} if not"
    );
    let unusual = unusual_resistance(&taken, top_mps.unwrap_or(SPEED_MPS));
    let unusual = unusual.map_or(String::new(), |it| format!("; UNUSUAL: {it}"));
    account.taken("rolling_resistance", "a, b, c", how + &unusual);
    Ok(Some(taken))
}

/// Returns the default curve of the mode that is wanted, or of the file's default mode.
fn effort(
    item: &Item,
    reading: &ImportReading,
    account: &mut Account,
) -> Result<Vec<(f64, f64)>, DatasetError> {
    let modes = item.need("modes", "effort curves by mode")?;
    let stated = match &reading.mode {
        Some(wanted) => wanted.as_str(),
        None => item.need_text("default_mode", "the name of a mode")?,
    };
    let mode = modes.get(stated).ok_or_else(|| modes.unknown("mode", stated, modes.keys()))?;
    let curve = mode.need("default_curve", "speeds and max_efforts")?;
    let speeds = curve.need("speeds", "a list of speeds in m/s")?.list("speeds", 1)?;
    let list = curve.need("max_efforts", "a list of forces in N")?;
    let forces = list.list("forces", 1)?;
    if speeds.len() != forces.len() {
        let found = format!("a list of {}", forces.len());
        return Err(list.out_of_range(&found, &format!("one for each of {} speeds", speeds.len())));
    }
    let points = speeds.into_iter().zip(forces).map(|(speed, force)| {
        let speed_mps = speed.number("a speed in m/s from 0 to 200", 0.0..=200.0)?;
        Ok(EffortEntry { entry: speed, speed_mps, force_n: force_n(&force)? })
    });
    let points = growing(&curve.full("speeds"), points)?;
    let field = format!("effort_curves.modes.{stated}.default_curve");
    account.taken(&field, "effort", "m/s, N / 1000");
    let others: Vec<&str> = modes.keys().filter(|name| *name != stated).collect();
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
