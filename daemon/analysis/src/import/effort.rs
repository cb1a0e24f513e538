//! Effort curves as the formats list them: force over a speed that grows.

use std::ops::RangeInclusive;

use super::error::ImportError;
use super::item::Item;
use crate::dataset::Problem;

/// How a format writes its speeds: in words, within which range, and how many of them are 1 m/s.
pub(super) struct Speeds {
    pub allowed: &'static str,
    pub range: RangeInclusive<f64>,
    pub per_mps: f64,
}

/// Points of (m/s, N) from the place, the speed and the force of each; `key` names the curve.
pub(super) fn points<'t>(
    key: &str,
    speeds: &Speeds,
    items: impl Iterator<Item = Result<[Item<'t>; 3], ImportError>>,
) -> Result<Vec<(f64, f64)>, ImportError> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (index, item) in items.enumerate() {
        let [place, speed, force] = item?;
        let speed_mps = speed.number(speeds.allowed, speeds.range.clone())? / speeds.per_mps;
        let force_n = force.number("a force in N from 0 to 1e7", 0.0..=1e7)?;
        if let Some(&(before, _)) = points.last()
            && speed_mps <= before
        {
            let (key, index, found) = (key.into(), index + 1, speed_mps);
            return Err(place.wrong(Problem::EffortOrder { key, index, found, before }));
        }
        points.push((speed_mps, force_n));
    }
    Ok(points)
}
