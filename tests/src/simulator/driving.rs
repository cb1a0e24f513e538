//! The declared train under a driver: the track is looked up at the simulated position.

use dynocar_model::simulate::motion::{SimulatedMotion, advance};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;

/// Forces that a driver commands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Controls {
    /// Traction force in N, never negative.
    pub traction_force_n: f64,
    /// Brake force in N, retarding, never negative.
    pub brake_force_n: f64,
}

/// Decides on the forces.
pub trait Driver {
    /// Returns the forces from `time_s` on for the motion of the train; `None` ends the run.
    fn controls(&mut self, time_s: f64, motion: SimulatedMotion) -> Option<Controls>;
}

/// A closure from time in s and motion to the forces is a driver.
impl<F: FnMut(f64, SimulatedMotion) -> Option<Controls>> Driver for F {
    fn controls(&mut self, time_s: f64, motion: SimulatedMotion) -> Option<Controls> {
        self(time_s, motion)
    }
}

/// A declared train that runs along a line.
#[derive(Clone, Copy, Debug)]
pub struct TrainOnLine<'a> {
    /// The train.
    pub train: &'a TrainModel,
    /// The line; without one it is level and straight.
    pub track: Option<&'a Track>,
    /// Gross mass in kg of this run.
    pub mass_kg: f64,
    /// Chainage in m of the train's centre at the start.
    pub start_m: f64,
    /// +1 while the chainage grows in the direction of travel, -1 while it falls.
    pub direction: f64,
}

impl TrainOnLine<'_> {
    /// Returns the chainage in m of the train's centre.
    pub fn position_m(&self, motion: SimulatedMotion) -> f64 {
        self.start_m + self.direction * motion.distance_m
    }

    /// Returns dv/dt in m/s² by the declared model; unknown properties of the line count as absent.
    ///
    /// At rest a negative value means that the train stays where it is.
    pub fn acceleration_mps2(&self, motion: SimulatedMotion, controls: Controls) -> f64 {
        let train = self.train;
        let centre_m = self.position_m(motion);
        let on_track = |look_up: fn(&Track, f64, f64) -> Option<f64>| {
            self.track.and_then(|track| look_up(track, centre_m, train.length_m)).unwrap_or(0.0)
        };
        let tunnel_n_per_kn = match train.tunnel_constant_n_per_kn_m {
            0.0 => 0.0,
            constant => constant * on_track(Track::tunnel_length_m),
        };
        let n_per_kn = train.resistance.w0_n_per_kn(motion.speed_mps)
            + train.curve_constant_n_per_kn_m * on_track(Track::curvature_per_m)
            + tunnel_n_per_kn
            + self.direction * on_track(Track::gradient_permille);
        let force_n = controls.traction_force_n
            - controls.brake_force_n
            - TrainModel::weight_kn(self.mass_kg) * n_per_kn;
        force_n / (self.mass_kg * (1.0 + train.rotating_mass_factor))
    }
}

/// One instant of a driven run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrivenPoint {
    /// Time in s from the start.
    pub time_s: f64,
    /// Distance and speed.
    pub motion: SimulatedMotion,
    /// Forces from here to the next point.
    pub controls: Controls,
}

/// Runs a train from rest until its driver ends the run or `time_max_s` is over.
///
/// The forces hold over a step of `step_s`; the motion within it is by Heun's method.
pub fn drive(
    line: &TrainOnLine<'_>,
    driver: &mut impl Driver,
    step_s: f64,
    time_max_s: f64,
) -> Vec<DrivenPoint> {
    let mut points = Vec::new();
    let mut motion = SimulatedMotion { distance_m: 0.0, speed_mps: 0.0 };
    for k in 0.. {
        let time_s = k as f64 * step_s;
        let Some(controls) = driver.controls(time_s, motion) else { break };
        points.push(DrivenPoint { time_s, motion, controls });
        if time_s >= time_max_s {
            break;
        }
        motion = advance(motion, step_s, |_, at| line.acceleration_mps2(at, controls));
    }
    points
}
