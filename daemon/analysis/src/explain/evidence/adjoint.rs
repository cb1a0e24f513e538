//! Inner products of whitened accelerations, without whitening them.
//!
//! The whitening filter is linear: the product of whitened accelerations with a whitened series is a sum over the bins,
//! with one factor for each bin. One backward pass of the adjoint filter over the run gives all these factors. The
//! part of a square after the last bin where a force acts depends only on the state of the filter there. A force at a
//! place therefore costs as many steps as it has bins, however long the filter remembers it.

use std::array;

use super::fit::Fit;
use super::run_data::RunData;
use super::run_scatter::DEVIATIONS;
use super::whitener::{self, FADING, LEVEL};

/// Adjoint filter of one run: it gives products of accelerations at the bins with the series of a fit.
#[derive(Clone, Debug)]
pub struct Adjoint {
    /// Change by 1 m/s² at each bin of the weighted products with the innovations, the columns of the run's own
    /// factors and the regressors that touch the run.
    added: Vec<f64>,
    /// The numbers of these regressors.
    regressors: Vec<usize>,
    walk: Vec<Walked>,
    steps: Vec<Step>,
}

/// Number of columns summed side by side.
const WIDE: usize = 4;
/// Number of products before those with the regressors.
const OWN_PRODUCTS: usize = 1 + DEVIATIONS;

/// Weighted products of whitened accelerations.
pub struct Products {
    /// With the innovations.
    pub innovations: f64,
    /// With themselves.
    pub square: f64,
    /// With the columns of the run's own factors.
    pub factors: [f64; DEVIATIONS],
}

/// A step of the filter, for the difference between speed and level, which no constant speed changes.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// Half of the time in s from the bin before; 0 where a segment starts, as all but `fade`.
    half_s: f64,
    fade: f64,
    carry_s: f64,
    /// Share of a difference that remains at the next bin.
    left: f64,
    /// Gain of the fading acceleration from a difference.
    gain: f64,
    per_deviation: f64,
    /// Weight of a squared difference.
    weight: f64,
    /// Remaining part of the square behind this bin, by the squares and the product of the remaining difference and
    /// of the fading acceleration.
    behind: [f64; 3],
}

/// A step from one bin to the next: the difference and the fading acceleration after it. The fields are all numbers
/// that a square needs, in the order in which the next step needs them.
#[derive(Clone, Copy, Debug)]
struct Walked {
    /// Half of the time in s from the bin before; 0 where a segment starts.
    half_s: f64,
    /// Weight of a squared difference.
    weight: f64,
    /// Factors of the difference and the fading acceleration before the step, for the difference.
    to_difference: [f64; 2],
    /// The same for the fading acceleration.
    to_fading: [f64; 2],
}

impl Walked {
    /// Returns all steps, each after the one before.
    fn all(steps: &[Step]) -> Vec<Self> {
        let mut before = [0.0; 3];
        let walked = |step: &Step| {
            let [left, gain, fade] = before;
            before = [step.left, step.gain, step.fade];
            Walked {
                half_s: step.half_s,
                weight: step.weight,
                to_difference: [left - step.carry_s * gain, -step.carry_s * fade],
                to_fading: [gain, fade],
            }
        };
        steps.iter().map(walked).collect()
    }
}

impl Adjoint {
    /// Of run number `index` of a fit.
    pub fn of(run: &RunData, fit: &Fit, index: usize) -> Self {
        let (filter, columns) = (&fit.filters[index], &fit.columns[index]);
        let touches = |number: &usize| !columns[*number].is_empty();
        let regressors: Vec<usize> = (0..columns.len()).filter(touches).collect();
        let first = std::iter::once(&fit.innovations[index]).chain(filter.columns());
        let series: Vec<&[f64]> =
            first.map(|it| &it[..]).chain(regressors.iter().map(|it| &columns[*it][..])).collect();
        let times_s = run.bins.iter().map(|bin| bin.time_s);
        let steps = steps(fit.whitener(index).steps(), times_s, filter.weights());
        let mut added = vec![0.0; series.len() * steps.len()];
        for (number, own) in series.iter().enumerate() {
            let added = added[number..].iter_mut().step_by(series.len());
            back(&steps, filter.weights(), own, added);
        }
        Adjoint { added, regressors, walk: Walked::all(&steps), steps }
    }

    /// Returns the products of whitened accelerations, given in m/s² from one bin on; those with the regressors are
    /// added to `cross`, by their numbers.
    pub fn products(&self, from: usize, shape: &[f64], cross: &mut [f64]) -> Products {
        let width = OWN_PRODUCTS + self.regressors.len();
        let mut sums = vec![0.0; width];
        let rows = || self.added[width * from..].chunks_exact(width).zip(shape);
        let mut column = 0;
        while column + WIDE <= width {
            sums[column..column + WIDE].copy_from_slice(&columns_sum::<WIDE>(rows(), column));
            column += WIDE;
        }
        for (column, sum) in sums.iter_mut().enumerate().skip(column) {
            [*sum] = columns_sum(rows(), column);
        }
        for (number, sum) in self.regressors.iter().zip(&sums[OWN_PRODUCTS..]) {
            cross[*number] = *sum;
        }
        Products {
            innovations: sums[0],
            square: self.square(from, shape),
            factors: array::from_fn(|k| sums[1 + k]),
        }
    }

    /// Returns the weighted square of whitened accelerations, given in m/s² from one bin on.
    fn square(&self, from: usize, shape: &[f64]) -> f64 {
        let (mut sum, mut before_mps2, [mut difference, mut fading]) = (0.0, 0.0, [0.0; 2]);
        let mut act = |step: &Walked, mps2: f64| {
            let gained_mps = step.half_s * (before_mps2 + mps2);
            before_mps2 = mps2;
            let ([by_difference, by_fading], [gain, fade]) = (step.to_difference, step.to_fading);
            let waited = difference;
            difference = by_difference * waited + (by_fading * fading + gained_mps);
            fading = gain * waited + fade * fading;
            sum += step.weight * difference * difference;
            (sum, difference, fading)
        };
        let end = from + shape.len();
        for (step, &mps2) in self.walk[from..end].iter().zip(shape) {
            act(step, mps2);
        }
        // The last acceleration lasts until the bin behind.
        let Some(next) = self.steps.get(end) else { return sum };
        let (sum, difference, fading) = act(&self.walk[end], 0.0);
        let left = next.left * difference;
        let fading = next.fade * fading + next.gain * difference;
        let [by_left, by_both, by_fading] = next.behind;
        sum + left * (by_left * left + 2.0 * by_both * fading) + by_fading * fading * fading
    }
}

/// Returns the sums of some columns over the rows, each row times its factor.
fn columns_sum<'a, const N: usize>(
    rows: impl Iterator<Item = (&'a [f64], &'a f64)>,
    first: usize,
) -> [f64; N] {
    rows.fold([0.0; N], |sums, (row, factor)| {
        let row = &row[first..first + N];
        array::from_fn(|k| sums[k] + factor * row[k])
    })
}

/// The steps of a filter over bins at these times in s, with these weights of the innovations.
fn steps(
    filter: &[whitener::Step],
    times_s: impl Iterator<Item = f64>,
    weights: &[f64],
) -> Vec<Step> {
    let mut before_s = 0.0;
    let step = |((step, time_s), weight): ((&whitener::Step, f64), &f64)| {
        let acts = if step.starts { 0.0 } else { 1.0 };
        let half_s = 0.5 * acts * (time_s - before_s);
        before_s = time_s;
        Step {
            half_s,
            fade: step.fade,
            carry_s: acts * step.carry_s,
            left: acts * (1.0 - step.gain[LEVEL]),
            gain: acts * step.gain[FADING],
            per_deviation: acts * step.per_deviation,
            weight: acts * weight * step.per_deviation * step.per_deviation,
            behind: [0.0; 3],
        }
    };
    let mut steps: Vec<Step> = filter.iter().zip(times_s).zip(weights).map(step).collect();
    let mut behind = [0.0; 3];
    for step in steps.iter_mut().rev() {
        step.behind = behind;
        behind = step.square_before(behind);
    }
    steps
}

impl Step {
    /// Returns the form of the square from this bin on in the state before it, by the form in the state after it: the
    /// backward recursion of the squares.
    fn square_before(&self, [by_left, by_both, by_fading]: [f64; 3]) -> [f64; 3] {
        let Step { fade, carry_s, left, gain, weight, .. } = *self;
        let difference =
            weight + left * (by_left * left + 2.0 * by_both * gain) + by_fading * gain * gain;
        let both = fade * (by_both * left + by_fading * gain);
        [
            difference,
            both - difference * carry_s,
            by_fading * fade * fade + carry_s * (difference * carry_s - 2.0 * both),
        ]
    }
}

/// Runs the adjoint filter backwards: the change by 1 m/s² at each bin of the weighted product with a whitened series.
fn back<'a>(
    steps: &[Step],
    weights: &[f64],
    series: &[f64],
    added: impl DoubleEndedIterator<Item = &'a mut f64> + ExactSizeIterator,
) {
    let (mut by_left, mut by_fading, mut by_next_mps2) = (0.0, 0.0, 0.0);
    let rows = steps.iter().zip(weights).zip(series).zip(added);
    for (((step, weight), value), added) in rows.rev() {
        let by_difference =
            weight * value * step.per_deviation + by_left * step.left + by_fading * step.gain;
        by_left = by_difference;
        by_fading = by_fading * step.fade - by_difference * step.carry_s;
        let by_mps2 = step.half_s * by_difference;
        // It lasts from the bin before to the next.
        *added = by_mps2 + by_next_mps2;
        by_next_mps2 = by_mps2;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;

    const BINS: usize = 11;

    /// A filter over two segments of motion, with the times of its bins in s.
    fn filter() -> (Vec<whitener::Step>, Vec<f64>) {
        let step = |k: usize| {
            let (starts, by) = (k == 0 || k == 6, k as f64);
            let gain = Vector2::new(0.4 + 0.02 * by, 0.1 - 0.005 * by);
            let (fade, carry_s) = (0.9 - 0.01 * by, 1.5 + 0.1 * by);
            whitener::Step { starts, fade, carry_s, gain, per_deviation: 3.0 + 0.2 * by }
        };
        ((0..BINS).map(step).collect(), (0..BINS).map(|k| 2.0 * k as f64 + 0.1).collect())
    }

    /// Returns accelerations in m/s² as whitened by the filter itself.
    fn whitened(filter: &[whitener::Step], times_s: &[f64], mps2: &[f64]) -> Vec<f64> {
        let (mut speed_mps, mut level_mps, mut fading) = (0.0, 0.0, 0.0);
        let innovation = |k: usize| {
            let step = &filter[k];
            let half_s = if step.starts { 0.0 } else { 0.5 * (times_s[k] - times_s[k - 1]) };
            speed_mps =
                if step.starts { 0.0 } else { speed_mps + half_s * (mps2[k - 1] + mps2[k]) };
            let ahead = if step.starts { speed_mps } else { level_mps + step.carry_s * fading };
            let difference = speed_mps - ahead;
            level_mps = ahead + step.gain[LEVEL] * difference;
            fading = step.fade * fading + step.gain[FADING] * difference;
            step.per_deviation * difference
        };
        (0..BINS).map(innovation).collect()
    }

    #[test]
    fn products_are_those_of_what_the_filter_makes() {
        let (filter, times_s) = filter();
        let weights: Vec<f64> = (0..BINS).map(|k| 1.0 - 0.05 * k as f64).collect();
        let series: Vec<f64> = (0..BINS).map(|k| (1.3 * k as f64).sin()).collect();
        let steps = steps(&filter, times_s.iter().copied(), &weights);
        let mut added = vec![0.0; (OWN_PRODUCTS + 1) * BINS];
        for number in [0, OWN_PRODUCTS] {
            back(&steps, &weights, &series, added[number..].iter_mut().step_by(OWN_PRODUCTS + 1));
        }
        let walk = Walked::all(&steps);
        let adjoint = Adjoint { added, regressors: vec![2], walk, steps };
        for (from, to) in [(0, 3), (1, 2), (3, 8), (4, 7), (7, BINS), (0, BINS)] {
            let shape: Vec<f64> = (from..to).map(|k| 0.3 + (0.7 * k as f64).cos()).collect();
            let mut mps2 = vec![0.0; BINS];
            mps2[from..to].copy_from_slice(&shape);
            let innovations = whitened(&filter, &times_s, &mps2);
            let with = |other: &[f64]| -> f64 {
                innovations.iter().zip(other).zip(&weights).map(|((i, o), w)| w * i * o).sum()
            };
            let mut cross = [0.0; 3];
            let products = adjoint.products(from, &shape, &mut cross);
            let is_near = |one: f64, other: f64| (one - other).abs() < 1e-12 * (1.0 + other.abs());
            assert!(is_near(products.square, with(&innovations)), "{from} to {to}");
            assert!(is_near(products.innovations, with(&series)), "{from} to {to}");
            assert!(cross[..2] == [0.0; 2] && is_near(cross[2], with(&series)), "{from} to {to}");
        }
    }
}
