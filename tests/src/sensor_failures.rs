//! Failures of sensors and channels, applied to good samples.

use dynocar_model::simulate::motion::quantised;
use dynocar_shared::{SampleField, TrainSample};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A way in which sensors or channels fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SensorFailure {
    /// A quantity is not a number.
    NotANumber,
    /// A quantity is infinite.
    Infinite,
    /// Every quantity keeps its value for 5 to 50 samples, while time goes on.
    Frozen,
    /// Speed and forces come in coarse steps for 5 to 50 samples.
    Quantised,
    /// A quantity takes a far-off value for one sample.
    Spikes,
    /// The sample is lost.
    Dropouts,
    /// The sample has the time of the previous one.
    RepeatedTime,
    /// The sample has a time up to 10 s earlier.
    ReversedTime,
    /// One sample's number is up to a million ahead; the next number continues the old sequence.
    SequenceJump,
    /// Speed in km/h where m/s are expected.
    KilometresPerHour,
    /// Forces in kN where N are expected, or the other way round.
    Thousandfold,
    /// A quantity with the wrong sign.
    SignFlip,
    /// Speed and forces stop at half of their ordinary greatest value.
    Saturated,
    /// The position leaps by up to 100 km.
    TeleportingPosition,
}

impl SensorFailure {
    /// All of them.
    pub const ALL: [SensorFailure; 14] = [
        SensorFailure::NotANumber,
        SensorFailure::Infinite,
        SensorFailure::Frozen,
        SensorFailure::Quantised,
        SensorFailure::Spikes,
        SensorFailure::Dropouts,
        SensorFailure::RepeatedTime,
        SensorFailure::ReversedTime,
        SensorFailure::SequenceJump,
        SensorFailure::KilometresPerHour,
        SensorFailure::Thousandfold,
        SensorFailure::SignFlip,
        SensorFailure::Saturated,
        SensorFailure::TeleportingPosition,
    ];

    /// Returns true for a failure that lasts over several samples.
    const fn is_burst(self) -> bool {
        matches!(self, SensorFailure::Frozen | SensorFailure::Quantised)
    }

    /// Applies the failure to a share of the samples; the first and the last are left alone, so
    /// that every gap lies between two samples.
    pub fn apply(self, samples: &[TrainSample], rate: f64, seed: u64) -> Spoiled {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let greatest =
            |field: SampleField| samples.iter().filter_map(|it| it.get(field)).fold(0.0, f64::max);
        let limits = [SampleField::Speed, SampleField::TractionForce, SampleField::BrakeForce]
            .map(|field| (field, 0.5 * greatest(field)));
        let mut spoiled = Spoiled { samples: Vec::with_capacity(samples.len()), dropped: 0 };
        let mut burst: Option<(TrainSample, u32)> = None;
        for (index, good) in samples.iter().enumerate() {
            let mut sample = *good;
            let is_inner = index > 0 && index + 1 < samples.len();
            let begin_rate = if self.is_burst() { rate / 27.0 } else { rate };
            if let Some((held, left)) = &mut burst {
                self.burst(&mut sample, held);
                *left -= 1;
                burst = burst.filter(|(_, left)| *left > 0);
            } else if is_inner && random.random::<f64>() < begin_rate {
                match self {
                    SensorFailure::Dropouts => {
                        spoiled.dropped += 1;
                        continue;
                    }
                    _ if self.is_burst() => burst = Some((sample, random.random_range(5..50))),
                    _ => self.spoil(&mut sample, &samples[index - 1], &limits, &mut random),
                }
            }
            spoiled.samples.push(sample);
        }
        spoiled
    }

    fn burst(self, sample: &mut TrainSample, held: &TrainSample) {
        let fields = [SampleField::Speed, SampleField::TractionForce, SampleField::BrakeForce];
        match self {
            SensorFailure::Frozen => {
                let TrainSample { time_ns, published_ns, sequence, .. } = *sample;
                *sample = TrainSample { time_ns, published_ns, sequence, ..*held };
            }
            _ => {
                for (field, step) in fields.into_iter().zip([1.0, 20_000.0, 20_000.0]) {
                    if let Some(value) = sample.get(field) {
                        sample.set(field, quantised(value, step));
                    }
                }
            }
        }
    }

    fn spoil(
        self,
        sample: &mut TrainSample,
        before: &TrainSample,
        limits: &[(SampleField, f64); 3],
        random: &mut ChaCha8Rng,
    ) {
        let any = |random: &mut ChaCha8Rng| {
            let set: Vec<SampleField> =
                SampleField::ALL.into_iter().filter(|&it| sample.get(it).is_some()).collect();
            set[random.random_range(0..set.len())]
        };
        let scale = |sample: &mut TrainSample, field, factor: f64| {
            if let Some(value) = sample.get(field) {
                sample.set(field, value * factor);
            }
        };
        match self {
            SensorFailure::NotANumber => sample.set(any(random), f64::NAN),
            SensorFailure::Infinite => {
                let sign = if random.random::<bool>() { 1.0 } else { -1.0 };
                sample.set(any(random), sign * f64::INFINITY);
            }
            SensorFailure::Spikes => {
                let factor = 10.0_f64.powf(4.0 * random.random::<f64>() - 1.0);
                scale(sample, any(random), factor);
            }
            SensorFailure::RepeatedTime => sample.time_ns = before.time_ns,
            SensorFailure::ReversedTime => {
                sample.time_ns -= random.random_range(1..10_000_000_000_i64);
            }
            SensorFailure::SequenceJump => sample.sequence += random.random_range(1_000..1_000_000),
            SensorFailure::KilometresPerHour => scale(sample, SampleField::Speed, 3.6),
            SensorFailure::Thousandfold => {
                let factor = if random.random::<bool>() { 1e3 } else { 1e-3 };
                scale(sample, SampleField::TractionForce, factor);
                scale(sample, SampleField::BrakeForce, factor);
            }
            SensorFailure::SignFlip => scale(sample, any(random), -1.0),
            SensorFailure::Saturated => {
                for &(field, limit) in limits {
                    if let Some(value) = sample.get(field) {
                        sample.set(field, value.min(limit));
                    }
                }
            }
            SensorFailure::TeleportingPosition => {
                sample.position_m += random.random_range(-1e5..1e5);
            }
            SensorFailure::Frozen | SensorFailure::Quantised | SensorFailure::Dropouts => {}
        }
    }
}

/// Good samples after the failure of a sensor.
#[derive(Clone, Debug)]
pub struct Spoiled {
    /// Arriving samples, in order.
    pub samples: Vec<TrainSample>,
    /// How many never do.
    pub dropped: u64,
}
