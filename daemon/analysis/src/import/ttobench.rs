//! What the files of TTOBench have in common: values that state their unit.

use dynocar_model::units::{Dimension, Unit};

use super::error::ImportError;
use super::item::Item;
use crate::dataset::{Choices, Problem};

/// The unit named under a key of a map, by the field's spelling of it.
pub(super) fn unit(item: &Item, key: &str, dimension: Dimension) -> Result<Unit, ImportError> {
    let stated = item.need(key, "a unit")?;
    let name = stated.text("a unit")?;
    // "permil" is theirs, "permille" ours.
    let known = if name == "permil" { "permille" } else { name };
    Unit::find(dimension, known).ok_or_else(|| {
        unknown_unit(&stated, name, Unit::of(dimension).map(|it| it.name().to_string()))
    })
}

fn unknown_unit(item: &Item, name: &str, names: impl Iterator<Item = String>) -> ImportError {
    let choices = Choices::new(name, names);
    let context = format!(" in {}", item.path);
    item.wrong(Problem::UnknownName { what: "unit", name: name.into(), context, choices })
}

/// A `{ unit, value }` under a key in its dimension's base unit, when there is one; `allowed` names the
/// range in it.
pub(super) fn value(
    root: &Item,
    key: &str,
    dimension: Dimension,
    allowed: &str,
    is_allowed: impl Fn(f64) -> bool,
) -> Result<Option<f64>, ImportError> {
    let Some(item) = root.get(key) else { return Ok(None) };
    let unit = unit(&item, "unit", dimension)?;
    let value = item.need("value", "a number")?;
    let base = |number: f64| unit.to_base(number);
    Ok(Some(base(value.number(allowed, |number| is_allowed(base(number)))?)))
}

/// A coefficient of resistance under a key in N/(m/s)^power, with its unit, when there is one.
pub(super) fn coefficient<'t>(
    root: &Item<'t>,
    key: &str,
    power: i32,
) -> Result<Option<(f64, &'t str)>, ImportError> {
    let Some(item) = root.get(key) else { return Ok(None) };
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
        return Err(unknown_unit(&stated, name, names.into_iter()));
    };
    let value = item
        .need("value", "a number")?
        .number("a number from 0 to 1e9", |value| (0.0..=1e9).contains(&value))?;
    Ok(Some((value * factor, name)))
}

/// Words that name a file: the identifier of its metadata.
pub(super) fn id<'t>(root: &Item<'t>) -> Result<&'t str, ImportError> {
    root.need("metadata", "keys and values with an id")?.need("id", "an identifier")?.text("an id")
}

/// Reasons for fields of the metadata that have no place.
pub(super) const METADATA: [(&str, &str); 4] = [
    ("library version", "neither file holds a version"),
    ("created by", "neither file holds an author"),
    ("license", "neither file holds a licence: mind it where you publish the result"),
    ("description", "neither file holds a description"),
];
