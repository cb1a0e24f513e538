//! Resistances that the library of effects lacks, by laws of the simulator's own.

use super::random::SimulatorRandom;

/// Inputs of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Around {
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Time in s from the run's first sample.
    pub time_s: f64,
    /// Outside temperature in °C.
    pub degc: f64,
}

/// Dependence of a resistance on its inputs ([`Around`]), without unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// A resonance: bell-shaped over speed.
    Band {
        /// Middle of the band.
        centre_mps: f64,
        /// Standard deviation.
        width_mps: f64,
    },
    /// As one over the speed, for slow trains.
    Slow {
        /// Limit at which the force vanishes.
        below_mps: f64,
        /// Speed below which the force grows no more.
        least_mps: f64,
    },
    /// A power of the speed.
    Power {
        /// Speed at which it is 1.
        at_mps: f64,
        /// Exponent.
        exponent: f64,
    },
    /// In proportion to the speed beyond a threshold.
    Beyond {
        /// The threshold.
        from_mps: f64,
        /// Further speed at which it is 1.
        span_mps: f64,
    },
    /// Grows with the speed up to a level: `tanh(v / over)`.
    Levelling {
        /// Speed over which it grows.
        over_mps: f64,
    },
    /// As the square of the speed, and the more the colder it is.
    FastInCold {
        /// Speed at which it is 1, ten kelvin below `until_degc`.
        at_mps: f64,
        /// Limit at which the force vanishes.
        until_degc: f64,
    },
    /// In proportion to the speed, from some time in each run on.
    FastLater {
        /// Speed at which it is 1.
        at_mps: f64,
        /// The time.
        from_s: f64,
    },
}

/// A law with the resistance in N/kN where it is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unlisted {
    /// The law.
    pub law: Law,
    /// The resistance in N/kN where it is 1.
    pub n_per_kn: f64,
}

impl Unlisted {
    /// Returns the resistance in N/kN.
    pub fn resistance_n_per_kn(&self, around: Around) -> f64 {
        let Around { speed_mps, time_s, degc } = around;
        let share = match self.law {
            Law::Band { centre_mps, width_mps } => {
                let away = (speed_mps - centre_mps) / width_mps;
                (-0.5 * away * away).exp()
            }
            Law::Slow { below_mps, least_mps } => {
                (below_mps / speed_mps.max(least_mps) - 1.0).max(0.0)
            }
            Law::Power { at_mps, exponent } => (speed_mps / at_mps).powf(exponent),
            Law::Beyond { from_mps, span_mps } => (speed_mps - from_mps).max(0.0) / span_mps,
            Law::Levelling { over_mps } => (speed_mps / over_mps).tanh(),
            Law::FastInCold { at_mps, until_degc } => {
                (speed_mps / at_mps).powi(2) * (until_degc - degc).max(0.0) / 10.0
            }
            Law::FastLater { at_mps, from_s } => {
                if time_s < from_s {
                    0.0
                } else {
                    speed_mps / at_mps
                }
            }
        };
        self.n_per_kn * share
    }

    /// Returns the speeds in m/s at which most of it acts, where these are not all.
    pub fn speed_range_mps(&self) -> Option<[f64; 2]> {
        match self.law {
            Law::Band { centre_mps, width_mps } => {
                Some([centre_mps - 2.0 * width_mps, centre_mps + 2.0 * width_mps])
            }
            Law::Slow { below_mps, .. } => Some([0.0, below_mps]),
            _ => None,
        }
    }

    /// Any law, of a size that matters to a train of this greatest speed, with this basic
    /// resistance at ordinary speed, at these temperatures in °C.
    pub fn draw(
        (speed_max_mps, w0_n_per_kn): (f64, f64),
        warmest_degc: f64,
        duration_s: f64,
        random: &mut SimulatorRandom,
    ) -> Self {
        let mut of = |low: f64, high: f64| random.uniform(low, high);
        let speed = |share: f64| share * speed_max_mps;
        let law = match of(0.0, 7.0) as u32 {
            0 => Law::Band { centre_mps: speed(of(0.4, 0.75)), width_mps: speed(of(0.03, 0.07)) },
            1 => Law::Slow { below_mps: speed(of(0.35, 0.6)), least_mps: of(2.0, 4.0) },
            2 => Law::Power { at_mps: speed(1.0), exponent: of(3.0, 4.0) },
            3 => Law::Beyond { from_mps: speed(of(0.4, 0.7)), span_mps: speed(0.3) },
            4 => Law::Levelling { over_mps: speed(of(0.15, 0.3)) },
            5 => Law::FastInCold { at_mps: speed(0.8), until_degc: warmest_degc - of(2.0, 6.0) },
            _ => Law::FastLater { at_mps: speed(0.8), from_s: duration_s * of(0.3, 0.6) },
        };
        let greatest = match law {
            // A train still has to start against it.
            Law::Slow { below_mps, least_mps } => 0.4 * (below_mps / least_mps - 1.0),
            _ => 1.0,
        };
        Unlisted { law, n_per_kn: w0_n_per_kn * of(0.6, 1.2) / greatest }
    }
}
