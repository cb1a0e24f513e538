//! The result for machines and for people.

use hdrhistogram::Histogram;
use serde_json::{Value, json};

use super::case::LatencyCase;
use super::costs::{Costs, MANY};
use crate::open_loop::controller::TrialOutcome;
use crate::open_loop::trial::{Answerer, Extent, OpenLoopTrial};
use crate::output::{Record, table};
use crate::rig::quantiles::{self, cells};
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

/// All latencies of a case.
pub fn pooled(
    trials: &[OpenLoopTrial],
    of: fn(&TrialOutcome) -> &Histogram<u64>,
) -> Histogram<u64> {
    quantiles::pooled(trials.iter().flat_map(|it| &it.pipelines).map(of))
}

/// Returns the measured latencies, for machines and for people.
pub fn of(measured: &MeasuredCase) -> (Value, String) {
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

/// A case: its quantiles, medians over the rounds of its ratio to the floor, and how often the daemon's thread was made
/// to wait.
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
