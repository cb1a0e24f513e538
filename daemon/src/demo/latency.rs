//! Times from a sample's publishing to the publishing of the snapshot that it gave.

use dynocar_client::SnapshotReader;
use dynocar_shared::services::PIPELINES_MAX;

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

    /// The least time in ns within which this share of the snapshots came; 0 without any.
    pub fn quantile_ns(&self, share: f64) -> u64 {
        let mut sorted = self.taken_ns.clone();
        sorted.sort_unstable();
        let rank = (share * sorted.len() as f64).ceil() as usize;
        sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0)
    }

    /// How many snapshots were measured.
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
