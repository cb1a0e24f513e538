//! The curves of a way.

use super::way::Way;

/// Half the length in m over which a change of direction is measured.
const REACH_M: f64 = 40.0;
/// A greater radius in m is straight.
const RADIUS_MAX_M: f64 = 2500.0;
/// A shorter curve in m is none.
const LENGTH_MIN_M: f64 = 30.0;

/// A curve of a way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundCurve {
    /// Along the way in m from where.
    pub from_m: f64,
    /// To where.
    pub to_m: f64,
    /// Mean radius in m.
    pub radius_m: f64,
}

/// The curves of a way, one after the other.
pub fn curves(way: &Way) -> Vec<FoundCurve> {
    let step_m = way.step_m();
    let count = way.nodes_m().len();
    let curvature: Vec<f64> = (0..count)
        .map(|node| {
            let at_m = node as f64 * step_m;
            let (from, to) = (way.direction(at_m - REACH_M), way.direction(at_m + REACH_M));
            let cross = from[0] * to[1] - from[1] * to[0];
            let dot = from[0] * to[0] + from[1] * to[1];
            cross.atan2(dot) / (2.0 * REACH_M)
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
            let from_m = (first as f64 - 0.5).max(0.0) * step_m;
            found.push(FoundCurve { from_m, to_m: from_m + length_m, radius_m });
        }
        first = end;
    }
    found
}

/// All the turning of a way in rad.
pub fn turning_rad(way: &Way) -> f64 {
    let nodes = way.nodes_m().len();
    let at = |node: usize| way.direction((node as f64 + 0.5) * way.step_m());
    (1..nodes.saturating_sub(1))
        .map(|node| {
            let (from, to) = (at(node - 1), at(node));
            (from[0] * to[1] - from[1] * to[0]).atan2(from[0] * to[0] + from[1] * to[1]).abs()
        })
        .sum()
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
            let way = 10.0 * f64::from(k);
            points.push([last[0] + way * angle.cos(), last[1] + way * angle.sin()]);
        }
        let found = curves(&Way::through(&points).unwrap());
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0].radius_m - 800.0).abs() < 60.0, "{found:?}");
        assert!((found[0].to_m - found[0].from_m - 800.0).abs() < 80.0);
    }
}
