//! A train of TTOBench: resistance in kN over km/h, and greatest force and power of its drive.

use dynocar_model::train::numbers::{LENGTH, MASS, ROTATING_MASS_FACTOR};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_model::units::Dimension;

use super::imported::{Account, ImportedTrain};
use super::ttobench::{coefficient, id, rest, value};
use crate::dataset::DatasetError;
use crate::dataset::document::{Item, above_zero};

/// Why fields have no place, and which.
const WITHOUT_PLACE: [(&str, &str); 6] = [
    ("train.toml holds no seats", "num seats"),
    (
        "one of two brakes with limits of their own: write [brake] by hand",
        "max reg braking force, max reg braking power, max pn braking force",
    ),
    ("train.toml holds no limit of acceleration", "max acceleration"),
    ("train.toml holds no limit of deceleration", "max deceleration"),
    ("no limit of speed has a place; the effort curve ends there", "max speed"),
    ("train.toml holds no losses", "efficiency traction, efficiency reg brake"),
];
/// The hyperbola of constant power is drawn through points whose speeds grow by this factor: the
/// straight lines between them lie 0.3 % above it at most.
const SPEED_RATIO: f64 = 1.12;

/// The train of a file.
pub(super) fn train(root: &Item) -> Result<ImportedTrain, DatasetError> {
    let id = id(root)?;
    let mut account = Account::default();
    root.need("mass", "a mass with its unit")?;
    let mass_kg = value(root, "mass", Dimension::Mass, "a mass from 1000 to 1e8 kg", 1e3..=1e8)?
        .unwrap_or_default();
    account.taken("mass", MASS.name, "t");
    account.unknown(LENGTH.name, "the format has none");
    let rho = value(root, "rho", Dimension::Ratio, "a share from 0 to 1 of the mass", 0.0..=1.0)?;
    let key = (ROTATING_MASS_FACTOR.name, "as a share of the mass");
    let rotating_mass_factor = account.given(rho, "rho", key, "no rho");
    let coaches = root.get("num coaches").map(|item| {
        let is_count = |it: f64| (1.0..=1000.0).contains(&it) && it.fract() == 0.0;
        let count = item.need("value", "a number of coaches")?;
        Ok(count.checked("a whole number from 1 to 1000", is_count)? as u32)
    });
    let key = ("cars", "as it stands");
    let cars = account.given(coaches.transpose()?, "num coaches", key, "no num coaches");
    let resistance = resistance(root, mass_kg, &mut account)?;
    let traction = traction(root, &mut account)?;
    rest(&mut account, root, &WITHOUT_PLACE);
    Ok(ImportedTrain {
        id: id.into(),
        place: root.place(),
        name: id.into(),
        mass_kg: Some(mass_kg),
        brake_mps2: None,
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
) -> Result<Option<Davis>, DatasetError> {
    let keys = ["rolling resistance r0", "rolling resistance r1", "rolling resistance r2"];
    let items = keys.map(|key| root.get(key));
    let weight_kn = TrainModel::weight_kn(mass_kg);
    let mut found = [0.0; 3];
    for (power, (key, item)) in keys.into_iter().zip(&items).enumerate() {
        let Some(item) = item else {
            account.unknown("a, b, c", format!("no {key}"));
            return Ok(None);
        };
        let (value, unit) = coefficient(item, power as i32)?;
        found[power] = value / weight_kn;
        let how = format!("{unit} by the weight of {weight_kn:.2} kN");
        account.taken(key, ["a", "b", "c"][power], how);
    }
    let [a, b, c] = found;
    Ok(Some(Davis { a, b, c }))
}

/// The smaller of force and power / speed, up to the greatest speed.
fn traction(root: &Item, account: &mut Account) -> Result<Option<Vec<(f64, f64)>>, DatasetError> {
    let (force, power, top) = ("max traction force", "max traction power", "max speed");
    let force = value(root, force, Dimension::Force, "from 1 to 1e7 N", 1.0..=1e7)?;
    let power = value(root, power, Dimension::Power, "from 1 to 1e9 W", 1.0..=1e9)?;
    let top = value(root, top, Dimension::Speed, "a speed up to 200 m/s", above_zero(200.0))?;
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
