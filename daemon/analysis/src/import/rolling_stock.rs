//! railtoolkit's rolling stock: vehicles, and trains as formations of them (schema 2022.05; the later
//! main has the same).

use dynocar_model::train::numbers::{LENGTH, MASS, ROTATING_MASS_FACTOR};
use dynocar_model::train::{Davis, EffortCurve};

use super::imported::{Account, ImportReading, ImportedTrain, force_n};
use crate::dataset::DatasetError;
use crate::dataset::document::{Item, above_zero};
use crate::dataset::train_file::{EffortEntry, growing};

const WITHOUT_PLACE: [(&str, &str); 4] = [
    ("train.toml holds no identifier", "UUID"),
    ("train.toml holds no picture", "picture"),
    ("train.toml holds no kind of propulsion", "power_type"),
    ("train.toml holds no speed limit", "speed_limit"),
];

/// Returns the trains of files of one schema, whose vehicles may stand in another of the files. If no file has a train,
/// each vehicle is one.
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

/// Returns the sum of the units' efforts, as far as all of them have one.
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

/// Speed in m/s at which the coefficients of speed hold.
const REFERENCE_MPS: f64 = 100.0 / 3.6;
/// Head wind in m/s.
const WIND_MPS: f64 = 15.0 / 3.6;

/// Which law a vehicle's resistance follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Powered,
    Freight,
    Passenger,
}

const KINDS: [(&str, Kind); 4] = [
    ("traction unit", Kind::Powered),
    ("multiple unit", Kind::Powered),
    ("freight", Kind::Freight),
    ("passenger", Kind::Passenger),
];

/// A vehicle as the file describes it.
pub(super) struct Vehicle<'t> {
    /// Where it stands.
    pub item: Item<'t>,
    /// Its identifier.
    pub id: &'t str,
    /// Its name.
    pub name: &'t str,
    /// Which law its resistance follows.
    pub kind: Kind,
    /// Length in m.
    pub length_m: f64,
    /// Mass in kg without load.
    pub empty_kg: f64,
    /// Permitted load in kg.
    pub load_kg: Option<f64>,
    /// Mass in kg on driving axles.
    pub driving_kg: Option<f64>,
    /// Basic resistance in ‰.
    pub base: Option<f64>,
    /// Resistance in ‰ of carrying axles, or with the speed.
    pub rolling: Option<f64>,
    /// Air resistance in ‰.
    pub air: Option<f64>,
    /// Factor for rotating mass.
    pub rotation: Option<f64>,
    /// Greatest traction force.
    pub effort: Option<EffortCurve>,
}

/// Reads a vehicle.
pub(super) fn vehicle(item: Item) -> Result<Vehicle, DatasetError> {
    let kind_item = item.need("vehicle_type", "a type of vehicle")?;
    let kind = kind_item.text("a type of vehicle")?;
    let (_, kind) = KINDS
        .into_iter()
        .find(|(name, _)| *name == kind)
        .ok_or_else(|| kind_item.unknown("type of vehicle", kind, KINDS.map(|(name, _)| name)))?;
    let mass = "a mass in t above 0, at most 1000";
    let permille = "a coefficient in permil above 0, at most 100";
    let length = "a length in m above 0, at most 1000";
    let tonnes = |key: &str| {
        let tonnes = item.optional(key, mass, above_zero(1000.0))?;
        Ok(tonnes.map(|it| it * 1000.0))
    };
    let resistance = |key: &str| item.optional(key, permille, above_zero(100.0));
    let empty_kg = item.required("mass", mass, above_zero(1000.0))? * 1000.0;
    let driving_kg = tonnes("mass_traction")?;
    if let (Some(driving_kg), Some(stated)) = (driving_kg, item.get("mass_traction"))
        && driving_kg > empty_kg
    {
        let allowed = "at most the vehicle's mass";
        return Err(stated.out_of_range(&(driving_kg / 1000.0).to_string(), allowed));
    }
    Ok(Vehicle {
        id: item.need_text("id", "an identifier")?,
        name: item.need_text("name", "a name")?,
        kind,
        length_m: item.required("length", length, above_zero(1000.0))?,
        empty_kg,
        load_kg: tonnes("load_limit")?,
        driving_kg,
        base: resistance("base_resistance")?,
        rolling: resistance("rolling_resistance")?,
        air: resistance("air_resistance")?,
        rotation: item.optional("rotation_mass", "a factor from 1 to 2", 1.0..=2.0)?,
        effort: item.get("tractive_effort").map(|list| effort(&list)).transpose()?,
        item,
    })
}

/// Pairs of km/h and N.
fn effort(list: &Item) -> Result<EffortCurve, DatasetError> {
    const FORM: &str = "pairs of speed in km/h and force in N";
    let points = list.list(FORM, 3)?.into_iter().map(|pair| {
        let [speed, force] = pair.tuple(FORM)?;
        let speed_mps = speed.number("a speed in km/h from 0 to 720", 0.0..=720.0)? / 3.6;
        Ok(EffortEntry { entry: pair, speed_mps, force_n: force_n(&force)? })
    });
    let points = growing(&list.path, points)?;
    Ok(EffortCurve::new(points).expect("three or more finite points of growing speed"))
}

impl Vehicle<'_> {
    /// a, b and c times the mass in kg, or the field that is missing.
    pub fn resistance(&self, share: f64) -> Result<Davis, &'static str> {
        let base = self.base.ok_or("base_resistance")?;
        let air = self.air.ok_or("air_resistance")?;
        let rolling = || self.rolling.ok_or("rolling_resistance");
        let loaded_kg = self.empty_kg + share * self.load_kg.unwrap_or(0.0);
        let still = |kg: f64| kg / REFERENCE_MPS.powi(2);
        Ok(match self.kind {
            Kind::Powered => {
                let driving_kg = match (self.driving_kg, self.rolling) {
                    (Some(driving_kg), _) => driving_kg,
                    (None, None) => self.empty_kg,
                    (None, Some(_)) => return Err("mass_traction"),
                };
                let carrying_kg = self.empty_kg - driving_kg;
                let carried = if carrying_kg > 0.0 { rolling()? * carrying_kg } else { 0.0 };
                against_wind(base * driving_kg + carried, 0.0, still(air * self.empty_kg))
            }
            Kind::Freight => Davis { a: base * loaded_kg, b: 0.0, c: still(air * loaded_kg) },
            Kind::Passenger => {
                let linear = rolling()? * loaded_kg / REFERENCE_MPS;
                against_wind(base * loaded_kg, linear, still(air * loaded_kg))
            }
        })
    }
}

/// a + b v + c (v + wind)².
fn against_wind(a: f64, b: f64, c: f64) -> Davis {
    Davis { a: a + c * WIND_MPS.powi(2), b: b + 2.0 * c * WIND_MPS, c }
}
