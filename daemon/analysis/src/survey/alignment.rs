//! Geographical positions as metres on a plane; and an alignment there: points of equal spacing, found by chainage and
//! by place, and its curves.

use std::collections::HashMap;

/// Distance in m between the nodes of an alignment.
pub const NODE_STEP_M: f64 = 10.0;
/// Size in m of the cells by which places are found.
const CELL_M: f64 = 50.0;

/// An alignment as a line through nodes about 10 m apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment {
    nodes_m: Vec<[f64; 2]>,
    step_m: f64,
    cells: HashMap<(i64, i64), Vec<u32>>,
}

/// Position of a point relative to an alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// Chainage in m of the nearest point of the alignment.
    pub chainage_m: f64,
    /// Distance in m from it, positive to the left.
    pub left_m: f64,
}

impl Alignment {
    /// Returns an alignment through points; `None` when it would be shorter than a step between its nodes.
    pub fn through(points_m: &[[f64; 2]]) -> Option<Alignment> {
        let mut sums = vec![0.0];
        for pair in points_m.windows(2) {
            sums.push(sums[sums.len() - 1] + distance_squared(pair[0], pair[1]).sqrt());
        }
        let length_m = sums[sums.len() - 1];
        if points_m.len() < 2 || !(length_m > NODE_STEP_M) {
            return None;
        }
        let count = (length_m / NODE_STEP_M).round().max(1.0) as usize;
        let step_m = length_m / count as f64;
        let mut segment = 0;
        let nodes_m: Vec<[f64; 2]> = (0..=count)
            .map(|k| {
                let at_m = k as f64 * step_m;
                while segment + 2 < sums.len() && sums[segment + 1] <= at_m {
                    segment += 1;
                }
                let span_m = (sums[segment + 1] - sums[segment]).max(1e-9);
                between(points_m[segment], points_m[segment + 1], (at_m - sums[segment]) / span_m)
            })
            .collect();
        let mut cells: HashMap<(i64, i64), Vec<u32>> = HashMap::new();
        for (k, node) in nodes_m.iter().enumerate() {
            cells.entry(cell(*node)).or_default().push(k as u32);
        }
        Some(Alignment { nodes_m, step_m, cells })
    }

    /// Returns the same alignment driven the other way round.
    pub fn reversed(&self) -> Option<Alignment> {
        Alignment::through(&self.nodes_m.iter().rev().copied().collect::<Vec<_>>())
    }

    /// Returns its nodes, east and north in m.
    pub fn nodes_m(&self) -> &[[f64; 2]] {
        &self.nodes_m
    }

    /// Returns the distance in m between its nodes.
    pub fn step_m(&self) -> f64 {
        self.step_m
    }

    /// Returns its length in m.
    pub fn length_m(&self) -> f64 {
        self.step_m * (self.nodes_m.len() - 1) as f64
    }

    /// Returns the point at a chainage in m, straight on beyond the ends.
    pub fn at(&self, chainage_m: f64) -> [f64; 2] {
        let segment = self.segment(chainage_m);
        let share = chainage_m / self.step_m - segment as f64;
        between(self.nodes_m[segment], self.nodes_m[segment + 1], share)
    }

    /// Returns the direction at a chainage, as a unit vector.
    pub fn direction(&self, chainage_m: f64) -> [f64; 2] {
        let segment = self.segment(chainage_m);
        let (from, to) = (self.nodes_m[segment], self.nodes_m[segment + 1]);
        let length = distance_squared(from, to).sqrt().max(1e-9);
        [(to[0] - from[0]) / length, (to[1] - from[1]) / length]
    }

    /// The nearest point within a window of chainages in m.
    pub fn beside(&self, point_m: [f64; 2], from_m: f64, to_m: f64) -> Foot {
        let (first, last) = (self.segment(from_m), self.segment(to_m));
        let mut nearest = (f64::INFINITY, Foot { chainage_m: from_m, left_m: f64::INFINITY });
        for segment in first..=last {
            let (from, to) = (self.nodes_m[segment], self.nodes_m[segment + 1]);
            let along = [to[0] - from[0], to[1] - from[1]];
            let offset = [point_m[0] - from[0], point_m[1] - from[1]];
            let squared = (along[0] * along[0] + along[1] * along[1]).max(1e-9);
            let share = (offset[0] * along[0] + offset[1] * along[1]) / squared;
            // The ends of the alignment go straight on.
            let low = if segment == 0 { f64::NEG_INFINITY } else { 0.0 };
            let high = if segment + 2 == self.nodes_m.len() { f64::INFINITY } else { 1.0 };
            let share = share.clamp(low, high);
            let distance = distance_squared(point_m, between(from, to, share));
            if distance < nearest.0 {
                let chainage_m = (segment as f64 + share) * self.step_m;
                let left = along[0] * offset[1] - along[1] * offset[0];
                nearest = (distance, Foot { chainage_m, left_m: distance.sqrt().copysign(left) });
            }
        }
        nearest.1
    }

    /// Nodes within `radius_m` (at most 50) of a point: their number and distance in m.
    pub fn nodes_near(
        &self,
        point_m: [f64; 2],
        radius_m: f64,
    ) -> impl Iterator<Item = (usize, f64)> + '_ {
        let (column, row) = cell(point_m);
        let around = (-1..=1).flat_map(move |x| (-1..=1).map(move |y| (column + x, row + y)));
        around.filter_map(|key| self.cells.get(&key)).flatten().filter_map(move |&node| {
            let distance = distance_squared(self.nodes_m[node as usize], point_m).sqrt();
            (distance < radius_m).then_some((node as usize, distance))
        })
    }

    fn segment(&self, chainage_m: f64) -> usize {
        ((chainage_m / self.step_m).max(0.0) as usize).min(self.nodes_m.len() - 2)
    }
}

fn cell(point_m: [f64; 2]) -> (i64, i64) {
    ((point_m[0] / CELL_M).floor() as i64, (point_m[1] / CELL_M).floor() as i64)
}

/// Half the length in m over which a change of direction is measured.
const REACH_M: f64 = 40.0;
/// A greater radius in m is straight.
const RADIUS_MAX_M: f64 = 2500.0;
/// Shortest curve in m.
const LENGTH_MIN_M: f64 = 30.0;
/// A curve that reaches an end of an alignment goes on beyond it for this many m: under half a train.
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

/// Returns the curves of an alignment, one after the other.
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

/// Returns all the turning of an alignment in rad.
pub fn turning_rad(alignment: &Alignment) -> f64 {
    let nodes = alignment.nodes_m().len();
    let at = |node: usize| alignment.direction((node as f64 + 0.5) * alignment.step_m());
    (1..nodes.saturating_sub(1)).map(|node| turned_rad(at(node - 1), at(node)).abs()).sum()
}

/// How far one direction is turned from another, to the left.
fn turned_rad(from: [f64; 2], to: [f64; 2]) -> f64 {
    (from[0] * to[1] - from[1] * to[0]).atan2(from[0] * to[0] + from[1] * to[1])
}

/// Semi-major axis in m of the ellipsoid of WGS 84.
const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// Flattening of the ellipsoid of WGS 84.
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// The plane that touches the ellipsoid, raised to a height, at one point: east and north in m.
///
/// Paths of up to 50 km keep their length within 3e-5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalPlane {
    latitude_deg: f64,
    longitude_deg: f64,
    height_m: f64,
}

impl LocalPlane {
    /// Returns a plane around a point.
    pub fn around(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Self {
        LocalPlane { latitude_deg, longitude_deg, height_m }
    }

    /// East and north in m of a position in degrees.
    pub fn project(&self, latitude_deg: f64, longitude_deg: f64) -> [f64; 2] {
        let [x0, y0, z0] = self.centred(self.latitude_deg, self.longitude_deg);
        let [x, y, z] = self.centred(latitude_deg, longitude_deg);
        let [dx, dy, dz] = [x - x0, y - y0, z - z0];
        let (sin_lat, cos_lat) = self.latitude_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = self.longitude_deg.to_radians().sin_cos();
        [cos_lon * dy - sin_lon * dx, cos_lat * dz - sin_lat * (cos_lon * dx + sin_lon * dy)]
    }

    /// Latitude and longitude in degrees of a point in m east and north.
    pub fn unproject(&self, point_m: [f64; 2]) -> [f64; 2] {
        let mut at = [self.latitude_deg, self.longitude_deg];
        // The radius of curvature is right to a percent, so that each round gains two digits.
        for _ in 0..8 {
            let [east_m, north_m] = self.project(at[0], at[1]);
            let degree_m = (SEMI_MAJOR_M + self.height_m) * 1f64.to_radians();
            at[0] += (point_m[1] - north_m) / degree_m;
            at[1] += (point_m[0] - east_m) / (degree_m * at[0].to_radians().cos());
        }
        at
    }

    /// Coordinates in m from the centre of the earth.
    fn centred(&self, latitude_deg: f64, longitude_deg: f64) -> [f64; 3] {
        let (sin_lat, cos_lat) = latitude_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = longitude_deg.to_radians().sin_cos();
        let squeeze = FLATTENING * (2.0 - FLATTENING);
        let normal_m = SEMI_MAJOR_M / (1.0 - squeeze * sin_lat * sin_lat).sqrt();
        let across_m = (normal_m + self.height_m) * cos_lat;
        let up_m = (normal_m * (1.0 - squeeze) + self.height_m) * sin_lat;
        [across_m * cos_lon, across_m * sin_lon, up_m]
    }
}

/// Squared distance in m² of two points of a plane.
pub fn distance_squared(one: [f64; 2], other: [f64; 2]) -> f64 {
    let [x, y] = [one[0] - other[0], one[1] - other[1]];
    x * x + y * y
}

/// The point that lies so much of the way between two points.
pub fn between(from: [f64; 2], to: [f64; 2], share: f64) -> [f64; 2] {
    [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_next_to_a_way_is_found_with_its_side() {
        let alignment = Alignment::through(&[[0.0, 0.0], [100.0, 0.0], [100.0, 80.0]]).unwrap();
        assert!((alignment.length_m() - 180.0).abs() < 1e-9);
        let beside = alignment.beside([42.0, 3.0], 0.0, 180.0);
        assert!((beside.chainage_m - 42.0).abs() < 1e-9 && (beside.left_m - 3.0).abs() < 1e-9);
        let beside = alignment.beside([105.0, 55.0], 0.0, 180.0);
        assert!((beside.chainage_m - 155.0).abs() < 1e-9 && (beside.left_m + 5.0).abs() < 1e-9);
        assert_eq!(alignment.at(190.0), [100.0, 90.0]);
        let near: Vec<_> = alignment.nodes_near([0.0, 0.0], 15.0).map(|(node, _)| node).collect();
        assert_eq!(near, [0, 1]);
    }

    #[test]
    fn one_place_is_no_way() {
        assert_eq!(Alignment::through(&[[1.0, 1.0], [1.0, 1.5]]), None);
    }

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

#[cfg(test)]
mod plane_tests {
    use super::*;

    #[test]
    fn a_minute_of_latitude_is_a_nautical_mile() {
        let plane = LocalPlane::around(45.0, 8.0, 0.0);
        let [east_m, north_m] = plane.project(45.0 + 1.0 / 60.0, 8.0);
        // 1852.2 m at 45° by the meridian's radius of curvature.
        assert!((north_m - 1852.2).abs() < 0.5 && east_m.abs() < 1e-6, "{east_m} {north_m}");
    }

    #[test]
    fn a_point_comes_back_from_the_plane() {
        let plane = LocalPlane::around(47.4, 8.5, 430.0);
        for point in [[0.0, 0.0], [25e3, -18e3], [-400.0, 31.5]] {
            let [latitude, longitude] = plane.unproject(point);
            let [east_m, north_m] = plane.project(latitude, longitude);
            assert!((east_m - point[0]).abs() < 1e-5 && (north_m - point[1]).abs() < 1e-5);
        }
    }
}
