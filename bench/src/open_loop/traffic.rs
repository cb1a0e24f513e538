//! The samples of a train that swings between 10 and 30 m/s once a minute: when they leave, and which of them are bad.

use std::f64::consts::TAU;

use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::{SampleField, TrainId, TrainSample};
use dynocar_tests::chance::Chance;

/// The traffic of every train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrafficPlan {
    /// Samples a second of each train.
    pub rate_hz: f64,
    /// Greatest delay of a sample, as a share of the period.
    pub jitter: f64,
    /// Samples that are gathered and leave at once; the mean rate stays.
    pub burst: u64,
    /// Share of samples that no validation should pass.
    pub bad_share: f64,
}

/// One train's samples in order, each with the time at which it is to leave.
#[derive(Clone, Debug)]
pub struct LoopTraffic {
    plan: TrafficPlan,
    motion: DrivenMotion,
    random: Chance,
    start_ns: i64,
    number: u64,
    count: u64,
    next: (TrainSample, i64),
}

impl LoopTraffic {
    /// Returns a train of which no sample leaves before [`LoopTraffic::begin`].
    pub fn new(plan: TrafficPlan, train: TrainId, start_ns: i64, seed: u64) -> Self {
        let random = Chance::new(seed ^ train.0.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let mut motion = DrivenMotion::new(train, start_ns);
        let next = (motion.sample(start_ns), start_ns);
        LoopTraffic { plan, motion, random, start_ns, number: 0, count: 0, next }
    }

    /// Begins `count` samples from a time on.
    pub fn begin(&mut self, start_ns: i64, count: u64) {
        (self.start_ns, self.number, self.count, self.next.1) = (start_ns, 0, count, start_ns);
        self.appoint();
    }

    /// Returns the next sample, with the time in ns at which it is to leave, if there is one more.
    pub fn upcoming(&self) -> Option<&(TrainSample, i64)> {
        (self.number < self.count).then_some(&self.next)
    }

    /// Prepares the sample after the next, which has left: none waits for that.
    pub fn prepare_next(&mut self) {
        self.number += 1;
        if self.number < self.count {
            self.appoint();
        }
    }

    /// Returns the sample that would be measured at a time in ns.
    pub fn sample(&mut self, time_ns: i64) -> TrainSample {
        self.motion.sample(time_ns)
    }

    fn measured_ns(&self, number: u64) -> i64 {
        self.start_ns + (number as f64 * 1e9 / self.plan.rate_hz) as i64
    }

    /// A burst leaves with its last sample; samples never overtake each other.
    fn appoint(&mut self) {
        let burst = self.plan.burst.max(1);
        let last_of_burst = (self.number / burst + 1) * burst - 1;
        let jitter_ns = match self.number % burst {
            0 => self.random.uniform() * self.plan.jitter * 1e9 / self.plan.rate_hz,
            _ => 0.0,
        };
        let appointed_ns = self.measured_ns(last_of_burst) + jitter_ns as i64;
        let mut sample = self.motion.sample(self.measured_ns(self.number));
        if self.plan.bad_share > 0.0 && self.random.uniform() < self.plan.bad_share {
            spoil(&mut sample, self.random.within(0..KINDS_OF_BAD));
        }
        self.next = (sample, appointed_ns.max(self.next.1));
    }
}

const KINDS_OF_BAD: u32 = 5;

fn spoil(sample: &mut TrainSample, kind: u32) {
    match kind {
        0 => sample.speed_mps = f64::NAN,
        1 => sample.speed_mps = 500.0,
        2 => sample.traction_force_n = -1.0,
        3 => sample.valid &= !SampleField::Speed.bit(),
        _ => sample.time_ns -= 3_600_000_000_000,
    }
}

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
    /// Returns the motion of a train from a time on, in ns of the controller's clock.
    pub fn new(train: TrainId, start_ns: i64) -> Self {
        let noise = train.0.wrapping_mul(0x9e37_79b9) | 1;
        DrivenMotion { train, start_ns, phase: train.0 as f64 * 0.37, noise }
    }

    /// Returns the sample at a time in ns of the controller's clock; every field is set.
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
            * GRAVITY_MPS2;
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

    /// Returns a uniform number between -1 and 1, by xorshift: its time is small compared with a publication's.
    fn next_noise(&mut self) -> f64 {
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 7;
        self.noise ^= self.noise << 17;
        (self.noise >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

#[cfg(test)]
mod tests {
    use dynocar_core::pipeline::admission::Admission;
    use dynocar_model::train::{Davis, TrainModel};

    use super::*;

    const TRAIN: TrainId = TrainId(2);

    fn take(traffic: &mut LoopTraffic) -> (TrainSample, i64) {
        let taken = *traffic.upcoming().expect("one more");
        traffic.prepare_next();
        taken
    }

    fn plan() -> TrafficPlan {
        TrafficPlan { rate_hz: 1_000.0, jitter: 0.5, burst: 8, bad_share: 0.1 }
    }

    #[test]
    fn samples_leave_in_order_in_bursts_and_at_the_mean_rate() {
        let mut traffic = LoopTraffic::new(plan(), TRAIN, 0, 1);
        traffic.begin(0, 8_000);
        let times: Vec<i64> = (0..8_000).map(|_| take(&mut traffic).1).collect();
        assert!(times.is_sorted() && traffic.upcoming().is_none());
        assert!(times.chunks(8).all(|burst| burst.iter().all(|&time| time == burst[0])));
        let seconds = times[times.len() - 1] as f64 * 1e-9;
        assert!((seconds - 8.0).abs() < 0.01, "{seconds}");
    }

    #[test]
    fn the_bad_share_is_refused_and_nothing_else() {
        let mut traffic = LoopTraffic::new(plan(), TRAIN, 1_000_000_000, 1);
        traffic.begin(1_000_000_000, 20_000);
        let train = TrainModel::bare("t", 200e3, Davis { a: 0.0, b: 0.0, c: 0.0 });
        let mut admission = Admission::new(TRAIN, train.into());
        let mut refused = 0.0;
        for number in 1..=20_000 {
            let (mut sample, _) = take(&mut traffic);
            sample.sequence = number;
            refused += f64::from(u8::from(admission.validate(&sample).is_err()));
        }
        assert!((refused / 20_000.0 - 0.1).abs() < 0.01, "{refused}");
    }
}

#[cfg(test)]
mod swinging_train_tests {
    use super::*;
    use dynocar_core::pipeline::admission::Admission;
    use dynocar_model::train::{Davis, TrainModel};

    #[test]
    fn every_sample_of_the_motion_is_valid() {
        let train = TrainId(3);
        let mut motion = DrivenMotion::new(train, 7);
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
