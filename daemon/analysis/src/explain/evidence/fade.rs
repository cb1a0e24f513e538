//! Share of a fading quantity that remains, step by step.

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
