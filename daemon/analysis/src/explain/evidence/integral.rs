//! Speeds at the bins of a run by integrated accelerations, and a model's speeds there for any a, b and c.

use super::bins::Bin;
use super::run_data::RunData;

/// Integrals in progress over the bins of a run; each segment of motion starts from zero.
pub(super) struct Integral<const N: usize> {
    segment: usize,
    gained: [f64; N],
    last_s: f64,
    last: [f64; N],
}

impl<const N: usize> Integral<N> {
    pub(super) const START: Self =
        Integral { segment: usize::MAX, gained: [0.0; N], last_s: 0.0, last: [0.0; N] };

    /// Returns the means of the integrals over the next bin.
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
    for bins in &mut bins {
        bins.clear();
        bins.reserve_exact(run.bins.len());
    }
    for bin in &run.bins {
        let means = integral.mean(run, bin, &accelerations);
        bins.iter_mut().zip(means).for_each(|(bins, mean)| bins.push(mean));
    }
}

/// Modelled speeds in m/s at the bins of a run, each segment starting from zero. They are linear in a, b and c, so that
/// other values of these need no new pass over the samples.
#[derive(Clone, Debug, Default)]
pub struct Response {
    /// Without a, b and c.
    pub rest: Vec<f64>,
    /// Addition by each unit of a, b and c.
    pub davis: [Vec<f64>; 3],
}

impl Response {
    /// The speeds for some a, b and c.
    pub fn bins(&self, [a, b, c]: [f64; 3], bins: &mut Vec<f64>) {
        let [by_a, by_b, by_c] = &self.davis;
        let davis = by_a.iter().zip(by_b).zip(by_c);
        let rows = self.rest.iter().zip(davis);
        bins.clear();
        bins.extend(rows.map(|(rest, ((by_a, by_b), by_c))| rest + a * by_a + b * by_b + c * by_c));
    }

    /// Adds a multiple of another response.
    pub fn add(&mut self, times: f64, other: &Response) {
        self.each(other, |own, other| *own += times * other);
    }

    /// Turns this response into its slope: its change from another for each unit of a parameter that differs by `by`.
    pub fn become_slope_from(&mut self, other: &Response, by: f64) {
        self.each(other, |own, other| *own = (*own - other) / by);
    }

    fn each(&mut self, other: &Response, change: impl Fn(&mut f64, f64)) {
        let own = std::iter::once(&mut self.rest).chain(&mut self.davis);
        for (own, other) in own.zip(std::iter::once(&other.rest).chain(&other.davis)) {
            own.iter_mut().zip(other).for_each(|(own, &other)| change(own, other));
        }
    }
}
