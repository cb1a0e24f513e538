//! How well resistance and mass can be known at best: the joint Cramér–Rao bound of a drive.
//!
//! All that [`World::draw`] draws is unknown at once, each with the variance that it is drawn with:
//! a, b, c, the loads, the scales and the delay of forces, brakes from stop to stop, wheels, rotating
//! mass, the wind of the day, and gusts and the map's error at every knot. What measured speeds say of them follows
//! from how the true motion would differ.

use dynocar_core::pipeline::train_kalman::TrainKalmanSettings;
use dynocar_model::force::balance::mps2_per_n_per_kn;
use nalgebra::{DMatrix, DVector, Matrix4};

use super::drive::Moment;
use super::world::{
    GUST_S, KNOT_M, KNOT_OVER_MEAN, LoadSource, Scenario, WEIGHING_STD, World, knot_std_permille,
};

/// Indices of the unknowns that every run shares, behind a, b and c; loads, brakes of each leg, gusts and knots
/// follow.
const TRACTION_SCALE: usize = 3;
const BRAKE_SCALE: usize = 4;
const DELAY: usize = 5;
const ROTATING_MASS: usize = 6;
const WHEEL: usize = 7;
const WIND: usize = 8;
/// Time in s between the speeds that are taken in: those between say the same many times.
const BLOCK_S: f64 = 0.5;
/// Distance in m between the places under the train at which the map is averaged.
const UNDER_TRAIN_M: f64 = 50.0;
/// Variance that stands for what is known exactly.
const EXACT: f64 = 1e-18;
/// Standard deviation of a load that is drawn evenly from 24 % of the declared mass.
const DRAWN_LOAD_STD: f64 = 0.24 / 3.464;

/// Standard deviation in m/s of the speed at which a run begins to count.
const START_STD_MPS: f64 = 1.0;

/// Whether another load may be on board after a stop. Nobody knows that it is not, unless the mass is exact: a
/// weighing that did not change may be off by as much as any other.
fn may_change(scenario: &Scenario) -> bool {
    scenario.load != LoadSource::Exact
}

/// What measured speeds say so far of all that is unknown.
pub struct Bound {
    /// Variance beforehand of each unknown.
    prior: Vec<f64>,
    information: DMatrix<f64>,
    /// Change of the speed by each unknown, of the run under way.
    sensitivity: Vec<f64>,
    /// The unknowns that the run under way has met.
    met: Vec<usize>,
    is_met: Vec<bool>,
    /// The unknown load of the run under way, and its brake.
    load: usize,
    brake: usize,
    /// Where brakes, gusts and knots begin among the unknowns.
    brakes_from: usize,
    gusts_from: usize,
    knots_from: usize,
    /// Where the speeds at which runs begin to count stand among the unknowns, and that of the next run.
    starts_from: usize,
    start: usize,
    /// Speed in m/s from which speeds count, as for the estimator.
    speed_min_mps: f64,
    block_s: f64,
    last: Option<Moment>,
}

impl Bound {
    /// Before the first sample of a drive of so many hours.
    pub fn new(world: &World, hours: f64) -> Self {
        let scenario = &world.scenario;
        let load_std = match scenario.load {
            LoadSource::Exact => 0.0,
            LoadSource::Weighed(permille) => 1e-3 * f64::from(permille),
            LoadSource::Unknown => DRAWN_LOAD_STD,
            LoadSource::Changing => WEIGHING_STD,
        };
        // No train here stops more than once a minute.
        let legs = (60.0 * hours) as usize + 2;
        let loads = if may_change(scenario) { legs } else { 1 };
        let gusts = (3600.0 * hours / GUST_S) as usize + 3;
        let end_m = world.stops_m[world.stops_m.len() - 1] + 1000.0;
        let knots = (end_m / KNOT_M) as usize + 3;
        let (declared, usual) = (world.declared.resistance, &world.mistakes);
        let davis =
            [declared.a, declared.b, declared.c].map(|it| (usual.coefficient_share * it).powi(2));
        let mut prior = davis.to_vec();
        prior.extend([
            usual.force_share.powi(2),
            usual.force_share.powi(2) + usual.brake_share.powi(2),
            usual.delay_s.powi(2),
            usual.rotating_mass.powi(2),
            usual.wheel_share.powi(2),
            usual.wind_mps.powi(2),
        ]);
        let mut add = |count: usize, std: f64| {
            let from = prior.len();
            prior.resize(from + count, (std * std).max(EXACT));
            from
        };
        let load = add(loads, load_std);
        let brakes_from = add(legs, usual.stop_to_stop_share);
        let gusts_from = add(gusts, KNOT_OVER_MEAN * usual.gust_mps);
        let knots_from = add(knots, knot_std_permille(scenario.map_std_permille));
        let starts_from = add(legs, START_STD_MPS);
        let count = prior.len();
        Bound {
            prior,
            information: DMatrix::zeros(count, count),
            sensitivity: vec![0.0; count],
            met: Vec::new(),
            is_met: vec![false; count],
            load,
            brake: brakes_from,
            brakes_from,
            gusts_from,
            knots_from,
            starts_from,
            start: starts_from,
            speed_min_mps: TrainKalmanSettings::default().speed_min_mps,
            block_s: 0.0,
            last: None,
        }
    }

    /// Takes in a cycle of a drive.
    pub fn see(&mut self, world: &World, truth: &Moment, cycle_s: f64) {
        let last = self.last.replace(*truth);
        let was_standing = last.is_none_or(|last| last.is_standing);
        if truth.is_standing && !was_standing {
            self.brake = (self.brake + 1).min(self.gusts_from - 1);
            self.load =
                (self.load + usize::from(may_change(&world.scenario))).min(self.brakes_from - 1);
        }
        let least_mps = self.speed_min_mps;
        let counts = |at: &Moment| !at.is_standing && at.speed_mps >= least_mps;
        let Some(last) = last.filter(|last| counts(last) && counts(truth)) else {
            return self.begin();
        };
        if self.met.is_empty() {
            self.meet(self.start, 1.0);
            self.start = (self.start + 1).min(self.prior.len() - 1);
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

    fn meet(&mut self, index: usize, change_mps: f64) {
        if !std::mem::replace(&mut self.is_met[index], true) {
            self.met.push(index);
        }
        self.sensitivity[index] += change_mps;
    }

    /// What a step does to the speed by each unknown.
    fn move_on(&mut self, world: &World, last: &Moment, truth: &Moment, step_s: f64) {
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
        for (index, power) in powers.into_iter().enumerate() {
            self.meet(index, -step_s * gain * power);
        }
        self.meet(TRACTION_SCALE, -step_s * push_mps2.max(0.0));
        self.meet(BRAKE_SCALE, -step_s * push_mps2.min(0.0));
        self.meet(self.brake, -step_s * push_mps2.min(0.0));
        self.meet(WIND, truth.direction * step_s * gain * by_wind);
        let (knot, share) = truth.gust;
        self.meet(self.gusts_from + knot, -step_s * gain * by_wind * (1.0 - share));
        self.meet(self.gusts_from + knot + 1, -step_s * gain * by_wind * share);
        self.meet(DELAY, -(truth.push_mps2 - last.push_mps2));
        self.meet(
            ROTATING_MASS,
            -step_s * acceleration_mps2 / (1.0 + world.truth.rotating_mass_factor),
        );
        self.meet(WHEEL, 0.0);
        self.meet(self.load, step_s * push_mps2);
        if world.scenario.map_std_permille > 0.0 {
            self.pass_knots(world.declared.length_m, truth, step_s * gain);
        }
    }

    fn pass_knots(&mut self, length_m: f64, truth: &Moment, seconds_gain: f64) {
        let places = (length_m / UNDER_TRAIN_M).ceil() as usize + 1;
        let change_mps = -truth.direction * seconds_gain / places as f64;
        for place in 0..places {
            let under = place as f64 / (places - 1) as f64 - 0.5;
            let at = ((truth.place_m + under * length_m) / KNOT_M).max(0.0);
            let (knot, share) = (self.knots_from + at as usize, at.fract());
            if knot + 1 < self.starts_from {
                self.meet(knot, change_mps * (1.0 - share));
                self.meet(knot + 1, change_mps * share);
            }
        }
    }

    fn measure(&mut self, world: &World, speed_mps: f64, count: f64) {
        let weight = count / world.scenario.speed_noise_mps.powi(2);
        let by_run = std::mem::replace(&mut self.sensitivity[WHEEL], speed_mps);
        for &i in &self.met {
            let scaled = weight * self.sensitivity[i];
            for &j in &self.met {
                self.information[(i, j)] += scaled * self.sensitivity[j];
            }
        }
        self.sensitivity[WHEEL] = by_run;
    }

    /// The least covariance of a, b, c in N/kN by powers of m/s and of the load, as a share of it.
    ///
    /// `None` without noise, where nothing limits it.
    pub fn covariance(&self) -> Option<Matrix4<f64>> {
        let sought = [0, 1, 2, self.load];
        let known =
            |place: &usize| self.information[(*place, *place)] > 0.0 && !sought.contains(place);
        let places: Vec<usize> =
            sought.into_iter().chain((0..self.prior.len()).filter(known)).collect();
        let information = DMatrix::from_fn(places.len(), places.len(), |i, j| {
            let prior = if i == j { 1.0 / self.prior[places[i]] } else { 0.0 };
            prior + self.information[(places[i], places[j])]
        });
        let factor = information.cholesky()?;
        let columns: [DVector<f64>; 4] = std::array::from_fn(|column| {
            let mut unit = DVector::zeros(places.len());
            unit[column] = 1.0;
            factor.solve(&unit)
        });
        let covariance = Matrix4::from_fn(|i, j| columns[j][i]);
        covariance.iter().all(|value| value.is_finite()).then_some(covariance)
    }
}
