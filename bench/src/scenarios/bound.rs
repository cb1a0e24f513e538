//! The joint Cramér–Rao bound of resistance and mass over a drive: no estimator can be more accurate.
//!
//! All values that [`World::draw`] draws are unknown at once, each with the variance of its draw: a, b, c, the loads,
//! the scales and the delay of forces, brakes from stop to stop, wheels, rotating mass, the wind of the day, and gusts
//! and the map's error at every knot. The information of measured speeds follows from the change of the true motion
//! with each unknown.

use std::collections::HashMap;

use dynocar_core::pipeline::train_kalman::TrainKalmanSettings;
use dynocar_model::force::mps2_per_n_per_kn;
use nalgebra::{DMatrix, DVector, Matrix4};

use super::scenario_train::DriveMoment;
use super::world::{
    KNOT_M, KNOT_OVER_MEAN, LoadSource, ROOM_KG, WEIGHING_STD, World, knot_std_permille,
};

/// Unknowns of the bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Unknown {
    /// a, b or c.
    Davis(usize),
    TractionScale,
    BrakeScale,
    Delay,
    RotatingMass,
    Wheel,
    Wind,
    /// The load, a share of it, after this many stops.
    Load(usize),
    /// The brake's force on a leg.
    Brake(usize),
    /// The gust at a knot.
    Gust(usize),
    /// The map's error at a knot.
    Knot(usize),
    /// The speed at which a run begins to count.
    Start(usize),
}

impl Unknown {
    /// Returns its standard deviation beforehand.
    fn std(self, world: &World) -> f64 {
        let (declared, usual) = (world.declared.resistance, &world.mistakes);
        let declared_kg = world.declared.mass_kg;
        match self {
            Unknown::Davis(power) => {
                usual.coefficient_share * [declared.a, declared.b, declared.c][power]
            }
            Unknown::TractionScale => usual.force_share,
            Unknown::BrakeScale => usual.force_share.hypot(usual.brake_share),
            Unknown::Delay => usual.delay_s,
            Unknown::RotatingMass => usual.rotating_mass,
            Unknown::Wheel => usual.wheel_share,
            Unknown::Wind => usual.wind_mps,
            Unknown::Load(_) => match world.scenario.load {
                LoadSource::Exact => 0.0,
                LoadSource::Weighed(permille) => 1e-3 * f64::from(permille),
                LoadSource::Unknown => DRAWN_LOAD_STD,
                LoadSource::Changing => WEIGHING_STD,
                LoadSource::Passengers => ROOM_KG / declared_kg / 3.464,
            },
            Unknown::Brake(_) => usual.stop_to_stop_share,
            Unknown::Gust(_) => KNOT_OVER_MEAN * usual.gust_mps,
            Unknown::Knot(_) => knot_std_permille(world.scenario.map_std_permille),
            Unknown::Start(_) => START_STD_MPS,
        }
    }
}

/// Time in s between the speeds that are taken in: those between say the same many times.
const BLOCK_S: f64 = 0.5;
/// Distance in m between the places under the train at which the map is averaged.
const UNDER_TRAIN_M: f64 = 50.0;
/// Variance that stands for an exactly known value.
const EXACT: f64 = 1e-18;
/// Standard deviation of a load that is drawn evenly from 24 % of the declared mass.
const DRAWN_LOAD_STD: f64 = 0.24 / 3.464;

/// Standard deviation in m/s of the speed at which a run begins to count.
const START_STD_MPS: f64 = 1.0;

/// Information of the measured speeds so far on all unknowns.
#[derive(Default)]
pub struct Bound {
    /// The place of everything met so far.
    places: HashMap<Unknown, usize>,
    /// Variance beforehand, by place.
    prior: Vec<f64>,
    information: DMatrix<f64>,
    /// Change of the speed with each unknown of the present run, and the places of these unknowns.
    sensitivity: Vec<f64>,
    met: Vec<usize>,
    is_met: Vec<bool>,
    stops: usize,
    runs: usize,
    block_s: f64,
    last: Option<DriveMoment>,
}

impl Bound {
    /// Takes in a cycle of a drive.
    pub fn see(&mut self, world: &World, truth: &DriveMoment, cycle_s: f64) {
        let last = self.last.replace(*truth);
        let was_standing = last.is_none_or(|last| last.is_standing);
        self.stops += usize::from(truth.is_standing && !was_standing);
        let least_mps = TrainKalmanSettings::default().speed_min_mps;
        let counts = |at: &DriveMoment| !at.is_standing && at.speed_mps >= least_mps;
        let Some(last) = last.filter(|last| counts(last) && counts(truth)) else {
            return self.begin();
        };
        if self.met.is_empty() {
            self.meet(world, Unknown::Start(self.runs), 1.0);
            self.runs += 1;
        }
        self.move_on(world, &last, truth, cycle_s);
        self.block_s += cycle_s;
        if self.block_s >= BLOCK_S {
            self.measure(world, truth.speed_mps, self.block_s / cycle_s);
            self.block_s = 0.0;
        }
    }

    /// Another run may begin.
    fn begin(&mut self) {
        for index in self.met.drain(..) {
            self.sensitivity[index] = 0.0;
            self.is_met[index] = false;
        }
        self.block_s = 0.0;
    }

    fn place(&mut self, world: &World, unknown: Unknown) -> usize {
        let place = *self.places.entry(unknown).or_insert(self.prior.len());
        if place == self.prior.len() {
            self.prior.push(unknown.std(world).powi(2).max(EXACT));
            self.sensitivity.push(0.0);
            self.is_met.push(false);
            if place >= self.information.nrows() {
                let room = 2 * place + 64;
                self.information.resize_mut(room, room, 0.0);
            }
        }
        place
    }

    fn meet(&mut self, world: &World, unknown: Unknown, change_mps: f64) {
        let place = self.place(world, unknown);
        if !std::mem::replace(&mut self.is_met[place], true) {
            self.met.push(place);
        }
        self.sensitivity[place] += change_mps;
    }

    /// Returns the number of loads so far. Unless the mass is exact, each stop counts as a new load: an unchanged
    /// weighing may be as wrong as any other.
    fn loads(&self, world: &World) -> usize {
        if world.scenario.load == LoadSource::Exact { 0 } else { self.stops }
    }

    /// Adds the change of the speed by each unknown over a step.
    fn move_on(&mut self, world: &World, last: &DriveMoment, truth: &DriveMoment, step_s: f64) {
        let resistance = &world.truth.resistance;
        let gain = mps2_per_n_per_kn(world.truth.rotating_mass_factor);
        let speed_mps = truth.speed_mps;
        let by_wind = 2.0 * resistance.c * (speed_mps + truth.headwind_mps);
        let slope = resistance.b + by_wind;
        let kept = 1.0 - step_s * gain * slope;
        self.met.iter().for_each(|index| self.sensitivity[*index] *= kept);
        let push_mps2 = 0.5 * (last.push_mps2 + truth.push_mps2);
        let acceleration_mps2 = (truth.speed_mps - last.speed_mps) / step_s;
        let powers = [1.0, speed_mps, speed_mps * speed_mps];
        let braked = -step_s * push_mps2.min(0.0);
        let (knot, share) = truth.gust;
        let by_gust = -step_s * gain * by_wind;
        let rotating = 1.0 + world.truth.rotating_mass_factor;
        for (unknown, change_mps) in [
            (Unknown::TractionScale, -step_s * push_mps2.max(0.0)),
            (Unknown::BrakeScale, braked),
            (Unknown::Brake(self.stops), braked),
            (Unknown::Wind, truth.direction * step_s * gain * by_wind),
            (Unknown::Gust(knot), by_gust * (1.0 - share)),
            (Unknown::Gust(knot + 1), by_gust * share),
            (Unknown::Delay, -(truth.push_mps2 - last.push_mps2)),
            (Unknown::RotatingMass, -step_s * acceleration_mps2 / rotating),
            (Unknown::Wheel, 0.0),
            (Unknown::Load(self.loads(world)), step_s * push_mps2),
        ] {
            self.meet(world, unknown, change_mps);
        }
        for (power, factor) in powers.into_iter().enumerate() {
            self.meet(world, Unknown::Davis(power), -step_s * gain * factor);
        }
        if world.scenario.map_std_permille > 0.0 {
            self.pass_knots(world, truth, step_s * gain);
        }
    }

    fn pass_knots(&mut self, world: &World, truth: &DriveMoment, seconds_gain: f64) {
        let length_m = world.declared.length_m;
        let places = (length_m / UNDER_TRAIN_M).ceil() as usize + 1;
        let change_mps = -truth.direction * seconds_gain / places as f64;
        for place in 0..places {
            let under = place as f64 / (places - 1) as f64 - 0.5;
            let at = ((truth.place_m + under * length_m) / KNOT_M).max(0.0);
            let (knot, share) = (at as usize, at.fract());
            self.meet(world, Unknown::Knot(knot), change_mps * (1.0 - share));
            self.meet(world, Unknown::Knot(knot + 1), change_mps * share);
        }
    }

    fn measure(&mut self, world: &World, speed_mps: f64, count: f64) {
        let weight = count / world.scenario.speed_noise_mps.powi(2);
        // An error of the wheel diameter changes the measured speed in proportion, without memory of the motion before.
        let wheel = self.place(world, Unknown::Wheel);
        self.sensitivity[wheel] = speed_mps;
        for &i in &self.met {
            let scaled = weight * self.sensitivity[i];
            for &j in &self.met {
                self.information[(i, j)] += scaled * self.sensitivity[j];
            }
        }
        self.sensitivity[wheel] = 0.0;
    }

    /// Returns the least covariance of a, b, c in N/kN by powers of m/s and of the load, as a share of it.
    ///
    /// `None` without noise, where nothing limits it.
    pub fn covariance(&mut self, world: &World) -> Option<Matrix4<f64>> {
        let sought = [
            Unknown::Davis(0),
            Unknown::Davis(1),
            Unknown::Davis(2),
            Unknown::Load(self.loads(world)),
        ];
        let sought = sought.map(|unknown| self.place(world, unknown));
        let count = self.prior.len();
        let mut information = self.information.view((0, 0), (count, count)).into_owned();
        for (place, variance) in self.prior.iter().enumerate() {
            information[(place, place)] += 1.0 / variance;
        }
        let factor = information.cholesky()?;
        let columns = sought.map(|place| {
            let mut unit = DVector::zeros(count);
            unit[place] = 1.0;
            factor.solve(&unit)
        });
        let covariance = Matrix4::from_fn(|i, j| columns[j][sought[i]]);
        covariance.iter().all(|value| value.is_finite()).then_some(covariance)
    }
}
