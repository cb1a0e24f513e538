//! Speed and position of a run's rows, and outliers among neighbouring values.

use serde::Serialize;

use super::manifest::PositionReference;
use super::order::TimeOrder;

/// Distance in m below which comparisons of position and speed say nothing.
pub(super) const DISTANCE_MIN_M: f64 = 200.0;
/// Greatest speed in m/s below zero that is the noise of a standing train.
const SPEED_NOISE_MPS: f64 = 0.2;
/// Difference in m/s from the neighbours below which a speed is never a spike.
const SPEED_SPIKE_LEAST_MPS: f64 = 0.3;
/// Sharpest bend of a speed curve in m/s²; a sharper one may be a spike.
const SPEED_BEND_MPS2: f64 = 1.5;

/// Where the positions come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PositionSource {
    /// The mapped column.
    Column,
    /// Integrated from the speed.
    IntegratedSpeed,
}

/// Speeds as read, with small negative ones set to zero.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Speeds {
    /// Speed in m/s, `NaN` where missing.
    pub speed_mps: Vec<f64>,
    /// Marks outliers.
    pub is_spike: Vec<bool>,
    /// Speeds set to zero because they were negative by noise.
    pub zeroed: usize,
    /// Speeds that stay negative.
    pub negative: usize,
}

impl Speeds {
    /// From the column, given the rows' order.
    pub fn new(column: &[f64], order: &TimeOrder) -> Self {
        let (mut zeroed, mut negative) = (0, 0);
        let mut speed_mps = column.to_vec();
        for speed in &mut speed_mps {
            if *speed < 0.0 && *speed >= -SPEED_NOISE_MPS {
                *speed = 0.0;
                zeroed += 1;
            } else if *speed < 0.0 {
                negative += 1;
            }
        }
        let least = SPEED_SPIKE_LEAST_MPS + SPEED_BEND_MPS2 * order.counts.step_s;
        let is_spike = spikes::<5>(&speed_mps, &order.in_order, least);
        Speeds { speed_mps, is_spike, zeroed, negative }
    }

    /// Returns the rows of the outliers, in order.
    pub fn outliers(&self) -> impl Iterator<Item = usize> {
        (0..self.is_spike.len()).filter(|&row| self.is_spike[row])
    }
}

/// Where a run's positions start and which way they grow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placement {
    /// Which point of the train the positions are of.
    pub reference: PositionReference,
    /// 1 while the chainage grows, -1 while it falls.
    pub direction: f64,
    /// Length of the train in m.
    pub train_length_m: f64,
    /// Declared chainage in m at the start.
    pub start_m: Option<f64>,
}

impl Placement {
    /// From the reference point to the train's centre, in m of chainage.
    fn to_centre_m(self) -> f64 {
        match self.reference {
            PositionReference::Centre => 0.0,
            PositionReference::Head => -0.5 * self.direction * self.train_length_m,
        }
    }

    /// Returns the chainage in m of the point that positions are of, by the centre's.
    pub fn reference_m(self, centre_m: f64) -> f64 {
        centre_m - self.to_centre_m()
    }

    /// Returns the chainage in m of the train's centre from the mapped column.
    pub fn centre_m(self, column: &[f64]) -> Vec<f64> {
        let to_centre_m = self.to_centre_m();
        column.iter().map(|position| position + to_centre_m).collect()
    }

    /// Returns the chainage in m of the train's centre, integrated from the speed.
    ///
    /// The speed is taken as linear between the rows that have one, over missing rows, missing
    /// speeds and spikes too. Without a declared start, the centre starts at 0. Rows out of
    /// order, and rows before the first speed or after the last one, get none.
    pub fn integrate(self, times_s: &[f64], speeds: &Speeds, order: &TimeOrder) -> Vec<f64> {
        let mut position_m = vec![f64::NAN; times_s.len()];
        let mut centre_m = self.start_m.map_or(0.0, |start| start + self.to_centre_m());
        let mut last: Option<usize> = None;
        let mut skipped: Vec<usize> = Vec::new();
        for row in order.rows() {
            let speed = speeds.speed_mps[row];
            if speed.is_nan() || speeds.is_spike[row] {
                skipped.push(row);
                continue;
            }
            if let Some(from) = last {
                let (v0, duration) = (speeds.speed_mps[from], times_s[row] - times_s[from]);
                let acceleration = (speed - v0) / duration;
                for &between in &skipped {
                    let t = times_s[between] - times_s[from];
                    let travelled_m = t * (v0 + 0.5 * acceleration * t);
                    position_m[between] = centre_m + self.direction * travelled_m;
                }
                centre_m += self.direction * 0.5 * (v0 + speed) * duration;
            }
            position_m[row] = centre_m;
            skipped.clear();
            last = Some(row);
        }
        position_m
    }
}

/// Quantile of the differences that counts as the spread of a run's values around their neighbours: above the median,
/// since a centre that is itself the median does not differ, and low enough for one value in ten, with its neighbours,
/// to be an outlier.
const SPREAD_QUANTILE: f64 = 0.75;
/// Least size of a spike in spreads; about eight standard deviations of white noise.
const SPIKE_SPREADS: f64 = 8.0;

/// Marks values that differ much from the median of the `N` around them (Hampel's filter, with the spread taken over
/// the whole run). `N` is odd: with 5, up to two rows in a row can be detected, with 3 a single one.
///
/// Only rows marked in `usable` and not `NaN` take part; the first and last few have too few
/// neighbours to be detected. `least` is the difference below which nothing is a spike.
pub(super) fn spikes<const N: usize>(values: &[f64], usable: &[bool], least: f64) -> Vec<bool> {
    let mut marks = vec![false; values.len()];
    let rows = (0..values.len()).filter(|&row| usable[row] && !values[row].is_nan());
    // Differences up to this neither are spikes nor raise the bound.
    let small = least / SPIKE_SPREADS;
    let mut large: Vec<(usize, f64)> = Vec::new();
    let mut window = [(0, 0.0); N];
    let mut windows = 0_usize;
    for (count, row) in rows.enumerate() {
        window.copy_within(1.., 0);
        window[N - 1] = (row, values[row]);
        if count + 1 < N {
            continue;
        }
        windows += 1;
        let (centre, value) = window[N / 2];
        let difference = (value - median(window.map(|(_, value)| value))).abs();
        if difference > small {
            large.push((centre, difference));
        }
    }
    let rank = (SPREAD_QUANTILE * windows as f64) as usize + large.len();
    let spread = match rank.checked_sub(windows).filter(|&rank| rank < large.len()) {
        Some(rank) => {
            large.select_nth_unstable_by(rank, |one, other| one.1.total_cmp(&other.1)).1.1
        }
        None => 0.0,
    };
    let bound = least.max(SPIKE_SPREADS * spread);
    for (row, difference) in large {
        marks[row] = difference > bound;
    }
    marks
}

/// The median of numbers, sorted by exchanging neighbours, without a branch.
fn median<const N: usize>(mut values: [f64; N]) -> f64 {
    for end in (1..N).rev() {
        for place in 0..end {
            let (one, other) = (values[place], values[place + 1]);
            values[place] = if one < other { one } else { other };
            values[place + 1] = if one < other { other } else { one };
        }
    }
    values[N / 2]
}

/// Returns where a train turns that goes far to one end of its positions and far back, and the way there and back in m.
pub(super) fn turn((low_m, high_m): (f64, f64), ends_m: [f64; 2]) -> Option<(f64, f64)> {
    let ways = [low_m, high_m].map(|turn_m| (turn_m, ends_m.map(|end_m| (turn_m - end_m).abs())));
    let is_far = |(_, ways_m): &(f64, [f64; 2])| ways_m.iter().all(|way_m| *way_m > DISTANCE_MIN_M);
    let far =
        ways.into_iter().filter(is_far).map(|(turn_m, [out_m, back_m])| (turn_m, out_m + back_m));
    far.max_by(|one, other| one.1.total_cmp(&other.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: Placement = Placement {
        reference: PositionReference::Head,
        direction: 1.0,
        train_length_m: 100.0,
        start_m: None,
    };

    #[test]
    fn the_centre_is_half_a_length_behind_the_head_in_both_directions() {
        assert_eq!(HEAD.centre_m(&[1000.0]), [950.0]);
        let back = Placement { direction: -1.0, ..HEAD };
        assert_eq!(back.centre_m(&[1000.0]), [1050.0]);
        let centre = Placement { reference: PositionReference::Centre, ..HEAD };
        assert_eq!(centre.centre_m(&[1000.0]), [1000.0]);
    }

    fn integrated(placement: Placement, times: &[f64], column: &[f64]) -> Vec<f64> {
        let order = TimeOrder::new(times, vec![0; times.len()]);
        placement.integrate(times, &Speeds::new(column, &order), &order)
    }

    #[test]
    fn position_is_the_integral_of_speed_from_the_declared_start() {
        let (times, speeds) = ([10.0, 11.0, 12.0, 13.0], [0.0, 2.0, 4.0, 4.0]);
        assert_eq!(integrated(HEAD, &times, &speeds), [0.0, 1.0, 4.0, 8.0]);
        let back = Placement { direction: -1.0, start_m: Some(500.0), ..HEAD };
        assert_eq!(integrated(back, &times, &speeds), [550.0, 549.0, 546.0, 542.0]);
    }

    #[test]
    fn missing_speeds_rows_and_spikes_are_bridged() {
        let nan = f64::NAN;
        let times: Vec<f64> = (0..12).filter(|i| *i != 9).map(f64::from).collect();
        let mut speeds: Vec<f64> = times.iter().map(|t| 2.0 * t).collect();
        (speeds[3], speeds[5]) = (nan, 300.0);
        let position = integrated(HEAD, &times, &speeds);
        for (time, position) in times.iter().zip(position) {
            assert!((position - time * time).abs() < 1e-9, "{time} s: {position} m");
        }
    }

    #[test]
    fn rows_out_of_order_have_no_integrated_position() {
        let position = integrated(HEAD, &[0.0, 1.0, 0.5, 2.0], &[1.0, 1.0, 1.0, 1.0]);
        assert!(position[2].is_nan());
        assert_eq!(position[3], 2.0);
    }

    #[test]
    fn only_the_noise_of_standstill_is_set_to_zero() {
        let order = TimeOrder::new(&[0.0, 1.0, 2.0], vec![0; 3]);
        let speeds = Speeds::new(&[-0.05, -3.0, 1.0], &order);
        assert_eq!(speeds.speed_mps, [0.0, -3.0, 1.0]);
        assert_eq!((speeds.zeroed, speeds.negative), (1, 1));
    }

    fn marked(values: &[f64], least: f64) -> Vec<usize> {
        let marks = spikes::<5>(values, &vec![true; values.len()], least);
        (0..values.len()).filter(|&row| marks[row]).collect()
    }

    #[test]
    fn a_spike_is_marked_and_a_step_is_not() {
        let mut values: Vec<f64> = (0..40).map(|i| if i < 20 { 1.0 } else { 50.0 }).collect();
        values[10] = 30.0;
        values[30] = f64::NAN;
        assert_eq!(marked(&values, 0.5), [10]);
    }

    #[test]
    fn two_spikes_in_a_row_are_both_marked() {
        let mut values = vec![5.0; 20];
        (values[8], values[9]) = (90.0, 90.0);
        assert_eq!(marked(&values, 0.5), [8, 9]);
        assert!(spikes::<3>(&values, &[true; 20], 0.5).iter().all(|&mark| !mark));
    }

    #[test]
    fn noise_and_ramps_hold_no_spikes() {
        let values: Vec<f64> =
            (0..200).map(|i| 0.3 * f64::from(i) + 0.4 * f64::from(i * 7919 % 13) / 13.0).collect();
        assert_eq!(marked(&values, 0.01), [] as [usize; 0]);
    }

    #[test]
    fn rows_that_are_not_usable_are_no_neighbours() {
        let values = [1.0, 1.0, 900.0, 900.0, 900.0, 1.0, 1.0, 1.0, 1.0];
        let usable = [true, true, false, false, false, true, true, true, true];
        assert!(spikes::<5>(&values, &usable, 0.5).iter().all(|&mark| !mark));
    }
}
