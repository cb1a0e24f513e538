//! Means over a few samples of motion, which are compared with a model.

use dynocar_model::simulate::OpenLoopRecording;

use crate::statistics::{middle, span};

/// Width in s of a bin over which speeds are averaged.
const BIN_S: f64 = 2.0;
/// Least width of a bin in sampling periods.
const BIN_SAMPLES_MIN: f64 = 2.0;
/// Speed in m/s below which the motion is not used: holding brakes and stiction act.
pub(super) const MOVING_MPS: f64 = 0.8;
/// Longest step in s between samples within a segment of motion.
pub(super) const SEGMENT_GAP_MAX_S: f64 = 5.0;
/// Least number of bins of a segment that is used.
const SEGMENT_BINS_MIN: usize = 4;
/// Time in s before and after reported sliding in which the wheels may slip, too: it is reported above a threshold.
const SLIDE_MARGIN_S: f64 = 1.0;
/// Time in s for which the couplings of a train oscillate after a change of force.
const RINGING_S: f64 = 6.0;

/// Mean over a few samples of one segment of motion, with the features of its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// First sample.
    pub first: usize,
    /// One past the last sample.
    pub end: usize,
    /// Number of the segment of motion within the run, from 0.
    pub segment: usize,
    /// Mean time in s since the run's first sample.
    pub time_s: f64,
    /// Mean measured speed in m/s.
    pub speed_mps: f64,
    /// By how much in m/s² the acceleration of the control force changed from a few seconds before
    /// to its end.
    pub jump_mps2: f64,
    /// Whether the wheels slip or slide, so that their speed is not the train's.
    pub is_sliding: bool,
}

impl Bin {
    /// The sample in the middle.
    pub fn middle(&self) -> usize {
        (self.first + self.end) / 2
    }
}

/// Median time in s between samples.
pub(super) fn sampling_period_s(time_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    middle(&mut steps).unwrap_or(BIN_S)
}

/// The bins of all segments of motion, in order of time.
pub(super) fn bins(recording: &OpenLoopRecording) -> Vec<Bin> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let width_s = BIN_S.max(BIN_SAMPLES_MIN * sampling_period_s(time_s));
    let usable = |i: usize| recording.is_simulated(i) && samples[i].speed_mps > MOVING_MPS;
    let mut bins: Vec<Bin> = Vec::new();
    let mut segment = 0;
    let mut i = 0;
    while i < samples.len() {
        if !usable(i) {
            i += 1;
            continue;
        }
        let mut end = i + 1;
        while end < samples.len()
            && usable(end)
            && time_s[end] - time_s[end - 1] <= SEGMENT_GAP_MAX_S
        {
            end += 1;
        }
        let segment_bins = segment_bins(recording, i, end, segment, width_s);
        if segment_bins.len() >= SEGMENT_BINS_MIN {
            bins.extend(segment_bins);
            segment += 1;
        }
        i = end;
    }
    bins
}

fn segment_bins(
    recording: &OpenLoopRecording,
    first: usize,
    end: usize,
    segment: usize,
    width_s: f64,
) -> Vec<Bin> {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let mut bins = Vec::new();
    let mut from = first;
    while from < end {
        // The small margin keeps rounded times from splitting a bin.
        let until_s = time_s[from] + width_s * (1.0 - 1e-6);
        let mut to = from + 1;
        while to < end && time_s[to] < until_s {
            to += 1;
        }
        let count = (to - from) as f64;
        let mean = |value: &dyn Fn(usize) -> f64| (from..to).map(value).sum::<f64>() / count;
        bins.push(Bin {
            first: from,
            end: to,
            segment,
            time_s: mean(&|i| time_s[i]),
            speed_mps: mean(&|i| samples[i].speed_mps),
            jump_mps2: jump_mps2(recording, from, to),
            is_sliding: slides(recording, from, to),
        });
        from = to;
    }
    bins
}

/// Returns whether sliding is reported between two samples or close to them.
fn slides(recording: &OpenLoopRecording, from: usize, to: usize) -> bool {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let first = time_s.partition_point(|&at_s| at_s < time_s[from] - SLIDE_MARGIN_S);
    let end = time_s.partition_point(|&at_s| at_s <= time_s[to - 1] + SLIDE_MARGIN_S);
    samples[first..end].iter().any(|sample| sample.is_sliding)
}

/// Range in m/s² of the acceleration of the control force, where it is known, from [`RINGING_S`] before
/// a sample to before another.
fn jump_mps2(recording: &OpenLoopRecording, from: usize, to: usize) -> f64 {
    let (samples, time_s) = (recording.samples(), recording.time_s());
    let recent = time_s[..from].iter().rev().take_while(|at_s| time_s[from] - **at_s <= RINGING_S);
    let known = (from - recent.count()..to).filter(|&i| recording.is_simulated(i));
    let accelerations = known.map(|i| {
        let sample = &samples[i];
        let force_n = sample.traction_force_n.unwrap_or(0.0) - sample.brake_force_n.unwrap_or(0.0);
        force_n / sample.mass_kg
    });
    span(accelerations).map_or(0.0, |[least, most]| most - least)
}

#[cfg(test)]
mod tests {
    use dynocar_model::force::ResolvedSample;

    use super::super::coasting;
    use super::super::noise::Noise;
    use super::*;

    #[test]
    fn the_speed_of_a_bin_near_a_reported_slide_counts_for_nothing() {
        let sample =
            |k: i64| ResolvedSample { time_ns: k * 500_000_000, is_sliding: k == 25, ..coasting() };
        let recording = OpenLoopRecording::new((0..60).map(sample).collect()).unwrap();
        let bins = bins(&recording);
        // Bins of 2 s from 10 and from 12 s on have a sample within a second of 12.5 s.
        let near = |bin: &Bin| (10.0..14.0).contains(&bin.time_s);
        assert!(bins.len() > 10 && bins.iter().all(|bin| bin.is_sliding == near(bin)));
        let var = |is_near: bool| {
            let bin = bins.iter().find(|bin| near(bin) == is_near).expect("such a bin");
            Noise::START.bin_var(bin)
        };
        assert!(var(true) > 1e4 * var(false));
    }
}
