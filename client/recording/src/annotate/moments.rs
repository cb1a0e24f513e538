//! When the moments of a dataset's runs were, as a recording logs them.

use crate::error::CopyError;
use crate::reading::{Item, Raw, Visitor};
use crate::recording::trains_of;

/// The samples of a recording with their moments, run by run as a dataset of it has them.
#[derive(Debug, Default)]
pub struct Moments {
    /// When the newest message was logged, in ns since 1970.
    logged_ns: u64,
    samples: Vec<Moment>,
}

#[derive(Clone, Copy, Debug)]
struct Moment {
    train: u64,
    run: (u32, i8),
    time_ns: i64,
    logged_ns: u64,
}

impl Visitor for Moments {
    type Error = CopyError;

    fn item(&mut self, item: Item<'_>) -> Result<(), CopyError> {
        if let Item::Sample(it) = item {
            let (run, logged_ns) = ((it.run, it.direction), self.logged_ns);
            let time_ns = it.time_ns;
            self.samples.push(Moment { train: it.train_id, run, time_ns, logged_ns });
        }
        Ok(())
    }

    fn raw(&mut self, raw: &Raw<'_>) -> Result<(), CopyError> {
        self.logged_ns = raw.header.log_time;
        Ok(())
    }
}

impl Moments {
    /// The trains that there are samples of, in order.
    pub fn trains(&self) -> Vec<u64> {
        trains_of(self.samples.iter().map(|it| it.train))
    }

    /// The runs of a train.
    pub fn runs(&self, train: u64) -> Vec<RunMoments> {
        let samples: Vec<Moment> =
            self.samples.iter().filter(|it| it.train == train).copied().collect();
        samples.chunk_by(|one, next| one.run == next.run).map(RunMoments::of).collect()
    }
}

/// The moments of one run.
#[derive(Debug)]
pub struct RunMoments {
    /// The recorder's time and when it was logged, in order of time.
    moments: Vec<(i64, u64)>,
}

impl RunMoments {
    fn of(samples: &[Moment]) -> Self {
        let mut moments: Vec<_> = samples.iter().map(|it| (it.time_ns, it.logged_ns)).collect();
        moments.sort_unstable();
        RunMoments { moments }
    }

    /// When a moment was that the dataset counts in s, in ns since 1970: by the nearest sample before it.
    pub fn wall_ns(&self, time_s: f64) -> u64 {
        let time_ns = (time_s * 1e9).round() as i64;
        let after = self.moments.partition_point(|it| it.0 <= time_ns);
        let (of_sample_ns, logged_ns) = self.moments[after.saturating_sub(1)];
        logged_ns.saturating_add_signed(time_ns - of_sample_ns)
    }
}
