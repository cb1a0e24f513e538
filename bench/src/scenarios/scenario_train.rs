//! Driving from stop to stop, and the samples that the controller writes.

use dynocar_model::simulate::motion::deceleration_mps2;
use dynocar_model::simulate::motion::{DeadTime, shown, slewed};
use dynocar_model::train::Davis;
use dynocar_shared::{SampleField, TrainId, TrainSample};

use super::brake::{Brake, BrakeReport, Friction};
use super::world::{
    BOARDING_STD_KG, GUST_S, Habits, KNOT_OVER_MEAN, LoadSource, ROOM_KG, WEIGHING_STD, World,
};

/// Steps of the simulation per cycle of the controller.
const STEPS: u32 = 10;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Standing { left_s: f64 },
    Driving,
    Coasting { left_s: f64 },
    Braking,
}

/// A moment of the drive: the written values, and the truth.
#[derive(Clone, Copy, Debug)]
pub struct DriveMoment {
    /// The sample of the controller.
    pub sample: TrainSample,
    /// Mass in kg.
    pub mass_kg: f64,
    /// Basic resistance in N/kN at the measured speed.
    pub w0_n_per_kn: f64,
    /// Speed in m/s.
    pub speed_mps: f64,
    /// True while the train stands at a stop.
    pub is_standing: bool,
    /// Acceleration in m/s² that the forces give.
    pub push_mps2: f64,
    /// Chainage in m of the train's centre.
    pub place_m: f64,
    /// 1 along growing chainage, else -1.
    pub direction: f64,
    /// Headwind in m/s, gusts included.
    pub headwind_mps: f64,
    /// Knots of the gusts so far, and how far it is to the next, as a share.
    pub gust: (usize, f64),
}

/// Returns the controller's cycle in s.
fn cycle_s(world: &World) -> f64 {
    1.0 / f64::from(world.scenario.rate_hz)
}

/// A train on its leg.
pub struct ScenarioTrain {
    world: World,
    habits: Habits,
    phase: Phase,
    next_stop: usize,
    now: DriveMoment,
    weighed_kg: f64,
    target_mps: f64,
    /// Acceleration in m/s² that the force gives, as commanded.
    commanded_mps2: f64,
    /// As demanded, before the limit of jerk.
    demanded_mps2: f64,
    friction: Friction,
    /// The reported acceleration, and how late it acts.
    reported_mps2: f64,
    dead_time: DeadTime<f64>,
    /// Step within a cycle at which a command acts.
    acts_at: u32,
    /// Exerted brake force over the assumed one, on this leg.
    brake_scale: f64,
    /// Gusts in m/s at the knots before and behind.
    gusts_mps: [f64; 2],
}

impl ScenarioTrain {
    /// Begins at the first stop.
    pub fn new(mut world: World) -> Self {
        let acts_at = world.random.within(0..STEPS);
        let mass_kg = world.truth.mass_kg;
        let mut drive = ScenarioTrain {
            habits: world.scenario.traffic.habits(),
            phase: Phase::Standing { left_s: 10.0 },
            next_stop: 1,
            now: DriveMoment {
                sample: TrainSample::empty(TrainId(1)),
                mass_kg,
                w0_n_per_kn: 0.0,
                speed_mps: 0.0,
                is_standing: true,
                push_mps2: 0.0,
                place_m: world.stops_m[0],
                direction: 1.0,
                headwind_mps: 0.0,
                gust: (0, 0.0),
            },
            weighed_kg: mass_kg,
            target_mps: 0.0,
            commanded_mps2: 0.0,
            demanded_mps2: 0.0,
            friction: Friction::default(),
            reported_mps2: 0.0,
            dead_time: DeadTime::new(world.delay_s, cycle_s(&world) / f64::from(STEPS)),
            acts_at,
            brake_scale: 1.0,
            gusts_mps: [0.0; 2],
            world,
        };
        drive.gusts_mps = [drive.next_gust_mps(), drive.next_gust_mps()];
        drive.weigh();
        drive
    }

    /// Returns the world that it drives in.
    pub fn world(&self) -> &World {
        &self.world
    }

    fn headwind_mps(&self) -> f64 {
        let ([from, to], (_, share)) = (self.gusts_mps, self.now.gust);
        from + share * (to - from) - self.now.direction * self.world.wind_mps
    }

    fn next_gust_mps(&mut self) -> f64 {
        KNOT_OVER_MEAN * self.world.mistakes.gust_mps * self.world.random.normal()
    }

    /// The gusts of a cycle later.
    fn blow(&mut self, cycle_s: f64) {
        self.now.gust.1 += cycle_s / GUST_S;
        if self.now.gust.1 >= 1.0 {
            self.now.gust = (self.now.gust.0 + 1, self.now.gust.1 - 1.0);
            self.gusts_mps = [self.gusts_mps[1], self.next_gust_mps()];
        }
    }

    fn weigh(&mut self) {
        let World { scenario, random, .. } = &mut self.world;
        self.weighed_kg = match scenario.load {
            LoadSource::Exact | LoadSource::Unknown | LoadSource::Passengers => self.now.mass_kg,
            // One weighing, wrong the same way for the whole drive.
            LoadSource::Weighed(permille) => {
                self.now.mass_kg * (1.0 + random.sign() * 1e-3 * f64::from(permille))
            }
            LoadSource::Changing => self.now.mass_kg * (1.0 + WEIGHING_STD * random.normal()),
        };
    }

    /// One cycle on.
    pub fn advance(&mut self) -> DriveMoment {
        let cycle_s = cycle_s(&self.world);
        self.command(cycle_s);
        self.blow(cycle_s);
        let step_s = cycle_s / f64::from(STEPS);
        let from_mps2 = self.reported_mps2;
        for step in 0..STEPS {
            self.reported_mps2 = if self.world.scenario.jumps {
                if step >= self.acts_at { self.commanded_mps2 } else { from_mps2 }
            } else {
                let share = f64::from(step + 1) / f64::from(STEPS);
                from_mps2 + share * (self.commanded_mps2 - from_mps2)
            };
            let brake = &self.world.scenario.brake;
            let told_mps2 = self.dead_time.pass(self.reported_mps2);
            let speed_mps = self.now.speed_mps;
            let acts_mps2 = self.friction.acts_mps2(brake, told_mps2, speed_mps, step_s);
            let before_mps2 = std::mem::replace(&mut self.now.push_mps2, acts_mps2);
            self.step(step_s, 0.5 * (before_mps2 + self.now.push_mps2));
        }
        self.measure();
        self.now
    }

    fn step(&mut self, step_s: f64, push_mps2: f64) {
        if matches!(self.phase, Phase::Standing { .. }) {
            return;
        }
        let truth = &self.world.truth;
        let gradient = self.now.direction * self.world.gradient_permille(self.now.place_m)[1];
        let gain = 9.806_65e-3 / (1.0 + truth.rotating_mass_factor);
        let Davis { a, b, c } = truth.resistance;
        let headwind_mps = self.headwind_mps();
        let acceleration = |speed_mps: f64| {
            let air_mps = speed_mps + headwind_mps;
            push_mps2 - gain * (gradient + a + b * speed_mps + c * air_mps * air_mps.abs())
        };
        let middle = self.now.speed_mps + 0.5 * step_s * acceleration(self.now.speed_mps);
        let next = (self.now.speed_mps + step_s * acceleration(middle)).max(0.0);
        self.now.place_m += self.now.direction * 0.5 * step_s * (self.now.speed_mps + next);
        self.now.speed_mps = next;
    }

    /// Sets the force that the driver commands.
    fn command(&mut self, cycle_s: f64) {
        let before_mps2 = self.commanded_mps2;
        self.decide(cycle_s);
        self.demanded_mps2 = self.commanded_mps2;
        if !self.world.scenario.jumps {
            let most = self.world.scenario.brake.jerk_mps3 * cycle_s;
            self.commanded_mps2 = slewed(before_mps2, self.commanded_mps2, most);
        }
    }

    fn decide(&mut self, cycle_s: f64) {
        let (most, brake) = self.habits.acceleration_mps2;
        let to_stop_m =
            self.now.direction * (self.world.stops_m[self.next_stop] - self.now.place_m);
        let needed = deceleration_mps2((self.now.speed_mps, 0.0), to_stop_m.max(0.5));
        if needed >= brake && !matches!(self.phase, Phase::Standing { .. }) {
            self.phase = Phase::Braking;
        }
        match &mut self.phase {
            Phase::Standing { left_s } => {
                let before_s = std::mem::replace(left_s, *left_s - cycle_s);
                let half_s = 0.5 * self.habits.standing_s;
                let (is_half, is_over) = (before_s > half_s && *left_s <= half_s, *left_s <= 0.0);
                self.commanded_mps2 = -self.habits.holding_mps2;
                if is_half {
                    self.board();
                }
                if is_over {
                    self.depart();
                }
            }
            Phase::Driving => {
                let power_mps = 0.4 * self.habits.top_mps;
                let limit = most * (power_mps / self.now.speed_mps.max(power_mps));
                let wanted = 0.3 * (self.target_mps - self.now.speed_mps) + 0.03;
                self.commanded_mps2 = wanted.clamp(-0.3 * brake, limit);
                let is_there = self.now.speed_mps > self.target_mps - 0.3;
                if is_there && self.world.random.uniform() < cycle_s / 60.0 {
                    let left_s = 15.0 + 60.0 * self.world.random.uniform();
                    self.phase = Phase::Coasting { left_s };
                }
            }
            Phase::Coasting { left_s } => {
                *left_s -= cycle_s;
                self.commanded_mps2 = 0.0;
                let is_slow = self.now.speed_mps < 0.75 * self.target_mps;
                let is_fast = self.now.speed_mps > 1.04 * self.target_mps;
                if *left_s <= 0.0 || is_slow || is_fast {
                    self.phase = Phase::Driving;
                }
            }
            Phase::Braking => {
                // Past the stop the train is brought to a stand, also downhill.
                let least = if to_stop_m < 0.0 { brake } else { 0.0 };
                self.commanded_mps2 = -needed.clamp(least, 1.3 * brake);
                let is_exact = self.world.scenario.brake == Brake::AS_TOLD;
                if self.now.speed_mps < 0.1 || (is_exact && to_stop_m < 0.3) {
                    self.arrive();
                }
            }
        }
    }

    fn depart(&mut self) {
        self.phase = Phase::Driving;
        let World { random, brake_scale, mistakes, .. } = &mut self.world;
        self.brake_scale = *brake_scale * (1.0 + mistakes.stop_to_stop_share * random.normal());
        self.commanded_mps2 = 0.0;
        self.target_mps = self.habits.top_mps * (0.75 + 0.25 * self.world.random.uniform());
    }

    /// Passengers leave and board, as far as there is room.
    fn board(&mut self) {
        let World { scenario, declared, random, .. } = &mut self.world;
        if scenario.load == LoadSource::Passengers {
            let changed_kg = self.now.mass_kg + BOARDING_STD_KG * random.normal();
            let most_kg = declared.mass_kg + ROOM_KG;
            self.now.mass_kg = changed_kg.clamp(declared.mass_kg, most_kg);
        }
    }

    fn arrive(&mut self) {
        self.now.speed_mps = 0.0;
        self.phase = Phase::Standing { left_s: self.habits.standing_s };
        (self.next_stop, self.now.direction) =
            self.world.after_stop(self.next_stop, self.now.direction);
        if self.world.scenario.load == LoadSource::Changing {
            let share = 0.24 * (self.world.random.uniform() - 0.5);
            self.now.mass_kg = self.world.declared.mass_kg * (1.0 + share);
            self.weigh();
        }
    }

    /// Writes the sample that the controller measures.
    fn measure(&mut self) {
        let headwind_mps = self.headwind_mps();
        let World { scenario, truth, force_scale, speed_scale, random, .. } = &mut self.world;
        let now = &mut self.now;
        now.headwind_mps = headwind_mps;
        now.is_standing = matches!(self.phase, Phase::Standing { .. });
        now.w0_n_per_kn = truth.resistance.w0_n_per_kn(now.speed_mps);
        let inertial_kg = now.mass_kg * (1.0 + truth.rotating_mass_factor);
        let force_n = self.reported_mps2 * inertial_kg;
        let noise_mps = scenario.speed_noise_mps * random.normal();
        let place_m = now.place_m + scenario.position_noise_m * random.normal();
        let measured_mps = shown(now.speed_mps, || *speed_scale * now.speed_mps + noise_mps);
        let braked = force_scale[1] / self.brake_scale;
        let sample = &mut now.sample;
        sample.sequence += 1;
        let cycle_ns = 1_000_000_000 / i64::from(scenario.rate_hz);
        sample.time_ns = 1_000_000_000 + cycle_ns * sample.sequence as i64;
        sample.direction = if now.direction > 0.0 { 1 } else { -1 };
        sample.set(SampleField::Speed, measured_mps);
        sample.set(SampleField::Position, place_m);
        sample.set(SampleField::TractionForce, force_scale[0] * force_n.max(0.0));
        let brake = &scenario.brake;
        let brake_n = match brake.reported {
            BrakeReport::Force | BrakeReport::Pressure => -force_n,
            BrakeReport::Demand => -inertial_kg * self.demanded_mps2,
            BrakeReport::ElectricForce => -force_n * Friction::electric_share(brake, now.speed_mps),
        };
        sample.set(SampleField::BrakeForce, braked * brake_n.max(0.0));
        if brake.reported == BrakeReport::Pressure {
            sample.set(SampleField::BrakeCylinderPressure, self.friction.pressure_pa());
        }
        if !matches!(scenario.load, LoadSource::Unknown | LoadSource::Passengers) {
            sample.set(SampleField::Mass, self.weighed_kg);
        }
        sample.set(SampleField::Gradient, self.world.gradient_permille(place_m)[0]);
    }
}
