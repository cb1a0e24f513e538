//! The curves of an alignment.

use super::alignment::Alignment;

/// Half the length in m over which a change of direction is measured.
const REACH_M: f64 = 40.0;
/// A greater radius in m is straight.
const RADIUS_MAX_M: f64 = 2500.0;
/// A shorter curve in m is none.
const LENGTH_MIN_M: f64 = 30.0;
/// A curve that reaches an end of an alignment goes on beyond it for so many m: under half a train.
const BEYOND_M: f64 = 110.0;

/// A curve of an alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundCurve {
    /// Along the alignment in m from where.
    pub from_m: f64,
    /// To where.
    pub to_m: f64,
    /// Mean radius in m.
    pub radius_m: f64,
}

/// The curves of an alignment, one after the other.
pub fn curves(alignment: &Alignment) -> Vec<FoundCurve> {
    let step_m = alignment.step_m();
    let count = alignment.nodes_m().len();
    let reach = (REACH_M / step_m).round().max(1.0) as usize;
    let direction = |segment: usize| alignment.direction((segment as f64 + 0.5) * step_m);
    let curvature: Vec<f64> = (0..count)
        .map(|node| {
            // Near an end the turning is that of the part that is there.
            let (first, last) = (node.saturating_sub(reach), (node + reach - 1).min(count - 2));
            let (from, to) = (direction(first), direction(last));
            turned_rad(from, to) / ((last - first).max(1) as f64 * step_m)
        })
        .collect();
    let mut found = Vec::new();
    let kind = |curvature: f64| match curvature.abs() * RADIUS_MAX_M >= 1.0 {
        true => curvature.signum() as i8,
        false => 0,
    };
    let mut first = 0;
    while first < count {
        let side = kind(curvature[first]);
        let end = (first..count).find(|&node| kind(curvature[node]) != side).unwrap_or(count);
        let length_m = (end - first) as f64 * step_m;
        if side != 0 && length_m >= LENGTH_MIN_M {
            let turned: f64 = curvature[first..end].iter().sum::<f64>() * step_m;
            let radius_m = length_m / turned.abs();
            let from_m = if first == 0 { -BEYOND_M } else { (first as f64 - 0.5) * step_m };
            let to_m = match end == count {
                true => alignment.length_m() + BEYOND_M,
                false => (end as f64 - 0.5) * step_m,
            };
            found.push(FoundCurve { from_m, to_m, radius_m });
        }
        first = end;
    }
    found
}

/// All the turning of an alignment in rad.
pub fn turning_rad(alignment: &Alignment) -> f64 {
    let nodes = alignment.nodes_m().len();
    let at = |node: usize| alignment.direction((node as f64 + 0.5) * alignment.step_m());
    (1..nodes.saturating_sub(1)).map(|node| turned_rad(at(node - 1), at(node)).abs()).sum()
}

/// How far one direction is turned from another, to the left.
fn turned_rad(from: [f64; 2], to: [f64; 2]) -> f64 {
    (from[0] * to[1] - from[1] * to[0]).atan2(from[0] * to[0] + from[1] * to[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arc_between_straights_is_a_curve_of_its_radius() {
        let mut points: Vec<[f64; 2]> = (0..50).map(|k| [10.0 * f64::from(k), 0.0]).collect();
        let start = points[49];
        for k in 1..=80 {
            let angle = 10.0 * f64::from(k) / 800.0;
            points.push([start[0] + 800.0 * angle.sin(), 800.0 * (1.0 - angle.cos())]);
        }
        let (last, angle) = (points[points.len() - 1], 1.0f64);
        for k in 1..50 {
            let alignment = 10.0 * f64::from(k);
            points.push([last[0] + alignment * angle.cos(), last[1] + alignment * angle.sin()]);
        }
        let found = curves(&Alignment::through(&points).unwrap());
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0].radius_m - 800.0).abs() < 60.0, "{found:?}");
        assert!((found[0].to_m - found[0].from_m - 800.0).abs() < 80.0);
    }
    #[test]
    fn a_curve_at_the_start_of_a_way_is_seen_from_there_on_and_goes_on_before_it() {
        let arc = |k: i32| {
            let angle = 10.0 * f64::from(k) / 400.0;
            [400.0 * angle.sin(), 400.0 * (1.0 - angle.cos())]
        };
        let points: Vec<[f64; 2]> = (0..30).map(arc).collect();
        let found = curves(&Alignment::through(&points).unwrap());
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0].radius_m - 400.0).abs() < 20.0, "{found:?}");
        assert!(found[0].from_m < -100.0 && found[0].to_m > 390.0, "{found:?}");
    }
}
