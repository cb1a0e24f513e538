//! railtoolkit's rolling stock: vehicles, and trains as formations of them (schema 2022.05; the later
//! main has the same).

use dynocar_model::train::numbers::{LENGTH, MASS, ROTATING_MASS_FACTOR};
use dynocar_model::train::{Davis, EffortCurve};

use super::imported::{Account, ImportReading, ImportedTrain};
use super::vehicle::{Kind, Vehicle, vehicle};
use crate::dataset::DatasetError;
use crate::dataset::document::Item;

const WITHOUT_PLACE: [(&str, &str); 4] = [
    ("train.toml holds no identifier", "UUID"),
    ("train.toml holds no picture", "picture"),
    ("train.toml holds no kind of propulsion", "power_type"),
    ("train.toml holds no speed limit", "speed_limit"),
];

/// The trains of files of one schema, whose vehicles may stand in another of the files. Without a
/// train each vehicle is one.
pub(super) fn trains(
    roots: &[Item],
    reading: &ImportReading,
) -> Result<Vec<ImportedTrain>, DatasetError> {
    let mut vehicles: Vec<Vehicle> = Vec::new();
    let mut trains: Vec<(&str, Item)> = Vec::new();
    for root in roots {
        let stock = root.get("vehicles");
        if stock.is_none() {
            root.need("trains", "a list of trains, or vehicles")?;
        }
        for item in list(stock, "vehicles")? {
            let vehicle = vehicle(item)?;
            unique(vehicles.iter().map(|it| (it.id, &it.item)), vehicle.id, &vehicle.item)?;
            vehicles.push(vehicle);
        }
        for item in list(root.get("trains"), "trains")? {
            let id = item.need_text("id", "an identifier")?;
            unique(trains.iter().map(|(id, it)| (*id, it)), id, &item)?;
            trains.push((id, item));
        }
    }
    if trains.is_empty() {
        let alone = |vehicle: &Vehicle| {
            let (id, name) = (vehicle.id, vehicle.name);
            let mut train = train(&vehicle.item, id, name, &[vehicle], reading);
            train.account.left("trains", "there is none: each vehicle counts as a train");
            train
        };
        return Ok(vehicles.iter().map(alone).collect());
    }
    let described = |(id, item): &(&str, Item)| -> Result<ImportedTrain, DatasetError> {
        let name = item.need_text("name", "a name")?;
        let mut train = train(item, id, name, &formation(item, &vehicles)?, reading);
        train.account.taken("trains.formation", "cars", "the number of vehicles");
        train.account.rest("trains.", item, &WITHOUT_PLACE);
        Ok(train)
    };
    trains.iter().map(described).collect()
}

fn list<'t>(item: Option<Item<'t>>, what: &str) -> Result<Vec<Item<'t>>, DatasetError> {
    item.map_or(Ok(Vec::new()), |item| item.list(what, 1))
}

/// Refuses an identifier that another of the same kind has.
pub(super) fn unique<'i, 't: 'i>(
    mut known: impl Iterator<Item = (&'t str, &'i Item<'t>)>,
    id: &str,
    item: &Item,
) -> Result<(), DatasetError> {
    let Some((_, first)) = known.find(|(other, _)| *other == id) else { return Ok(()) };
    let (key, line) = (item.full("id"), first.place().line.unwrap_or(1));
    Err(item
        .wrong(format!("{key} = '{id}': expected another than in line {line}, which is the same")))
}

fn formation<'v, 't>(
    item: &Item,
    vehicles: &'v [Vehicle<'t>],
) -> Result<Vec<&'v Vehicle<'t>>, DatasetError> {
    let expected = "identifiers of vehicles";
    let wanted = item.need("formation", expected)?.list(expected, 1)?;
    let find = |wanted: &Item| {
        let id = wanted.text(expected)?;
        vehicles.iter().find(|it| it.id == id).ok_or_else(|| {
            wanted.wrong(format!(
                "{}: the vehicle '{id}' is described in none of the files; give its file too",
                wanted.path
            ))
        })
    };
    wanted.iter().map(find).collect()
}

fn train(
    item: &Item,
    id: &str,
    name: &str,
    formation: &[&Vehicle],
    reading: &ImportReading,
) -> ImportedTrain {
    let mut account = Account::default();
    let share = reading.load_share;
    let sum = |value: &dyn Fn(&Vehicle) -> f64| formation.iter().map(|it| value(it)).sum::<f64>();
    let empty_kg = sum(&|it| it.empty_kg);
    let permitted_kg = sum(&|it| it.load_kg.unwrap_or(0.0));
    let count = formation.len();
    account.taken("vehicles.mass", MASS.name, format!("t, the sum over {count}"));
    let load_t = permitted_kg / 1000.0;
    match (permitted_kg > 0.0, share > 0.0) {
        (true, true) => {
            let how = format!("{:.4} t, {share} of what is permitted, added", share * load_t);
            account.taken("vehicles.load_limit", MASS.name, how);
        }
        (true, false) => {
            let why = format!("mass_t is the empty train's; --load 1 adds all of {load_t:.4} t");
            account.left("vehicles.load_limit", why);
        }
        (false, true) => account.left("vehicles.load_limit", "no vehicle has one: none is added"),
        (false, false) => {}
    }
    account.taken("vehicles.length", LENGTH.name, format!("m, the sum over {count}"));
    let rotating_mass_factor = rotating(formation, empty_kg, &mut account);
    let mass_kg = empty_kg + share * permitted_kg;
    let resistance = resistance(formation, share, mass_kg, &mut account);
    let traction = traction(formation, &mut account);
    for vehicle in formation {
        account.rest("vehicles.", &vehicle.item, &WITHOUT_PLACE);
    }
    ImportedTrain {
        id: id.into(),
        place: item.place(),
        name: name.into(),
        mass_kg: Some(mass_kg),
        brake_mps2: None,
        length_m: Some(sum(&|it| it.length_m)),
        cars: Some(count as u32),
        rotating_mass_factor,
        resistance,
        traction,
        account,
    }
}

/// The factors are means by empty mass, and hold for the train as it is loaded, as in TrainRuns.jl.
fn rotating(formation: &[&Vehicle], empty_kg: f64, account: &mut Account) -> Option<f64> {
    let mut inertia_kg = 0.0;
    for vehicle in formation {
        let Some(factor) = vehicle.rotation else {
            let why = format!("'{}' has no rotation_mass", vehicle.id);
            account.unknown(ROTATING_MASS_FACTOR.name, why);
            return None;
        };
        inertia_kg += factor * vehicle.empty_kg;
    }
    let how = "factor less 1, the mean by mass";
    account.taken("vehicles.rotation_mass", ROTATING_MASS_FACTOR.name, how);
    Some(inertia_kg / empty_kg - 1.0)
}

fn resistance(
    formation: &[&Vehicle],
    share: f64,
    mass_kg: f64,
    account: &mut Account,
) -> Option<Davis> {
    // In ‰ of kg: by the whole mass in kg they are N/kN.
    let mut total = [0.0; 3];
    for vehicle in formation {
        match vehicle.resistance(share) {
            Ok(Davis { a, b, c }) => {
                total.iter_mut().zip([a, b, c]).for_each(|(sum, own)| *sum += own);
            }
            Err(field) => {
                let why = format!("'{}' has no {field}, which its law needs", vehicle.id);
                account.unknown("a, b, c", why);
                return None;
            }
        }
        if vehicle.kind == Kind::Freight && vehicle.rolling.is_some() {
            let why = "of a freight wagon: its law (Strahl) has none";
            account.left("vehicles.rolling_resistance", why);
        }
    }
    let how = "‰ of weight, by the laws of TrainRuns.jl: v over 100 km/h, head wind 15 km/h";
    account.taken("vehicles.base_, rolling_, air_resistance", "a, b, c", how);
    let [a, b, c] = total.map(|sum| sum / mass_kg);
    Some(Davis { a, b, c })
}

/// The sum of the units' efforts, as far as all of them have one.
fn traction(formation: &[&Vehicle], account: &mut Account) -> Option<Vec<(f64, f64)>> {
    let powered = || formation.iter().filter(|it| it.kind == Kind::Powered);
    if let Some(without) = powered().find(|it| it.effort.is_none()) {
        account.unknown("effort", format!("'{}' has no tractive_effort", without.id));
        return None;
    }
    let curves: Vec<&EffortCurve> = powered().filter_map(|it| it.effort.as_ref()).collect();
    let ends = curves.iter().filter_map(|curve| curve.points().last()).map(|point| point.0);
    let Some(end_mps) = ends.min_by(f64::total_cmp) else {
        account.unknown("effort", "no vehicle has traction");
        return None;
    };
    let mut speeds: Vec<f64> =
        curves.iter().flat_map(|curve| curve.points()).map(|point| point.0).collect();
    speeds.retain(|speed| *speed <= end_mps);
    speeds.sort_unstable_by(f64::total_cmp);
    speeds.dedup();
    let how = match curves.len() {
        1 => "km/h / 3.6, N / 1000".into(),
        count => format!("km/h / 3.6, N / 1000, the sum of {count} units"),
    };
    account.taken("vehicles.tractive_effort", "effort", how);
    let at = |speed: f64| (speed, curves.iter().map(|curve| curve.force_n(speed)).sum());
    Some(speeds.into_iter().map(at).collect())
}
