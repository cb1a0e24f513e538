//! Cases of the latency measurement, and the sets of cases that are measured together; the result for machines and for
//! people, and the distributions as a picture: latency over the share of samples that took longer.

use std::path::Path;

use dynocar::config::IdleStrategy;
use dynocar::output::write_file;
use dynocar_shared::PipelineKind;
use hdrhistogram::Histogram;
use plotters::prelude::*;
use serde_json::{Value, json};

use super::costs::{Costs, MANY};
use crate::open_loop::controller::TrialOutcome;
use crate::open_loop::trial::{Answerer, Companion, Extent, OpenLoopTrial, Setting};
use crate::open_loop::wire::COMPARED;
use crate::output::{BenchError, Record, during, table};
use crate::rig;
use crate::statistics::{self, cells, median};

/// One line of the result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LatencyCase {
    /// `floor`, `dynocar/<pipeline>` or `alternative/<transport>`.
    pub name: String,
    /// The answering side, and the programs and candidates that run with it.
    pub setting: Setting,
}

impl LatencyCase {
    fn new(name: impl Into<String>, idle: IdleStrategy, answerer: Answerer) -> Self {
        let setting = Setting { answerer, idle, companions: &[], candidates: 0 };
        LatencyCase { name: name.into(), setting }
    }

    fn alone(kind: PipelineKind, idle: IdleStrategy) -> Self {
        LatencyCase::new(format!("dynocar/{kind}"), idle, Answerer::Daemon(vec![kind], Some(kind)))
    }

    /// Returns the compared pipeline, and behind it on its thread every other fast one.
    pub fn all_fast(idle: IdleStrategy) -> Self {
        LatencyCase::new("dynocar/all_fast", idle, all_fast(true))
    }

    /// Returns the compared pipeline with other readers of its channels, or with candidates on trial in its shadow.
    fn beside(
        what: &str,
        (companions, candidates): (&'static [Companion], u32),
        idle: IdleStrategy,
    ) -> Self {
        let LatencyCase { name, setting } = LatencyCase::alone(COMPARED, idle);
        let name = format!("{name}+{what}");
        LatencyCase { name, setting: Setting { companions, candidates, ..setting } }
    }

    /// Returns its name with its idle strategy.
    pub fn label(&self) -> String {
        format!("{} ({})", self.name, self.setting.idle)
    }

    /// Returns the strategy of the floor that this case is compared with: nothing is lower for an
    /// adaptive thread than one that never sleeps.
    pub fn floor_idle(&self) -> IdleStrategy {
        match self.setting.idle {
            IdleStrategy::Event => IdleStrategy::Event,
            IdleStrategy::Busy | IdleStrategy::Adaptive => IdleStrategy::Busy,
        }
    }
}

/// Returns the daemon with every fast pipeline, of which the compared one is the first or the last.
fn all_fast(is_first: bool) -> Answerer {
    let mut pipelines = rig::fast_pipelines();
    pipelines.retain(|&kind| kind != COMPARED);
    pipelines.insert(if is_first { 0 } else { pipelines.len() }, COMPARED);
    Answerer::Daemon(pipelines, Some(COMPARED))
}

/// Returns every case, or the ones that a quick check runs.
pub fn cases(is_quick: bool) -> Vec<LatencyCase> {
    use IdleStrategy::{Adaptive, Busy, Event};
    let mut cases = vec![
        LatencyCase::new("floor", Busy, Answerer::Floor),
        LatencyCase::alone(COMPARED, Busy),
        LatencyCase::alone(COMPARED, Adaptive),
        LatencyCase::all_fast(Busy),
        LatencyCase::new("alternative/unix_datagram", Busy, Answerer::UnixDatagram),
        LatencyCase::new("floor", Event, Answerer::Floor),
        LatencyCase::alone(COMPARED, Event),
        LatencyCase::new("alternative/unix_datagram", Event, Answerer::UnixDatagram),
        #[cfg(feature = "zeromq")]
        LatencyCase::new("alternative/zeromq", Event, Answerer::ZeroMq),
    ];
    if !is_quick {
        cases.push(LatencyCase::new("dynocar/all_fast_last", Busy, all_fast(false)));
        cases.push(LatencyCase::alone(PipelineKind::Echo, Busy));
        let others = rig::fast_pipelines().into_iter().filter(|&kind| kind != COMPARED);
        cases.extend(others.map(|kind| LatencyCase::alone(kind, Busy)));
    }
    cases
}

/// Returns the cases with other readers, whose programs must have been built.
pub fn cases_with_readers() -> Vec<LatencyCase> {
    use Companion::{Live, Recorder};
    let all: [(&str, &[Companion]); 3] =
        [("recorder", &[Recorder]), ("live", &[Live]), ("recorder+live", &[Recorder, Live])];
    let of = |idle| all.map(|(what, companions)| LatencyCase::beside(what, (companions, 0), idle));
    [of(IdleStrategy::Event), of(IdleStrategy::Busy)].concat()
}

/// Returns the cases with models on trial.
pub fn cases_in_shadow() -> Vec<LatencyCase> {
    [IdleStrategy::Event, IdleStrategy::Busy]
        .map(|idle| LatencyCase::beside("two_candidates", (&[], 2), idle))
        .into()
}

/// A case with its trial of every round.
pub type Rounds = (LatencyCase, Vec<OpenLoopTrial>);

/// Measured latencies.
#[derive(Clone, Debug)]
pub struct MeasuredCase {
    /// Each case with its trial of every round.
    pub cases: Vec<Rounds>,
    /// Cost of each call.
    pub costs: Costs,
    /// Load of a daemon while no sample comes: processor time in % of a core, by idle strategy.
    pub at_rest: Vec<(String, f64)>,
    /// Rounds and samples of the measurement.
    pub extent: Extent,
}

/// Returns all latencies of a case.
pub fn pooled(
    trials: &[OpenLoopTrial],
    of: fn(&TrialOutcome) -> &Histogram<u64>,
) -> Histogram<u64> {
    statistics::pooled(trials.iter().flat_map(|it| &it.pipelines).map(of))
}

/// Returns the measured latencies, for machines and for people.
pub fn summary(measured: &MeasuredCase) -> (Value, String) {
    let MeasuredCase { cases, costs, at_rest, extent } = measured;
    let (rate_hz, cores) = (extent.traffic.rate_hz, extent.cores);
    let records: Vec<Record> = cases.iter().map(|case| record(case, cases)).collect();
    let rounds = cases.first().map_or(0, |(_, trials)| trials.len());
    let rests = at_rest.iter().map(|(idle, it)| json!({ "idle": idle, "cpu_percent": it }));
    let mut all = json!(costs);
    all["cases"] = json!(records);
    all["at_rest"] = rests.collect();
    all["rate_hz"] = json!(rate_hz);
    all["rounds"] = json!(rounds);
    all["controller_core"] = json!(cores.controller);
    all["daemon_core"] = json!(cores.server);
    let mut lines = vec![
        format!(
            "Sample → snapshot polled, open loop at {rate_hz} Hz, {rounds} rounds, controller on core \
             {}, daemon on core {}\n{}",
            cores.controller,
            cores.server,
            table(&records)
        ),
        format!(
            "One poll without news {:.0} ns, of {MANY} pipelines {:.0} ns, with news {:.0} ns; one \
             publish {:.0} ns",
            costs.poll_without_news_ns,
            costs.poll_of_many_without_news_ns,
            costs.poll_with_news_ns,
            costs.publish_ns
        ),
    ];
    lines.extend(
        at_rest.iter().map(|(idle, it)| format!("no samples ({idle}): {it:.2} % of a core")),
    );
    let unanswered: f64 = records.iter().filter_map(|it| it.value("unanswered")).sum();
    if unanswered > 0.0 {
        lines.push(format!("{unanswered} samples were not answered"));
    }
    if cfg!(not(feature = "zeromq")) {
        lines.push(
            "ZeroMQ was not measured: build with --features zeromq and a C++ compiler".into(),
        );
    }
    (all, lines.join("\n") + "\n")
}

/// Returns a case: its quantiles, medians over the rounds of its ratio to the floor, and how often the daemon's thread
/// was made to wait.
fn record((case, trials): &Rounds, all: &[Rounds]) -> Record {
    let floor =
        all.iter().find(|(it, _)| it.name == "floor" && it.setting.idle == case.floor_idle());
    let ratio = |quantile: f64| {
        let of =
            |it: &OpenLoopTrial| it.pipelines[0].from_appointed.value_at_quantile(quantile) as f64;
        let rounds = floor.into_iter().flat_map(|(_, floors)| trials.iter().zip(floors));
        median(rounds.map(|(ours, floor)| of(ours) / of(floor)).collect())
    };
    let appointed = pooled(trials, |outcome| &outcome.from_appointed);
    let from_publish = pooled(trials, |outcome| &outcome.from_publish);
    let offered: u64 = trials.iter().flat_map(|it| &it.pipelines).map(|it| it.offered).sum();
    let is_daemon = matches!(case.setting.answerer, Answerer::Daemon(..));
    let preempted: u64 = trials.iter().map(|it| it.preempted).sum();
    let record = Record::default()
        .with("case (idle)", case.label())
        .with("count", appointed.len())
        .for_machines("unanswered", offered - appointed.len())
        .for_machines("from_publish", json!(cells(Record::default(), &from_publish)));
    cells(record, &appointed)
        .number("p50/floor", ratio(0.5), 2)
        .number("p99/floor", ratio(0.99), 2)
        .number("preempted", is_daemon.then_some(preempted as f64), 0)
}

const SIZE: (u32, u32) = (1_240, 640);
/// Width in px of the curves; their names stand next to them.
const CURVES_PX: u32 = 960;
/// Height in px of a name, and of the names' first line.
const NAME_PX: (i32, i32) = (22, 56);
/// Latencies shown, in µs.
const SPAN_US: (f64, f64) = (0.2, 20_000.0);
/// The axis runs over log10(1 / share of samples that took longer): 0 is all, 4 is 1 in 10,000.
const NINES: f64 = 4.5;

/// Draws the floors, the daemon's compared cases and the alternatives.
///
/// # Errors
///
/// When the file cannot be written.
pub fn draw(measured: &MeasuredCase, file: &Path) -> Result<(), BenchError> {
    let mut svg = String::new();
    draw_into(measured, &mut svg).map_err(during(file.display()))?;
    Ok(write_file(file, &svg)?)
}

fn draw_into(measured: &MeasuredCase, svg: &mut String) -> Result<(), BenchError> {
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let caption = format!("Sample → snapshot polled at {} Hz", measured.extent.traffic.rate_hz);
    let (curves, names) = area.split_horizontally(CURVES_PX);
    let mut chart = ChartBuilder::on(&curves)
        .caption(caption, ("sans-serif", 22))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..NINES, (SPAN_US.0..SPAN_US.1).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("quantile")
        .y_desc("latency in µs")
        .x_labels(6)
        .x_label_formatter(&|nines| quantile_name(*nines))
        .y_label_formatter(&|us| format!("{us}"))
        .draw()?;
    let shown = measured.cases.iter().filter(|(case, _)| is_shown(case));
    for (index, (case, outcomes)) in shown.enumerate() {
        let color = Palette99::pick(index).to_rgba();
        let latencies = pooled(outcomes, |outcome| &outcome.from_appointed);
        chart.draw_series(LineSeries::new(points(&latencies), color.stroke_width(2)))?;
        let y = NAME_PX.1 + NAME_PX.0 * index as i32;
        names.draw(&PathElement::new([(4, y), (24, y)], color.stroke_width(2)))?;
        names.draw(&Text::new(case.label(), (32, y - 7), ("sans-serif", 13)))?;
    }
    area.present()?;
    Ok(())
}

/// Returns the other pipelines alone lie so near to each other that lines would hide lines.
fn is_shown(case: &LatencyCase) -> bool {
    match &case.setting.answerer {
        Answerer::Daemon(_, polled) => *polled == Some(COMPARED),
        _ => true,
    }
}

/// `90 %`, `99.9 %`: as many decimals as the quantile has nines beyond two.
fn quantile_name(nines: f64) -> String {
    let decimals = (nines.ceil() as usize).saturating_sub(2);
    format!("{:.decimals$} %", 100.0 * (1.0 - 0.1_f64.powf(nines)))
}

fn points(histogram: &Histogram<u64>) -> Vec<(f64, f64)> {
    // Beyond the longest latency there is nothing more to draw.
    let last = (histogram.len().max(1) as f64).log10().min(NINES);
    (0..=200)
        .map(|step| f64::from(step) / 200.0 * NINES)
        .filter(|&nines| nines <= last)
        .map(|nines| {
            let ns = histogram.value_at_quantile(1.0 - 0.1_f64.powf(nines));
            (nines, ns as f64 * 1e-3)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_has_a_floor_and_a_name_of_the_contract() {
        for is_quick in [false, true] {
            let cases = [cases(is_quick), cases_with_readers(), cases_in_shadow()].concat();
            for case in &cases {
                let floor = cases
                    .iter()
                    .find(|it| it.name == "floor" && it.setting.idle == case.floor_idle());
                assert!(floor.is_some(), "{}", case.name);
                let is_named = case.name == "floor"
                    || case.name.starts_with("dynocar/")
                    || case.name.starts_with("alternative/");
                assert!(is_named, "{}", case.name);
            }
        }
    }

    #[test]
    fn no_case_is_measured_twice() {
        let cases = [cases(false), cases_with_readers(), cases_in_shadow()].concat();
        for (index, case) in cases.iter().enumerate() {
            let same = |it: &LatencyCase| it.label() == case.label();
            assert_eq!(cases.iter().position(same), Some(index));
        }
    }
}
