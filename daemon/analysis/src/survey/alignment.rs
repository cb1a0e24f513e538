//! An alignment on the plane: points of equal spacing, looked up by chainage and by place.

use std::collections::HashMap;

use super::geodesy::{between, distance_squared};

/// Distance in m between the nodes of an alignment.
pub const NODE_STEP_M: f64 = 10.0;
/// Size in m of the cells in which places are looked up.
const CELL_M: f64 = 50.0;

/// An alignment as a line through nodes about 10 m apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment {
    nodes_m: Vec<[f64; 2]>,
    step_m: f64,
    cells: HashMap<(i64, i64), Vec<u32>>,
}

/// Where a point lies beside an alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beside {
    /// Chainage in m of the nearest point of the alignment.
    pub chainage_m: f64,
    /// Distance in m from it, positive to the left.
    pub left_m: f64,
}

impl Alignment {
    /// An alignment through points; `None` when they are not two places apart.
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

    /// The same alignment driven the other way round.
    pub fn reversed(&self) -> Option<Alignment> {
        Alignment::through(&self.nodes_m.iter().rev().copied().collect::<Vec<_>>())
    }

    /// Its nodes, east and north in m.
    pub fn nodes_m(&self) -> &[[f64; 2]] {
        &self.nodes_m
    }

    /// Distance in m between its nodes.
    pub fn step_m(&self) -> f64 {
        self.step_m
    }

    /// Its length in m.
    pub fn length_m(&self) -> f64 {
        self.step_m * (self.nodes_m.len() - 1) as f64
    }

    /// The point at a chainage in m, straight on beyond the ends.
    pub fn at(&self, chainage_m: f64) -> [f64; 2] {
        let segment = self.segment(chainage_m);
        let share = chainage_m / self.step_m - segment as f64;
        between(self.nodes_m[segment], self.nodes_m[segment + 1], share)
    }

    /// The direction at a chainage, as a unit vector.
    pub fn direction(&self, chainage_m: f64) -> [f64; 2] {
        let segment = self.segment(chainage_m);
        let (from, to) = (self.nodes_m[segment], self.nodes_m[segment + 1]);
        let length = distance_squared(from, to).sqrt().max(1e-9);
        [(to[0] - from[0]) / length, (to[1] - from[1]) / length]
    }

    /// The nearest point within a window of chainages in m.
    pub fn beside(&self, point_m: [f64; 2], from_m: f64, to_m: f64) -> Beside {
        let (first, last) = (self.segment(from_m), self.segment(to_m));
        let mut nearest = (f64::INFINITY, Beside { chainage_m: from_m, left_m: f64::INFINITY });
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
                nearest = (distance, Beside { chainage_m, left_m: distance.sqrt().copysign(left) });
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
}
