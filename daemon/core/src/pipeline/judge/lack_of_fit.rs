//! How often a force that no parameter explains was seen lately.

/// Looks over which the share is remembered.
const MEMORY: f64 = 300.0;
/// Looks before anything is said.
const LOOKS_MIN: f64 = 30.0;
/// Standard deviations beyond which a force is no chance.
const DEVIATIONS_MIN: f64 = 3.0;
/// Share of the basic resistance from which a force matters.
const SHARE_MIN: f64 = 0.1;
/// Share of the looks with such a force that the model cannot be said to fit with.
const LASTING_MIN: f64 = 0.1;

/// A watch on what a slow bias has to take up because no parameter of the model can.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LackOfFit {
    looks: f64,
    share: f64,
}

impl LackOfFit {
    /// Takes in a force with its standard deviation and the basic resistance at the same speed,
    /// all in N/kN.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn look(&mut self, force: f64, std: f64, resistance: f64) {
        let is_seen = force.abs() > DEVIATIONS_MIN * std && force.abs() > SHARE_MIN * resistance;
        self.looks = (self.looks + 1.0).min(MEMORY);
        self.share += (f64::from(is_seen) - self.share) / self.looks;
    }

    /// True when the model did not fit for a good part of the time.
    pub fn is_lasting(&self) -> bool {
        self.looks >= LOOKS_MIN && self.share > LASTING_MIN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_force_that_is_sure_and_large_and_lasts_counts() {
        let lasting = |force: f64, std: f64, every: u32| {
            let mut fit = LackOfFit::default();
            for k in 0..600_u32 {
                fit.look(if k.is_multiple_of(every) { force } else { 0.0 }, std, 2.0);
            }
            fit.is_lasting()
        };
        assert!(lasting(1.0, 0.1, 1) && lasting(-1.0, 0.1, 4));
        assert!(!lasting(1.0, 0.5, 1), "may be chance");
        assert!(!lasting(0.1, 0.01, 1), "hardly matters");
        assert!(!lasting(1.0, 0.1, 50), "a moment");
    }

    #[test]
    fn a_fault_that_has_gone_is_forgotten() {
        let mut fit = LackOfFit::default();
        (0..100).for_each(|_| fit.look(1.0, 0.1, 2.0));
        assert!(fit.is_lasting());
        (0..1000).for_each(|_| fit.look(0.0, 0.1, 2.0));
        assert!(!fit.is_lasting());
    }
}
