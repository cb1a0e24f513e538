//! Rides on the line: driving, forces that the model lacks, the controller's measurements, and the estimators that
//! learn the mass on a leg.

use dynocar_core::pipeline::Outcome;
use dynocar_core::pipeline::admission::Admission;
use dynocar_estimators::wang::force_model::LineResistance;
use dynocar_estimators::wang::{
    MassKalman, MassKalmanSettings, MassRegression, StagedDescent, StagedDescentSettings,
};
use dynocar_model::force::ResolvedSample;
use dynocar_model::simulate::motion::deceleration_mps2;
use dynocar_model::simulate::motion::{autoregressed, quantised, shown, slewed};
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::{SampleField, TrainId, TrainSample};
use dynocar_tests::chance::Chance;

use super::shuttle::{
    BRAKE_MAX_N, CURVE_RADIUS_M, DisturbanceLaw, EMPTY_MASS_KG, PERIOD_S, STATIONS_M, Shuttle,
    ShuttleMoment,
};
use crate::rig::resolving;
use crate::statistics::KMH;

const SERVICE_BRAKE_MPS2: f64 = 0.7;

/// Returns the wanted traction minus brake force in N on the way to a stop at a chainage in m.
pub type RideDriver<'a> = dyn FnMut(&Shuttle, &ShuttleMoment, f64) -> f64 + 'a;

/// Powers to the limit, lets the speed fall by 6 km/h while coasting, brakes for lower limits
/// and for the stop.
fn limit_driver() -> impl FnMut(&Shuttle, &ShuttleMoment, f64) -> f64 {
    let (mut is_powering, mut is_stopping) = (true, false);
    move |shuttle, now, to_m| {
        let brake_n = |deceleration: f64| (-now.mass_kg * deceleration).max(-BRAKE_MAX_N);
        let stop_m = (now.direction * (to_m - now.position_m)).max(1.0);
        let stop_mps2 = deceleration_mps2((now.speed_mps, 0.0), stop_m);
        is_stopping |= stop_mps2 > SERVICE_BRAKE_MPS2;
        if is_stopping {
            return brake_n(stop_mps2.clamp(0.5, 1.0));
        }
        let (needed_mps2, limit_mps) = limit_need(now);
        if needed_mps2 > SERVICE_BRAKE_MPS2 || now.speed_mps > limit_mps + 2.0 * KMH {
            is_powering = false;
            return brake_n(needed_mps2.clamp(0.4, 1.0));
        }
        if now.speed_mps < limit_mps - 6.0 * KMH {
            is_powering = true;
        } else if now.speed_mps > limit_mps - 0.5 * KMH {
            is_powering = false;
        }
        let is_near = needed_mps2.max(stop_mps2) > 0.6 * SERVICE_BRAKE_MPS2;
        match &shuttle.train.traction {
            Some(effort) if is_powering && !is_near => 0.95 * effort.force_n(now.speed_mps),
            _ => 0.0,
        }
    }
}

/// Returns the greatest deceleration in m/s² that a lower limit ahead asks for, and the limit here in m/s.
fn limit_need(now: &ShuttleMoment) -> (f64, f64) {
    let mut needed = 0.0_f64;
    let mut here_mps = f64::INFINITY;
    for (start_m, end_m, limit_kmh) in limits() {
        let limit_mps = limit_kmh * KMH;
        if (start_m..end_m).contains(&now.position_m) {
            here_mps = limit_mps;
        }
        let entry_m = if now.direction > 0.0 { start_m } else { end_m };
        let ahead_m = now.direction * (entry_m - now.position_m);
        if ahead_m > 0.0 && now.speed_mps > limit_mps {
            needed = needed.max(deceleration_mps2((now.speed_mps, limit_mps), ahead_m.max(0.5)));
        }
    }
    (needed, here_mps)
}

/// (from m, to m, km/h).
fn limits() -> [(f64, f64, f64); 8] {
    [
        (-1e9, 3_100.0, 80.0),
        (3_100.0, 7_500.0, 105.0),
        (7_500.0, 10_000.0, 70.0),
        (10_000.0, 15_000.0, 100.0),
        (15_000.0, 17_500.0, 55.0),
        (17_500.0, 21_300.0, 90.0),
        (21_300.0, 25_000.0, 75.0),
        (25_000.0, 1e9, 60.0),
    ]
}

const FORCE_SLEW_N_PER_S: f64 = 80_000.0;

impl Shuttle {
    /// Drives like [`limit_driver`].
    pub fn drive(
        &self,
        start: &ShuttleMoment,
        to_m: f64,
        dwell_s: f64,
        disturbance: &mut DisturbanceLaw<'_>,
    ) -> Vec<ShuttleMoment> {
        self.drive_with(&mut limit_driver(), start, to_m, dwell_s, disturbance)
    }

    /// Drives from standstill to standstill at `to_m`, then stands for `dwell_s`.
    pub fn drive_with(
        &self,
        driver: &mut RideDriver<'_>,
        start: &ShuttleMoment,
        to_m: f64,
        dwell_s: f64,
        disturbance: &mut DisturbanceLaw<'_>,
    ) -> Vec<ShuttleMoment> {
        let mut now = ShuttleMoment { speed_mps: 0.0, force_n: 0.0, ..*start };
        now.direction = (to_m - now.position_m).signum();
        let mut ride = vec![now];
        loop {
            let wanted_n = driver(self, &now, to_m);
            let to_n = slewed(now.force_n, wanted_n, FORCE_SLEW_N_PER_S * PERIOD_S);
            let next = self.advance(&now, to_n, disturbance);
            if next.speed_mps <= 0.0 && now.force_n < 0.0 {
                break;
            }
            now = next;
            ride.push(now);
        }
        let standing = (dwell_s / PERIOD_S).round() as usize;
        for _ in 0..standing {
            now.time_s += PERIOD_S;
            (now.speed_mps, now.force_n) = (0.0, -20_000.0);
            ride.push(now);
        }
        ride
    }

    /// Drives to and fro until there are `count` samples, the empty train throughout.
    pub fn crossing(
        &self,
        count: usize,
        disturbance: &mut DisturbanceLaw<'_>,
    ) -> Vec<ShuttleMoment> {
        let mut ride: Vec<ShuttleMoment> = Vec::with_capacity(count + 8_000);
        let mut now = self.standing_at(STATIONS_M[0], EMPTY_MASS_KG);
        let mut station = 0_usize;
        let mut is_outbound = true;
        while ride.len() < count {
            station = if is_outbound { station + 1 } else { station - 1 };
            let leg = self.drive(&now, STATIONS_M[station], 30.0, disturbance);
            now = leg[leg.len() - 1];
            now.time_s += PERIOD_S;
            ride.extend(leg);
            is_outbound = match station {
                0 => true,
                3 => false,
                _ => is_outbound,
            };
        }
        ride.truncate(count);
        ride
    }
}

/// Returns the leg of 3 km from the first station: power, coasting around 80 km/h, braking.
pub fn leg(
    shuttle: &Shuttle,
    mass_kg: f64,
    disturbance: &mut DisturbanceLaw<'_>,
) -> Vec<ShuttleMoment> {
    shuttle.drive(&shuttle.standing_at(STATIONS_M[0], mass_kg), STATIONS_M[1], 10.0, disturbance)
}

/// Returns the empty train comes to the first station, a load changes it, and it runs the leg.
///
/// On the way there the filter learns the noise of the speed; the mass of the leg it has to
/// learn anew.
pub fn there_and_back(
    shuttle: &Shuttle,
    mass_kg: f64,
    disturbance: &mut DisturbanceLaw<'_>,
) -> Vec<ShuttleMoment> {
    let empty = shuttle.standing_at(STATIONS_M[1], EMPTY_MASS_KG);
    let mut ride = shuttle.drive(&empty, STATIONS_M[0], 20.0, disturbance);
    let last = ride[ride.len() - 1];
    let loaded = ShuttleMoment { time_s: last.time_s + PERIOD_S, mass_kg, ..last };
    ride.extend(shuttle.drive(&loaded, STATIONS_M[1], 10.0, disturbance));
    ride
}

/// Returns the resistances that act.
pub fn known_resistance(shuttle: &Shuttle) -> LineResistance {
    let [basic, curve, tunnel] = shuttle.truth;
    let (curve, tunnel) = (Some(curve), Some(tunnel));
    LineResistance { basic, curve, tunnel, reference_radius_m: CURVE_RADIUS_M }
}

/// Our filter behind its admission, as a pipeline has it.
pub struct AdmittedKalman {
    admission: Admission,
    /// The filter.
    pub filter: MassKalman,
}

impl AdmittedKalman {
    /// Takes the next sample.
    pub fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        self.admission.pass(&mut self.filter, sample)
    }
}

/// Returns our filter with a resistance.
pub fn kalman(shuttle: &Shuttle, resistance: &LineResistance) -> AdmittedKalman {
    let settings = MassKalmanSettings::default().with_resistance(resistance);
    let filter = MassKalman::new(settings, &shuttle.train).expect("default settings");
    AdmittedKalman { admission: Admission::new(TrainId(1), shuttle.train.clone()), filter }
}

/// Returns the paper's last stage with a resistance.
pub fn staged(
    shuttle: &Shuttle,
    mass_regression: MassRegression,
    resistance: &LineResistance,
) -> StagedDescent {
    let settings = StagedDescentSettings { mass_regression, ..StagedDescentSettings::default() };
    let mut staged = StagedDescent::new(settings, &shuttle.train).expect("default settings");
    staged.resume(resistance);
    staged
}

/// Standard deviation in m/s of a leg's mean headwind: a fresh breeze.
pub const MEAN_WIND_STD_MPS: f64 = 3.0;
/// Standard deviation of the gusts in m/s.
pub const GUST_STD_MPS: f64 = 1.0;
/// Correlation time of the gusts in s.
pub const GUST_TIME_S: f64 = 8.0;

/// Headwind: a mean for the leg and gusts, acting on the quadratic part of the resistance, the Davis coefficient c
/// in N/kN per (m/s)².
pub fn wind(quadratic: f64, seed: u64) -> impl FnMut(f64) -> f64 {
    let mut random = Chance::new(seed);
    let mean_mps = MEAN_WIND_STD_MPS * random.normal();
    let mut gust_mps = GUST_STD_MPS * random.normal();
    let keep = (-PERIOD_S / GUST_TIME_S).exp();
    move |speed_mps| {
        gust_mps = autoregressed(gust_mps, keep, GUST_STD_MPS, random.normal());
        let air_mps = speed_mps + mean_mps + gust_mps;
        quadratic * (air_mps * air_mps.abs() - speed_mps * speed_mps)
    }
}

/// Returns an unexplained acceleration drawn from one of the mass filter's bias models, all equally likely; successive
/// seeds take the models in turn.
pub fn presumed(seed: u64) -> impl FnMut(f64) -> f64 {
    let models = MassKalmanSettings::default().bias_models();
    let model = models[(seed % models.len() as u64) as usize];
    let mut random = Chance::new(seed ^ 0xb1a5);
    let mut bias_mps2 = model.std_mps2 * random.normal();
    let keep = model.keep(PERIOD_S);
    move |speed_mps| {
        bias_mps2 = keep * bias_mps2 + model.noise_variance(keep).sqrt() * random.normal();
        -1e3 / GRAVITY_MPS2 * model.shape(speed_mps) * bias_mps2
    }
}

/// Standard deviation of the speed sensor in m/s: 0.05 km/h.
const SPEED_STD_MPS: f64 = 0.05 / 3.6;
/// Step of the speed's digits in m/s: 0.1 km/h.
const SPEED_QUANTUM_MPS: f64 = 0.1 / 3.6;

/// Returns the variance in (m/s)² of a measured speed: sensor and rounding.
pub fn speed_variance() -> f64 {
    SPEED_STD_MPS * SPEED_STD_MPS + SPEED_QUANTUM_MPS * SPEED_QUANTUM_MPS / 12.0
}

/// Returns the samples of a drive with noise and rounding, through validation and force resolution.
pub fn measure(
    shuttle: &Shuttle,
    ride: &[ShuttleMoment],
    random: &mut Chance,
) -> Vec<ResolvedSample> {
    let mut resolve = resolving(TrainId(1), &shuttle.train, Some(shuttle.track.clone()));
    let mut resolved = Vec::with_capacity(ride.len());
    for (index, instant) in ride.iter().enumerate() {
        let speed_mps = shown(instant.speed_mps, || {
            quantised(instant.speed_mps + SPEED_STD_MPS * random.normal(), SPEED_QUANTUM_MPS)
        });
        let mut sample = TrainSample::empty(TrainId(1))
            .with(SampleField::Speed, speed_mps)
            .with(SampleField::Position, instant.position_m)
            .with(SampleField::TractionForce, instant.force_n.max(0.0))
            .with(SampleField::BrakeForce, (-instant.force_n).max(0.0));
        sample.time_ns = (instant.time_s * 1e9).round() as i64;
        sample.sequence = index as u64 + 1;
        sample.direction = instant.direction as i8;
        resolved.push(resolve(&sample).expect("a plausible sample"));
    }
    resolved
}
