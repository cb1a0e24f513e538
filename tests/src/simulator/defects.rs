//! Defects between the sensors and the recording.

use dynocar_shared::{SampleField, TrainSample};

use super::random::SimulatorRandom;
use super::settings::Defects;

/// Applies the defects to the samples of one run.
pub fn spoil(
    samples: Vec<TrainSample>,
    defects: &Defects,
    random: &mut SimulatorRandom,
) -> Vec<TrainSample> {
    let mut samples = remove_rows(samples, defects, random);
    for sample in samples.iter_mut().skip(1) {
        empty_cells(sample, defects.missing_cells, random);
        if random.chance(defects.outliers) {
            spike(sample, random);
        }
    }
    let repeated = repeat_rows(samples, defects.repeated_rows, random);
    swap_rows(repeated, defects.swapped_rows, random)
}

/// Removes single rows and longer gaps; the first row stays.
fn remove_rows(
    samples: Vec<TrainSample>,
    defects: &Defects,
    random: &mut SimulatorRandom,
) -> Vec<TrainSample> {
    let mut gap_end_ns = i64::MIN;
    let mut last_ns = samples.first().map_or(0, |sample| sample.time_ns);
    samples
        .into_iter()
        .enumerate()
        .filter(|(k, sample)| {
            let step_s = (sample.time_ns - last_ns) as f64 * 1e-9;
            last_ns = sample.time_ns;
            if random.chance(defects.gaps_per_hour * step_s / 3600.0) {
                gap_end_ns = sample.time_ns + (random.uniform(1.0, 5.0) * 1e9) as i64;
            }
            let is_lost = random.chance(defects.missing_rows) || sample.time_ns < gap_end_ns;
            *k == 0 || !is_lost
        })
        .map(|(_, sample)| sample)
        .collect()
}

fn empty_cells(sample: &mut TrainSample, share: f64, random: &mut SimulatorRandom) {
    for field in [
        SampleField::Position,
        SampleField::TractionForce,
        SampleField::BrakeForce,
        SampleField::BrakeCylinderPressure,
        SampleField::AmbientTemperature,
    ] {
        if random.chance(share) {
            sample.valid &= !field.bit();
        }
    }
}

/// One quantity far off.
fn spike(sample: &mut TrainSample, random: &mut SimulatorRandom) {
    match random.integer(0, 3) {
        0 => {
            let off_mps = random.sign() * random.uniform(3.0, 30.0);
            sample.set(SampleField::Speed, (sample.speed_mps + off_mps).max(0.0));
        }
        1 => {
            let off_m = random.sign() * random.uniform(150.0, 4000.0);
            sample.set(SampleField::Position, sample.position_m + off_m);
        }
        2 => {
            let times = random.uniform(3.0, 10.0);
            sample.set(SampleField::TractionForce, 20e3 + times * sample.traction_force_n);
        }
        _ => {
            let times = random.uniform(3.0, 10.0);
            sample.set(SampleField::BrakeForce, 20e3 + times * sample.brake_force_n);
        }
    }
}

fn repeat_rows(
    samples: Vec<TrainSample>,
    share: f64,
    random: &mut SimulatorRandom,
) -> Vec<TrainSample> {
    let mut rows = Vec::with_capacity(samples.len());
    for sample in samples {
        rows.push(sample);
        if random.chance(share) {
            rows.push(sample);
        }
    }
    rows
}

fn swap_rows(
    samples: Vec<TrainSample>,
    share: f64,
    random: &mut SimulatorRandom,
) -> Vec<TrainSample> {
    let mut rows = samples;
    for k in 2..rows.len() {
        if random.chance(share) {
            rows.swap(k - 1, k);
        }
    }
    rows
}
