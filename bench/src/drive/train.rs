//! The simulated train: its motion under a force, and the readings of its sensors. No estimator sees its true
//! parameters.

use dynocar_core::pipeline::braking::intake::DeclaredGear;
use dynocar_model::simulate::motion::{DeadTime, shown};
use dynocar_model::simulate::motion::{SimulatedMotion, advance};
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::{SampleField, TrainId, TrainSample, Uncertain};
use dynocar_tests::chance::Chance;

use super::deviations::{Hidden, Service, ability, declared_gear, next_load_kg};
use super::knowledge::{Ability, Knowledge};
use super::plan::{PIECE_M, PlannedLeg};
use crate::scenarios::world::{LoadSource, Mistakes, WEIGHING_STD, World};

/// Longest step of the simulation in s.
const STEP_MAX_S: f64 = 0.02;
/// Standard deviation in m of the balises' places before a stop.
const BALISE_STD_M: f64 = 0.08;
/// Mean time in s by which forces act later than they are reported.
const MEAN_DELAY_S: f64 = Mistakes::USUAL.mean_delay_s;

/// Returns the simulation's steps in a cycle, and the length of a step in s.
fn steps(service: &Service) -> (usize, f64) {
    let count = (service.cycle_s() / STEP_MAX_S).ceil();
    (count as usize, service.cycle_s() / count)
}

/// A train on its line.
pub struct Train {
    /// Its service.
    pub service: Service,
    world: World,
    hidden: Hidden,
    /// The declared model.
    pub declared: TrainModel,
    /// Brake gear as the daemon assumes it.
    pub gear: DeclaredGear,
    /// Declared abilities of the train.
    pub ability: Ability,
    seed: u64,
    random: Chance,
    next_stop: usize,
    direction: f64,
    start_m: f64,
    motion: SimulatedMotion,
    /// True gross mass in kg.
    pub mass_kg: f64,
    weighed_kg: f64,
    brake_scale: f64,
    balise_m: f64,
    /// Reported traction minus brake force in N, and how late it acts.
    reported_n: f64,
    dead_time: DeadTime<f64>,
    cycles: u64,
    /// Work in J of the traction at the rims since the last stop.
    pub energy_j: f64,
    legs: u64,
}

impl Train {
    /// Returns a train at the first stop.
    pub fn new(service: Service, seed: u64) -> Self {
        let world = World::draw(service.scenario(), Mistakes::USUAL, seed);
        let mut random = Chance::new(seed ^ 0x6472_6976_6572);
        let hidden = Hidden::draw(&service, &world, &mut random);
        let declared = service.declared();
        let start_m = world.stops_m[0];
        let mut train = Train {
            gear: declared_gear(&declared.brake_gear),
            declared,
            ability: ability(service.traffic),
            seed,
            random,
            next_stop: 1,
            direction: 1.0,
            start_m,
            motion: SimulatedMotion { distance_m: 0.0, speed_mps: 0.0 },
            mass_kg: world.truth.mass_kg,
            weighed_kg: 0.0,
            brake_scale: 1.0,
            balise_m: 0.0,
            reported_n: 0.0,
            dead_time: DeadTime::new(world.delay_s, steps(&service).1),
            cycles: 0,
            energy_j: 0.0,
            legs: 0,
            service,
            world,
            hidden,
        };
        train.load();
        train
    }

    /// Changes the load; every leg draws from its own seed, so that the load does not depend on the driver.
    fn load(&mut self) {
        self.legs += 1;
        let of_leg = self.seed ^ self.legs.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.random = Chance::new(of_leg);
        let random = &mut self.random;
        self.mass_kg = next_load_kg(self.service.traffic, self.mass_kg, random);
        let scale = match self.world.scenario.load {
            LoadSource::Changing => 1.0 + WEIGHING_STD * random.normal(),
            LoadSource::Weighed(permille) => {
                // One weighing, wrong the same way all day.
                let sign = if self.seed.is_multiple_of(2) { 1.0 } else { -1.0 };
                1.0 + sign * 1e-3 * f64::from(permille)
            }
            LoadSource::Exact | LoadSource::Unknown | LoadSource::Passengers => 1.0,
        };
        self.weighed_kg = scale * self.mass_kg;
        self.brake_scale =
            self.hidden.brake_scale * (1.0 + Mistakes::USUAL.stop_to_stop_share * random.normal());
        self.balise_m = BALISE_STD_M * random.normal();
        self.energy_j = 0.0;
    }

    /// Turns the train, which stands at a stop, to the next leg.
    pub fn turn_to_next(&mut self) {
        self.start_m = self.chainage_m();
        self.motion = SimulatedMotion { distance_m: 0.0, speed_mps: 0.0 };
        (self.next_stop, self.direction) = self.world.after_stop(self.next_stop, self.direction);
        self.load();
    }

    /// Returns the leg ahead by the map, without a time.
    pub fn leg(&self) -> PlannedLeg {
        let length_m = self.direction * (self.world.stops_m[self.next_stop] - self.start_m);
        let pieces = (length_m / PIECE_M) as usize + 2;
        let slope = |piece: usize| {
            let chainage_m = self.start_m + self.direction * PIECE_M * piece as f64;
            let curve =
                self.declared.curve_constant_n_per_kn_m * self.hidden.curvature_per_m(chainage_m);
            self.direction * self.world.gradient_permille(chainage_m)[0] + curve
        };
        let slopes_permille = (0..pieces).map(slope).collect();
        let top_mps = self.service.traffic.habits().top_mps;
        PlannedLeg { length_m, top_mps, due_s: f64::INFINITY, slopes_permille }
    }

    fn chainage_m(&self) -> f64 {
        self.start_m + self.direction * self.motion.distance_m
    }

    /// True distance to the stopping point in m.
    pub fn left_m(&self) -> f64 {
        self.direction * (self.world.stops_m[self.next_stop] - self.chainage_m())
    }

    /// True speed in m/s.
    pub fn speed_mps(&self) -> f64 {
        self.motion.speed_mps
    }

    /// Exerted over reported brake force on this leg.
    pub fn brake_scale(&self) -> f64 {
        self.brake_scale / self.world.force_scale[1]
    }

    /// Returns the true rail's adhesion at a speed in m/s.
    pub fn adhesion(&self, speed_mps: f64) -> f64 {
        let (law, scale) = self.hidden.rail;
        law.adhesion(speed_mps) * scale
    }

    /// True basic resistance in the direction of travel, in the open, with the wind of the day.
    pub fn davis(&self) -> Davis {
        let Davis { a, b, c } = self.world.truth.resistance;
        let head_mps = -self.direction * self.hidden.wind_mps;
        Davis { a: a + c * head_mps * head_mps, b: b + 2.0 * c * head_mps, c }
    }

    /// Returns the true parameters, counted in reported forces.
    pub fn truth(&self) -> Knowledge {
        let [traction, brake] = self.world.force_scale;
        // m dv/dt = reported / scale - W w is scale m dv/dt = reported - scale W w.
        Knowledge {
            mass_kg: Uncertain::exact(traction * self.mass_kg),
            rotating_mass_factor: self.world.truth.rotating_mass_factor,
            davis: self.davis(),
            w0_std_n_per_kn: 0.0,
            brake_scale: Uncertain::exact(self.brake_scale * traction / brake),
            rail: Some(self.hidden.adhesion()),
        }
    }

    /// Returns the acceleration in m/s² under a reported force in N at a distance and speed.
    fn acceleration_mps2(&self, reported_n: f64, at: SimulatedMotion) -> f64 {
        let weight_n = self.mass_kg * GRAVITY_MPS2;
        let force_n = match reported_n < 0.0 {
            true => {
                let brake_n = -reported_n * self.brake_scale();
                -brake_n.min(weight_n * self.adhesion(at.speed_mps))
            }
            false => reported_n / self.world.force_scale[0],
        };
        let chainage_m = self.start_m + self.direction * at.distance_m;
        let davis = self.davis();
        let air = davis.c * at.speed_mps * at.speed_mps * self.hidden.tunnel_share(chainage_m);
        let curve = self.hidden.curve_constant * self.hidden.curvature_per_m(chainage_m);
        let gradient = self.direction * self.world.gradient_permille(chainage_m)[1];
        let resisting = davis.w0_n_per_kn(at.speed_mps) + air + curve + gradient;
        (force_n - 1e-3 * weight_n * resisting)
            / (self.mass_kg * (1.0 + self.world.truth.rotating_mass_factor))
    }

    /// One cycle under a commanded force in N, braking negative; gives the acceleration in m/s² at its end.
    pub fn apply(&mut self, commanded_n: f64) -> f64 {
        let (steps, step_s) = steps(&self.service);
        // The reported force follows the command; the rest of the lag is the mean delay.
        let follow = 1.0 - (-step_s / (self.ability.lag_s - MEAN_DELAY_S)).exp();
        let mut acceleration = 0.0;
        for _ in 0..steps {
            self.reported_n += follow * (commanded_n - self.reported_n);
            let acting_n = self.dead_time.pass(self.reported_n);
            let before = self.motion;
            self.motion = advance(before, step_s, |_, at| self.acceleration_mps2(acting_n, at));
            acceleration = (self.motion.speed_mps - before.speed_mps) / step_s;
            let piece_m = self.motion.distance_m - before.distance_m;
            self.energy_j += piece_m * (acting_n / self.world.force_scale[0]).max(0.0);
        }
        self.cycles += 1;
        acceleration
    }

    /// True distance in m of a full braking from here.
    pub fn full_braking_m(&self) -> f64 {
        let full_n = -self.ability.brake_max_n;
        let mut at = self.motion;
        while at.speed_mps > 0.0 && at.distance_m < self.motion.distance_m + 50e3 {
            at = advance(at, 0.05, |_, at| self.acceleration_mps2(full_n, at));
        }
        at.distance_m - self.motion.distance_m
    }

    /// Returns the sample that the controller measures and writes.
    pub fn sample(&mut self) -> TrainSample {
        let World { scenario, speed_scale, .. } = &self.world;
        let speed_mps = shown(self.motion.speed_mps, || {
            speed_scale * self.motion.speed_mps + scenario.speed_noise_mps * self.random.normal()
        });
        let noise_m = scenario.position_noise_m * self.random.normal();
        let place_m = self.chainage_m() + self.balise_m + noise_m;
        let mut sample = TrainSample::empty(TrainId(1));
        sample.time_ns =
            1_000_000_000 + 1_000_000 * i64::from(self.service.cycle_ms) * self.cycles as i64;
        sample.direction = if self.direction > 0.0 { 1 } else { -1 };
        let brake_n = (-self.reported_n).max(0.0);
        sample.set(SampleField::Speed, speed_mps);
        sample.set(SampleField::Position, place_m);
        sample.set(SampleField::TractionForce, self.reported_n.max(0.0));
        sample.set(SampleField::BrakeForce, brake_n);
        sample.set(SampleField::BrakeCylinderPressure, brake_n / self.gear.declared_force_n(1.0));
        sample.set(SampleField::Gradient, self.world.gradient_permille(place_m)[0]);
        let curvature = self.hidden.curvature_per_m(place_m);
        sample.set(SampleField::CurveRadius, if curvature > 0.0 { 1.0 / curvature } else { 0.0 });
        if scenario.load != LoadSource::Unknown {
            sample.set(SampleField::Mass, self.weighed_kg);
        }
        sample
    }

    /// Returns the distance in m from the start of the way of a measured place.
    pub fn along_m(&self, sample: &TrainSample) -> f64 {
        self.direction * (sample.position_m - self.start_m)
    }

    /// Standing time at a stop in s: shortened, for nothing is learned meanwhile.
    pub fn standing_s(&self) -> f64 {
        self.service.traffic.habits().standing_s.min(30.0)
    }
}
