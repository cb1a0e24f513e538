//! Random process that remains when the model is right.

use super::bins::Bin;

/// Shares of the slow part of a noise under which a kind is tried again.
const STIFF_SHARES: [f64; 2] = [0.01, 1e-4];
/// Least variance in (m/s²)² of a fading force.
const FADING_VAR_MIN: f64 = 1e-10;

/// Variance in (m/s)² of the train's speed where that of its wheels says nothing of it.
const SLIDE_VAR: f64 = 100.0;

/// Noise of the bins: white measurement noise, a white force, and a force that fades with a time constant
/// (Ornstein-Uhlenbeck), such as gusts or a rough map leave. Where the control force changes, the car with the speed
/// sensor moves against the others on its couplings, which adds measurement noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Variance in (m/s)² of a bin's mean speed.
    pub measurement_var: f64,
    /// Further standard deviation in m/s for each m/s² by which the acceleration of the control
    /// force changed of late, in s.
    pub jump_s: f64,
    /// Spectral density in (m/s)²/s of the white acceleration.
    pub white_density: f64,
    /// Variance in (m/s²)² of the fading acceleration.
    pub fading_var: f64,
    /// Its time constant in s.
    pub fading_s: f64,
    /// Differences from run to run.
    pub scatter: RunScatter,
    /// Upper limit of these differences.
    pub scatter_most: RunScatter,
}

impl Noise {
    /// Where an estimation starts.
    pub const START: Noise = Noise {
        measurement_var: 1e-4,
        jump_s: 0.0,
        white_density: 1e-6,
        fading_var: 1e-5,
        fading_s: 20.0,
        scatter: RunScatter::USUAL,
        scatter_most: RunScatter::MOST,
    };

    /// Returns the noise with a small and with a smaller share of the fading force only: under it a lasting force
    /// counts in full, while a noise that was estimated in the presence of an undeclared force takes that force for
    /// noise. Returns only one where the smaller is no less.
    pub fn stiffer(self) -> Vec<Noise> {
        let stiff = |share: f64| Noise {
            fading_var: (share * self.fading_var).max(FADING_VAR_MIN),
            ..self
        };
        let mut both: Vec<Noise> = STIFF_SHARES.map(stiff).into();
        both.dedup();
        both
    }

    /// Returns the standard deviation in m/s² of the mean acceleration by the force over some seconds.
    pub fn mean_acceleration_mps2(&self, over_s: f64) -> f64 {
        let Noise { white_density, fading_var, fading_s, .. } = *self;
        let lasting_s = over_s - fading_s * (1.0 - (-over_s / fading_s).exp());
        (white_density * over_s + 2.0 * fading_var * fading_s * lasting_s).sqrt() / over_s
    }

    /// Variance in (m/s)² of the mean speed of a bin.
    #[inline]
    pub(super) fn bin_var(&self, bin: &Bin) -> f64 {
        let of_jump_mps = self.jump_s * bin.jump_mps2;
        let of_slide = if bin.is_sliding { SLIDE_VAR } else { 0.0 };
        self.measurement_var + of_jump_mps * of_jump_mps + of_slide
    }

    pub(super) fn to_logs(self) -> [f64; 4] {
        [self.measurement_var, self.white_density, self.fading_var, self.fading_s].map(f64::ln)
    }

    pub(super) fn with_logs(self, logs: [f64; 4]) -> Self {
        let bounded = |value: f64, low: f64, high: f64| value.exp().clamp(low, high);
        Noise {
            measurement_var: bounded(logs[0], 1e-8, 1.0),
            // No model is good to 0.01 N/kN in every second; where nearly nothing is left, all would count.
            white_density: bounded(logs[1], 1e-8, 1e-2),
            fading_var: bounded(logs[2], 1e-10, 1e-2),
            fading_s: bounded(logs[3], 4.0, 400.0),
            ..self
        }
    }
}

/// Standard deviations of the runs' own factors; that of the delays is fixed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunScatter {
    /// Of the factor on the control force.
    pub force: f64,
    /// Of the factor on the basic resistance.
    pub resistance: f64,
    /// Of the headwind in m/s.
    pub wind_mps: f64,
}

impl RunScatter {
    /// Differences of well-kept force sensors and ordinary weather.
    pub const USUAL: RunScatter = RunScatter { force: 0.003, resistance: 0.012, wind_mps: 0.01 };
}

/// Greatest difference in s of steps that count as equal: recorded times are rounded.
pub(super) const SAME_STEP_S: f64 = 1e-9;

/// Share exp(-step / time) that remains after each step; it is computed again only where the step changes, since nearly
/// all steps of a recording are equal.
#[derive(Clone, Copy, Debug)]
pub struct Fade {
    time_s: f64,
    step_s: f64,
    share: f64,
}

impl Fade {
    /// Returns a fade with a time constant in s.
    pub fn new(time_s: f64) -> Self {
        Fade { time_s, step_s: 0.0, share: 1.0 }
    }

    /// Returns the share that remains after a step in s.
    #[inline]
    pub fn over(&mut self, step_s: f64) -> f64 {
        if (step_s - self.step_s).abs() > SAME_STEP_S {
            (self.step_s, self.share) = (step_s, (-step_s / self.time_s).exp());
        }
        self.share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_follows_the_step() {
        let mut fade = Fade::new(4.0);
        for step_s in [0.0, 2.0, 2.0 + 1e-12, 8.0, 2.0] {
            assert!((fade.over(step_s) - (-step_s / 4.0f64).exp()).abs() < 1e-9, "{step_s}");
        }
    }
}
