//! The result for machines and for people.

use hdrhistogram::Histogram;
use serde::Serialize;

use super::Measured;
use super::case::{Case, Outcome};
use super::costs::Costs;
use super::rest::AtRest;
use crate::output::{self, Record};
use crate::rig::quantiles::{self, Quantiles, for_people};
use crate::rig::usage::ThreadUsage;
use crate::statistics::median;

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
    quantiles::pooled(outcomes.iter().map(|it| &it.slice.from_appointed))
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
        median(rounds.map(|(ours, floor)| of(ours) / of(floor)).collect()).unwrap_or(f64::NAN)
    };
    let stages: [_; 3] = std::array::from_fn(|stage| {
        quantiles::pooled(outcomes.iter().map(|it| &it.slice.stages[stage]))
    });
    let from_publish = quantiles::pooled(outcomes.iter().map(|it| &it.slice.from_publish));
    let mut suffered = None;
    for usage in outcomes.iter().filter_map(|it| it.suffered) {
        *suffered.get_or_insert(ThreadUsage::default()) += usage;
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
    let records: Vec<Record> = report.cases.iter().map(record).collect();
    let mut lines = vec![format!(
        "Sample → snapshot polled, open loop at {} Hz, {} rounds, controller on core {}, daemon on \
         core {}\n{}",
        report.rate_hz,
        report.rounds,
        report.controller_core,
        report.daemon_core,
        output::table(&records)
    )];
    let costs = &report.costs;
    lines.push(format!(
        "One poll without news {:.0} ns, with news {:.0} ns; one publish {:.0} ns",
        costs.poll_without_news_ns, costs.poll_with_news_ns, costs.publish_ns
    ));
    let at_rest = report.at_rest.iter();
    lines.extend(
        at_rest.map(|it| format!("no samples ({}): {:.2} % of a core", it.idle, it.cpu_percent)),
    );
    let unanswered: u64 = report.cases.iter().map(|line| line.unanswered).sum();
    if unanswered > 0 {
        lines.push(format!("{unanswered} samples were not answered"));
    }
    if cfg!(not(feature = "zeromq")) {
        lines.push(
            "ZeroMQ was not measured: build with --features zeromq and a C++ compiler".into(),
        );
    }
    lines.join("\n") + "\n"
}

/// A case: its quantiles, where the time went (until the sample left, until its answer left, until that was
/// polled), and what the daemon's thread suffered.
fn record(line: &ReportRow) -> Record {
    let record = Record::default()
        .with("case (idle)", format!("{} ({})", line.name, line.idle))
        .with("count", line.latency.count);
    let record = quantiles::cells(record, &line.latency)
        .number("p50/floor", line.floor_ratio_p50, 2)
        .number("p99/floor", line.floor_ratio_p99, 2);
    let record = (["p50 leaving", "answering", "polling"].into_iter().enumerate()).fold(
        record,
        |record, (stage, name)| {
            let ns = line.stages_p50_ns.map(|stages| for_people(stages[stage] as f64));
            record.with(name, ns.unwrap_or_default())
        },
    );
    let suffered = |of: fn(&ThreadUsage) -> u64| {
        line.suffered.as_ref().map_or(String::new(), |it| of(it).to_string())
    };
    record
        .with("page faults", suffered(|it| it.minor_faults + it.major_faults))
        .with("own waits", suffered(|it| it.voluntary_switches))
        .with("preempted", suffered(|it| it.involuntary_switches))
}
