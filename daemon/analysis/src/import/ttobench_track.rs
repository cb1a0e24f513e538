//! A track of TTOBench: stops, permitted speeds, gradients and curvatures along it.

use std::ops::{Bound, RangeBounds};

use dynocar_model::track::TrackCurve;
use dynocar_model::units::{Dimension, Unit};

use super::imported::{Account, ImportedLine};
use super::ttobench::{id, rest, unit};
use crate::dataset::DatasetError;
use crate::dataset::document::{Item, above_zero};
use crate::dataset::keys::track::{GRADIENT, LENGTH, PERMITTED_SPEED};

const WITHOUT_PLACE: [(&str, &str); 1] =
    [("track.toml holds gradients, no height above the sea", "altitude")];
/// A transition curve becomes pieces of constant radius of this length in m at most.
const PIECE_M: f64 = 20.0;
/// A flatter curve than of this radius in m resists by less than 0.03 N/kN: it is straight.
const RADIUS_MAX_M: f64 = 25_000.0;
/// No line is longer, in m.
const POSITION_MAX_M: f64 = 1e7;
/// The sharpest radius in m of any railway is larger.
const RADIUS_MIN_M: f64 = 10.0;

/// The line of a file.
pub(super) fn line(root: &Item) -> Result<ImportedLine, DatasetError> {
    let id = id(root)?;
    let mut account = Account::default();
    let stops = stops(root)?;
    let length_m = stops[stops.len() - 1];
    account.taken("stops", LENGTH.name, "m, the last stop");
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
    rest(&mut account, root, &WITHOUT_PLACE);
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

/// The reciprocal of a radius, which is "infinity" where the line is straight.
fn curvature_per_m(item: &Item, unit: &Unit) -> Result<f64, DatasetError> {
    if item.text("a radius").is_ok_and(|text| text == "infinity") {
        return Ok(0.0);
    }
    let radius = item.checked("a radius of 10 m or more, or \"infinity\"", |radius| {
        unit.to_base(radius).abs() >= RADIUS_MIN_M
    })?;
    Ok(1.0 / unit.to_base(radius))
}
