//! The result for machines and for people.

use std::fmt::Write;

use hdrhistogram::Histogram;
use serde::Serialize;

use super::Measured;
use super::case::{Case, Outcome};
use super::costs::Costs;
use super::rest::AtRest;
use crate::rig::quantiles::{Quantiles, for_people, histogram, median};
use crate::rig::usage::ThreadUsage;

/// The result for machines.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// One line for each case.
    pub cases: Vec<ReportRow>,
    /// What a call costs.
    #[serde(flatten)]
    pub costs: Costs,
    /// What a daemon takes while no sample comes.
    pub at_rest: Vec<AtRest>,
    /// Samples a second.
    pub rate_hz: f64,
    /// Rounds through all cases.
    pub rounds: usize,
    /// Core of the controller.
    pub controller_core: usize,
    /// Core of what answers.
    pub daemon_core: usize,
}

/// One case.
#[derive(Clone, Debug, Serialize)]
pub struct ReportRow {
    /// `floor`, `dynocar/<pipeline>` or `alternative/<transport>`.
    pub name: String,
    /// `busy`, `adaptive` or `event`.
    pub idle: String,
    /// From a sample's appointed time to the poll that brought its snapshot.
    #[serde(flatten)]
    pub latency: Quantiles,
    /// Samples without an answer.
    pub unanswered: u64,
    /// From the moment before publishing, as a closed loop would have it.
    pub from_publish: Quantiles,
    /// Medians in ns of where that went: until the sample left, until its answer left, until that
    /// was polled; none where the peer does not say.
    pub stages_p50_ns: Option<[u64; 3]>,
    /// Median over the rounds of this case's p50 over the floor's.
    pub floor_ratio_p50: f64,
    /// Median over the rounds of this case's p99 over the floor's.
    pub floor_ratio_p99: f64,
    /// Page faults and context switches of the daemon's thread; none without a daemon.
    pub suffered: Option<ThreadUsage>,
}

/// All latencies of a case.
pub fn pooled(outcomes: &[Outcome]) -> Histogram<u64> {
    let mut all = histogram();
    for outcome in outcomes {
        // Every histogram has the same bounds.
        let _ = all.add(&outcome.slice.from_appointed);
    }
    all
}

impl Report {
    /// Of what was measured.
    pub fn of(measured: &Measured) -> Self {
        Report {
            cases: measured.cases.iter().map(|case| line(case, &measured.cases)).collect(),
            costs: measured.costs,
            at_rest: measured.at_rest.clone(),
            rate_hz: measured.schedule.rate_hz,
            rounds: measured.cases.first().map_or(0, |(_, outcomes)| outcomes.len()),
            controller_core: measured.cores.controller,
            daemon_core: measured.cores.server,
        }
    }
}

fn line((case, outcomes): &(Case, Vec<Outcome>), all: &[(Case, Vec<Outcome>)]) -> ReportRow {
    let floor = all.iter().find(|(it, _)| it.name == "floor" && it.idle == case.floor_idle());
    let ratio = |quantile: f64| {
        let of =
            |outcome: &Outcome| outcome.slice.from_appointed.value_at_quantile(quantile) as f64;
        let rounds = floor.into_iter().flat_map(|(_, floors)| outcomes.iter().zip(floors));
        median(rounds.map(|(ours, floor)| of(ours) / of(floor)).collect())
    };
    let mut from_publish = histogram();
    let mut stages: [_; 3] = std::array::from_fn(|_| histogram());
    let mut suffered = None;
    for outcome in outcomes {
        for (all, own) in stages.iter_mut().zip(&outcome.slice.stages) {
            let _ = all.add(own);
        }
        // Every histogram has the same bounds.
        let _ = from_publish.add(&outcome.slice.from_publish);
        if let Some(usage) = outcome.suffered {
            *suffered.get_or_insert(ThreadUsage::default()) += usage;
        }
    }
    ReportRow {
        name: case.name.clone(),
        idle: case.idle.to_string(),
        latency: Quantiles::of(&pooled(outcomes)),
        unanswered: outcomes.iter().map(|outcome| outcome.slice.unanswered).sum(),
        from_publish: Quantiles::of(&from_publish),
        stages_p50_ns: (!stages[0].is_empty()).then(|| stages.map(|it| it.value_at_quantile(0.5))),
        floor_ratio_p50: ratio(0.5),
        floor_ratio_p99: ratio(0.99),
        suffered,
    }
}

/// The result for people.
pub fn table(report: &Report) -> String {
    let mut text = cases_table(report);
    add_stages(&mut text, report);
    add_costs(&mut text, report);
    if cfg!(not(feature = "zeromq")) {
        text += "ZeroMQ was not measured: build with --features zeromq and a C++ compiler\n";
    }
    text
}

/// A line for each case.
fn cases_table(report: &Report) -> String {
    let mut text = format!(
        "Sample → snapshot polled, open loop at {} Hz, {} rounds, controller on core {}, daemon on \
         core {}\n{:<34} {:>8} {:>10} {:>10} {:>10} {:>10} {:>10} {:>9} {:>9}\n",
        report.rate_hz,
        report.rounds,
        report.controller_core,
        report.daemon_core,
        "case (idle)",
        "count",
        "p50",
        "p99",
        "p99.9",
        "p99.99",
        "max",
        "p50/floor",
        "p99/floor"
    );
    for line in &report.cases {
        let it = &line.latency;
        let [p50, p99, p999, p9999, max] =
            [it.p50_ns, it.p99_ns, it.p999_ns, it.p9999_ns, it.max_ns]
                .map(|ns| for_people(ns as f64));
        // Writing into a String cannot fail.
        let _ = writeln!(
            text,
            "{:<34} {:>8} {p50:>10} {p99:>10} {p999:>10} {p9999:>10} {max:>10} {:>9.2} {:>9.2}",
            format!("{} ({})", line.name, line.idle),
            it.count,
            line.floor_ratio_p50,
            line.floor_ratio_p99,
        );
    }
    text
}

/// Where the time goes, where that was measured.
fn add_stages(text: &mut String, report: &Report) {
    for line in &report.cases {
        if let Some(stages) = line.stages_p50_ns {
            let [leaving, answering, polling] = stages.map(|ns| for_people(ns as f64));
            let _ = writeln!(
                text,
                "{:<34} p50 until the sample leaves {leaving}, until its answer leaves {answering}, \
                 until that is polled {polling}",
                format!("{} ({})", line.name, line.idle),
            );
        }
    }
}

/// What a poll, a publish and a rest cost, and what the threads suffered.
fn add_costs(text: &mut String, report: &Report) {
    let costs = &report.costs;
    let _ = writeln!(
        text,
        "One poll without news {:.0} ns, with news {:.0} ns; one publish {:.0} ns",
        costs.poll_without_news_ns, costs.poll_with_news_ns, costs.publish_ns
    );
    for it in &report.at_rest {
        let _ = writeln!(text, "no samples ({}): {:.2} % of a core", it.idle, it.cpu_percent);
    }
    for line in &report.cases {
        if let Some(it) = line.suffered {
            let _ = writeln!(
                text,
                "{} ({}): {} page faults, {} waits of its own, {} times preempted",
                line.name,
                line.idle,
                it.minor_faults + it.major_faults,
                it.voluntary_switches,
                it.involuntary_switches
            );
        }
    }
    let unanswered: u64 = report.cases.iter().map(|line| line.unanswered).sum();
    if unanswered > 0 {
        let _ = writeln!(text, "{unanswered} samples were not answered");
    }
}
