//! The samples of a train that swings between 10 and 30 m/s once a minute.

use std::f64::consts::TAU;

use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use dynocar_shared::{SampleField, TrainId, TrainSample};

/// Seconds for one swing.
const PERIOD_S: f64 = 60.0;
const MEAN_SPEED_MPS: f64 = 20.0;
const SWING_MPS: f64 = 10.0;
const MASS_KG: f64 = 200e3;
const INERTIAL_MASS_KG: f64 = MASS_KG * 1.08;
/// Speed noise, uniform, in m/s either way: a tachometer's quantum.
const SPEED_NOISE_MPS: f64 = 0.01;
/// Brake-cylinder pressure in Pa for each N of brake force.
const PRESSURE_PA_PER_N: f64 = 1.5;

/// One train's motion; trains differ in phase.
#[derive(Clone, Debug)]
pub struct DrivenMotion {
    train: TrainId,
    start_ns: i64,
    phase: f64,
    noise: u64,
}

impl DrivenMotion {
    /// The motion of a train from a time on, in ns of the controller's clock.
    pub fn of(train: TrainId, start_ns: i64) -> Self {
        let noise = train.0.wrapping_mul(0x9e37_79b9) | 1;
        DrivenMotion { train, start_ns, phase: train.0 as f64 * 0.37, noise }
    }

    /// The sample at a time in ns of the controller's clock; every field is set.
    pub fn sample(&mut self, time_ns: i64) -> TrainSample {
        let elapsed_s = (time_ns - self.start_ns) as f64 * 1e-9;
        let rate = TAU / PERIOD_S;
        let angle = rate * elapsed_s + self.phase;
        let speed_mps = MEAN_SPEED_MPS - SWING_MPS * angle.cos();
        let acceleration_mps2 = SWING_MPS * rate * angle.sin();
        let position_m =
            MEAN_SPEED_MPS * elapsed_s - SWING_MPS / rate * (angle.sin() - self.phase.sin());
        let resistance_n = (1.95 + 0.031 * speed_mps + 0.0042 * speed_mps * speed_mps)
            * MASS_KG
            * 1e-3
            * STANDARD_GRAVITY_MPS2;
        let force_n = INERTIAL_MASS_KG * acceleration_mps2 + resistance_n;
        let brake_n = (-force_n).max(0.0);
        let mut sample = TrainSample::empty(self.train)
            .with(SampleField::Position, position_m)
            .with(SampleField::Speed, speed_mps + self.next_noise() * SPEED_NOISE_MPS)
            .with(SampleField::TractionForce, force_n.max(0.0))
            .with(SampleField::BrakeForce, brake_n)
            .with(SampleField::BrakeCylinderPressure, brake_n * PRESSURE_PA_PER_N)
            .with(SampleField::Acceleration, acceleration_mps2)
            .with(SampleField::SpecificForce, acceleration_mps2)
            .with(SampleField::Mass, MASS_KG)
            .with(SampleField::AmbientTemperature, 15.0)
            .with(SampleField::Gradient, 0.0)
            .with(SampleField::CurveRadius, 0.0);
        sample.time_ns = time_ns;
        sample
    }

    /// Uniform between -1 and 1, by xorshift: cheap enough to stand beside a publish.
    fn next_noise(&mut self) -> f64 {
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 7;
        self.noise ^= self.noise << 17;
        (self.noise >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_core::pipeline::admission::Admission;
    use dynocar_model::train::{Davis, TrainModel};

    #[test]
    fn every_sample_of_the_motion_is_valid() {
        let train = TrainId(3);
        let mut motion = DrivenMotion::of(train, 7);
        let model = TrainModel::bare("t", MASS_KG, Davis { a: 0.0, b: 0.0, c: 0.0 });
        let mut admission = Admission::new(train, model.into());
        for number in 1..=200_000_u64 {
            let mut sample = motion.sample(number as i64 * 1_000_000);
            (sample.sequence, sample.run) = (number, 1);
            admission.validate(&sample).unwrap_or_else(|reason| panic!("{number}: {reason}"));
        }
        assert_eq!(admission.lost(), 0);
    }
}
