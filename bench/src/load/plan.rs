//! The load of several trains with some pipelines on one daemon, and its result for machines and for people.

use dynocar::config::IdleStrategy;
use dynocar_shared::PipelineKind;
use serde_json::{Value, json};

use crate::ending;
use crate::open_loop::controller::TrialOutcome;
use crate::open_loop::trial::{Answerer, Extent, OpenLoopTrial, Setting, run};
use crate::output::{BenchError, Record, table};
use crate::rig::cores::in_thread;
use crate::rig::quantiles::{cells, for_people, pooled};

/// Several trains with some pipelines.
#[derive(Clone, Debug)]
pub struct Load {
    /// The pipelines of the daemon.
    pub pipelines: Vec<PipelineKind>,
    /// Idle strategy of its threads.
    pub idle: IdleStrategy,
    /// Extent of the load.
    pub extent: Extent,
}

impl Load {
    /// Puts it on a daemon.
    ///
    /// # Errors
    ///
    /// When a process or channel fails.
    pub fn run(&self) -> Result<OpenLoopTrial, BenchError> {
        let answerer = Answerer::Daemon(self.pipelines.clone(), None);
        let setting = Setting { answerer, idle: self.idle, companions: &[], candidates: 0 };
        in_thread(|| run(&setting, &self.extent, ending::flag()))
    }
}

const MEBIBYTE: f64 = 1024.0 * 1024.0;

/// Returns a trial, for machines and for people.
pub fn result(load: &Load, trial: &OpenLoopTrial) -> (Value, String) {
    let of = |since| load.pipelines.iter().zip(&trial.pipelines).map(move |it| pipeline(it, since));
    let records: Vec<Record> = of("appointed").chain(of("leaving")).collect();
    let (trains, rate_hz) = (load.extent.trains, load.extent.traffic.rate_hz);
    let seconds = load.extent.seconds;
    let [publishers_s, daemon_s] = trial.waits_s;
    let all = json!({
        "trains": trains,
        "rate_hz": rate_hz,
        "seconds": seconds,
        "pipelines": records,
        "cpu_percent": trial.cpu_percent,
        "rss_start_bytes": trial.rss_start_bytes,
        "rss_bytes": trial.rss_bytes,
        "publisher_lag_ns": trial.publisher_lag_ns,
        "waits": { "publishers_s": publishers_s, "daemon_s": daemon_s },
    });
    let text = format!(
        "{trains} trains at {rate_hz} Hz for {seconds} s\n{}\n\
         daemon: {:.0} % of a core, {:.1} MiB resident ({:.1} MiB at first); samples left at most {} \
         late\n\
         ready but without a processor: publishers {:.2} %, daemon {:.2} % of the time\n",
        table(&records),
        trial.cpu_percent,
        trial.rss_bytes as f64 / MEBIBYTE,
        trial.rss_start_bytes as f64 / MEBIBYTE,
        for_people(trial.publisher_lag_ns as f64),
        100.0 * publishers_s / seconds,
        100.0 * daemon_s / seconds
    );
    (all, text)
}

fn pipeline((kind, it): (&PipelineKind, &TrialOutcome), since: &str) -> Record {
    let counts = Record::default()
        .with("pipeline", kind)
        .with("since", since)
        .with("offered", it.offered)
        .with("used", it.used)
        .with("rejected", it.rejected)
        .with("lost", it.missing());
    cells(counts, if since == "leaving" { &it.from_publish } else { &it.from_appointed })
}

/// One size of the daemon's task, with the latency over all pipelines.
pub fn size(load: &Load, trial: &OpenLoopTrial) -> Record {
    let counts = Record::default()
        .with("trains", load.extent.trains)
        .with("pipelines", load.pipelines.len())
        .with("lost", trial.missing());
    cells(counts, &pooled(trial.pipelines.iter().map(|it| &it.from_appointed)))
        .number("% of a core", trial.cpu_percent, 1)
        .number("MiB", trial.rss_bytes as f64 / MEBIBYTE, 1)
}
