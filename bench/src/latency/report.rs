//! The result for machines and for people.

use hdrhistogram::Histogram;
use serde_json::{Value, json};

use super::case::{Case, Outcome};
use super::costs::{AtRest, Costs, MANY};
use super::schedule::{Schedule, Slice};
use crate::output::{Record, table};
use crate::rig::cores::Cores;
use crate::rig::quantiles::{self, cells, for_people};
use crate::statistics::median;

/// A case with its outcome of every round.
type Rounds = (Case, Vec<Outcome>);

/// What was measured.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Each case with its outcome of every round.
    pub cases: Vec<Rounds>,
    /// What a call costs.
    pub costs: Costs,
    /// What a daemon takes while no sample comes.
    pub at_rest: Vec<AtRest>,
    /// How it was driven.
    pub schedule: Schedule,
    /// Where it ran.
    pub cores: Cores,
}

/// All latencies of a case, from appointed times unless another histogram is asked for.
pub fn pooled(outcomes: &[Outcome], of: fn(&Slice) -> &Histogram<u64>) -> Histogram<u64> {
    quantiles::pooled(outcomes.iter().map(|it| of(&it.slice)))
}

/// What was measured, for machines and for people.
pub fn of(measured: &Measured) -> (Value, String) {
    let Measured { cases, costs, at_rest, schedule, cores } = measured;
    let records: Vec<Record> = cases.iter().map(|case| record(case, cases)).collect();
    let rounds = cases.first().map_or(0, |(_, outcomes)| outcomes.len());
    let mut all = json!(costs);
    all["cases"] = json!(records);
    all["at_rest"] = json!(at_rest);
    all["rate_hz"] = json!(schedule.rate_hz);
    all["rounds"] = json!(rounds);
    all["controller_core"] = json!(cores.controller);
    all["daemon_core"] = json!(cores.server);
    let mut lines = vec![
        format!(
            "Sample → snapshot polled, open loop at {} Hz, {rounds} rounds, controller on core {}, \
             daemon on core {}\n{}",
            schedule.rate_hz,
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
    let at_rest = at_rest.iter();
    lines.extend(
        at_rest.map(|it| format!("no samples ({}): {:.2} % of a core", it.idle, it.cpu_percent)),
    );
    let unanswered: u64 = cases.iter().map(|(_, outcomes)| unanswered(outcomes)).sum();
    if unanswered > 0 {
        lines.push(format!("{unanswered} samples were not answered"));
    }
    if cfg!(not(feature = "zeromq")) {
        lines.push(
            "ZeroMQ was not measured: build with --features zeromq and a C++ compiler".into(),
        );
    }
    (all, lines.join("\n") + "\n")
}

fn unanswered(outcomes: &[Outcome]) -> u64 {
    outcomes.iter().map(|outcome| outcome.slice.unanswered).sum()
}

/// A case: its quantiles, medians over the rounds of its ratio to the floor, where the time went (until the sample
/// left, until its answer left, until that was polled), and what the daemon's thread suffered.
fn record((case, outcomes): &Rounds, all: &[Rounds]) -> Record {
    let floor = all.iter().find(|(it, _)| it.name == "floor" && it.idle == case.floor_idle());
    let ratio = |quantile: f64| {
        let of =
            |outcome: &Outcome| outcome.slice.from_appointed.value_at_quantile(quantile) as f64;
        let rounds = floor.into_iter().flat_map(|(_, floors)| outcomes.iter().zip(floors));
        median(rounds.map(|(ours, floor)| of(ours) / of(floor)).collect())
    };
    let appointed = pooled(outcomes, |slice| &slice.from_appointed);
    let from_publish = pooled(outcomes, |slice| &slice.from_publish);
    let record = Record::default()
        .with("case (idle)", format!("{} ({})", case.name, case.idle))
        .with("count", appointed.len())
        .for_machines("unanswered", unanswered(outcomes))
        .for_machines("from_publish", json!(cells(Record::default(), &from_publish)));
    let mut record = cells(record, &appointed).number("p50/floor", ratio(0.5), 2).number(
        "p99/floor",
        ratio(0.99),
        2,
    );
    for (stage, name) in ["p50 leaving", "answering", "polling"].into_iter().enumerate() {
        let all = quantiles::pooled(outcomes.iter().map(|it| &it.slice.stages[stage]));
        let ns = (!all.is_empty()).then(|| all.value_at_quantile(0.5));
        record = record.shown(name, ns.map_or(String::new(), |ns| for_people(ns as f64)), ns);
    }
    let suffered: Vec<[u64; 3]> = outcomes.iter().filter_map(|it| it.suffered).collect();
    for (which, name) in ["page faults", "own waits", "preempted"].into_iter().enumerate() {
        let sum: u64 = suffered.iter().map(|it| it[which]).sum();
        let known = (!suffered.is_empty()).then_some(sum as f64);
        record = record.number(name, known, 0);
    }
    record
}
