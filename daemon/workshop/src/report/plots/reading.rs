//! Pointer readings of a chart: the data behind the picture, at the resolution of the picture.

use serde_json::{Value, json};

/// Number of steps that a picture resolves in the range of a quantity.
const STEPS: f64 = 2000.0;
/// Number of columns that a picture resolves.
const COLUMNS: f64 = 1000.0;

/// A quantity over a chart's horizontal axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name for people.
    pub name: String,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// Its values.
    pub values: Vec<f64>,
    /// Half widths of their 95 % intervals; empty where none are known.
    pub halves: Vec<f64>,
}

/// Pointer readings of one chart.
#[derive(Clone, Debug, PartialEq)]
pub struct PointerReading {
    /// Name of the horizontal axis.
    pub name: String,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// True where the data are points, false where they are a line between them.
    pub is_points: bool,
    /// Where the data are, ascending; no number where a line breaks.
    pub at: Vec<f64>,
    /// The data.
    pub series: Vec<Series>,
}

impl PointerReading {
    /// Returns a chart without data yet.
    pub fn new(name: impl Into<String>, unit: &'static str, is_points: bool, at: Vec<f64>) -> Self {
        PointerReading { name: name.into(), unit, is_points, at, series: Vec::new() }
    }

    /// Returns the same with a series more.
    #[must_use]
    pub fn with(
        mut self,
        name: impl Into<String>,
        unit: &'static str,
        values: Vec<f64>,
        halves: Vec<f64>,
    ) -> Self {
        self.series.push(Series { name: name.into(), unit, values, halves });
        self
    }

    fn json(&self) -> Value {
        let decimals = digits(self.series.iter().flat_map(|it| &it.values));
        let series = self.series.iter().map(|it| {
            let [values, halves] = [&it.values, &it.halves].map(|list| coded(list, decimals));
            json!([it.name, it.unit, values, halves])
        });
        let series: Vec<Value> = series.collect();
        let is_count = self.at.iter().all(|at| at.fract() == 0.0);
        let at = coded(&self.at, if is_count { 0 } else { 1 + digits(&self.at) });
        json!({ "x": [self.name, self.unit], "points": self.is_points, "at": at, "series": series })
    }
}

/// Returns the readings of a plot's charts, for the page's script.
pub fn json(readings: &[PointerReading]) -> String {
    Value::from(readings.iter().map(PointerReading::json).collect::<Vec<_>>()).to_string()
}

/// Decimals in which a picture of these values shows a difference.
fn digits<'v>(values: impl IntoIterator<Item = &'v f64>) -> i32 {
    let finite = values.into_iter().filter(|value| value.is_finite());
    let (low, high) =
        finite.fold((f64::MAX, f64::MIN), |range, it| (range.0.min(*it), range.1.max(*it)));
    let step = if high > low { (high - low) / STEPS } else { 1e-3 };
    (-step.log10()).round().clamp(0.0, 9.0) as i32
}

/// Returns the values as whole numbers, each less the one before: decimals first, null for no number.
fn coded(values: &[f64], digits: i32) -> Value {
    if values.is_empty() {
        return Value::Null;
    }
    let mut last = 0;
    let steps = values.iter().map(|value| {
        let whole = (value * 10f64.powi(digits)).round();
        value.is_finite().then(|| whole as i64 - std::mem::replace(&mut last, whole as i64))
    });
    let first = std::iter::once(Some(i64::from(digits)));
    first.chain(steps).map(Value::from).collect::<Vec<_>>().into()
}

/// Returns a line with the first, least, greatest and last point of every column of a picture.
pub fn thinned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return points };
    if points.len() as f64 <= 4.0 * COLUMNS {
        return points;
    }
    let (from, width) = (first.0, (last.0 - first.0) / COLUMNS);
    let column = |point: &(f64, f64)| ((point.0 - from) / width).floor();
    let mut thin = Vec::new();
    for group in points.chunk_by(|one, other| column(one) == column(other)) {
        let index = |k: Option<usize>| k.unwrap_or(0);
        let by_value = |one: &usize, other: &usize| group[*one].1.total_cmp(&group[*other].1);
        let low = index((0..group.len()).min_by(by_value));
        let high = index((0..group.len()).max_by(by_value));
        let mut kept = [0, low, high, group.len() - 1];
        kept.sort_unstable();
        thin.extend(kept.map(|k| group[k]));
    }
    thin
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_are_whole_steps_as_fine_as_the_picture_shows_them() {
        let at = vec![0.0, 2.5, f64::NAN, 100.0];
        let reading = PointerReading::new("Time", "s", false, at).with(
            "speed",
            "m/s",
            vec![1.0, 1.5, f64::NAN, -3.0],
            Vec::new(),
        );
        assert_eq!(
            json(&[reading]),
            r#"[{"at":[2,0,250,null,9750],"points":false,"series":[["speed","m/s",[3,1000,500,null,-4500],null]],"x":["Time","s"]}]"#
        );
    }

    #[test]
    fn a_thinned_line_keeps_its_ends_and_every_peak() {
        let mut points: Vec<(f64, f64)> =
            (0..100_000).map(|k| (f64::from(k), f64::from(k % 7))).collect();
        points[54_321].1 = 99.0;
        let thin = thinned(points.clone());
        assert!(thin.len() <= 4100, "{}", thin.len());
        assert_eq!((thin.first(), thin.last()), (points.first(), points.last()));
        assert!(thin.contains(&(54_321.0, 99.0)) && thin.is_sorted_by_key(|point| point.0));
        let short = points[..10].to_vec();
        assert_eq!(thinned(short.clone()), short);
    }
}
