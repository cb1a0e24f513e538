//! Statistics of the legs of all trains, with intervals; and one picture of them: stops, timetable and energy with
//! declared, learned and true parameters.

use dynocar_tests::chance::Chance;
use plotters::coord::Shift;
use plotters::prelude::*;

use super::deviations::{Service, traffic_name};
use super::journey::DrivenLeg;
use super::link::ASKED;
use super::run::{DrivenRecord, Informant};
use crate::output::{BenchError, Record};
use crate::scenarios::score::{QuantityScore, Scores};
use crate::statistics::{mean, quantiles};

/// Number of random selections of the trains behind an interval.
const DRAWS: usize = 400;
/// Greatest stopping error in m of a leg whose energy counts: if a driver stops farther off, the legs do not compare.
const SAME_STOP_M: f64 = 1.0;
/// Statistics of a service's legs: mean and standard deviation of the place beyond the stopping point in m, stops
/// within 0.3 and 0.5 m in %; then the compared measures, of which less is better.
const STATISTICS: usize = 8;
/// Compared measures: name, place among the statistics, and the difference that nobody would notice.
const MEASURES: [(&str, usize, f64); 4] = [
    ("stop_error_rms_m", STOP_RMS, 0.03),
    ("energy_percent", ENERGY, 0.3),
    ("late_s", LATE, 0.5),
    ("jerk_mps3", 7, 0.05),
];
/// Place of the root mean square of the stopping error in m among the statistics.
pub const STOP_RMS: usize = 4;
/// Place of the energy at the same running time over that with true parameters, in %.
pub const ENERGY: usize = 5;
/// Place of the mean size of the deviation from the timetable in s.
pub const LATE: usize = 6;
/// Share of bounds that may be exceeded.
const EXCEEDED_MAX: f64 = 0.01;

/// A figure with its 95 % interval over trains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FigureInterval {
    /// The figure.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Statistics of trains, given by their places; the intervals are those of trains drawn anew.
fn figures<const N: usize>(
    trains: usize,
    statistics: impl Fn(&[usize]) -> [f64; N],
) -> [FigureInterval; N] {
    let all: Vec<usize> = (0..trains).collect();
    let mut random = Chance::new(95);
    let mut draw = || -> Vec<usize> { all.iter().map(|_| random.within(0..trains)).collect() };
    let draws: Vec<[f64; N]> = (0..DRAWS).map(|_| statistics(&draw())).collect();
    let values = statistics(&all);
    std::array::from_fn(|which| {
        let drawn = draws.iter().map(|it| it[which]).collect();
        let [low, high] = quantiles(drawn, [0.025, 0.975]).unwrap_or([f64::NAN; 2]);
        FigureInterval { value: values[which], low, high }
    })
}

/// A service with one kind of parameters.
#[derive(Clone, Debug)]
pub struct Line {
    /// The row of the table.
    pub record: Record,
    /// Every statistic.
    pub figures: [FigureInterval; STATISTICS],
    /// Bounds that were looked at, and those that the true braking distance exceeded or that could not be given.
    bounds: [usize; 2],
}

/// Everything about one service.
#[derive(Clone, Debug)]
pub struct Scored {
    /// The service.
    pub service: Service,
    /// Declared, Dynocar, true.
    pub lines: Vec<Line>,
    /// Scores of the answers, by quantity.
    pub answers: Vec<Record>,
    /// Differences with Dynocar beyond the noise.
    pub differences: Vec<Record>,
    /// Losses with Dynocar, in words, where they are not paid back by a better stop, or where stops or bounds are
    /// worse.
    pub broken: Option<String>,
}

/// The legs of one kind of parameters, and those of all kinds, for the energy of the same stops.
struct Drives<'a> {
    own: &'a [DrivenRecord],
    all: &'a [Vec<DrivenRecord>; 3],
}

impl Drives<'_> {
    fn statistics(&self, trains: &[usize]) -> [f64; STATISTICS] {
        let legs = || trains.iter().flat_map(|&train| &self.own[train].legs);
        let mean = |of: &dyn Fn(&DrivenLeg) -> f64| mean(legs().map(of));
        let beyond_m = mean(&|leg| leg.beyond_m);
        let within =
            |most_m: f64| 100.0 * mean(&|leg| f64::from(u8::from(leg.beyond_m.abs() <= most_m)));
        [
            beyond_m,
            mean(&|leg| (leg.beyond_m - beyond_m).powi(2)).sqrt(),
            within(0.3),
            within(0.5),
            mean(&|leg| leg.beyond_m.powi(2)).sqrt(),
            self.energy_percent(trains),
            mean(&|leg| leg.late_s.abs()),
            mean(&|leg| leg.jerk_mps3),
        ]
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

    fn stops(&self) -> usize {
        self.own.iter().map(|driven| driven.legs.len()).sum()
    }
}

/// Scores a service's drives with declared, learned and true parameters.
pub fn score(service: Service, all: &[Vec<DrivenRecord>; 3]) -> Scored {
    let drives = all.each_ref().map(|own| Drives { own, all });
    let lines: Vec<Line> =
        Informant::ALL.iter().zip(&drives).map(|(it, own)| line(&service, *it, own)).collect();
    let stops = drives[1].stops();
    let answers = (0..ASKED.len()).map(|index| answer(&service, index, &all[1], stops)).collect();
    let (differences, broken) = comparison(&service, &drives, lines[1].bounds);
    Scored { service, lines, answers, differences, broken }
}

/// Returns a figure under three names: value, lower and upper end of its interval.
fn ranged(
    record: Record,
    name: &str,
    figure: FigureInterval,
    factor: f64,
    decimals: usize,
) -> Record {
    record
        .number(name, factor * figure.value, decimals)
        .number(format!("{name}_low"), factor * figure.low, decimals)
        .number(format!("{name}_high"), factor * figure.high, decimals)
}

fn line(service: &Service, (informant, name): (Informant, &str), drives: &Drives<'_>) -> Line {
    let figures = figures(drives.own.len(), |it| drives.statistics(it));
    let legs = drives.own.iter().flat_map(|driven| &driven.legs);
    let looks: Vec<_> = legs.flat_map(|leg| &leg.looks).collect();
    let is_exceeded = |bound_m: Option<f64>, true_m| bound_m.is_none_or(|it| true_m > it);
    let exceeded = looks.iter().filter(|look| is_exceeded(look.bound_m, look.true_m)).count();
    let percent =
        |ratios: Vec<f64>| 100.0 * ratios.iter().sum::<f64>() / ratios.len().max(1) as f64;
    let given = looks.iter().filter_map(|look| Some(look.bound_m? / look.true_m)).collect();
    let fixed = looks.iter().map(|it| it.fixed_m / it.true_m).collect();
    let record = service.record().with("parameters", name).with("stops", drives.stops());
    let columns = [
        ("stop_error_mean_cm", 100.0, 0),
        ("stop_error_std_cm", 100.0, 0),
        ("within_30_cm_percent", 1.0, 0),
        ("within_50_cm_percent", 1.0, 0),
        ("energy_percent", 1.0, 1),
        ("late_s", 1.0, 1),
    ];
    let shown = figures[..STOP_RMS].iter().chain(&figures[ENERGY..]);
    let record =
        columns.iter().zip(shown).fold(record, |record, (&(name, factor, decimals), it)| {
            ranged(record, name, *it, factor, decimals)
        });
    // The true parameters leave no room for a bound.
    let bounded = |value: f64| (informant != Informant::Truth).then_some(value);
    let record = record
        .number("jerk_mps3", figures[STATISTICS - 1].value, 2)
        .number("bounds", bounded(looks.len() as f64), 0)
        .number("bounds_exceeded", bounded(exceeded as f64), 0)
        .number("bound_percent", bounded(percent(given)), 0)
        .number("fixed_bound_percent", percent(fixed), 0);
    Line { record, figures, bounds: [looks.len(), exceeded] }
}

/// Returns the record of the score of one answer.
fn answer(service: &Service, index: usize, driven: &[DrivenRecord], stops: usize) -> Record {
    let scores: Vec<QuantityScore> = driven.iter().map(|it| it.scores[index].clone()).collect();
    let all = Scores(&scores);
    let changes = all.count(|it| it.changes) as f64;
    let record = service.record().with("quantity", ASKED[index].name());
    record
        .number("usable_percent", all.usable_percent(), 1)
        .number("wrong_percent", all.percent(|it| it.wrong), 2)
        .number("worse_than_declared_percent", all.percent(|it| it.worse), 1)
        .number("error_percent", all.rms_percent(|it| it.error_square), 1)
        .number("declared_error_percent", all.rms_percent(|it| it.declared_square), 1)
        .number("first_use_s", all.first_use_s(), 0)
        .number("changes_per_stop", changes / stops.max(1) as f64, 1)
}

/// Compares the driver with Dynocar to the one with declared parameters.
fn comparison(
    service: &Service,
    [declared, learned, _]: &[Drives<'_>; 3],
    [bounds, exceeded]: [usize; 2],
) -> (Vec<Record>, Option<String>) {
    let (mut records, mut worse, mut stop) = (Vec::new(), Vec::new(), None);
    let differences = figures(declared.own.len(), |it| {
        let (with, without) = (learned.statistics(it), declared.statistics(it));
        MEASURES.map(|(_, which, _)| with[which] - without[which])
    });
    for ((measure, which, unnoticed), figure) in MEASURES.into_iter().zip(differences) {
        let FigureInterval { value, low, high } = figure;
        let (is_better, is_worse) = (high < 0.0, low > unnoticed);
        if !is_better && !is_worse {
            continue;
        }
        if which == STOP_RMS {
            stop = Some(is_better);
        }
        if is_worse {
            worse.push(format!("{measure}: {value:+.3} ({low:+.3} to {high:+.3})"));
        }
        let record =
            ranged(service.record().with("measure", measure), "difference", figure, 1.0, 3);
        records.push(record.with("verdict", if is_better { "better" } else { "worse" }));
    }
    // One in a hundred is promised; two deviations of chance on top.
    let expected = EXCEEDED_MAX * bounds as f64;
    let are_bounds_broken = exceeded as f64 > expected + 2.0 * expected.sqrt();
    if are_bounds_broken {
        worse.push(format!("bounds: {exceeded} of {bounds} exceeded"));
    }
    let is_broken = match stop {
        Some(is_better) => are_bounds_broken || !is_better,
        None => !worse.is_empty(),
    };
    (records, is_broken.then(|| format!("{}: {}", service.name(), worse.join("; "))))
}

const SIZE: (u32, u32) = (1_080, 400);
const COLORS: [RGBColor; 3] =
    [RGBColor(176, 176, 176), RGBColor(31, 119, 180), RGBColor(44, 160, 44)];
const NAMES: [&str; 3] = ["declared parameters", "with Dynocar", "true parameters"];

/// Title, place among the statistics, and factor and shift of the drawn value.
const PANELS: [(&str, usize, f64, f64); 3] = [
    ("stopping error in cm (rms)", STOP_RMS, 100.0, 0.0),
    ("off the timetable in s", LATE, 1.0, 0.0),
    ("energy above the least in %", ENERGY, 1.0, -100.0),
];

/// Returns the picture of some services as SVG; one group of bars each.
///
/// # Errors
///
/// When the picture cannot be drawn.
pub fn picture(scored: &[&Scored]) -> Result<String, BenchError> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let panels = area.split_evenly((1, 3));
        for (index, (area, (title, which, factor, shift))) in panels.iter().zip(PANELS).enumerate()
        {
            let of = |value: f64| factor * value + shift;
            let figure = |all: &[FigureInterval]| {
                let FigureInterval { value, low, high } = all[which];
                FigureInterval { value: of(value), low: of(low), high: of(high) }
            };
            panel(area, title, scored, figure, index == 0)?;
        }
        area.present()?;
    }
    Ok(text)
}

/// One group of bars for each service.
fn panel(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    title: &str,
    scored: &[&Scored],
    figure: impl Fn(&[FigureInterval]) -> FigureInterval,
    has_legend: bool,
) -> Result<(), BenchError> {
    let figures = scored.iter().flat_map(|it| &it.lines).map(|line| figure(&line.figures));
    let most = figures.map(|it| it.high).fold(0.0, f64::max).max(1e-3);
    let right = 4.0 * scored.len() as f64;
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 17))
        .margin(10)
        .y_label_area_size(40)
        .build_cartesian_2d(0.0..right, -0.12 * most..1.25 * most)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .disable_x_axis()
        .y_labels(6)
        .y_label_formatter(&|value| match *value < 0.0 {
            true => String::new(),
            false => format!("{}", (10.0 * value).round() / 10.0),
        })
        .draw()?;
    for (group, it) in scored.iter().enumerate() {
        let left = 4.0 * group as f64 + 0.5;
        for (bar, line) in it.lines.iter().enumerate() {
            let (from, to) = (left + bar as f64, left + bar as f64 + 0.9);
            let bar_figure = figure(&line.figures);
            let (middle, color) = (0.5 * (from + to), COLORS[bar]);
            chart.draw_series([Rectangle::new(
                [(from, 0.0), (to, bar_figure.value.max(0.0))],
                color.filled(),
            )])?;
            let ends = [(middle, bar_figure.low.max(0.0)), (middle, bar_figure.high.max(0.0))];
            chart.draw_series([PathElement::new(ends, BLACK.stroke_width(1))])?;
        }
        let name = traffic_name(it.service.traffic);
        chart.draw_series([Text::new(name, (left, -0.03 * most), ("sans-serif", 14))])?;
    }
    if has_legend {
        for (index, name) in NAMES.into_iter().enumerate() {
            let at = (0.03 * right, (1.22 - 0.08 * index as f64) * most);
            let to = (0.06 * right, (1.18 - 0.08 * index as f64) * most);
            chart.draw_series([Rectangle::new([at, to], COLORS[index].filled())])?;
            let beside = (0.075 * right, at.1);
            chart.draw_series([Text::new(name, beside, ("sans-serif", 13))])?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_holds_the_figure_and_shrinks_with_trains() {
        let spread = |trains: usize| {
            let [found] = figures(trains, |it| {
                [it.iter().map(|&train| (train % 5) as f64).sum::<f64>() / it.len() as f64]
            });
            assert!(found.low <= found.value && found.value <= found.high, "{found:?}");
            found.high - found.low
        };
        assert!(spread(200) < 0.6 * spread(20));
    }
}
