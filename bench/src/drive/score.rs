//! What the legs of all trains come to, with intervals.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::answers::{ASKED, Use};
use super::journey::DrivenLeg;
use super::line::Service;
use super::run::{Driven, Informant};
use crate::statistics::{median, quantiles};

/// Draws of the trains behind an interval.
const DRAWS: usize = 400;
/// A leg counts for the energy where every driver stops so near in m: else it is not the same service.
const SAME_STOP_M: f64 = 1.0;
/// What is no difference that anybody would notice: stop in m, energy in %, lateness in s, jerk in m/s³.
const UNNOTICED: [f64; 4] = [0.03, 0.3, 0.5, 0.05];
/// What is compared.
const MEASURES: [&str; 4] = ["stop_error_rms_m", "energy_percent", "late_s", "jerk_mps3"];
/// Share of bounds that may be exceeded.
const EXCEEDED_MAX: f64 = 0.01;

/// A figure with its 95 % interval over trains.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// The figure.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Figure {
    /// A statistic of trains, given by their places; the interval is that of trains drawn anew.
    fn of(trains: usize, statistic: impl Fn(&[usize]) -> f64) -> Self {
        let all: Vec<usize> = (0..trains).collect();
        let mut random = ChaCha8Rng::seed_from_u64(95);
        let draws: Vec<f64> = (0..DRAWS)
            .map(|_| {
                let drawn: Vec<usize> =
                    all.iter().map(|_| random.random_range(0..trains)).collect();
                statistic(&drawn)
            })
            .collect();
        let value = statistic(&all);
        let [low, high] = quantiles(draws, [0.025, 0.975]).unwrap_or([f64::NAN; 2]);
        Figure { value, low, high }
    }
}

/// A service with one kind of parameters.
#[derive(Clone, Debug, Serialize)]
pub struct ReportRow {
    /// The service.
    pub scenario: String,
    /// The parameters.
    pub driver: &'static str,
    /// Stops behind the figures.
    pub stops: usize,
    /// Mean of the place beyond the stopping point in m.
    pub beyond_m: Figure,
    /// Its standard deviation in m.
    pub spread_m: Figure,
    /// Root of its mean square in m.
    pub error_m: Figure,
    /// Stops within 0.3 m in %.
    pub within_03_percent: Figure,
    /// Stops within 0.5 m in %.
    pub within_05_percent: Figure,
    /// Energy at the rims at the same running time, over that with true parameters, in %.
    pub energy_percent: Figure,
    /// Mean size of the deviation from the timetable in s.
    pub late_s: Figure,
    /// Mean of the legs' greatest jerk in m/s³.
    pub jerk_mps3: Figure,
    /// Bounds looked at.
    pub bounds: usize,
    /// Those that the true braking distance exceeded, or that could not be given; absent for the true
    /// parameters, which leave no room.
    pub exceeded: Option<usize>,
    /// Length of the bound over the true braking distance in %.
    pub bound_percent: Option<f64>,
    /// The same of the fixed worst case.
    pub fixed_percent: f64,
}

/// What an answer was worth in a service.
#[derive(Clone, Debug, Serialize)]
pub struct Answered {
    /// The service.
    pub scenario: String,
    /// The quantity.
    pub quantity: &'static str,
    /// Share of the time in which it was usable in %.
    pub usable_percent: f64,
    /// Share of that with the truth more than four deviations off in %.
    pub wrong_percent: f64,
    /// Share of that with the declared value nearer to the truth, by 1 % of the truth, in %.
    pub worse_percent: f64,
    /// Root of the mean square of its error in % of the truth; of the declared value then.
    pub error_percent: [Option<f64>; 2],
    /// Median time in s until the first use, over trains.
    pub first_s: Option<f64>,
    /// Changes of usable for each stop.
    pub changes_per_stop: f64,
}

/// The driver with Dynocar beside the one with declared parameters.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// The service.
    pub scenario: String,
    /// What differs beyond the noise.
    pub differences: Vec<Difference>,
    /// Bounds that were exceeded more often than promised, in words.
    pub exceeded: Option<String>,
    /// True where that is not paid back by a better stop, or where stops or bounds are worse.
    pub is_broken: bool,
}

/// A measure that differs beyond the noise.
#[derive(Clone, Debug, Serialize)]
pub struct Difference {
    /// The measure, with its unit.
    pub measure: &'static str,
    /// With Dynocar less with declared parameters; less is better.
    pub figure: Figure,
    /// Whether it is better.
    pub is_better: bool,
}

impl Comparison {
    /// What is worse beyond the noise, in words.
    pub fn worse(&self) -> String {
        let own = self.differences.iter().filter(|it| !it.is_better);
        let words = own.map(|Difference { measure, figure, .. }| {
            let Figure { value, low, high } = figure;
            format!("{measure}: {value:+.3} ({low:+.3} to {high:+.3})")
        });
        words.chain(self.exceeded.clone()).collect::<Vec<_>>().join("; ")
    }
}

/// Everything about one service.
#[derive(Clone, Debug, Serialize)]
pub struct Scored {
    /// Declared, Dynocar, true.
    pub lines: Vec<ReportRow>,
    /// By quantity.
    pub answers: Vec<Answered>,
    /// With and without Dynocar.
    pub comparison: Comparison,
}

/// The legs of one kind of parameters beside all kinds, for the energy of the same stops.
struct Drives<'a> {
    own: &'a [Driven],
    all: &'a [Vec<Driven>; 3],
}

impl Drives<'_> {
    fn mean(&self, trains: &[usize], of: impl Fn(&DrivenLeg) -> f64) -> f64 {
        let legs = || trains.iter().flat_map(|&train| &self.own[train].legs);
        legs().map(of).sum::<f64>() / legs().count().max(1) as f64
    }

    fn energy_percent(&self, trains: &[usize]) -> f64 {
        let (mut own_j, mut true_j) = (0.0, 0.0);
        for &train in trains {
            for (index, leg) in self.own[train].legs.iter().enumerate() {
                let is_same =
                    self.all.iter().all(|it| it[train].legs[index].beyond_m.abs() <= SAME_STOP_M);
                if is_same {
                    own_j += leg.energy_j;
                    true_j += self.all[2][train].legs[index].energy_j;
                }
            }
        }
        if true_j > 0.0 { 100.0 * own_j / true_j } else { f64::NAN }
    }

    fn error_m(&self, trains: &[usize]) -> f64 {
        self.mean(trains, |leg| leg.beyond_m.powi(2)).sqrt()
    }

    /// Stop, energy, lateness and jerk: less is better.
    fn compared(&self, trains: &[usize]) -> [f64; 4] {
        [
            self.error_m(trains),
            self.energy_percent(trains),
            self.mean(trains, |leg| leg.late_s.abs()),
            self.mean(trains, |leg| leg.jerk_mps3),
        ]
    }
}

/// Scores a service's drives with declared, learned and true parameters.
pub fn score(service: Service, all: &[Vec<Driven>; 3]) -> Scored {
    let lines: Vec<ReportRow> = Informant::ALL
        .into_iter()
        .zip(all)
        .map(|(informant, own)| line(service, informant, &Drives { own, all }))
        .collect();
    let stops: usize = all[1].iter().map(|driven| driven.legs.len()).sum();
    let answers = (0..ASKED.len()).map(|index| answered(service, index, &all[1], stops)).collect();
    let comparison = comparison(service, all, &lines);
    Scored { lines, answers, comparison }
}

fn line(service: Service, informant: Informant, drives: &Drives<'_>) -> ReportRow {
    let trains = drives.own.len();
    let share = |within_m: f64| {
        Figure::of(trains, |it| {
            100.0 * drives.mean(it, |leg| f64::from(u8::from(leg.beyond_m.abs() <= within_m)))
        })
    };
    let beyond_m = |it: &[usize]| drives.mean(it, |leg| leg.beyond_m);
    let looks: Vec<_> =
        drives.own.iter().flat_map(|driven| &driven.legs).flat_map(|leg| &leg.looks).collect();
    let count = looks.len().max(1) as f64;
    let is_exceeded = |bound_m: Option<f64>, true_m| bound_m.is_none_or(|it| true_m > it);
    let exceeded = looks.iter().filter(|look| is_exceeded(look.bound_m, look.true_m)).count();
    let given = looks.iter().filter_map(|look| Some(look.bound_m? / look.true_m));
    let given_count = given.clone().count().max(1) as f64;
    let is_true = informant == Informant::Truth;
    ReportRow {
        scenario: service.name(),
        driver: informant.name(),
        stops: drives.own.iter().map(|driven| driven.legs.len()).sum(),
        beyond_m: Figure::of(trains, beyond_m),
        spread_m: Figure::of(trains, |it| {
            let mean = beyond_m(it);
            drives.mean(it, |leg| (leg.beyond_m - mean).powi(2)).sqrt()
        }),
        error_m: Figure::of(trains, |it| drives.error_m(it)),
        within_03_percent: share(0.3),
        within_05_percent: share(0.5),
        energy_percent: Figure::of(trains, |it| drives.energy_percent(it)),
        late_s: Figure::of(trains, |it| drives.mean(it, |leg| leg.late_s.abs())),
        jerk_mps3: Figure::of(trains, |it| drives.mean(it, |leg| leg.jerk_mps3)),
        bounds: looks.len(),
        exceeded: (!is_true).then_some(exceeded),
        bound_percent: (!is_true).then_some(100.0 * given.sum::<f64>() / given_count),
        fixed_percent: 100.0 * looks.iter().map(|it| it.fixed_m / it.true_m).sum::<f64>() / count,
    }
}

fn answered(service: Service, index: usize, driven: &[Driven], stops: usize) -> Answered {
    let mut total = Use::default();
    driven.iter().for_each(|it| total.join(&it.uses[index]));
    let cycle_ms = f64::from(service.cycle_ms);
    let first_s = |it: &Driven| {
        it.uses[index].first.map_or(f64::INFINITY, |cycles| 1e-3 * cycles as f64 * cycle_ms)
    };
    let first_s = median(driven.iter().map(first_s).collect()).filter(|it| it.is_finite());
    let usable = total.usable.max(1) as f64;
    let percent = |count: u64| 100.0 * count as f64 / usable;
    let error = |square: f64| {
        (total.usable > 0 && square.is_finite()).then_some(100.0 * (square / usable).sqrt())
    };
    Answered {
        scenario: service.name(),
        quantity: ASKED[index].name(),
        usable_percent: 100.0 * total.usable as f64 / total.cycles.max(1) as f64,
        wrong_percent: percent(total.wrong),
        worse_percent: percent(total.worse),
        error_percent: total.squares.map(error),
        first_s,
        changes_per_stop: total.changes as f64 / stops.max(1) as f64,
    }
}

fn comparison(service: Service, all: &[Vec<Driven>; 3], lines: &[ReportRow]) -> Comparison {
    let [declared, learned] = [0, 1].map(|which| Drives { own: &all[which], all });
    let difference = |index: usize| {
        let figure = Figure::of(all[0].len(), |it| {
            learned.compared(it)[index] - declared.compared(it)[index]
        });
        let (is_worse, is_better) = (figure.low > UNNOTICED[index], figure.high < 0.0);
        let measure = MEASURES[index];
        (is_worse || is_better).then_some(Difference { measure, figure, is_better })
    };
    let differences: Vec<Difference> = (0..MEASURES.len()).filter_map(difference).collect();
    let stop = differences.iter().find(|it| it.measure == MEASURES[0]).map(|it| it.is_better);
    let line = &lines[1];
    let bounds = line.bounds as f64;
    // One in a hundred is promised; two deviations of chance on top.
    let most = EXCEEDED_MAX * bounds + 2.0 * (EXCEEDED_MAX * bounds).sqrt();
    let exceeded = line.exceeded.unwrap_or_default();
    let are_bounds_broken = exceeded as f64 > most;
    let is_worse = are_bounds_broken || differences.iter().any(|it| !it.is_better);
    Comparison {
        scenario: service.name(),
        differences,
        exceeded: are_bounds_broken.then(|| format!("bounds: {exceeded} of {bounds} exceeded")),
        is_broken: are_bounds_broken || stop == Some(false) || (is_worse && stop != Some(true)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_holds_the_figure_and_shrinks_with_trains() {
        let spread = |trains: usize| {
            let found = Figure::of(trains, |it| {
                it.iter().map(|&train| (train % 5) as f64).sum::<f64>() / it.len() as f64
            });
            assert!(found.low <= found.value && found.value <= found.high, "{found:?}");
            found.high - found.low
        };
        assert!(spread(200) < 0.6 * spread(20));
    }
}
