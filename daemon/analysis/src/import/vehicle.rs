//! A vehicle of railtoolkit's rolling stock, and the law of its resistance.
//!
//! The schema states three coefficients of resistance in ‰ and no law. The laws are those by which
//! TrainRuns.jl, the schema's own program, reads them (Wende: Fahrdynamik des Schienenverkehrs, 2003,
//! pages 151 and 153), for each kN of weight, with v in m/s, v0 = 100 km/h and a head wind of w = 15 km/h:
//!
//! - traction and multiple units: base on driving axles, rolling on carrying axles, air ((v + w) / v0)²
//! - freight wagons (Strahl): base + air (v / v0)²
//! - passenger coaches (Sauthoff): base + rolling v / v0 + air ((v + w) / v0)²

use dynocar_model::train::{Davis, EffortCurve};

use super::imported::force_n;
use crate::dataset::DatasetError;
use crate::dataset::document::{Item, above_zero};
use crate::dataset::train_file::{EffortEntry, growing};

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
