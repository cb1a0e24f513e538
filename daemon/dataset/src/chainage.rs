//! Positions that leap as no train moves: single ones, which come back, and breaks of the chainage, after which all
//! positions count from elsewhere.

use super::order::quantile;

/// Distance in m by which a position may leave the integrated speed at once, in addition to the following ones.
const LEAP_M: f64 = 100.0;
/// Greatest share of the way since the last correction that a wheel's diameter lets an odometer miss...
const WHEEL_SHARE: f64 = 0.03;
/// ... where balises, this many m apart, correct it.
const BETWEEN_BALISES_M: f64 = 2000.0;
/// A position that leaves the integrated speed by more than this in m was corrected.
pub const CORRECTION_MIN_M: f64 = 1.0;
/// Steps within which an outlier comes back.
const AWAY_STEPS: usize = 10;
/// More breaks than these in a run are none.
const BREAKS_MAX: usize = 5;
/// Quantile of the changes of position that counts as the step of a coarse one, and how many steps a leap takes.
const COARSE: (f64, f64) = (0.9, 3.0);
/// Positions that move on from a leap in this many rows stay there.
const MOVED_ROWS: usize = 5;
/// Share of the integrated speed that a train may go.
const SPARE: f64 = 1.5;
/// The speed in m/s that a train may have where none is recorded.
const UNKNOWN_MPS: f64 = 60.0;

/// Returns the places of the steps in which the chainage breaks, of all steps of a run by position and by integrated
/// speed, in m of travel. Where it seems to break often, position or speed is in another unit: none is returned.
pub fn breaks(steps_m: &[(f64, f64)]) -> Vec<usize> {
    let leaps = leaps(steps_m);
    let leap_m = leap_m(coarse_m(steps_m.iter().map(|step| step.0)));
    // A position that comes back was an outlier; one at an end may be.
    let is_near = |one: &(usize, f64), next: &(usize, f64)| next.0 - one.0 <= AWAY_STEPS;
    let stays = |leaps: &&[(usize, f64)]| {
        let jump_m: f64 = leaps.iter().map(|leap| leap.1).sum();
        let within = AWAY_STEPS..steps_m.len().saturating_sub(AWAY_STEPS);
        jump_m.abs() > leap_m && leaps.iter().all(|leap| within.contains(&leap.0))
    };
    let found = leaps.chunk_by(is_near).filter(stays).flatten();
    let found: Vec<usize> = found.map(|leap| leap.0).collect();
    if found.len() > BREAKS_MAX { Vec::new() } else { found }
}

/// Returns the steps in which the position leaps away from the integrated speed, each with its place and by how many m.
fn leaps(steps_m: &[(f64, f64)]) -> Vec<(usize, f64)> {
    let coarse_m = coarse_m(steps_m.iter().map(|step| step.0));
    // The way since the last correction, and that on which the position was kept.
    let (mut way_m, mut kept_m) = (0.0_f64, 0.0);
    let mut found = Vec::new();
    for (place, &(by_position_m, by_speed_m)) in steps_m.iter().enumerate() {
        kept_m += by_speed_m;
        if by_position_m == 0.0 {
            continue;
        }
        let missed_m = (by_position_m - kept_m).abs().min((by_position_m - by_speed_m).abs());
        if missed_m > leap_m(coarse_m) + WHEEL_SHARE * way_m.min(BETWEEN_BALISES_M) {
            found.push((place, by_position_m - by_speed_m));
        }
        let is_corrected = missed_m > CORRECTION_MIN_M.max(coarse_m);
        way_m = if is_corrected { 0.0 } else { way_m + kept_m };
        kept_m = 0.0;
    }
    found
}

/// Returns the step in m of a coarse position, from its changes from row to row.
fn coarse_m(changes_m: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = changes_m.map(f64::abs).filter(|it| *it > 0.0).collect();
    quantile(&mut sizes, COARSE.0).unwrap_or(0.0)
}

/// Returns how far in m a position with these steps may leave the integrated speed at once.
fn leap_m(coarse_m: f64) -> f64 {
    LEAP_M + COARSE.1 * coarse_m
}

/// Returns the rows whose position leaps away and comes back, or is held at 0 until the first fix or from the last one
/// on.
pub(super) fn away(times_s: &[f64], position_m: &[f64], speed_mps: &[f64]) -> Vec<usize> {
    let rows: Vec<usize> = (0..position_m.len()).filter(|&row| !position_m[row].is_nan()).collect();
    let steps = rows.windows(2).map(|it| position_m[it[1]] - position_m[it[0]]);
    let leap_m = leap_m(coarse_m(steps));
    let way_m = way_m(times_s, speed_mps);
    let is_near = |from: usize, to: usize| {
        let most_m = SPARE * (way_m[to] - way_m[from]) + leap_m;
        (position_m[to] - position_m[from]).abs() <= most_m
    };
    let mut found = Vec::new();
    let mut leapt: Vec<usize> = Vec::new();
    let (mut last, mut moved) = (None, 0);
    for &row in &rows {
        let Some(from) = last else {
            last = Some(row);
            continue;
        };
        if is_near(from, row) {
            found.append(&mut leapt);
            (last, moved) = (Some(row), 0);
            continue;
        }
        let goes_on = leapt
            .last()
            .is_some_and(|&before| is_near(before, row) && position_m[before] != position_m[row]);
        moved = if goes_on { moved + 1 } else { moved };
        leapt.push(row);
        if moved >= MOVED_ROWS {
            found.extend(held_at_start(&rows, position_m, (from, leapt[0])));
            leapt.clear();
            (last, moved) = (Some(row), 0);
        }
    }
    let held_m = leapt.first().map(|&row| position_m[row]);
    let is_held = held_m == Some(0.0) && leapt.iter().all(|&row| position_m[row] == 0.0);
    if is_held {
        found.append(&mut leapt);
    }
    found
}

/// Returns the way in m at each row, by the speeds, or by the greatest that a train may have.
fn way_m(times_s: &[f64], speed_mps: &[f64]) -> Vec<f64> {
    let mut way_m = 0.0;
    let row_m = |row: usize| {
        let step_s = row.checked_sub(1).map_or(0.0, |before| times_s[row] - times_s[before]);
        let speed = speed_mps.get(row).copied().filter(|it| it.abs() < UNKNOWN_MPS);
        way_m += speed.unwrap_or(UNKNOWN_MPS).abs() * step_s.max(0.0);
        way_m
    };
    (0..times_s.len()).map(row_m).collect()
}

/// Returns the rows before a leap that are held at 0 from the first one on; `from` is the last of them.
fn held_at_start(
    rows: &[usize],
    position_m: &[f64],
    (from, leapt): (usize, usize),
) -> impl Iterator<Item = usize> {
    let held = rows.iter().copied().take_while(|&row| row < leapt);
    let is_held = from < leapt && held.clone().all(|row| position_m[row] == 0.0);
    held.filter(move |_| is_held).collect::<Vec<_>>().into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the rows of a train at 20 m/s that are away, with some positions replaced.
    fn rows_away(position_m: impl Fn(usize, f64) -> f64) -> Vec<usize> {
        let times_s: Vec<f64> = (0..1000).map(|row| 0.2 * row as f64).collect();
        let true_m = times_s.iter().map(|time_s| 5000.0 + 20.0 * time_s);
        let position_m: Vec<f64> =
            true_m.enumerate().map(|(row, true_m)| position_m(row, true_m)).collect();
        away(&times_s, &position_m, &[20.0; 1000])
    }

    #[test]
    fn positions_that_leap_and_come_back_are_away_and_breaks_are_not() {
        assert_eq!(rows_away(|_, true_m| true_m), []);
        let blocks = |row: usize, true_m| if row % 400 > 380 { 9999.0 } else { true_m };
        assert_eq!(rows_away(blocks), (381..400).chain(781..800).collect::<Vec<_>>());
        let late = |row: usize, true_m| if row < 150 { 0.0 } else { true_m };
        assert_eq!(rows_away(late), (0..150).collect::<Vec<_>>(), "before the first fix");
        let lost = |row: usize, true_m| if row > 900 { 0.0 } else { true_m };
        assert_eq!(rows_away(lost), (901..1000).collect::<Vec<_>>(), "after the last fix");
        assert_eq!(rows_away(|row, true_m| if row < 500 { true_m } else { true_m + 700.0 }), []);
        assert_eq!(rows_away(|_, true_m| (true_m / 1000.0).floor() * 1000.0), [], "coarse");
        let caught_up = |row: usize, true_m| {
            if (300..500).contains(&row) { 6200.0 } else { true_m }
        };
        assert_eq!(rows_away(caught_up), [], "a receiver that holds its last fix");
    }

    #[test]
    fn a_break_is_more_than_an_odometer_misses_between_balises() {
        let steps = |jumps_m: &[(usize, f64)]| {
            let mut steps = vec![(4.0, 4.0); 1000];
            jumps_m.iter().for_each(|&(place, jump_m)| steps[place].0 += jump_m);
            breaks(&steps)
        };
        assert_eq!(steps(&[]), []);
        assert_eq!(steps(&[(500, 60.0)]), [], "a balise after 2 km, with wheels 3 % off");
        assert_eq!(steps(&[(500, 200.0), (700, -300.0)]), [500, 700]);
        let often: Vec<(usize, f64)> = (1..9).map(|place| (100 * place, 500.0)).collect();
        assert_eq!(steps(&often), [], "another unit");
        assert_eq!(
            steps(&[(500, 700.0), (501, -700.0), (600, 300.0), (602, -290.0)]),
            [],
            "outliers"
        );
        let mut kept = vec![(4.0, 4.0); 1000];
        kept[400..600].fill((0.0, 4.0));
        kept[600].0 = 804.0;
        assert_eq!(breaks(&kept), [], "a receiver that held its last fix");
    }
}
