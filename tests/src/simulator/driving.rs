//! The declared train under a driver: the track is looked up at the simulated position.

use dynocar_model::simulate::motion::{Motion, advance};
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
    /// The forces from `time_s` on, given where the train is; `None` ends the run.
    fn controls(&mut self, time_s: f64, motion: Motion) -> Option<Controls>;
}

/// A closure (time in s, motion) to the forces.
impl<F: FnMut(f64, Motion) -> Option<Controls>> Driver for F {
    fn controls(&mut self, time_s: f64, motion: Motion) -> Option<Controls> {
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
    /// Chainage in m of the train's centre.
    pub fn position_m(&self, motion: Motion) -> f64 {
        self.start_m + self.direction * motion.distance_m
    }

    /// dv/dt in m/s² by the declared model; what is not known of the line counts as none there.
    ///
    /// At rest a negative value means that the train stays where it is.
    pub fn acceleration_mps2(&self, motion: Motion, controls: Controls) -> f64 {
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
    pub motion: Motion,
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
    let mut motion = Motion { distance_m: 0.0, speed_mps: 0.0 };
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

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_model::track::{Curve, Tunnel};
    use dynocar_model::train::Davis;

    fn train() -> TrainModel {
        let resistance = Davis { a: 1.6, b: 0.02, c: 0.003 };
        TrainModel {
            length_m: 150.0,
            rotating_mass_factor: 0.08,
            curve_constant_n_per_kn_m: 600.0,
            tunnel_constant_n_per_kn_m: 0.00013,
            ..TrainModel::bare("test", 200e3, resistance)
        }
    }

    fn track() -> Track {
        Track::new(
            "test".into(),
            None,
            Some(&[(0.0, 0.0), (1000.0, 8.0), (2500.0, -12.0)]),
            Some(vec![Curve { start_m: 1500.0, end_m: 1900.0, radius_m: 300.0 }]),
            Some(vec![Tunnel { start_m: 2600.0, end_m: 3000.0 }]),
        )
        .unwrap()
    }

    #[test]
    fn the_line_acts_with_the_sign_of_the_direction() {
        let (train, track) = (train(), track());
        let at = |start_m, direction| TrainOnLine {
            train: &train,
            track: Some(&track),
            mass_kg: 180e3,
            start_m,
            direction,
        };
        let still = Motion { distance_m: 0.0, speed_mps: 10.0 };
        let n_per_kn = |line: TrainOnLine<'_>| {
            -line.acceleration_mps2(still, Controls::default()) * 1000.0 * 1.08 / 9.81
        };
        let w0 = 1.6 + 0.2 + 0.3;
        assert!((n_per_kn(at(1200.0, 1.0)) - (w0 + 8.0)).abs() < 1e-9);
        assert!((n_per_kn(at(1200.0, -1.0)) - (w0 - 8.0)).abs() < 1e-9);
        assert!((n_per_kn(at(1700.0, -1.0)) - (w0 - 8.0 + 2.0)).abs() < 1e-9);
        assert!((n_per_kn(at(2800.0, 1.0)) - (w0 - 12.0 + 0.00013 * 400.0)).abs() < 1e-9);
    }

    #[test]
    fn a_train_on_a_slope_starts_only_with_enough_force_and_gains_its_work_as_energy() {
        let (train, track) = (train(), track());
        let line = TrainOnLine {
            train: &train,
            track: Some(&track),
            mass_kg: 200e3,
            start_m: 1100.0,
            direction: 1.0,
        };
        let with_traction = |traction_force_n: f64| {
            let mut driver = move |_, _| Some(Controls { traction_force_n, brake_force_n: 0.0 });
            drive(&line, &mut driver, 0.1, 40.0)
        };
        // Gradient and Davis a need 9.6 N/kN, that is 18.8 kN.
        assert!(with_traction(18e3).iter().all(|point| point.motion.distance_m == 0.0));
        let points = with_traction(60e3);
        let end = points[points.len() - 1].motion;
        assert_eq!(points.len(), 401);
        assert!(end.distance_m < 300.0, "still before the curve");
        let resisted_j: f64 = points
            .windows(2)
            .map(|pair| {
                let speed_mps = 0.5 * (pair[0].motion.speed_mps + pair[1].motion.speed_mps);
                let travelled_m = pair[1].motion.distance_m - pair[0].motion.distance_m;
                TrainModel::weight_kn(200e3)
                    * (train.resistance.w0_n_per_kn(speed_mps) + 8.0)
                    * travelled_m
            })
            .sum();
        let kinetic_j = 0.5 * 216e3 * end.speed_mps * end.speed_mps;
        let work_j = 60e3 * end.distance_m;
        assert!((work_j - resisted_j - kinetic_j).abs() < 1e-4 * work_j);
    }
}
