//! Decision whether both directions run on one track, and which parts they share.

use super::alignment::Alignment;
use super::recording::SAME_ALIGNMENT_M;
use crate::statistics::share_of;

/// Least share of the common part of two alignments on which they lie within `SAME_TRACK_M` of each other, if they are
/// one track.
const SAME_TRACK_SHARE: f64 = 0.97;
/// Greatest distance in m between the two directions' alignments where they are on one track.
const SAME_TRACK_M: f64 = 25.0;
/// Greatest difference in m between the chainages of two alignments at the same places, if they are one.
const SAME_CHAINAGE_M: f64 = 15.0;
/// Greatest difference between the lengths of one track as two directions measure them, as a share.
const DRIFT_SHARE: f64 = 0.005;
/// Addition to `SAME_CHAINAGE_M` for each m of the line, since the measured lengths drift unevenly.
const UNEVEN_SHARE: f64 = 0.0005;
/// Least difference in m between the ways there and back that shows a crossing of the line with itself.
const CROSSING_MIN_M: f64 = 300.0;
/// Length in m: where both directions go on alone for more than this at the same end, they fork there and are two
/// tracks.
const FORK_M: f64 = 100.0;

/// Comparison of two alignments, each in its direction of travel.
pub struct Compared {
    /// Chainage in m, along the alignment of growing chainage, at which the alignment of falling chainage starts.
    pub start_chainage_m: f64,
    /// The one track of both, in the direction of growing chainage, over all that at least one of them drives; `None`
    /// if they are two tracks.
    pub joined: Option<Alignment>,
}

/// Compares the alignments of growing and of falling chainage; `None` when they never meet.
pub fn compare(growing: &Alignment, falling: &Alignment) -> Option<Compared> {
    let twin = |at: &[f64; 2]| {
        growing.nodes_near(*at, SAME_ALIGNMENT_M).min_by(|one, other| one.1.total_cmp(&other.1))
    };
    let mut twins: Vec<Option<(usize, f64)>> = falling.nodes_m().iter().map(twin).collect();
    forget_crossings(&mut twins, growing, falling);
    let first = twins.iter().position(Option::is_some)?;
    let last = twins.iter().rposition(Option::is_some)?;
    let both = &twins[first..=last];
    let apart = both.iter().filter(|twin| twin.is_none_or(|twin| twin.1 > SAME_TRACK_M)).count();
    // Chainage along the one and back along the other: the same everywhere on one track, but for
    // a drift, since two measures of a length differ by a share of it.
    let mut sums_m: Vec<f64> = twins
        .iter()
        .enumerate()
        .filter_map(|(node, twin)| Some(there_and_back_m(growing, twin.as_ref()?.0, falling, node)))
        .collect();
    let start_chainage_m = share_of(&sums_m, 0.5);
    let (one, other) = sums_m.split_at(sums_m.len() / 2);
    let drift_m = 2.0 * (share_of(other, 0.5) - share_of(one, 0.5));
    let count = sums_m.len() as f64;
    for (node, sum_m) in sums_m.iter_mut().enumerate() {
        *sum_m -= drift_m * node as f64 / count;
    }
    // The growing alignment starts where the falling one ends.
    let (start, end) = (twins[last]?.0, twins[first]?.0);
    let forks = |one: usize, other: usize| {
        one.min(other) as f64 * growing.step_m().min(falling.step_m()) > FORK_M
    };
    let (ahead, back) = (growing.nodes_m(), falling.nodes_m());
    let is_same = start < end
        && (apart as f64) < (1.0 - SAME_TRACK_SHARE) * both.len() as f64
        && drift_m.abs() < DRIFT_SHARE * growing.length_m()
        && share_of(&sums_m, 0.97) - share_of(&sums_m, 0.03)
            < SAME_CHAINAGE_M + UNEVEN_SHARE * growing.length_m()
        && !forks(start, back.len() - 1 - last)
        && !forks(ahead.len() - 1 - end, first);
    let joined = || {
        let from = if last + 1 < back.len() { start } else { 0 };
        let to = if first > 0 { end } else { ahead.len() - 1 };
        let mut nodes: Vec<[f64; 2]> = back[last + 1..].iter().rev().copied().collect();
        nodes.extend_from_slice(&ahead[from..=to]);
        nodes.extend(back[..first].iter().rev());
        Alignment::through(&nodes)
    };
    let joined = is_same.then(joined).flatten();
    Some(Compared { start_chainage_m, joined })
}

/// Returns the distance in m along the growing alignment to a node and on along the falling one from its node to its
/// start: the same wherever both take one track.
fn there_and_back_m(growing: &Alignment, ahead: usize, falling: &Alignment, back: usize) -> f64 {
    ahead as f64 * growing.step_m() + back as f64 * falling.step_m()
}

/// Forgets twins where a line only crosses itself: there and back is another alignment there.
fn forget_crossings(twins: &mut [Option<(usize, f64)>], growing: &Alignment, falling: &Alignment) {
    let sum_m = |(back, twin): (usize, &Option<(usize, f64)>)| {
        twin.map(|(ahead, _)| there_and_back_m(growing, ahead, falling, back))
    };
    let sums_m: Vec<f64> = twins.iter().enumerate().filter_map(sum_m).collect();
    let middle_m = share_of(&sums_m, 0.5);
    let far_m = CROSSING_MIN_M.max(2.0 * DRIFT_SHARE * growing.length_m());
    for (back, twin) in twins.iter_mut().enumerate() {
        if sum_m((back, &*twin)).is_some_and(|sum_m| (sum_m - middle_m).abs() > far_m) {
            *twin = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alignment(from_m: i32, to_m: i32, left_m: f64) -> Alignment {
        let step = if to_m > from_m { 10 } else { -10 };
        let count = (to_m - from_m) / step;
        let point = |k: i32| [f64::from(from_m + k * step), left_m];
        Alignment::through(&(0..=count).map(point).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn directions_that_begin_and_end_elsewhere_on_one_track_are_joined() {
        let compared = compare(&alignment(0, 3000, 0.0), &alignment(3600, -500, 4.0)).unwrap();
        let joined = compared.joined.unwrap();
        assert!((joined.length_m() - 4100.0).abs() < 1.0, "{}", joined.length_m());
        assert!((joined.nodes_m()[0][0] + 500.0).abs() < 1.0);
        assert!((compared.start_chainage_m - 3600.0).abs() < 41.0);
    }

    #[test]
    fn a_line_that_crosses_itself_is_one_track_as_far_as_both_drive_it() {
        // Two kilometres east, a loop to the left, and north across the beginning.
        let mut points: Vec<[f64; 2]> = (0..200).map(|k| [10.0 * f64::from(k), 0.0]).collect();
        for k in 0..=150 {
            let angle = f64::from(k) * 1.5 * std::f64::consts::PI / 150.0;
            points.push([2000.0 + 500.0 * angle.sin(), 500.0 - 500.0 * angle.cos()]);
        }
        points.extend((1..200).map(|k| [1500.0, 500.0 - 10.0 * f64::from(k)]));
        let whole = Alignment::through(&points).unwrap();
        let upper: Vec<[f64; 2]> =
            points.iter().skip(220).rev().map(|it| [it[0] + 3.0, it[1]]).collect();
        let compared = compare(&whole, &Alignment::through(&upper).unwrap()).unwrap();
        let joined = compared.joined.expect("one track");
        assert!((joined.length_m() - whole.length_m()).abs() < 15.0, "{}", joined.length_m());
    }

    #[test]
    fn lengths_that_drift_apart_are_one_track_and_a_detour_makes_two() {
        let growing = alignment(0, 20_000, 0.0);
        let wavy = |k: i32| [20_000.0 - 10.0 * f64::from(k), 0.6 * f64::from(k % 2)];
        let drifting: Vec<[f64; 2]> = (0..=2000).map(wavy).collect();
        let falling = Alignment::through(&drifting).unwrap();
        assert!(falling.length_m() > 20_030.0, "{}", falling.length_m());
        assert!(compare(&growing, &falling).unwrap().joined.is_some());
        let mut detour = drifting[..1000].to_vec();
        detour.extend((0..=12).map(|k| [10_010.0, 5.0 * f64::from(k)]));
        detour.extend((0..=12).map(|k| [10_000.0, 60.0 - 5.0 * f64::from(k)]));
        detour.extend_from_slice(&drifting[1000..]);
        assert!(compare(&growing, &Alignment::through(&detour).unwrap()).unwrap().joined.is_none());
    }

    #[test]
    fn ways_that_fork_or_lie_apart_stay_two() {
        let mut points: Vec<[f64; 2]> = (0..60).map(|k| [10.0 * f64::from(k), 200.0]).collect();
        points.reverse();
        points.extend((0..200).map(|k| [-10.0 - 10.0 * f64::from(k), 0.0]));
        let growing = alignment(-2000, 600, 0.0);
        assert!(compare(&growing, &Alignment::through(&points).unwrap()).unwrap().joined.is_none());
        assert!(compare(&growing, &alignment(600, -2000, 30.0)).unwrap().joined.is_none());
        assert!(compare(&growing, &alignment(600, -2000, 300.0)).is_none());
    }
}
