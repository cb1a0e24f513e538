//! A train of TTOBench: resistance in kN over km/h, and greatest force and power of its drive.

use dynocar_model::train::{Davis, TrainModel};
use dynocar_model::units::Dimension;

use super::error::ImportError;
use super::imported::{Account, ImportedTrain};
use super::item::Item;
use super::ttobench::{METADATA, coefficient, id, value};
use crate::dataset::SourcePosition;

const TAKEN: [&str; 9] = [
    "metadata",
    "mass",
    "rho",
    "num coaches",
    "max traction force",
    "max traction power",
    "rolling resistance r0",
    "rolling resistance r1",
    "rolling resistance r2",
];
const BRAKE: &str = "one of two brakes with limits of their own: write [brake] by hand";
const WITHOUT_PLACE: [(&str, &str); 9] = [
    ("num seats", "train.toml holds no seats"),
    ("max reg braking force", BRAKE),
    ("max reg braking power", BRAKE),
    ("max pn braking force", BRAKE),
    ("max acceleration", "train.toml holds no limit of acceleration"),
    ("max deceleration", "train.toml holds no limit of deceleration"),
    ("max speed", "no limit of speed has a place; the effort curve ends there"),
    ("efficiency traction", "train.toml holds no losses"),
    ("efficiency reg brake", "train.toml holds no losses"),
];
/// The hyperbola of constant power is drawn through points whose speeds grow by this factor: the
/// straight lines between them lie 0.3 % above it at most.
const SPEED_RATIO: f64 = 1.12;

/// The train of a file.
pub(super) fn train(root: &Item) -> Result<ImportedTrain, ImportError> {
    let id = id(root)?;
    let mut account = Account::default();
    let mass = "a mass from 1000 to 1e8 kg";
    let is_mass = |kg: f64| (1e3..=1e8).contains(&kg);
    root.need("mass", "a mass with its unit")?;
    let mass_kg = value(root, "mass", Dimension::Mass, mass, is_mass)?.unwrap_or_default();
    account.taken("mass", "mass_t", "t");
    account.unknown("length_m", "the format has none");
    let share = "a share from 0 to 1 of the mass";
    let is_share = |share: f64| (0.0..=1.0).contains(&share);
    let rotating_mass_factor = value(root, "rho", Dimension::Ratio, share, is_share)?;
    match rotating_mass_factor {
        Some(_) => account.taken("rho", "rotating_mass_factor", "as a share of the mass"),
        None => account.unknown("rotating_mass_factor", "no rho"),
    }
    let cars = match root.get("num coaches") {
        Some(item) => {
            let count = item.need("value", "a number of coaches")?;
            let whole = "a whole number from 1 to 1000";
            let is_whole = |it: f64| (1.0..=1000.0).contains(&it) && it.fract() == 0.0;
            account.taken("num coaches", "cars", "as it stands");
            Some(count.number(whole, is_whole)? as u32)
        }
        None => {
            account.unknown("cars", "no num coaches");
            None
        }
    };
    let resistance = resistance(root, mass_kg, &mut account)?;
    let traction = traction(root, &mut account)?;
    account.rest("", root.keys(), &TAKEN, &WITHOUT_PLACE);
    if let Some(metadata) = root.get("metadata") {
        account.rest("metadata.", metadata.keys(), &["id"], &METADATA);
    }
    Ok(ImportedTrain {
        id: id.into(),
        place: SourcePosition::line(root.label(), root.line()),
        name: id.into(),
        mass_kg,
        length_m: None,
        cars,
        rotating_mass_factor,
        resistance,
        traction,
        account,
    })
}

fn resistance(
    root: &Item,
    mass_kg: f64,
    account: &mut Account,
) -> Result<Option<Davis>, ImportError> {
    let keys = ["rolling resistance r0", "rolling resistance r1", "rolling resistance r2"];
    let mut found = [0.0; 3];
    for (power, key) in keys.into_iter().enumerate() {
        let Some((value, unit)) = coefficient(root, key, power as i32)? else {
            account.unknown("a, b, c", format!("no {key}"));
            return Ok(None);
        };
        found[power] = value / TrainModel::weight_kn(mass_kg);
        let how = format!("{unit} by the weight of {:.2} kN", TrainModel::weight_kn(mass_kg));
        account.taken(key, ["a", "b", "c"][power], how);
    }
    let [a, b, c] = found;
    Ok(Some(Davis { a, b, c }))
}

/// The smaller of force and power / speed, up to the greatest speed.
fn traction(root: &Item, account: &mut Account) -> Result<Option<Vec<(f64, f64)>>, ImportError> {
    let force = value(root, "max traction force", Dimension::Force, "from 1 to 1e7 N", |force| {
        (1.0..=1e7).contains(&force)
    })?;
    let power = value(root, "max traction power", Dimension::Power, "from 1 to 1e9 W", |power| {
        (1.0..=1e9).contains(&power)
    })?;
    let top = value(root, "max speed", Dimension::Speed, "a speed up to 200 m/s", |speed| {
        speed > 0.0 && speed <= 200.0
    })?;
    let (Some(force_n), Some(power_w), Some(top_mps)) = (force, power, top) else {
        let why = "it needs max traction force, max traction power and max speed";
        account.unknown("effort", why);
        return Ok(None);
    };
    let how = "the smaller of force and power / v, at points up to max speed";
    account.taken("max traction force, max traction power", "effort", how);
    let mut points = vec![(0.0, force_n)];
    let mut speed_mps = power_w / force_n;
    while speed_mps < top_mps {
        points.push((speed_mps, power_w / speed_mps));
        speed_mps *= SPEED_RATIO;
    }
    points.push((top_mps, force_n.min(power_w / top_mps)));
    Ok(Some(points))
}
