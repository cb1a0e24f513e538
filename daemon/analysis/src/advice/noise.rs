//! Noise behind snapshots of the resistance, estimated from these snapshots.
//!
//! A filter of [a, b, c, v] whose force is disturbed with the density d² (d in N/kN √s) gains information on a, for
//! given b and c, at the rate 1 / d² while the train moves, at any speed and in any manoeuvre: every moment measures
//! w0(v) = a + b v + c v² with the variance d² / dt, and the derivative of w0 by a is 1. The growth of the (a, a)
//! entry of the information, the inverse of the published covariance, therefore gives d, including everything that
//! widens the published covariance. The noise of the measured speed is the default of the pipeline.

use dynocar_core::pipeline::train_kalman::{TrainKalmanSettings, declared_a_std};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{Parameter, ParameterSnapshot, PipelineKind};
use nalgebra::Matrix3;

/// Noise that limits an estimate of the resistance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunNoise {
    /// Standard deviation of a measured speed in m/s.
    pub speed_noise_mps: f64,
    /// Root of the density of disturbing forces in N/kN √s.
    pub disturbance_n_per_kn_sqrt_s: f64,
    /// Time in s between two samples.
    pub step_s: f64,
}

/// Least time in s of the controller's clock between two snapshots that are compared.
const LOOK_S: f64 = 5.0;
/// Number of rates that are remembered: those of the newest three minutes of motion.
const LOOKS: usize = 36;
/// Least number of rates that are used; with fewer, the rate over the whole time counts.
const LOOKS_MIN: usize = 4;
/// Times between samples in s that can be.
const STEP_S: (f64, f64) = (1e-4, 2.5);

/// Follows the snapshots of one pipeline of the resistance.
#[derive(Clone, Debug, Default)]
pub struct NoiseSeen {
    last: Option<Look>,
    step_s: Option<f64>,
    /// Growth of the information in 1/(N/kN)² per s, the newest last.
    rates: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
struct Look {
    epoch: u64,
    generation: u64,
    time_ns: i64,
    sequence: u64,
    information: f64,
}

impl NoiseSeen {
    /// Takes in a snapshot; call it with every one or with some of them.
    pub fn see(&mut self, snapshot: &ParameterSnapshot) {
        let Some(information) = information_on_a(snapshot) else { return };
        let now = Look {
            epoch: snapshot.epoch,
            generation: snapshot.generation,
            time_ns: snapshot.sample_time_ns,
            sequence: snapshot.sample_sequence,
            information,
        };
        let Some(last) = self.last else {
            self.last = Some(now);
            return;
        };
        let elapsed_s = 1e-9 * now.time_ns.saturating_sub(last.time_ns) as f64;
        let samples = now.sequence.saturating_sub(last.sequence);
        let is_the_same = (now.epoch, now.generation) == (last.epoch, last.generation);
        if !is_the_same || elapsed_s < 0.0 || now.sequence < last.sequence {
            *self = NoiseSeen { last: Some(now), ..NoiseSeen::default() };
            return;
        }
        if elapsed_s < LOOK_S {
            return;
        }
        self.last = Some(now);
        let step_s = elapsed_s / samples.max(1) as f64;
        if !(STEP_S.0..=STEP_S.1).contains(&step_s) {
            return;
        }
        self.step_s = Some(step_s);
        let rate = (now.information - last.information) / elapsed_s;
        // At rest nothing is learned, after a jump of the coefficients knowledge is lost.
        if rate > 0.0 {
            if self.rates.len() == LOOKS {
                self.rates.remove(0);
            }
            self.rates.push(rate);
        }
    }

    /// Returns the noise behind the newest snapshot of the pipeline; `None` while nothing has been learned, or if
    /// the noise of this kind of pipeline cannot be estimated.
    pub fn noise(&self, newest: &ParameterSnapshot, train: &TrainModel) -> Option<RunNoise> {
        let step_s = self.step_s?;
        let rate = if self.rates.len() >= LOOKS_MIN {
            fastest(&self.rates)
        } else {
            let before = declared_a_std(train).powi(-2);
            (information_on_a(newest)? - before) / (newest.samples_used as f64 * step_s)
        };
        let speed_noise_mps = TrainKalmanSettings::default().speed_noise_mps;
        let noise =
            RunNoise { speed_noise_mps, disturbance_n_per_kn_sqrt_s: rate.sqrt().recip(), step_s };
        let is_known = noise.speed_noise_mps > 0.0 && noise.disturbance_n_per_kn_sqrt_s > 0.0;
        (is_known && (noise.speed_noise_mps + noise.disturbance_n_per_kn_sqrt_s).is_finite())
            .then_some(noise)
    }
}

/// Returns the information on a for given b and c, of the pipelines that learn it from every sample.
fn information_on_a(snapshot: &ParameterSnapshot) -> Option<f64> {
    let learns = matches!(
        snapshot.pipeline_kind()?,
        PipelineKind::TrajectoryKalman | PipelineKind::TrainKalman
    );
    if !learns {
        return None;
    }
    let (_, covariance) = davis_of(snapshot)?;
    let information = covariance.cholesky()?.inverse()[(0, 0)];
    information.is_finite().then_some(information)
}

/// Returns the ninth decile of some rates: most are lower, while mass, wind and the scales of the forces are not
/// determined.
fn fastest(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[9 * (sorted.len() - 1) / 10]
}

/// Parameters that the pipeline answers: a, b, c and the mass.
pub const ANSWERED: [Parameter; 4] =
    [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC, Parameter::Mass];

/// Returns the coefficients and their covariance out of a snapshot that has all three.
pub fn davis_of(snapshot: &ParameterSnapshot) -> Option<(Davis, Matrix3<f64>)> {
    let [davis @ .., _] = ANSWERED;
    let [Some(a), Some(b), Some(c)] = davis.map(|it| snapshot.index_of(it)) else { return None };
    let places = [a, b, c];
    let [a, b, c] = places.map(|index| snapshot.values[index]);
    let covariance = Matrix3::from_fn(|i, j| snapshot.covariance_at(places[i], places[j]));
    Some((Davis { a, b, c }, covariance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_core::pipeline::output::write_parameters;
    use dynocar_model::train::Davis;
    use nalgebra::{Matrix3, Vector3};

    const DISTURBANCE: f64 = 0.4;

    /// Returns the snapshot of a filter after a time at speeds that wander, 10 samples a second.
    fn snapshot(time_s: f64, information: &Matrix3<f64>) -> ParameterSnapshot {
        let mut snapshot = ParameterSnapshot::empty();
        snapshot.pipeline_kind = PipelineKind::TrajectoryKalman as u32;
        snapshot.sample_time_ns = (1e9 * time_s) as i64;
        snapshot.sample_sequence = (10.0 * time_s) as u64;
        snapshot.samples_used = snapshot.sample_sequence;
        let covariance = information.try_inverse().unwrap();
        let [a, b, c, _] = ANSWERED;
        write_parameters(&mut snapshot, [a, b, c], &Vector3::new(1.5, 0.02, 0.003), &covariance);
        snapshot
    }

    fn after(seconds: u32, stands_from_s: u32) -> Option<RunNoise> {
        let train = TrainModel {
            rotating_mass_factor: 0.06,
            ..TrainModel::bare("test", 1e5, Davis { a: 1.5, b: 0.02, c: 0.003 })
        };
        let prior = Vector3::new(declared_a_std(&train), 0.02, 0.002);
        let mut information = Matrix3::from_diagonal(&prior.map(|std| std.powi(-2)));
        let mut seen = NoiseSeen::default();
        let mut newest = snapshot(0.0, &information);
        for second in 0..=seconds {
            newest = snapshot(f64::from(second), &information);
            seen.see(&newest);
            if second < stands_from_s {
                let speed = 10.0 + f64::from(second % 20);
                let row = Vector3::new(1.0, speed, speed * speed);
                information += row * row.transpose() / (DISTURBANCE * DISTURBANCE);
            }
        }
        seen.noise(&newest, &train)
    }

    #[test]
    fn the_disturbance_is_reported_by_how_the_information_grows_at_any_speed() {
        for (seconds, stands_from_s) in [(60, 60), (8, 8), (600, 300)] {
            let noise = after(seconds, stands_from_s).unwrap();
            let ratio = noise.disturbance_n_per_kn_sqrt_s / DISTURBANCE;
            assert!((0.95..1.05).contains(&ratio), "{seconds} s: {ratio}");
            assert!((noise.step_s - 0.1).abs() < 1e-9);
        }
    }

    #[test]
    fn nothing_is_reported_before_anything_is_learned_or_of_other_pipelines() {
        assert_eq!(after(3, 3), None, "one look");
        assert_eq!(after(60, 0), None, "a train that stands");
        let mut other = snapshot(0.0, &Matrix3::identity());
        other.pipeline_kind = PipelineKind::Ls as u32;
        let mut seen = NoiseSeen::default();
        (0..100).for_each(|second| {
            other.sample_time_ns = second * 1_000_000_000;
            seen.see(&other);
        });
        let train = TrainModel::bare("test", 1e5, Davis { a: 1.5, b: 0.02, c: 0.003 });
        assert_eq!(seen.noise(&other, &train), None);
    }
}
