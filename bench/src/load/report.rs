//! The result for machines and for people.

use serde::Serialize;

use super::search::{Found, Size};
use super::trial::{Trial, TrialPlan};
use super::waits::Waits;
use crate::output::{self, Record};
use crate::rig::host::HostFigures;
use crate::rig::quantiles::{self, Quantiles, for_people};

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
    let since_appointed = report.pipelines.iter().map(|it| (it, &it.latency, "appointed"));
    let since_leaving = report.pipelines.iter().map(|it| (it, &it.since_leaving, "leaving"));
    let record = |(it, latency, since): (&ReportRow, &Quantiles, &str)| {
        let counts = Record::default()
            .with("pipeline", &it.name)
            .with("since", since)
            .with("offered", it.offered)
            .with("used", it.used)
            .with("rejected", it.rejected)
            .with("lost", it.lost);
        quantiles::cells(counts, latency)
    };
    let records: Vec<Record> = since_appointed.chain(since_leaving).map(record).collect();
    let Report { trains, rate_hz, seconds, waits, host, .. } = report;
    let share = |waited_s: f64| 100.0 * waited_s / seconds;
    let lines = [
        format!("{trains} trains at {rate_hz} Hz for {seconds} s\n{}", output::table(&records)),
        format!(
            "daemon: {:.0} % of a core, {:.1} MiB resident ({:.1} MiB at first); samples left at most \
             {} late",
            report.cpu_percent,
            report.rss_bytes as f64 / MEBIBYTE,
            report.rss_start_bytes as f64 / MEBIBYTE,
            for_people(report.publisher_lag_ns as f64)
        ),
        format!(
            "ready but without a processor: publishers {:.2} %, daemon {:.2} % of the time; the machine \
             beneath says that it took {:.2} %",
            share(waits.publishers_s),
            share(waits.daemon_s),
            share(waits.stolen_s)
        ),
        format!(
            "host: threads that only read the clock were away {:.1} % of the time, {} at most; that \
             alone makes p99 {} and p99.9 {}",
            host.away_percent,
            for_people(host.longest_ns as f64),
            for_people(host.p99_ns as f64),
            for_people(host.p999_ns as f64)
        ),
    ];
    lines.join("\n") + "\n" + &limits(report)
}

/// The highest rate and the growth, where they were asked for.
fn limits(report: &Report) -> String {
    let mut text = String::new();
    if let Some(found) = &report.search {
        let limit = if found.limited_by_publishers { "the publishers'" } else { "the daemon's" };
        text += &format!(
            "highest rate without loss: {:.0} Hz a train, {:.0} samples/s; the limit is {limit}\n",
            found.rate_hz, found.samples_per_s
        );
    }
    let sizes =
        report.growth.iter().flatten().map(|size| {
            let counts = Record::default()
                .with("trains", size.trains)
                .with("pipelines", size.pipelines)
                .with("lost", size.lost);
            quantiles::cells(counts, &size.latency)
                .number("% of a core", size.cpu_percent, 1)
                .number("MiB", size.rss_bytes as f64 / MEBIBYTE, 1)
        });
    text + &output::table(&sizes.collect::<Vec<_>>())
}
