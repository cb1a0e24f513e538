//! Faults in the times of whole rows by recorders and tools: seconds without a fraction, an hour of summer time,
//! rows in another order; and times that begin again.

use super::order::quantile;

/// An hour, by which clocks are put forward and back.
pub(super) const HOUR_S: f64 = 3600.0;
/// A clock of twelve hours begins again after these, one of a day at midnight.
pub(super) const HALF_DAY_S: f64 = 12.0 * HOUR_S;
pub(super) const DAY_S: f64 = 2.0 * HALF_DAY_S;
/// Counters of 32 and of 16 bits begin again after as many ms or µs.
const COUNTERS_S: [f64; 5] = [4_294_967.296, 2_147_483.648, 4_294.967_296, 2_147.483_648, 65.536];
/// Greatest change in m/s of a moving train's speed over a step, in addition to that by its acceleration.
const SPEED_STEP_MPS: f64 = 1.0;
/// Speed in m/s above which a train moves, by the coarsest sensor.
const CREEPING_MPS: f64 = 0.3;
/// Sharpest acceleration in m/s².
const ACCELERATION_MPS2: f64 = 3.0;
/// Share of rows with the time of the row before above which times have no fraction.
const REPEATED_SHARE: f64 = 0.4;
/// Share of rows out of order above which the whole file is in another order.
const DISORDER_SHARE: f64 = 0.05;
/// Least number of rows in a part that was recorded as one.
const PART_ROWS: usize = 50;
/// Time in s above which a clock does not count from 1970.
const FAR_S: f64 = 9.2e9;

/// Repairs of the times of a run, each with the row.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ClockFaults {
    /// Where the clock was put forward or back, and by how many s.
    pub jumps: Vec<(usize, f64)>,
    /// Rows with one stamp, where they are spread over the time to the next.
    pub shared: Option<usize>,
    /// True where rows stood in another order.
    pub sorted: bool,
    /// Row where times begin again and overlap those before, and by how many s they fall.
    pub anew: Option<(usize, f64)>,
}

/// Corrects the times of a run where their fault is evident. Returns the corrections, and the order of the rows where
/// they stood in another.
///
/// `is_repeated` returns whether a row repeats the row before in all but the time.
pub(super) fn mend(
    times_s: &mut [f64],
    speed_mps: &[f64],
    is_repeated: impl Fn(usize) -> bool,
) -> (ClockFaults, Option<Vec<usize>>) {
    let mut faults = ClockFaults::default();
    if let Some(first_s) = times_s.first().copied().filter(|it| it.abs() > FAR_S) {
        // Ticks since the year 1, days since the year 0.
        times_s.iter_mut().for_each(|time_s| *time_s -= first_s.floor());
    }
    if times_s.len() < 10 {
        return (faults, None);
    }
    // Where the newest row stands first, every step is one back.
    let is_reversed = times_s.is_sorted_by(|one, next| one >= next);
    let sign = if is_reversed { -1.0 } else { 1.0 };
    let mut steps: Vec<f64> =
        times_s.windows(2).map(|it| sign * (it[1] - it[0])).filter(|step| *step > 0.0).collect();
    let Some(step_s) = quantile(&mut steps, 0.5) else { return (faults, None) };
    faults.shared = spread(times_s, step_s, is_repeated);
    let step_s = step_s / faults.shared.unwrap_or(1) as f64;
    faults.jumps = set_back(times_s, speed_mps, step_s);
    let order = match faults.shared {
        None => sorted(times_s, speed_mps, &mut faults),
        Some(_) => None,
    };
    (faults, order)
}

/// Takes out the hours by which the clock was put forward or back while the train went on.
fn set_back(times_s: &mut [f64], speed_mps: &[f64], step_s: f64) -> Vec<(usize, f64)> {
    let mut jumps = Vec::new();
    let mut shift_s = 0.0;
    let mut before_s = times_s[0];
    for row in 1..times_s.len() {
        let ahead_s = times_s[row] - before_s;
        let begins_again_s = begins_again_s((before_s, times_s[row]), step_s);
        before_s = times_s[row];
        let hour_s = match (begins_again_s, ahead_s) {
            (Some(after_s), _) => -after_s,
            (None, 0.0..) => HOUR_S,
            (None, _) if ahead_s < -0.5 * HALF_DAY_S => -HALF_DAY_S,
            (None, _) => -HOUR_S,
        };
        let is_hour = (ahead_s - hour_s - step_s).abs() <= 1.5 * step_s.max(0.4);
        let (from, to) = (speed_mps[row - 1], speed_mps[row]);
        let goes_on = (to - from).abs() <= SPEED_STEP_MPS + ACCELERATION_MPS2 * step_s;
        // A train that stands for an hour does so.
        let is_moving = ahead_s < 0.0 || from.min(to) > CREEPING_MPS;
        if is_hour && goes_on && is_moving {
            jumps.push((row, hour_s));
            shift_s -= hour_s;
        }
        times_s[row] += shift_s;
    }
    jumps
}

/// Returns the time in s after which a clock begins again at 0, where it does so between two rows.
fn begins_again_s((before_s, now_s): (f64, f64), step_s: f64) -> Option<f64> {
    let spare_s = 2.5 * step_s.max(0.4);
    let is_end = |after_s: &f64| (after_s - spare_s..*after_s + step_s).contains(&before_s);
    let begins = (0.0..spare_s).contains(&now_s) && now_s < before_s;
    [DAY_S].into_iter().chain(COUNTERS_S).find(is_end).filter(|_| begins)
}

/// Spreads rows that share a stamp evenly over the time to the next one; gives how many usually do.
fn spread(times_s: &mut [f64], step_s: f64, is_repeated: impl Fn(usize) -> bool) -> Option<usize> {
    let shared: Vec<usize> =
        (1..times_s.len()).filter(|&row| times_s[row] == times_s[row - 1]).collect();
    let is_disordered = times_s.windows(2).any(|it| it[1] < it[0] && it[1] > it[0] - 0.5 * HOUR_S);
    let copies = shared.iter().filter(|&&row| is_repeated(row)).count();
    if (shared.len() as f64) < REPEATED_SHARE * times_s.len() as f64
        || is_disordered
        || 2 * copies > shared.len()
    {
        return None;
    }
    let groups: Vec<usize> = times_s.chunk_by(|one, next| one == next).map(<[f64]>::len).collect();
    let mut inner: Vec<f64> = groups.iter().map(|&rows| rows as f64).collect();
    let usual = quantile(&mut inner, 0.5)? as usize;
    let mut row = 0;
    for (index, &rows) in groups.iter().enumerate() {
        // The first second may have begun before the recording.
        let missing = if index == 0 { usual.saturating_sub(rows) } else { 0 };
        let share_s = step_s / rows.max(usual) as f64;
        for (place, time_s) in times_s[row..row + rows].iter_mut().enumerate() {
            *time_s += (missing + place) as f64 * share_s;
        }
        row += rows;
    }
    Some(usual)
}

/// Returns the rows in the order of time, where parts that do not overlap, or single rows, stand in another.
fn sorted(times_s: &[f64], speed_mps: &[f64], faults: &mut ClockFaults) -> Option<Vec<usize>> {
    let falls: Vec<usize> =
        (1..times_s.len()).filter(|&row| times_s[row] < times_s[row - 1]).collect();
    let first = *falls.first()?;
    let count = times_s.len();
    let out_of_order =
        count - super::order::longest_increasing(times_s).iter().filter(|it| **it).count();
    if (out_of_order as f64) < DISORDER_SHARE * count as f64 {
        return None;
    }
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&one, &other| times_s[one].total_cmp(&times_s[other]));
    let mut steps: Vec<f64> = order.windows(2).map(|it| times_s[it[1]] - times_s[it[0]]).collect();
    let step_s = quantile(&mut steps, 0.5)?;
    let twice = steps.iter().filter(|step| **step < 0.25 * step_s).count();
    let is_of_parts = count / (falls.len() + 1) >= PART_ROWS;
    let overlap = is_of_parts && {
        // A part's rows stand together in the order of time, too, or the parts are rows of one motion in turn.
        let breaks = order.windows(2).filter(|it| it[1] != it[0] + 1).count();
        let by_time = order.iter().map(|&row| speed_mps[row]);
        breaks > 2 * falls.len() + count / 100
            && roughness(by_time) >= 0.8 * roughness(speed_mps.iter().copied())
    };
    if overlap || twice as f64 > DISORDER_SHARE * count as f64 {
        faults.anew = Some((first, times_s[first - 1] - times_s[first]));
        return None;
    }
    faults.sorted = true;
    Some(order)
}

/// Returns how far the speed goes up and down from row to row, in m/s.
fn roughness(speed_mps: impl Iterator<Item = f64>) -> f64 {
    let mut before = None;
    let steps =
        speed_mps.filter(|it| !it.is_nan()).filter_map(|it| Some((it - before.replace(it)?).abs()));
    steps.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mended(times_s: &[f64], speed_mps: &[f64]) -> (Vec<f64>, ClockFaults, Option<Vec<usize>>) {
        let mut times = times_s.to_vec();
        let (faults, order) = mend(&mut times, speed_mps, |_| false);
        (times, faults, order)
    }

    fn grid(rows: usize) -> Vec<f64> {
        (0..rows).map(|row| 1000.0 + 0.2 * row as f64).collect()
    }

    fn are_equal(one: &[f64], other: &[f64]) -> bool {
        one.iter().zip(other).all(|(one, other)| (one - other).abs() < 1e-6)
    }

    #[test]
    fn an_hour_forward_or_back_is_taken_out_where_the_train_goes_on() {
        let times = grid(400);
        for hour_s in [HOUR_S, -HOUR_S, -HALF_DAY_S] {
            let put: Vec<f64> = times
                .iter()
                .enumerate()
                .map(|(row, it)| it + if row < 150 { 0.0 } else { hour_s })
                .collect();
            for speed_mps in [20.0, 0.7] {
                let (found, faults, order) = mended(&put, &[speed_mps; 400]);
                assert_eq!((faults.jumps, order), (vec![(150, hour_s)], None), "{speed_mps} m/s");
                assert!(are_equal(&found, &times));
            }
        }
        let stood: Vec<f64> = times
            .iter()
            .enumerate()
            .map(|(row, it)| it + if row < 150 { 0.0 } else { HOUR_S })
            .collect();
        assert_eq!(mended(&stood, &[0.0; 400]).0, stood, "a train that stands for an hour");
    }

    #[test]
    fn a_clock_that_begins_again_at_midnight_or_after_its_last_count_goes_on() {
        let true_s: Vec<f64> = (0..1000).map(|row| 0.2 * row as f64).collect();
        for after_s in [DAY_S].into_iter().chain(COUNTERS_S) {
            let start_s = after_s - 30.1;
            let wrapped: Vec<f64> =
                true_s.iter().map(|it| (start_s + it).rem_euclid(after_s)).collect();
            let (found, faults, order) = mended(&wrapped, &[20.0; 1000]);
            let expected: Vec<f64> = true_s.iter().map(|it| start_s + it).collect();
            assert!(are_equal(&found, &expected), "{after_s} s");
            assert_eq!((faults.jumps[0], order), ((151, -after_s), None));
            assert_eq!(faults.jumps.len(), if after_s < 100.0 { 3 } else { 1 });
        }
    }

    #[test]
    fn rows_that_share_whole_seconds_are_spread_over_them() {
        let times = grid(403);
        let whole: Vec<f64> = times[2..].iter().map(|it| (it + 1e-6).floor()).collect();
        let speeds: Vec<f64> = (0..401).map(|row| 0.1 * row as f64).collect();
        let (found, faults, _) = mended(&whole, &speeds);
        assert_eq!(faults.shared, Some(5));
        assert!(are_equal(&found, &times[2..]), "{:?} {:?}", &found[..8], &times[2..8]);
        let copied: Vec<f64> = (0..400).map(|row| f64::from(row / 2)).collect();
        let mut times = copied.clone();
        assert_eq!(mend(&mut times, &[1.0; 400], |row| row % 2 == 1).0.shared, None, "rows twice");
    }

    #[test]
    fn rows_in_any_order_and_parts_in_another_are_sorted() {
        let times = grid(500);
        let shuffled: Vec<f64> = (0..500).map(|row| times[(row * 37) % 500]).collect();
        let parts: Vec<f64> = [&times[300..], &times[..120], &times[120..300]].concat();
        for disordered in [shuffled, parts] {
            let (found, faults, order) = mended(&disordered, &[20.0; 500]);
            assert!(faults.sorted && faults.anew.is_none(), "{faults:?}");
            let order = order.unwrap();
            assert!(order.windows(2).all(|it| found[it[0]] < found[it[1]]));
        }
        let mut swapped = times.clone();
        swapped.swap(10, 11);
        assert_eq!(mended(&swapped, &[20.0; 500]).2, None, "single rows are refused and counted");
    }

    #[test]
    fn times_that_begin_anew_are_reported_where_they_do() {
        let times = grid(300);
        let again: Vec<f64> = [&times[..], &times[..250]].concat();
        let beside: Vec<f64> = times
            .iter()
            .chain(&times[20..])
            .enumerate()
            .map(|(row, it)| if row < 300 { *it } else { it + 0.1 })
            .collect();
        for anew in [again, beside] {
            let (_, faults, order) = mended(&anew, &vec![20.0; anew.len()]);
            assert_eq!((faults.anew.unwrap().0, order), (300, None));
        }
    }

    #[test]
    fn rows_of_one_motion_in_turn_are_sorted_and_two_motions_are_not() {
        let time_of = |part: usize, row: usize| 0.2 * (7 * row + part) as f64;
        let places = (0..7).flat_map(|part| (0..100).map(move |row| (part, row)));
        let times: Vec<f64> = places.clone().map(|(part, row)| time_of(part, row)).collect();
        let speed = |time: f64| 10.0 + 5.0 * (0.1 * time).sin();
        let of_one: Vec<f64> = times.iter().map(|&time| speed(time)).collect();
        let (_, faults, order) = mended(&times, &of_one);
        assert!(faults.sorted && faults.anew.is_none() && order.is_some(), "{faults:?}");
        let of_seven: Vec<f64> =
            places.map(|(part, row)| speed(time_of(part, row)) + 0.4 * part as f64).collect();
        let (_, faults, order) = mended(&times, &of_seven);
        assert!(faults.anew.is_some() && order.is_none(), "{faults:?}");
    }

    #[test]
    fn far_epochs_are_near_ones() {
        let ticks: Vec<f64> = (0..20).map(|row| 6.38e10 + 0.5 * f64::from(row)).collect();
        assert_eq!(mended(&ticks, &[1.0; 20]).0[3], 1.5);
    }
}
