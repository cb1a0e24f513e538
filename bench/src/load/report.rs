//! The result for machines and for people.

use std::fmt::Write;

use serde::Serialize;

use super::search::{Found, Size};
use super::trial::{Trial, TrialPlan};
use super::waits::Waits;
use crate::rig::host::HostFigures;
use crate::rig::quantiles::{Quantiles, for_people};

/// The result for machines.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Number of trains.
    pub trains: u64,
    /// Samples a second of each.
    pub rate_hz: f64,
    /// How long, in s.
    pub seconds: f64,
    /// By pipeline, over all trains.
    pub pipelines: Vec<ReportRow>,
    /// Processor time of the daemon over wall time, in %.
    pub cpu_percent: f64,
    /// Resident memory of the daemon after the first tenth, in bytes.
    pub rss_start_bytes: u64,
    /// Resident memory of the daemon at the end, in bytes.
    pub rss_bytes: u64,
    /// What the host took away from busy threads before and after the load.
    pub host: HostFigures,
    /// The latest that a sample left after its appointed time, in ns.
    pub publisher_lag_ns: i64,
    /// What kernel and host took from publishers and daemon during the load.
    pub waits: Waits,
    /// The highest rate without loss, when it was searched for.
    pub search: Option<Found>,
    /// Growth with trains and pipelines, when it was asked for.
    pub growth: Option<Vec<Size>>,
}

/// One pipeline.
#[derive(Clone, Debug, Serialize)]
pub struct ReportRow {
    /// Its kind.
    pub name: String,
    /// Samples published for its trains.
    pub offered: u64,
    /// Samples that entered the estimate.
    pub used: u64,
    /// Samples refused.
    pub rejected: u64,
    /// Samples of which it gave no account.
    pub lost: u64,
    /// From appointed time to the poll that brought the snapshot.
    #[serde(flatten)]
    pub latency: Quantiles,
    /// The same from the moment at which the sample left.
    pub since_leaving: Quantiles,
}

impl Report {
    /// Of a trial.
    pub fn of(plan: &TrialPlan, trial: &Trial, host: HostFigures) -> Self {
        let line = |it: &super::trial::PipelineOutcome| ReportRow {
            name: it.kind.to_string(),
            offered: it.offered,
            used: it.used,
            rejected: it.rejected,
            lost: it.missing(),
            latency: Quantiles::of(&it.latency),
            since_leaving: Quantiles::of(&it.since_leaving),
        };
        Report {
            trains: plan.trains,
            rate_hz: plan.traffic.rate_hz,
            seconds: plan.seconds,
            pipelines: trial.pipelines.iter().map(line).collect(),
            cpu_percent: trial.cpu_percent,
            rss_start_bytes: trial.rss_start_bytes,
            rss_bytes: trial.rss_bytes,
            host,
            publisher_lag_ns: trial.publisher_lag_ns,
            waits: trial.waits,
            search: None,
            growth: None,
        }
    }
}

const MEBIBYTE: f64 = 1024.0 * 1024.0;

/// The result for people.
pub fn table(report: &Report) -> String {
    let mut text = pipelines_table(report);
    add_host(&mut text, report);
    add_limits(&mut text, report);
    text
}

/// A line for each pipeline, and one for its answers counted from where the sample left.
fn pipelines_table(report: &Report) -> String {
    let mut text = format!(
        "{} trains at {} Hz for {} s\n{:<22} {:>10} {:>10} {:>9} {:>9} {:>10} {:>10} {:>10} {:>10}\n",
        report.trains,
        report.rate_hz,
        report.seconds,
        "pipeline",
        "offered",
        "used",
        "rejected",
        "lost",
        "p50",
        "p99",
        "p99.9",
        "max"
    );
    // Writing into a String cannot fail.
    for line in &report.pipelines {
        let it = &line.latency;
        let [p50, p99, p999, max] =
            [it.p50_ns, it.p99_ns, it.p999_ns, it.max_ns].map(|ns| for_people(ns as f64));
        let _ = writeln!(
            text,
            "{:<22} {:>10} {:>10} {:>9} {:>9} {p50:>10} {p99:>10} {p999:>10} {max:>10}",
            line.name, line.offered, line.used, line.rejected, line.lost
        );
    }
    for line in &report.pipelines {
        let it = &line.since_leaving;
        let [p50, p99, p999, max] =
            [it.p50_ns, it.p99_ns, it.p999_ns, it.max_ns].map(|ns| for_people(ns as f64));
        let name = format!("  {} since leaving", line.name);
        let _ = writeln!(text, "{name:<64} {p50:>10} {p99:>10} {p999:>10} {max:>10}");
    }
    text
}

/// What daemon and machine had to do for it.
fn add_host(text: &mut String, report: &Report) {
    let _ = writeln!(
        text,
        "daemon: {:.0} % of a core, {:.1} MiB resident ({:.1} MiB at first); samples left at most \
         {} late",
        report.cpu_percent,
        report.rss_bytes as f64 / MEBIBYTE,
        report.rss_start_bytes as f64 / MEBIBYTE,
        for_people(report.publisher_lag_ns as f64)
    );
    let waits = &report.waits;
    let share = |seconds: f64| 100.0 * seconds / report.seconds;
    let _ = writeln!(
        text,
        "ready but without a processor: publishers {:.2} %, daemon {:.2} % of the time; the machine \
         beneath says that it took {:.2} %",
        share(waits.publishers_s),
        share(waits.daemon_s),
        share(waits.stolen_s)
    );
    let host = &report.host;
    let _ = writeln!(
        text,
        "host: threads that only read the clock were away {:.1} % of the time, {} at most; that \
         alone makes p99 {} and p99.9 {}",
        host.away_percent,
        for_people(host.longest_ns as f64),
        for_people(host.p99_ns as f64),
        for_people(host.p999_ns as f64)
    );
}

/// The highest rate and how the load grows, where that was looked for.
fn add_limits(text: &mut String, report: &Report) {
    if let Some(found) = &report.search {
        let limit = if found.limited_by_publishers { "the publishers'" } else { "the daemon's" };
        let _ = writeln!(
            text,
            "highest rate without loss: {:.0} Hz a train, {:.0} samples/s; the limit is {limit}",
            found.rate_hz, found.samples_per_s
        );
    }
    for size in report.growth.iter().flatten() {
        let _ = writeln!(
            text,
            "{:>3} trains, {:>2} pipelines: {:>6} lost, p50 {:>9}, p99 {:>9}, {:>5.1} % of a core, \
             {:.1} MiB",
            size.trains,
            size.pipelines,
            size.lost,
            for_people(size.latency.p50_ns as f64),
            for_people(size.latency.p99_ns as f64),
            size.cpu_percent,
            size.rss_bytes as f64 / MEBIBYTE
        );
    }
}
