//! Speed and deceleration along one stop, from its speeds alone.

use dynocar_shared::TrainSample;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use dynocar_core::filter::fixed_lag::FixedLagSmoother;
use dynocar_core::filter::{Gaussian, NotPositiveDefinite};

const SPEED: usize = 0;
const DECELERATION: usize = 1;
/// Fewest samples of a stop.
const SAMPLES_MIN: usize = 4;
/// Normalised innovation beyond which a speed counts less (Huber 1964).
const HUBER: f64 = 3.0;
/// The brake has built up when the deceleration reaches this share of the following deceleration...
const BUILT_UP: f64 = 0.9;
/// ... over this time in s...
const FOLLOWS_S: f64 = 3.0;
/// ... and counts as settled this time in s later.
const SETTLES_S: f64 = 2.0;
/// The brake was eased when the deceleration is below this share of an earlier one...
const EASED: f64 = 0.7;
/// ... and differs from it by this many standard deviations.
const EASED_STDS: f64 = 2.0;
/// Speed in m/s below which a full brake may be released, too.
const SOFT_MPS: f64 = 2.0;
/// Standard deviation in m/s² of the deceleration at the start of a stop.
const START_STD_MPS2: f64 = 1.0;
/// Standard deviations in m/s of a measured speed that the fit tries.
const NOISES_MPS: [f64; 9] = [0.002, 0.005, 0.01, 0.02, 0.04, 0.07, 0.12, 0.2, 0.35];
/// Standard deviations in m/s² that the deceleration gains in 1 s, that are tried.
const WALKS_MPS2: [f64; 8] = [0.0005, 0.003, 0.008, 0.02, 0.05, 0.1, 0.2, 0.4];
/// Standard deviations in m/s³ that its trend gains in 1 s, that are tried.
const BENDS_MPS3: [f64; 4] = [0.0, 0.0007, 0.002, 0.006];
/// Standard deviation in m/s³ of the trend at the start of a stop, where there is one.
const TREND_STD_MPS3: f64 = 0.05;

/// A moment of a stop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DecelerationPoint {
    /// Time in s since the brake was applied.
    #[serde(skip)]
    pub time_s: f64,
    /// Smoothed speed in m/s.
    pub speed_mps: f64,
    /// Smoothed deceleration in m/s².
    pub deceleration_mps2: f64,
    /// Its standard deviation in m/s².
    pub std_mps2: f64,
}

/// Speed and deceleration along one stop.
///
/// The deceleration walks at random, with a trend or without; the size of the walk and the noise of the speed have the
/// greatest likelihood of the speeds. While the brake builds up the deceleration walks further than later, so that the
/// later part is smoothed by itself.
#[derive(Clone, Debug, PartialEq)]
pub struct DecelerationCurve {
    /// The moments, in order.
    pub points: Vec<DecelerationPoint>,
    /// The first moment at which the brake has built up; `None` where it never did.
    pub built_up: Option<usize>,
}

impl DecelerationCurve {
    /// Returns the curve of a stop's samples; `None` for too few.
    pub fn from_samples(samples: &[TrainSample]) -> Option<Self> {
        let mut points = smoothed(samples)?;
        let built_up = built_up(&points);
        if let Some(from) = built_up
            && let Some(rest) = smoothed(&samples[from..])
        {
            let built_s = points[from].time_s;
            points.truncate(from);
            points.extend(
                rest.iter().map(|it| DecelerationPoint { time_s: it.time_s + built_s, ..*it }),
            );
        }
        Some(DecelerationCurve { points, built_up })
    }

    /// Returns the last moment at which the train was at least so fast in m/s.
    pub fn at_speed(&self, speed_mps: f64) -> Option<&DecelerationPoint> {
        self.points.iter().rev().find(|point| point.speed_mps >= speed_mps)
    }

    /// Returns the moment of the greatest deceleration and a later one at which the brake had been eased; `None`
    /// where it was not.
    pub fn eased(&self) -> Option<[DecelerationPoint; 2]> {
        let points = self.points.get(self.built_up?..)?;
        let mut most = points.first()?;
        for point in points.iter().take_while(|it| it.speed_mps >= SOFT_MPS) {
            let loss = most.deceleration_mps2 - point.deceleration_mps2;
            let is_less = point.deceleration_mps2 < EASED * most.deceleration_mps2;
            if is_less && loss > EASED_STDS * most.std_mps2.hypot(point.std_mps2) {
                return Some([*most, *point]);
            }
            if point.deceleration_mps2 > most.deceleration_mps2 {
                most = point;
            }
        }
        None
    }

    /// Returns the speed in m/s at which the brake was applied.
    pub fn from_mps(&self) -> f64 {
        self.points[0].speed_mps
    }

    /// Returns the distance in m from the application of the brake to the standstill.
    pub fn distance_m(&self) -> f64 {
        let pairs = self.points.windows(2);
        pairs
            .map(|pair| {
                let mean_mps = 0.5 * (pair[0].speed_mps + pair[1].speed_mps);
                mean_mps.max(0.0) * (pair[1].time_s - pair[0].time_s)
            })
            .sum()
    }
}

/// Returns the moment after which the deceleration is that of the built-up brake: a while after it first reached the
/// deceleration that follows.
fn built_up(points: &[DecelerationPoint]) -> Option<usize> {
    let reaches = |from: usize| {
        let point = &points[from];
        let following =
            points[from..].iter().take_while(|it| it.time_s <= point.time_s + FOLLOWS_S);
        let (count, sum) =
            following.fold((0.0, 0.0), |(n, sum), it| (n + 1.0, sum + it.deceleration_mps2));
        let is_braking = point.deceleration_mps2 > 3.0 * point.std_mps2;
        is_braking && point.deceleration_mps2 >= BUILT_UP * sum / count
    };
    let reached_s =
        (0..points.len()).find(|&from| reaches(from)).map(|from| points[from].time_s)?;
    points.iter().position(|point| point.time_s >= reached_s + SETTLES_S)
}

/// Returns the speed and deceleration at every sample, given all of them; `None` for too few.
fn smoothed(samples: &[TrainSample]) -> Option<Vec<DecelerationPoint>> {
    if samples.len() < SAMPLES_MIN {
        return None;
    }
    let tried = NOISES_MPS.iter().flat_map(|&noise_mps| {
        WALKS_MPS2.iter().flat_map(move |&walk_mps2| {
            BENDS_MPS3.iter().map(move |&bend_mps3| Pass { noise_mps, walk_mps2, bend_mps3 })
        })
    });
    let scored = tried.filter_map(|pass| Some((pass.likelihood(samples, &mut None).ok()?, pass)));
    let (_, best) = scored.max_by(|one, other| one.0.total_cmp(&other.0))?;
    let mut smoothers = Some([SPEED, DECELERATION].map(|_| FixedLagSmoother::new(samples.len())));
    best.likelihood(samples, &mut smoothers).ok()?;
    let [speeds, decelerations] = smoothers?;
    let mut points: Vec<DecelerationPoint> = speeds
        .newest_first()
        .zip(decelerations.newest_first())
        .map(|(speed, deceleration)| DecelerationPoint {
            time_s: speed.tag,
            speed_mps: speed.mean,
            deceleration_mps2: deceleration.mean,
            std_mps2: deceleration.variance.max(0.0).sqrt(),
        })
        .collect();
    points.reverse();
    Some(points)
}

type Smoothers = Option<[FixedLagSmoother<3, f64>; 2]>;

/// One pass over the speeds under an assumed noise.
struct Pass {
    noise_mps: f64,
    walk_mps2: f64,
    bend_mps3: f64,
}

impl Pass {
    /// Returns the logarithm of the likelihood; remembers every moment where wanted.
    fn likelihood(
        &self,
        samples: &[TrainSample],
        smoothers: &mut Smoothers,
    ) -> Result<f64, NotPositiveDefinite> {
        let start_ns = samples[0].time_ns;
        let mut state = Gaussian::independent(
            Vector3::new(samples[0].speed_mps, 0.0, 0.0),
            Vector3::new(
                self.noise_mps.max(0.1),
                START_STD_MPS2,
                if self.bend_mps3 > 0.0 { TREND_STD_MPS3 } else { 0.0 },
            ),
        );
        let (mut sum, mut last_s) = (0.0, 0.0);
        for (index, sample) in samples.iter().enumerate() {
            let time_s = 1e-9 * (sample.time_ns - start_ns) as f64;
            if index > 0 {
                self.move_on(&mut state, time_s - last_s, smoothers);
                sum += self.take(&mut state, sample.speed_mps, smoothers)?;
            }
            last_s = time_s;
            for (component, smoother) in smoothers.iter_mut().flatten().enumerate() {
                smoother.remember(&state, component, time_s);
            }
        }
        Ok(sum)
    }

    fn move_on(&self, state: &mut Gaussian<3>, h: f64, smoothers: &mut Smoothers) {
        let jacobian = Matrix3::new(1.0, -h, -0.5 * h * h, 0.0, 1.0, h, 0.0, 0.0, 1.0);
        let (walk, bend) = (self.walk_mps2.powi(2), self.bend_mps3.powi(2));
        let speed = walk * h.powi(3) / 3.0 + bend * h.powi(5) / 20.0;
        let speed_deceleration = -0.5 * walk * h * h - bend * h.powi(4) / 8.0;
        let speed_trend = -bend * h.powi(3) / 6.0;
        let deceleration = walk * h + bend * h.powi(3) / 3.0;
        let deceleration_trend = 0.5 * bend * h * h;
        #[rustfmt::skip]
        let noise = Matrix3::new(
            speed, speed_deceleration, speed_trend,
            speed_deceleration, deceleration, deceleration_trend,
            speed_trend, deceleration_trend, bend * h,
        );
        state.predict(jacobian * state.mean, &jacobian, &noise);
        smoothers.iter_mut().flatten().for_each(|smoother| smoother.predict(&jacobian));
    }

    fn take(
        &self,
        state: &mut Gaussian<3>,
        speed_mps: f64,
        smoothers: &mut Smoothers,
    ) -> Result<f64, NotPositiveDefinite> {
        let mut variance = self.noise_mps * self.noise_mps;
        let normalised = state.innovation(SPEED, speed_mps, variance)?.normalised().abs();
        variance *= (normalised / HUBER).max(1.0);
        let innovation = state.innovation(SPEED, speed_mps, variance)?;
        let gain = state.take(SPEED, &innovation, variance);
        for smoother in smoothers.iter_mut().flatten() {
            smoother.take(SPEED, &innovation, &gain);
        }
        Ok(innovation.log_likelihood())
    }
}
