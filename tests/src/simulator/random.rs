//! One seeded stream of random numbers per subject.

use crate::chance::Chance;

/// Purpose of a stream of random numbers.
///
/// Subjects draw from streams of their own, so that an effect added to a dataset leaves train,
/// line, driver and noise as they were.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// The train.
    Train,
    /// The line.
    SimulatedLine,
    /// Which runs are made, and how they are driven.
    Plans,
    /// The size and place of effects.
    Effects,
    /// Column names and units of the files.
    Files,
    /// The quality of the sensors.
    SensorTypes,
    /// The survey's errors.
    Survey,
    /// Deviations that all runs share.
    Deviations,
    /// Differences from run to run that are not planned.
    Variation(usize),
    /// The wind of a run's day.
    Day(usize),
    /// Gusts of wind in a run.
    Gusts(usize),
    /// The driver of a run.
    Driver(usize),
    /// Wheel slip in a run.
    Slip(usize),
    /// The sensors of a run.
    Sensors(usize),
    /// Missing rows and outliers of a run.
    Defects(usize),
    /// The GNSS receiver in a run.
    Gnss(usize),
}

impl Stream {
    fn number(self) -> u64 {
        let of_run = |subject: u64, run: usize| subject + 16 * (run as u64 + 1);
        match self {
            Stream::Train => 1,
            Stream::SimulatedLine => 2,
            Stream::Plans => 3,
            Stream::Effects => 4,
            Stream::Files => 5,
            Stream::SensorTypes => 11,
            Stream::Survey => 12,
            Stream::Deviations => 10,
            Stream::Variation(run) => of_run(13, run),
            Stream::Day(run) => of_run(15, run),
            Stream::Gusts(run) => of_run(6, run),
            Stream::Driver(run) => of_run(7, run),
            Stream::Slip(run) => of_run(8, run),
            Stream::Sensors(run) => of_run(9, run),
            Stream::Defects(run) => of_run(10, run),
            Stream::Gnss(run) => of_run(14, run),
        }
    }
}

/// A seeded source of random numbers.
#[derive(Clone, Debug)]
pub struct SimulatorRandom {
    chance: Chance,
    spare_gaussian: Option<f64>,
}

impl SimulatorRandom {
    /// Returns the stream of a subject under a seed.
    pub fn new(seed: u64, stream: Stream) -> Self {
        SimulatorRandom { chance: Chance::of_stream(seed, stream.number()), spare_gaussian: None }
    }

    /// Uniform from `low` to `high`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.chance.between(low, high)
    }

    /// Returns a number drawn from the standard normal distribution; every second one completes a pair.
    pub fn gaussian(&mut self) -> f64 {
        if let Some(spare) = self.spare_gaussian.take() {
            return spare;
        }
        let [gaussian, spare] = self.chance.normal_pair();
        self.spare_gaussian = Some(spare);
        gaussian
    }

    /// Returns a whole number from `low` to `high`, both included.
    pub fn integer(&mut self, low: usize, high: usize) -> usize {
        self.chance.within(low..=high)
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.chance.uniform() < probability
    }

    /// +1 or -1.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// One of several.
    ///
    /// # Panics
    ///
    /// When there is nothing to choose from.
    pub fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.integer(0, choices.len() - 1)]
    }
}
