//! Findings of the demo, and the time between the publishing of a sample and that of its snapshot.

use dynocar_client::SnapshotReader;
use dynocar_dataset::Dataset;
use dynocar_shared::services::PIPELINES_MAX;
use dynocar_shared::{
    HALF_95, Parameter, ParameterSnapshot, PipelineKind, Quantity, Reason, SampleField,
};
use serde::Serialize;

/// The demo's result for machines.
#[derive(Clone, Debug, Serialize)]
pub struct DemoAnswer {
    /// Each pipeline with its status.
    pub pipelines: Vec<PipelineAnswer>,
    /// Counts of the samples, for the pipeline that used the fewest.
    pub samples: SampleAnswer,
    /// Time between the publishing of a sample and that of its snapshot.
    pub latency: LatencyAnswer,
}

/// A pipeline of the demo.
#[derive(Clone, Debug, Serialize)]
pub struct PipelineAnswer {
    /// The estimator's name.
    pub name: &'static str,
    /// The quantities for which it is the recommended pipeline.
    pub answers: Vec<&'static str>,
    /// Its status at the end.
    pub status: &'static str,
    /// Why.
    pub reason: &'static str,
    /// Samples that entered the estimate.
    pub used: u64,
    /// Samples refused.
    pub rejected: u64,
    /// Samples that never arrived.
    pub lost: u64,
}

/// Counts of samples.
#[derive(Clone, Debug, Serialize)]
pub struct SampleAnswer {
    /// Handed to the channel.
    pub published: u64,
    /// Entered the estimate.
    pub used: u64,
    /// Refused.
    pub rejected: u64,
    /// Never arrived.
    pub lost: u64,
}

/// Percentiles of the latency.
#[derive(Clone, Debug, Serialize)]
pub struct LatencyAnswer {
    /// Half of the snapshots came within this time, in ns.
    pub p50_ns: u64,
    /// 99 of 100 snapshots came within this time, in ns.
    pub p99_ns: u64,
    /// Snapshots measured.
    pub count: u64,
}

/// Findings of the demo, for people and for machines.
pub struct Summary {
    /// Played dataset.
    pub dataset: Dataset,
    /// Samples played.
    pub published: u64,
    /// How fast.
    pub rate: f64,
    /// The last snapshot of each pipeline.
    pub snapshots: Vec<ParameterSnapshot>,
    /// Times from sample to snapshot.
    pub latency: Latencies,
}

impl Summary {
    /// Returns the result for machines.
    pub fn answer(&self) -> DemoAnswer {
        let pipelines: Vec<PipelineAnswer> = self.snapshots.iter().map(pipeline_answer).collect();
        let worst = |of: fn(&PipelineAnswer) -> u64| pipelines.iter().map(of);
        let samples = SampleAnswer {
            published: self.published,
            used: worst(|it| it.used).min().unwrap_or(0),
            rejected: worst(|it| it.rejected).max().unwrap_or(0),
            lost: worst(|it| it.lost).max().unwrap_or(self.published),
        };
        let latency = LatencyAnswer {
            p50_ns: self.latency.quantile_ns(0.5),
            p99_ns: self.latency.quantile_ns(0.99),
            count: self.latency.count(),
        };
        DemoAnswer { pipelines, samples, latency }
    }

    /// Returns the result for people.
    pub fn text(&self) -> String {
        let answer = self.answer();
        let mut text = format!(
            "\n{}\n{:<18} {:<12} {:<32} {:>7} {:>9} {:>5}\n",
            self.resistance(),
            "pipeline",
            "answers",
            "status",
            "used",
            "rejected",
            "lost"
        );
        for it in &answer.pipelines {
            let status = match it.reason {
                "none" => it.status.to_owned(),
                reason => format!("{} ({reason})", it.status),
            };
            text += &format!(
                "{:<18} {:<12} {status:<32} {:>7} {:>9} {:>5}\n",
                it.name,
                it.answers.join(" "),
                it.used,
                it.rejected,
                it.lost
            );
        }
        text += &self.mass();
        let DemoAnswer { samples, latency, .. } = answer;
        text += &format!(
            "\n{} samples published at {} times the recorded rate, {} lost\n",
            samples.published, self.rate, samples.lost
        );
        text + &format!(
            "sample → snapshot: p50 {:.1} µs, p99 {:.1} µs over {} snapshots\n",
            latency.p50_ns as f64 * 1e-3,
            latency.p99_ns as f64 * 1e-3,
            latency.count
        )
    }

    /// Declared and estimated mass of the last run.
    fn mass(&self) -> String {
        let last = self.dataset.runs.last().and_then(|run| run.samples.last());
        let declared_kg = last.and_then(|sample| sample.get(SampleField::Mass));
        let declared_t = 1e-3 * declared_kg.unwrap_or(self.dataset.train.mass_kg);
        let sentence = |it: &ParameterSnapshot| {
            let mass_t = it.value(Parameter::Mass)?;
            let half_width_t = HALF_95 * it.std(Parameter::Mass)?;
            Some(format!(
                "\nmass on the last run: declared {declared_t:.0} t, \
                 estimated {mass_t:.0} ± {half_width_t:.0} t\n"
            ))
        };
        self.snapshots.iter().filter(|it| it.answers(Quantity::Mass)).filter_map(sentence).collect()
    }

    /// Declared and estimated resistance over the driven speeds; empty without motion.
    fn resistance(&self) -> String {
        let estimates: Vec<&ParameterSnapshot> =
            self.snapshots.iter().filter(|it| it.resistance_at(10.0).is_some()).collect();
        let low = estimates.iter().map(|it| it.speed_min_mps).fold(f64::INFINITY, f64::min);
        let high = estimates.iter().map(|it| it.speed_max_mps).fold(0.0, f64::max);
        if estimates.is_empty() || low >= high {
            return String::new();
        }
        let mut text = String::from(
            "Basic resistance in N/kN: declared, and estimated with its 95 % interval\n",
        );
        text += &format!("{:>8} {:>9}", "m/s", "declared");
        estimates.iter().for_each(|it| text += &format!(" {:>17}", name(it)));
        text.push('\n');
        let steps = 6;
        for step in 0..=steps {
            let speed_mps = low + (high - low) * f64::from(step) / f64::from(steps);
            let declared = self.dataset.train.resistance.w0_n_per_kn(speed_mps);
            text += &format!("{speed_mps:>8.1} {declared:>9.3}");
            for estimate in estimates.iter().filter_map(|it| it.resistance_at(speed_mps)) {
                let half_width = HALF_95 * estimate.w0_std_n_per_kn;
                text +=
                    &format!(" {:>17}", format!("{:.3} ± {half_width:.3}", estimate.w0_n_per_kn));
            }
            text.push('\n');
        }
        text
    }
}

fn name(snapshot: &ParameterSnapshot) -> &'static str {
    PipelineKind::from_number(snapshot.pipeline_kind).map_or("?", PipelineKind::name)
}

fn pipeline_answer(snapshot: &ParameterSnapshot) -> PipelineAnswer {
    let answered = Quantity::ALL.iter().filter(|&&it| snapshot.answers(it));
    PipelineAnswer {
        name: name(snapshot),
        answers: answered.map(|it| it.name()).collect(),
        status: snapshot.status().name(),
        reason: snapshot.reason().map_or("?", Reason::name),
        used: snapshot.samples_used,
        rejected: snapshot.samples_rejected,
        lost: snapshot.samples_lost,
    }
}

/// All times of a demo in ns.
#[derive(Clone, Debug, Default)]
pub struct Latencies {
    taken_ns: Vec<u64>,
    last_sequence: [u64; PIPELINES_MAX],
}

impl Latencies {
    /// Takes in each snapshot that is new since the last call.
    pub fn record(&mut self, reader: &SnapshotReader, now_ns: i64) {
        for reading in reader.readings(now_ns) {
            let snapshot = reading.snapshot;
            let last = &mut self.last_sequence[snapshot.pipeline_index as usize];
            if snapshot.sequence > *last {
                *last = snapshot.sequence;
                let taken_ns = snapshot.published_ns - snapshot.sample_published_ns;
                self.taken_ns.push(u64::try_from(taken_ns).unwrap_or(0));
            }
        }
    }

    /// Returns the least time in ns within which this share of the snapshots came; 0 without any.
    pub fn quantile_ns(&self, share: f64) -> u64 {
        let mut sorted = self.taken_ns.clone();
        sorted.sort_unstable();
        let rank = (share * sorted.len() as f64).ceil() as usize;
        sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0)
    }

    /// Returns how many snapshots were measured.
    pub fn count(&self) -> u64 {
        self.taken_ns.len() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_is_the_least_time_that_reaches_the_share() {
        let of = |taken_ns: Vec<u64>| Latencies { taken_ns, ..Latencies::default() };
        let latencies = of((1..=100).rev().collect());
        assert_eq!([0.5, 0.99, 1.0].map(|share| latencies.quantile_ns(share)), [50, 99, 100]);
        assert_eq!((of(vec![]).quantile_ns(0.5), of(vec![7]).quantile_ns(0.99)), (0, 7));
    }
}
