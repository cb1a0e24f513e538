//! The result for machines and for people.

use serde_json::{Value, json};

use super::trial::{PipelineOutcome, Trial, TrialPlan};
use crate::output::{Record, table};
use crate::rig::cores::HostGaps;
use crate::rig::quantiles::{cells, for_people, pooled};

const MEBIBYTE: f64 = 1024.0 * 1024.0;

/// A trial, with what the host took away from busy threads before and after it, for machines and for people.
pub fn of(plan: &TrialPlan, trial: &Trial, host: &HostGaps) -> (Value, String) {
    let appointed = trial.pipelines.iter().map(|it| pipeline(it, "appointed"));
    let leaving = trial.pipelines.iter().map(|it| pipeline(it, "leaving"));
    let records: Vec<Record> = appointed.chain(leaving).collect();
    let (trains, rate_hz, seconds) = (plan.trains, plan.traffic.rate_hz, plan.seconds);
    let host = host.figures();
    let [publishers, daemon, stolen] = trial.waits_s.map(|waited_s| 100.0 * waited_s / seconds);
    let [publishers_s, daemon_s, stolen_s] = trial.waits_s;
    let all = json!({
        "trains": trains,
        "rate_hz": rate_hz,
        "seconds": seconds,
        "pipelines": records,
        "cpu_percent": trial.cpu_percent,
        "rss_start_bytes": trial.rss_start_bytes,
        "rss_bytes": trial.rss_bytes,
        "host": host,
        "publisher_lag_ns": trial.publisher_lag_ns,
        "waits": { "publishers_s": publishers_s, "daemon_s": daemon_s, "stolen_s": stolen_s },
    });
    let lines = [
        format!("{trains} trains at {rate_hz} Hz for {seconds} s\n{}", table(&records)),
        format!(
            "daemon: {:.0} % of a core, {:.1} MiB resident ({:.1} MiB at first); samples left at most \
             {} late",
            trial.cpu_percent,
            trial.rss_bytes as f64 / MEBIBYTE,
            trial.rss_start_bytes as f64 / MEBIBYTE,
            for_people(trial.publisher_lag_ns as f64)
        ),
        format!(
            "ready but without a processor: publishers {publishers:.2} %, daemon {daemon:.2} % of the \
             time; the machine beneath says that it took {stolen:.2} %"
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
    (all, lines.join("\n") + "\n")
}

fn pipeline(it: &PipelineOutcome, since: &str) -> Record {
    let latency = if since == "leaving" { &it.since_leaving } else { &it.latency };
    let counts = Record::default()
        .with("pipeline", it.kind)
        .with("since", since)
        .with("offered", it.offered)
        .with("used", it.used)
        .with("rejected", it.rejected)
        .with("lost", it.missing());
    cells(counts, latency)
}

/// One size of the daemon's task, with the latency over all pipelines.
pub fn size(plan: &TrialPlan, trial: &Trial) -> Record {
    let counts = Record::default()
        .with("trains", plan.trains)
        .with("pipelines", plan.pipelines.len())
        .with("lost", trial.missing());
    cells(counts, &pooled(trial.pipelines.iter().map(|it| &it.latency)))
        .number("% of a core", trial.cpu_percent, 1)
        .number("MiB", trial.rss_bytes as f64 / MEBIBYTE, 1)
}
