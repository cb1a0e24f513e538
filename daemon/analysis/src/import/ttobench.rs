//! Common forms of TTOBench files: values that state their unit.

use std::ops::RangeBounds;

use dynocar_model::units::{Dimension, Unit};

use super::imported::Account;
use crate::dataset::DatasetError;
use crate::dataset::document::Item;

/// The unit named under a key of a map, by the field's spelling of it.
pub(super) fn unit(item: &Item, key: &str, dimension: Dimension) -> Result<Unit, DatasetError> {
    let stated = item.need(key, "a unit")?;
    let name = stated.text("a unit")?;
    // "permil" is theirs, "permille" ours.
    let known = if name == "permil" { "permille" } else { name };
    Unit::find(dimension, known)
        .ok_or_else(|| stated.unknown("unit", name, Unit::of(dimension).map(|it| it.name())))
}

/// A `{ unit, value }` under a key in its dimension's base unit, when there is one; `allowed` names the
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

/// The coefficient of resistance of a value in N/(m/s)^power, with its unit.
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

/// Words that name a file: the identifier of its metadata.
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
