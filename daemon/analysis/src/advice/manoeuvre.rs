//! Manoeuvres on the level that a train can drive within its limits.

use std::fmt;

use dynocar_model::train::{Davis, TrainModel};

/// Lowest speed in m/s at which a manoeuvre begins or ends.
const SPEED_LOW_MPS: f64 = 2.0;
/// Speeds at which manoeuvres begin, as shares of the highest.
const SPEED_SHARES: [f64; 5] = [0.3, 0.45, 0.6, 0.8, 1.0];
/// Deceleration in m/s² of a service braking, where the train's brake gives it.
const SERVICE_BRAKING_MPS2: f64 = 0.5;
/// Highest speed in m/s that a manoeuvre asks of any train.
const SPEED_MAX_MPS: f64 = 125.0;

/// The train by the present estimates, with which a manoeuvre is computed.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// The declared train, mainly for its limits: effort curves and their highest speed.
    pub train: &'a TrainModel,
    /// The resistance as estimated.
    pub davis: Davis,
    /// Gross mass in kg.
    pub mass_kg: f64,
    /// Highest speed in m/s to ask for.
    pub speed_max_mps: f64,
}

impl<'a> Scene<'a> {
    /// Returns a train whose highest speed is that of its effort curves, lower where its traction no longer
    /// overcomes its resistance; without curves the highest that was driven, `speed_seen_mps`.
    pub fn new(train: &'a TrainModel, davis: Davis, mass_kg: f64, speed_seen_mps: f64) -> Self {
        let speed_max_mps =
            train.speed_max_mps().unwrap_or(speed_seen_mps).clamp(0.0, SPEED_MAX_MPS);
        let mut scene = Scene { train, davis, mass_kg, speed_max_mps };
        while scene.speed_max_mps > SPEED_LOW_MPS
            && scene
                .full_traction_n(scene.speed_max_mps)
                .is_some_and(|full_n| full_n <= scene.resistance_n(scene.speed_max_mps))
        {
            scene.speed_max_mps -= 1.0;
        }
        scene
    }

    /// Basic resistance in N at a speed.
    fn resistance_n(&self, speed_mps: f64) -> f64 {
        TrainModel::weight_kn(self.mass_kg) * self.davis.w0_n_per_kn(speed_mps)
    }

    fn full_traction_n(&self, speed_mps: f64) -> Option<f64> {
        Some(self.train.traction.as_ref()?.force_n(speed_mps))
    }

    fn service_brake_n(&self, speed_mps: f64) -> f64 {
        let wanted_n = SERVICE_BRAKING_MPS2 * self.inertial_mass_kg();
        self.train.brake.as_ref().map_or(wanted_n, |brake| brake.force_n(speed_mps).min(wanted_n))
    }

    /// mass (1 + gamma) in kg.
    pub fn inertial_mass_kg(&self) -> f64 {
        self.mass_kg * (1.0 + self.train.rotating_mass_factor)
    }

    /// Returns every manoeuvre that the train can drive within a time in s.
    pub fn catalogue(&self, within_s: f64) -> Vec<PlannedManoeuvre> {
        let top_mps = self.speed_max_mps.floor();
        let mut speeds: Vec<f64> =
            SPEED_SHARES.iter().map(|share| (share * top_mps).round()).collect();
        speeds.retain(|&speed_mps| speed_mps > SPEED_LOW_MPS);
        speeds.dedup();
        let has_traction = self.train.traction.is_some();
        let drive = |kind, from_mps, to_mps| PlannedManoeuvre { kind, from_mps, to_mps, within_s };
        let mut all = Vec::new();
        for &speed_mps in &speeds {
            all.push(drive(DriveKind::Coast, speed_mps, SPEED_LOW_MPS));
            all.push(drive(DriveKind::Brake, speed_mps, SPEED_LOW_MPS));
            if has_traction {
                all.push(drive(DriveKind::Hold, speed_mps, speed_mps));
            }
        }
        if let (true, Some(&low_mps)) = (has_traction, speeds.first()) {
            let below_top = || speeds.iter().filter(|&&speed_mps| speed_mps < top_mps);
            all.push(drive(DriveKind::Accelerate, SPEED_LOW_MPS, top_mps));
            all.extend(below_top().map(|&from| drive(DriveKind::Accelerate, from, top_mps)));
            all.push(drive(DriveKind::Sweep, low_mps, top_mps));
        }
        all
    }
}

/// A way to drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveKind {
    /// Neither traction nor brake.
    Coast,
    /// The speed held by traction.
    Hold,
    /// Full traction.
    Accelerate,
    /// A service braking.
    Brake,
    /// Full traction up to the highest speed, then coasting: the whole range of speeds.
    Sweep,
}

/// A manoeuvre: begins at one speed and ends at another or after a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedManoeuvre {
    /// How it is driven.
    pub kind: DriveKind,
    /// Speed in m/s at its start.
    pub from_mps: f64,
    /// Speed in m/s at which it ends, or turns to coasting in a sweep.
    pub to_mps: f64,
    /// The longest it takes, in s.
    pub within_s: f64,
}

/// A manoeuvre under way.
#[derive(Clone, Copy, Debug)]
pub struct ManoeuvreDriver {
    drive: PlannedManoeuvre,
    has_turned: bool,
}

impl PlannedManoeuvre {
    /// Begins it.
    pub fn begin(self) -> ManoeuvreDriver {
        ManoeuvreDriver { drive: self, has_turned: false }
    }

    /// In words, with the time in s and the speed in m/s that it ended with.
    pub fn in_words(&self, lasted_s: f64, end_mps: f64) -> String {
        let from = Speed(self.from_mps);
        match self.kind {
            DriveKind::Coast => format!("{lasted_s:.0} s coasting from {from}"),
            DriveKind::Hold => format!("{lasted_s:.0} s at a steady {from}"),
            DriveKind::Accelerate => {
                format!("full traction from {from} to {}, {lasted_s:.0} s", Speed(end_mps))
            }
            DriveKind::Brake => {
                format!("a service braking from {from} to {}, {lasted_s:.0} s", Speed(end_mps))
            }
            DriveKind::Sweep => format!(
                "full traction from {from} up to {}, then coasting, {lasted_s:.0} s in all",
                Speed(self.to_mps)
            ),
        }
    }
}

impl ManoeuvreDriver {
    /// Returns the traction minus brake in N at a speed; `None` when the manoeuvre is over.
    pub fn force_n(&mut self, scene: &Scene<'_>, speed_mps: f64) -> Option<f64> {
        let PlannedManoeuvre { kind, to_mps, .. } = self.drive;
        let full_n = || scene.full_traction_n(speed_mps);
        self.has_turned |= kind == DriveKind::Sweep && speed_mps >= to_mps;
        match kind {
            DriveKind::Coast => (speed_mps > to_mps).then_some(0.0),
            DriveKind::Brake => (speed_mps > to_mps).then(|| -scene.service_brake_n(speed_mps)),
            DriveKind::Hold => Some(scene.resistance_n(speed_mps).min(full_n()?)),
            DriveKind::Accelerate => (speed_mps < to_mps).then(full_n)?,
            DriveKind::Sweep if self.has_turned => (speed_mps > SPEED_LOW_MPS).then_some(0.0),
            DriveKind::Sweep => full_n(),
        }
    }
}

/// A speed as railways say it, too.
struct Speed(f64);

impl fmt::Display for Speed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.0} m/s ({:.0} km/h)", self.0, 3.6 * self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_model::train::EffortCurve;

    const DAVIS: Davis = Davis { a: 1.5, b: 0.01, c: 0.005 };

    fn train(traction_n: f64) -> TrainModel {
        TrainModel {
            traction: EffortCurve::new(vec![(0.0, traction_n), (40.0, traction_n)]),
            brake: EffortCurve::new(vec![(0.0, 30_000.0)]),
            ..TrainModel::bare("test", 100_000.0, DAVIS)
        }
    }

    #[test]
    fn no_manoeuvre_asks_for_more_than_the_train_has() {
        // 981 kN of weight: 6 kN overcome 6.1 N/kN, which is the resistance at 29.3 m/s.
        for (traction_n, highest_mps) in [(100_000.0, 40.0), (6_000.0, 29.0)] {
            let train = train(traction_n);
            let scene = Scene::new(&train, DAVIS, 100_000.0, 10.0);
            assert_eq!(scene.speed_max_mps, highest_mps);
            let all = scene.catalogue(60.0);
            assert!(all.len() > 15);
            for drive in all {
                assert!(drive.from_mps.max(drive.to_mps) <= highest_mps, "{drive:?}");
                let force_n = drive.begin().force_n(&scene, drive.from_mps).unwrap_or(0.0);
                assert!((-30_000.0..=traction_n).contains(&force_n), "{drive:?}: {force_n}");
            }
        }
    }

    #[test]
    fn a_train_without_declared_traction_is_asked_for_none() {
        let train = TrainModel::bare("test", 100_000.0, DAVIS);
        let scene = Scene::new(&train, DAVIS, 100_000.0, 20.0);
        let all = scene.catalogue(60.0);
        assert!(!all.is_empty());
        for drive in all {
            assert!(matches!(drive.kind, DriveKind::Coast | DriveKind::Brake), "{drive:?}");
            assert!(drive.from_mps <= 20.0, "no faster than was driven: {drive:?}");
        }
    }

    #[test]
    fn a_sweep_turns_to_coasting_at_the_highest_speed() {
        let train = train(100_000.0);
        let scene = Scene::new(&train, DAVIS, 100_000.0, 20.0);
        let kind = DriveKind::Sweep;
        let sweep = PlannedManoeuvre { kind, from_mps: 12.0, to_mps: 40.0, within_s: 180.0 };
        let mut driver = sweep.begin();
        assert_eq!(driver.force_n(&scene, 12.0), Some(100_000.0));
        assert_eq!(driver.force_n(&scene, 40.1), Some(0.0));
        assert_eq!(driver.force_n(&scene, 39.0), Some(0.0));
        assert_eq!(driver.force_n(&scene, 1.9), None);
        let words = sweep.in_words(170.4, 30.0);
        assert!(words.contains("up to 40 m/s (144 km/h)"), "{words}");
    }
}
