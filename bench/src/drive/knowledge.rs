//! Beliefs of a driver about its train, and the train's abilities.

use dynocar_model::train::{Davis, EffortCurve};
use dynocar_shared::Uncertain;
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::stopping::{EffortPoint, RailAdhesion, Stop, StoppingError};

/// The parameters by which a driver plans, brakes and bounds its stops. Forces are counted as the train
/// reports them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knowledge {
    /// Gross mass in kg.
    pub mass_kg: Uncertain,
    /// gamma: inertial mass = mass (1 + gamma).
    pub rotating_mass_factor: f64,
    /// Basic resistance.
    pub davis: Davis,
    /// Standard deviation of w0 in N/kN at the speed of the moment.
    pub w0_std_n_per_kn: f64,
    /// Exerted over reported brake force.
    pub brake_scale: Uncertain,
    /// Adhesion of the rail, where it is known.
    pub rail: Option<RailAdhesion>,
}

/// Declared abilities of the train.
#[derive(Clone, Debug, PartialEq)]
pub struct Ability {
    /// Greatest traction force over speed.
    pub traction: EffortCurve,
    /// Greatest brake force in N.
    pub brake_max_n: f64,
    /// Deceleration in m/s² of an ordinary stop.
    pub braking_mps2: f64,
    /// Greatest change of a commanded acceleration in m/s³.
    pub jerk_mps3: f64,
    /// Time in s by which acting forces follow commanded ones.
    pub lag_s: f64,
}

impl Knowledge {
    /// Returns the mass with its rotating part in kg.
    pub fn inertial_kg(&self) -> f64 {
        self.mass_kg.value * (1.0 + self.rotating_mass_factor)
    }

    /// Returns the resistance and slope in N at a speed in m/s.
    pub fn resisting_n(&self, speed_mps: f64, slope_permille: f64) -> f64 {
        let weight_kn = 1e-3 * self.mass_kg.value * GRAVITY_MPS2;
        weight_kn * (self.davis.w0_n_per_kn(speed_mps) + slope_permille)
    }

    /// Returns the acceleration in m/s² under a force in N, braking negative.
    pub fn acceleration_mps2(&self, force_n: f64, speed_mps: f64, slope_permille: f64) -> f64 {
        let exerted_n = if force_n < 0.0 { self.brake_scale.value * force_n } else { force_n };
        (exerted_n - self.resisting_n(speed_mps, slope_permille)) / self.inertial_kg()
    }

    /// Returns the force in N, braking negative, that gives an acceleration in m/s².
    pub fn force_n(&self, acceleration_mps2: f64, speed_mps: f64, slope_permille: f64) -> f64 {
        let exerted_n =
            self.inertial_kg() * acceleration_mps2 + self.resisting_n(speed_mps, slope_permille);
        match exerted_n < 0.0 {
            true => exerted_n / self.brake_scale.value.max(0.1),
            false => exerted_n,
        }
    }

    /// Returns the deceleration in m/s² that brake and rail can give on the level at a speed in m/s.
    pub fn braking_max_mps2(&self, ability: &Ability, speed_mps: f64) -> f64 {
        let weight_n = self.mass_kg.value * GRAVITY_MPS2;
        let brake_n = ability.brake_max_n * self.brake_scale.value;
        let carried_n = match self.rail {
            None | Some(RailAdhesion::Unlimited) => f64::INFINITY,
            Some(RailAdhesion::Coefficient(it)) => weight_n * it.value,
            Some(RailAdhesion::Law(law, scale)) => weight_n * law.adhesion(speed_mps) * scale.value,
        };
        brake_n.min(carried_n) / self.inertial_kg()
    }

    /// Returns the distance in m of a full braking that is not exceeded with a confidence; `else_rail` is presumed
    /// where nothing is known of the rail.
    ///
    /// # Errors
    ///
    /// See [`StoppingError`].
    pub fn bound_m(
        &self,
        ability: &Ability,
        (from_speed_mps, slope_permille): (f64, f64),
        else_rail: RailAdhesion,
        confidence: f64,
    ) -> Result<f64, StoppingError> {
        let effort = [EffortPoint { speed_mps: 0.0, force_n: ability.brake_max_n }];
        let Davis { a, b, c } = self.davis;
        // A mass that is wrong acts on a stop as a brake that is.
        let mass_share = self.mass_kg.std / self.mass_kg.value;
        let scale = self.brake_scale;
        let stop = Stop {
            rotating_mass_factor: self.rotating_mass_factor,
            w0_std_n_per_kn: self.w0_std_n_per_kn,
            gradient_permille: slope_permille,
            brake_scale: Uncertain::new(scale.value, scale.std.hypot(scale.value * mass_share)),
            adhesion: self.rail.unwrap_or(else_rail),
            ..Stop::level(from_speed_mps, self.mass_kg.value, [a, b, c], &effort)
        };
        stop.estimate(confidence).map(|found| found.distance_bound_m)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::drive) fn metro() -> (Knowledge, Ability) {
        let knowledge = Knowledge {
            mass_kg: Uncertain::exact(230e3),
            rotating_mass_factor: 0.06,
            davis: Davis { a: 2.1, b: 0.02, c: 0.0016 },
            w0_std_n_per_kn: 0.0,
            brake_scale: Uncertain::exact(1.0),
            rail: None,
        };
        let traction = EffortCurve::new(vec![(0.0, 240e3), (8.0, 240e3), (20.0, 96e3)]);
        let ability = Ability {
            traction: traction.expect("rising speeds"),
            brake_max_n: 290e3,
            braking_mps2: 0.9,
            jerk_mps3: 0.6,
            lag_s: 0.5,
        };
        (knowledge, ability)
    }

    #[test]
    fn the_force_for_an_acceleration_gives_that_acceleration() {
        let (mut knowledge, _) = metro();
        knowledge.brake_scale.value = 0.9;
        for wanted in [-1.0, -0.2, 0.0, 0.4] {
            let force_n = knowledge.force_n(wanted, 12.0, -3.0);
            assert!((knowledge.acceleration_mps2(force_n, 12.0, -3.0) - wanted).abs() < 1e-12);
        }
    }

    #[test]
    fn a_bound_grows_with_what_is_not_known_and_a_slippery_rail_limits_the_brake() {
        let (exact, ability) = metro();
        let bound = |knowledge: &Knowledge| {
            knowledge.bound_m(&ability, (20.0, 0.0), RailAdhesion::Unlimited, 0.99).unwrap()
        };
        let unsure = Knowledge { mass_kg: Uncertain::new(230e3, 10e3), ..exact };
        assert!(bound(&unsure) > 1.05 * bound(&exact));
        let slippery = RailAdhesion::Coefficient(Uncertain::exact(0.06));
        let slippery = Knowledge { rail: Some(slippery), ..exact };
        let most = slippery.braking_max_mps2(&ability, 20.0);
        assert!((most - 0.06 * GRAVITY_MPS2 / 1.06).abs() < 1e-12, "{most}");
    }
}
