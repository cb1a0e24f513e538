//! Whether the brake-cylinder pressure has the size that brakes work with.

use dynocar_shared::{SampleField, TrainSample};

/// Braking time in s that is enough to judge.
const BRAKING_MIN_S: f64 = 20.0;
/// Times of which the means forget, in s.
const MEMORY_S: f64 = 2000.0;
/// The pressure follows the brake when it is so many times as high while braking.
const CONTRAST_MIN: f64 = 3.0;

/// Mean pressure with and without brake force.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PressureContrast {
    braking: Mean,
    released: Mean,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mean {
    time_s: f64,
    integral_pa_s: f64,
}

impl Mean {
    fn take(&mut self, value: f64, step_s: f64) {
        let keep = 1.0 / (1.0 + step_s / MEMORY_S);
        self.time_s = self.time_s * keep + step_s;
        self.integral_pa_s = self.integral_pa_s * keep + value * step_s;
    }

    fn value(&self) -> f64 {
        self.integral_pa_s / self.time_s
    }
}

impl PressureContrast {
    /// Takes in a sample and the time since the one before it.
    pub fn take(&mut self, sample: &TrainSample, step_s: f64) {
        let pressure = sample.get(SampleField::BrakeCylinderPressure);
        let (Some(pressure), Some(brake)) = (pressure, sample.get(SampleField::BrakeForce)) else {
            return;
        };
        let mean = if brake > 0.0 { &mut self.braking } else { &mut self.released };
        mean.take(pressure.abs(), step_s);
    }

    /// The mean pressure in Pa while braking, when it surely follows the brake.
    pub fn braking_pa(&self) -> Option<f64> {
        let is_enough = self.braking.time_s.min(self.released.time_s) >= BRAKING_MIN_S;
        let follows = is_enough && self.braking.value() > CONTRAST_MIN * self.released.value();
        follows.then(|| self.braking.value())
    }
}
