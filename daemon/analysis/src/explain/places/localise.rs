//! Place along the line, and runs, where a force of a given shape acts; error of the declared gradient there.

use dynocar_model::track::Track;

use super::runs::{FoundIntervals, best_runs};
use super::site::Inside;
use crate::explain::evidence::{Bin, RunData};
use crate::explain::scan::{Scan, Tuple};
use crate::parallel;
use crate::statistics::{least_first, span};

/// Shortest interval in m that the search tries.
const SHORTEST_M: f64 = 150.0;
/// Final resolution of the ends in m.
const FINEST_M: f64 = 10.0;
/// Least number of runs in which an effect tied to a place shows, where there are that many; in fewer runs it is an
/// event.
const PLACE_RUNS_MIN: usize = 2;
/// Least share of the gain of all intervals that a further interval must add.
const FURTHER_SHARE: f64 = 0.05;
/// Standard deviation of a surveyed gradient in ‰, which is N/kN.
pub const MAP_ERROR_PERMILLE: f64 = SURVEYED.permille;
/// Number of times that all intervals are refined jointly.
const SWEEPS: usize = 2;
/// Greatest number of intervals of one effect.
const INTERVALS_MAX: usize = 6;

struct Cell {
    interval_m: [f64; 2],
    runs: Vec<Tuple>,
}

/// A shape: acceleration in m/s² per unit at a sample of a run, where the force acts in full.
pub type Shape<'s> = &'s (dyn Fn(&RunData, usize) -> f64 + Sync);

/// A shape at the bins of all fit runs, with the indices of the bins.
struct Places<'s, 'a> {
    scan: &'s Scan<'a>,
    inside: Inside,
    /// By run and bin: chainage in m and acceleration in m/s² per unit.
    bins: Vec<Vec<(Option<f64>, f64)>>,
    /// By run, for each [`BLOCK`] of bins: least and greatest chainage in m.
    blocks: Vec<Vec<[f64; 2]>>,
}

/// Tuples of runs that one thread takes at a time at least: less work is not worth handing out.
const TUPLES_A_TASK: usize = 64;
/// Bins that are looked at together.
const BLOCK: usize = 16;

impl<'s, 'a> Places<'s, 'a> {
    fn new(scan: &'s Scan<'a>, shape: Shape, inside: Inside) -> Self {
        let at_bins = |run: &RunData| {
            let middles = run.bins.iter().map(Bin::middle);
            middles.map(|i| (run.samples()[i].position_m, shape(run, i))).collect()
        };
        let bins: Vec<Vec<(Option<f64>, f64)>> = scan.problem.runs.iter().map(at_bins).collect();
        let extent = |block: &[(Option<f64>, f64)]| {
            let known = block.iter().filter_map(|bin| bin.0);
            span(known).unwrap_or([f64::INFINITY, f64::NEG_INFINITY])
        };
        let blocks = bins.iter().map(|run| run.chunks(BLOCK).map(extent).collect()).collect();
        Places { scan, inside, bins, blocks }
    }

    fn run_tuple(&self, index: usize, intervals_m: &[[f64; 2]]) -> Tuple {
        let value = |&(position_m, value): &(Option<f64>, f64)| match self
            .inside
            .share(position_m, intervals_m)
        {
            0.0 => 0.0,
            share => share * value,
        };
        let reach_m = self.inside.reach_m();
        let may_be_in = |[low, high]: &[f64; 2]| {
            intervals_m.iter().any(|[from, to]| low - reach_m <= *to && high + reach_m >= *from)
        };
        let (bins, blocks) = (&self.bins[index], &self.blocks[index]);
        let Some(first) = blocks.iter().position(may_be_in) else {
            return Tuple::zero(self.scan.fit.theta.len());
        };
        let last = blocks.iter().rposition(may_be_in).unwrap_or(first);
        let near = BLOCK * first..(BLOCK * (last + 1)).min(bins.len());
        let mut shape = vec![0.0; near.len()];
        let blocks = bins[near.clone()].chunks(BLOCK).zip(&blocks[first..=last]);
        for (shape, (bins, _)) in
            shape.chunks_mut(BLOCK).zip(blocks).filter(|(_, (_, extent))| may_be_in(extent))
        {
            shape.iter_mut().zip(bins).for_each(|(shape, bin)| *shape = value(bin));
        }
        self.scan.local_tuple(index, near.start, &shape)
    }

    fn tuples(&self, interval_m: [f64; 2]) -> Vec<Tuple> {
        (0..self.bins.len()).map(|index| self.run_tuple(index, &[interval_m])).collect()
    }
}

/// The chainage in m over which the fit runs move.
pub fn span_m(scan: &Scan) -> Option<[f64; 2]> {
    let runs = scan.problem.runs.iter();
    let middles = runs.flat_map(|run| run.bins.iter().map(|bin| &run.samples()[bin.middle()]));
    let span = span(middles.filter_map(|sample| sample.position_m));
    span.filter(|[low, high]| high - low > 4.0 * SHORTEST_M)
}

fn cells(places: &Places, [low, high]: [f64; 2]) -> Vec<Cell> {
    let shortest_m = SHORTEST_M.max((high - low) / 250.0);
    let mut intervals_m = Vec::new();
    let mut length_m = shortest_m;
    while length_m < 0.6 * (high - low) {
        let count = ((high - low) / (0.5 * length_m)).ceil() as usize;
        for k in 0..count {
            let from_m = low + 0.5 * length_m * k as f64;
            intervals_m.push([from_m, from_m + length_m]);
        }
        length_m *= 1.6;
    }
    let cell = |&interval_m: &[f64; 2]| Cell { interval_m, runs: places.tuples(interval_m) };
    parallel::of_each(&intervals_m, cell)
}

/// Finds the intervals and runs in which a common positive factor on a shape explains most.
///
/// Intervals are added while each explains more than the
/// choice among all of them does by chance.
pub fn find(scan: &Scan, shape: Shape, inside: Inside) -> Option<FoundIntervals> {
    let span = span_m(scan)?;
    let places = Places::new(scan, shape, inside);
    let cells = cells(&places, span);
    let interval_cost = 2.0 * (cells.len().max(2) as f64).ln();
    let runs_min = PLACE_RUNS_MIN.min(scan.problem.runs.len());
    let by_runs = parallel::of_each_number(cells.len(), |number| {
        (&cells[number], best_runs(scan, &cells[number].runs, runs_min))
    });
    let best = by_runs
        .into_iter()
        .max_by(|one, other| (one.1.1 - one.1.3).total_cmp(&(other.1.1 - other.1.3)))?;
    let (cell, (runs, gain, _, subset)) = best;
    if gain <= 0.0 {
        return None;
    }
    let mut found = FoundIntervals {
        intervals_m: vec![cell.interval_m],
        span_m: span,
        runs,
        gain,
        estimate: 0.0,
        choice_cost: subset,
        map_error: 0.0,
    };
    places.polish(&mut found, 0);
    while found.intervals_m.len() < INTERVALS_MAX {
        let Some(added) = places.with_another(&cells, &found) else { break };
        if added.gain - found.gain < (interval_cost + 6.0).max(FURTHER_SHARE * found.gain) {
            break;
        }
        found = added;
    }
    if found.intervals_m.len() > 1 {
        // Each was found given the earlier intervals only, and the runs by the first: others end before they reach it.
        for _ in 0..SWEEPS {
            places.choose_runs(&mut found, runs_min);
            (0..found.intervals_m.len()).for_each(|index| places.polish(&mut found, index));
        }
    }
    least_first(&mut found.intervals_m, |it| it[0]);
    found.choice_cost += found.intervals_m.len() as f64 * interval_cost;
    found.map_error = places.map_error(&found);
    Some(found)
}

/// Returns the standard deviation in ‰ of the mean gradient over some intervals: the one that the line states for
/// each, and no less than a surveyor's.
fn gradient_std_permille(track: Option<&Track>, intervals_m: &[[f64; 2]]) -> f64 {
    let squares: f64 = intervals_m
        .iter()
        .map(|[from_m, to_m]| {
            let stated = track.and_then(|track| track.gradient_std_permille(*from_m, *to_m));
            stated.unwrap_or(0.0).max(MAP_ERROR_PERMILLE).powi(2)
        })
        .sum();
    squares.sqrt() / intervals_m.len().max(1) as f64
}

/// True when an interval overlaps none of some others.
fn apart(one: [f64; 2], others: &[[f64; 2]]) -> bool {
    others.iter().all(|other| one[1] <= other[0] || one[0] >= other[1])
}

impl Places<'_, '_> {
    /// Returns the error of the factor by an error of the gradient map. It slows the train in one direction and
    /// helps it in the other, so that passes in both directions cancel it; a set of runs in one direction shows it
    /// in full, the same in every run.
    fn map_error(&self, found: &FoundIntervals) -> f64 {
        let (mut square, mut leaning, mut resistance, mut full) = (0.0, 0.0, 0.0, 0.0);
        for (index, run) in self.scan.problem.runs.iter().enumerate() {
            if found.runs.as_ref().is_some_and(|runs| !runs.contains(&index)) {
                continue;
            }
            let tuple = self.run_tuple(index, &found.intervals_m);
            square += tuple.square;
            leaning += run.direction * tuple.square;
            for (bin, &(position_m, value)) in run.bins.iter().zip(&self.bins[index]) {
                let share = self.inside.share(position_m, &found.intervals_m);
                let sample = &run.samples()[bin.middle()];
                resistance += share * self.scan.per_unit_resistance_mps2(sample);
                full += (share * value).abs();
            }
        }
        if square <= 0.0 || full <= 0.0 {
            return 0.0;
        }
        // With a profile of its own for each direction, nothing cancels.
        let track = self.scan.track;
        let is_one = track.is_none_or(|track| track.is_one_profile());
        let leaning = if is_one { (leaning / square).abs() } else { 1.0 };
        gradient_std_permille(track.map(|track| &**track), &found.intervals_m)
            * leaning
            * (resistance / full)
    }

    /// The sum over the chosen runs.
    fn summed(&self, tuples: &[Tuple], runs: &Option<Vec<usize>>) -> Tuple {
        let mut sum = Tuple::zero(self.scan.fit.theta.len());
        for (index, tuple) in tuples.iter().enumerate() {
            if runs.as_ref().is_none_or(|runs| runs.contains(&index)) {
                sum.add(tuple);
            }
        }
        sum
    }

    /// Returns the sum over the chosen runs of some intervals together: the noise filter still remembers one interval
    /// when the train comes to the next.
    fn over(&self, intervals_m: &[[f64; 2]], runs: &Option<Vec<usize>>) -> Tuple {
        let mut sum = Tuple::zero(self.scan.fit.theta.len());
        let is_chosen = |index: &usize| runs.as_ref().is_none_or(|runs| runs.contains(index));
        for index in (0..self.bins.len()).filter(is_chosen) {
            sum.add(&self.run_tuple(index, intervals_m));
        }
        sum
    }

    fn with_another(&self, cells: &[Cell], found: &FoundIntervals) -> Option<FoundIntervals> {
        let base = self.over(&found.intervals_m, &found.runs);
        let gains = parallel::of_each(cells, |cell| {
            apart(cell.interval_m, &found.intervals_m).then(|| {
                let mut sum = self.summed(&cell.runs, &found.runs);
                sum.add(&base);
                self.scan.gain(&sum).0
            })
        });
        let gains = cells.iter().zip(gains).filter_map(|(cell, gain)| Some((cell, gain?)));
        let most = gains.max_by(|one, other| one.1.total_cmp(&other.1));
        let (cell, gain) = most?;
        let mut grown = found.clone();
        grown.intervals_m.push(cell.interval_m);
        grown.gain = gain;
        self.polish(&mut grown, found.intervals_m.len());
        Some(grown)
    }

    /// Chooses the runs again by all intervals together, where that explains more after its cost, which is all that
    /// `choice_cost` holds here.
    fn choose_runs(&self, found: &mut FoundIntervals, runs_min: usize) {
        let tuples: Vec<Tuple> =
            (0..self.bins.len()).map(|index| self.run_tuple(index, &found.intervals_m)).collect();
        let (runs, gain, estimate, choice_cost) = best_runs(self.scan, &tuples, runs_min);
        if gain - choice_cost > found.gain - found.choice_cost {
            *found = FoundIntervals { runs, gain, estimate, choice_cost, ..found.clone() };
        }
    }

    /// Moves the ends of an interval while that explains more.
    fn polish(&self, found: &mut FoundIntervals, index: usize) {
        let mut others = found.intervals_m.clone();
        let own = others.remove(index);
        let value = |interval: [f64; 2]| {
            let together = [&others[..], &[interval]].concat();
            let (gain, estimate) = self.scan.gain(&self.over(&together, &found.runs));
            if estimate <= 0.0 { (0.0, estimate) } else { (gain, estimate) }
        };
        let tries_a_task = TUPLES_A_TASK.div_ceil(self.bins.len());
        let mut best = (own, value(own));
        let mut step_m = 0.5 * (best.0[1] - best.0[0]);
        while step_m > FINEST_M {
            let [from, to] = best.0;
            let tries = [
                [from - step_m, to],
                [from + step_m, to],
                [from, to - step_m],
                [from, to + step_m],
                [from - step_m, to - step_m],
                [from + step_m, to + step_m],
            ];
            let possible = |it: &[f64; 2]| it[1] - it[0] >= 100.0 && apart(*it, &others);
            let tries: Vec<[f64; 2]> = tries.into_iter().filter(possible).collect();
            let values =
                parallel::in_tasks(tries.len(), tries_a_task, |k| (tries[k], value(tries[k])));
            let better = values.into_iter().max_by(|one, other| one.1.0.total_cmp(&other.1.0));
            match better {
                Some(better) if better.1.0 > best.1.0 => best = better,
                _ => step_m *= 0.5,
            }
        }
        found.intervals_m[index] = best.0;
        (found.gain, found.estimate) = best.1;
    }
}

/// Size and length of the errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorScale {
    /// Standard deviation in ‰.
    pub permille: f64,
    /// Length in m over which the error changes.
    pub length_m: f64,
}

/// A map drawn from altitudes, with a wrong vertical curve or a smoothed hill.
pub const MAP: ErrorScale = ErrorScale { permille: 1.5, length_m: 1500.0 };
/// Remaining error of a usual survey: short pieces, each a little wrong.
pub const SURVEYED: ErrorScale = ErrorScale { permille: 0.1, length_m: 600.0 };
/// A line whose gradient nobody surveyed: a railway's, and a street's in hills.
pub const UNSURVEYED: [ErrorScale; 2] =
    [ErrorScale { permille: 8.0, length_m: 600.0 }, ErrorScale { permille: 25.0, length_m: 200.0 }];
