//! TTOBench files, whose values state their unit: a train with its resistance in kN over km/h and the greatest force and
//! power of its drive; a track with stops, permitted speeds, gradients and curvatures along it.

use std::ops::{Bound, RangeBounds};

use dynocar_model::track::TrackCurve;
use dynocar_model::train::numbers::{LENGTH, MASS, ROTATING_MASS_FACTOR};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_model::units::{Dimension, Unit};

use super::imported::{Account, ImportedLine, ImportedTrain};
use crate::dataset::document::{Item, above_zero};
use crate::dataset::keys::track::{GRADIENT, PERMITTED_SPEED};
use crate::dataset::{DatasetError, keys};

/// Returns the unit named under a key of a map, by the field's spelling of it.
pub(super) fn unit(item: &Item, key: &str, dimension: Dimension) -> Result<Unit, DatasetError> {
    let stated = item.need(key, "a unit")?;
    let name = stated.text("a unit")?;
    // "permil" is theirs, "permille" ours.
    let known = if name == "permil" { "permille" } else { name };
    Unit::find(dimension, known)
        .ok_or_else(|| stated.unknown("unit", name, Unit::of(dimension).map(|it| it.name())))
}

/// Returns a `{ unit, value }` under a key in its dimension's base unit, when there is one; `allowed` names the
/// range in it.
pub(super) fn value(
    root: &Item,
    key: &str,
    dimension: Dimension,
    allowed: &str,
    range: impl RangeBounds<f64>,
) -> Result<Option<f64>, DatasetError> {
    let Some(item) = root.get(key) else { return Ok(None) };
    let unit = unit(&item, "unit", dimension)?;
    item.need("value", "a number")?.in_unit(&unit, allowed, range).map(Some)
}

/// Returns the coefficient of resistance of a value in N/(m/s)^power, with its unit.
pub(super) fn coefficient<'t>(item: &Item<'t>, power: i32) -> Result<(f64, &'t str), DatasetError> {
    let stated = item.need("unit", "a unit")?;
    let name = stated.text("a unit")?;
    let known = || {
        Unit::of(Dimension::Force).flat_map(move |force| {
            Unit::of(Dimension::Speed).map(move |speed| {
                let per = match power {
                    0 => String::new(),
                    1 => format!("/({})", speed.name()),
                    power => format!("/({})^{power}", speed.name()),
                };
                let factor = force.to_base(1.0) / speed.to_base(1.0).powi(power);
                (format!("{}{per}", force.name()), factor)
            })
        })
    };
    let Some((_, factor)) = known().find(|(known, _)| known == name) else {
        let mut names: Vec<String> = known().map(|(known, _)| known).collect();
        names.dedup();
        return Err(stated.unknown("unit", name, names));
    };
    let value = item.need("value", "a number")?.number("a number from 0 to 1e9", 0.0..=1e9)?;
    Ok((value * factor, name))
}

/// Returns the words that name a file: the identifier of its metadata.
pub(super) fn id<'t>(root: &Item<'t>) -> Result<&'t str, DatasetError> {
    root.need("metadata", "keys and values with an id")?.need("id", "an identifier")?.text("an id")
}

/// Accounts for the fields of a file and of its metadata that were not taken.
pub(super) fn rest(account: &mut Account, root: &Item, without_place: &[(&str, &str)]) {
    account.rest("", root, without_place);
    if let Some(metadata) = root.get("metadata") {
        account.rest("metadata.", &metadata, &METADATA);
    }
}

/// Why fields of the metadata have no place, and which.
const METADATA: [(&str, &str); 4] = [
    ("neither file holds a version", "library version"),
    ("neither file holds an author", "created by"),
    ("neither file holds a licence: mind it where you publish the result", "license"),
    ("neither file holds a description", "description"),
];

/// Why fields of a train have no place, and which.
const TRAIN_WITHOUT_PLACE: [(&str, &str); 6] = [
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

/// Returns the train of a file.
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
    rest(&mut account, root, &TRAIN_WITHOUT_PLACE);
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

/// Returns the smaller of force and power / speed, up to the greatest speed.
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

/// Why fields of a track have no place, and which.
const TRACK_WITHOUT_PLACE: [(&str, &str); 1] =
    [("track.toml holds gradients, no height above the sea", "altitude")];
/// A transition curve becomes pieces of constant radius of this length in m at most.
const PIECE_M: f64 = 20.0;
/// A flatter curve than of this radius in m resists by less than 0.03 N/kN: it is straight.
const RADIUS_MAX_M: f64 = 25_000.0;
/// No line is longer, in m.
const POSITION_MAX_M: f64 = 1e7;
/// The sharpest radius in m of any railway is larger.
const RADIUS_MIN_M: f64 = 10.0;

/// Returns the line of a file.
pub(super) fn line(root: &Item) -> Result<ImportedLine, DatasetError> {
    let id = id(root)?;
    let mut account = Account::default();
    let stops = stops(root)?;
    let length_m = stops[stops.len() - 1];
    account.taken("stops", keys::track::LENGTH.name, "m, the last stop");
    account.taken("stops", "stops", "m; the format has no names");
    let speeds = root.get("speed limits").map(|item| {
        pairs(&item, ("velocity", Dimension::Speed), "up to 200 m/s", above_zero(200.0))
    });
    let (field, key) = ("speed limits", (PERMITTED_SPEED.name, "to m/s"));
    let permitted_speed = account.given(speeds.transpose()?, field, key, "no speed limits");
    let slopes = root.get("gradients").map(|item| {
        let list = pairs(&item, ("slope", Dimension::Ratio), "within 0.15", -0.15..=0.15)?;
        Ok(list.into_iter().map(|(at_m, slope)| (at_m, 1000.0 * slope)).collect())
    });
    let level = GRADIENT.assign("[[0.0, 0.0]]");
    let why = &format!("no gradients; the format means a level line: {level} says so");
    let key = ("gradient", "to ‰, climbing positive");
    let gradient = account.given(slopes.transpose()?, "gradients", key, why);
    let curves = root.get("curvatures").map(|item| curves(&item, length_m)).transpose()?;
    let how = "m, without sign; transitions in pieces of 20 m at most, mean curvature kept";
    let why = "no curvatures; the format means a straight line, but real ones leave them out \
               too: curves = [] says that there are none";
    let curves = account.given(curves, "curvatures", ("curves", how), why);
    account.unknown("tunnels", "the format has none");
    rest(&mut account, root, &TRACK_WITHOUT_PLACE);
    Ok(ImportedLine {
        id: id.into(),
        place: root.place(),
        name: id.into(),
        length_m,
        gradient,
        curves,
        stops: stops.into_iter().map(|at_m| (at_m, String::new())).collect(),
        permitted_speed,
        account,
    })
}

fn stops(root: &Item) -> Result<Vec<f64>, DatasetError> {
    let item = root.need("stops", "stops with their unit")?;
    let unit = unit(&item, "unit", Dimension::Length)?;
    let mut stops = Vec::new();
    for stop in item.need("values", "a list of positions")?.list("stops", 2)? {
        stops.push(position_m(&stop, &unit, stops.last().copied())?);
    }
    Ok(stops)
}

fn position_m(item: &Item, unit: &Unit, before_m: Option<f64>) -> Result<f64, DatasetError> {
    let (allowed, least) = match before_m {
        Some(before_m) => {
            let allowed = format!("a position above the one before ({before_m} m)");
            (allowed, Bound::Excluded(before_m))
        }
        None => ("a position from 0 to 1e7 m".into(), Bound::Included(0.0)),
    };
    item.in_unit(unit, &allowed, (least, Bound::Included(POSITION_MAX_M)))
}

/// Pairs of position in m and a value in its dimension's base unit.
fn pairs(
    item: &Item,
    (name, dimension): (&str, Dimension),
    allowed: &str,
    range: impl RangeBounds<f64> + Clone,
) -> Result<Vec<(f64, f64)>, DatasetError> {
    let units = item.need("units", "the units of the values")?;
    let (along, unit) =
        (unit(&units, "position", Dimension::Length)?, unit(&units, name, dimension)?);
    let mut list: Vec<(f64, f64)> = Vec::new();
    for pair in item.need("values", "a list of pairs")?.list("pairs", 1)? {
        let [at, value] = pair.tuple("[position, value]")?;
        let at_m = position_m(&at, &along, list.last().map(|before| before.0))?;
        list.push((at_m, value.in_unit(&unit, allowed, range.clone())?));
    }
    Ok(list)
}

/// Curves from triples of position and the radius there and before the next.
fn curves(item: &Item, length_m: f64) -> Result<Vec<TrackCurve>, DatasetError> {
    let units = item.need("units", "the units of the values")?;
    let along = unit(&units, "position", Dimension::Length)?;
    let from = unit(&units, "radius at start", Dimension::Length)?;
    let to = unit(&units, "radius at end", Dimension::Length)?;
    let mut sections: Vec<(f64, [f64; 2])> = Vec::new();
    for triple in item.need("values", "a list of triples")?.list("triples", 1)? {
        let [at, start, end] = triple.tuple("[position, radius at start, radius at end]")?;
        let at_m = position_m(&at, &along, sections.last().map(|before| before.0))?;
        sections.push((at_m, [curvature_per_m(&start, &from)?, curvature_per_m(&end, &to)?]));
    }
    let mut curves = Vec::new();
    for (index, &(start_m, [first, last])) in sections.iter().enumerate() {
        let end_m = sections.get(index + 1).map_or(length_m, |next| next.0);
        let pieces =
            if first == last { 1.0 } else { ((end_m - start_m) / PIECE_M).ceil().max(1.0) };
        let step_m = (end_m - start_m) / pieces;
        for piece in 0..pieces as usize {
            let piece = piece as f64;
            // Curvature is linear along a transition: the middle has the mean.
            let curvature = first + (last - first) * (piece + 0.5) / pieces;
            // No rounding may let the last piece reach into the next section.
            let ends_here = piece + 1.0 >= pieces;
            let piece_end_m = if ends_here { end_m } else { start_m + (piece + 1.0) * step_m };
            let piece_start_m = start_m + piece * step_m;
            if curvature.abs() * RADIUS_MAX_M >= 1.0 && piece_end_m > piece_start_m {
                let radius_m = 1.0 / curvature.abs();
                curves.push(TrackCurve { start_m: piece_start_m, end_m: piece_end_m, radius_m });
            }
        }
    }
    Ok(curves)
}

/// Returns the reciprocal of a radius, which is "infinity" where the line is straight.
fn curvature_per_m(item: &Item, unit: &Unit) -> Result<f64, DatasetError> {
    if item.text("a radius").is_ok_and(|text| text == "infinity") {
        return Ok(0.0);
    }
    let radius = item.checked("a radius of 10 m or more, or \"infinity\"", |radius| {
        unit.to_base(radius).abs() >= RADIUS_MIN_M
    })?;
    Ok(1.0 / unit.to_base(radius))
}
