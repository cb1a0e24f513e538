//! The result for machines and for people, and the distributions as a picture: latency over the share of samples that
//! took longer.

use std::path::Path;

use dynocar::output::write_file;
use hdrhistogram::Histogram;
use plotters::prelude::*;
use serde_json::{Value, json};

use super::case::LatencyCase;
use super::costs::{Costs, MANY};
use crate::open_loop::controller::TrialOutcome;
use crate::open_loop::sockets::COMPARED;
use crate::open_loop::trial::{Answerer, Extent, OpenLoopTrial};
use crate::output::{BenchError, Record, during, table};
use crate::rig::quantiles;
use crate::rig::quantiles::cells;
use crate::statistics::median;

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
    quantiles::pooled(trials.iter().flat_map(|it| &it.pipelines).map(of))
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
