//! Speeds that accelerations come to at the bins of a run.

use super::bins::Bin;
use super::run_data::RunData;

/// Integrals on their way over the bins of a run, each segment of motion starting from zero.
pub(super) struct Integral<const N: usize> {
    segment: usize,
    gained: [f64; N],
    last_s: f64,
    last: [f64; N],
}

impl<const N: usize> Integral<N> {
    pub(super) const START: Self =
        Integral { segment: usize::MAX, gained: [0.0; N], last_s: 0.0, last: [0.0; N] };

    /// Their means over the next bin.
    #[inline]
    pub(super) fn mean(
        &mut self,
        run: &RunData,
        bin: &Bin,
        accelerations: impl Fn(usize) -> [f64; N],
    ) -> [f64; N] {
        let time_s = &run.recording.time_s()[bin.first..bin.end];
        let mut sums = [0.0; N];
        if bin.segment != self.segment {
            self.segment = bin.segment;
            (self.gained, self.last_s) = ([0.0; N], time_s[0]);
            self.last = accelerations(bin.first);
        }
        for (i, &time_s) in (bin.first..).zip(time_s) {
            let here = accelerations(i);
            let half_s = 0.5 * (time_s - self.last_s);
            for k in 0..N {
                self.gained[k] += half_s * (here[k] + self.last[k]);
                sums[k] += self.gained[k];
            }
            (self.last_s, self.last) = (time_s, here);
        }
        sums.map(|sum| sum / time_s.len() as f64)
    }
}

/// Integrals of accelerations in m/s² over each segment of motion, averaged over the bins.
pub fn integrate_bins<const N: usize>(
    run: &RunData,
    accelerations: impl Fn(usize) -> [f64; N],
    mut bins: [&mut Vec<f64>; N],
) {
    let mut integral = Integral::START;
    bins.iter_mut().for_each(|bins| bins.clear());
    for bin in &run.bins {
        let means = integral.mean(run, bin, &accelerations);
        bins.iter_mut().zip(means).for_each(|(bins, mean)| bins.push(mean));
    }
}
