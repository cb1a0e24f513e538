//! Beliefs of a driver about its train, taken from the daemon's answers, whether they were right, and the train's abilities.

use dynocar_model::train::{Davis, EffortCurve};
use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use dynocar_shared::stopping::{EffortPoint, RailAdhesion, Stop, StoppingError};
use dynocar_shared::{Parameter, ParameterSnapshot, Quantity, Uncertain};

use super::train::Train;
use crate::scenarios::score::{Answer, COUNTS_MPS, QuantityScore};

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
        let weight_kn = 1e-3 * self.mass_kg.value * STANDARD_GRAVITY_MPS2;
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
        let weight_n = self.mass_kg.value * STANDARD_GRAVITY_MPS2;
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
        assert!((most - 0.06 * STANDARD_GRAVITY_MPS2 / 1.06).abs() < 1e-12, "{most}");
    }
}

/// Quantities that the driver asks for.
pub const ASKED: [Quantity; 4] =
    [Quantity::Resistance, Quantity::Mass, Quantity::BrakeFriction, Quantity::Adhesion];

fn value(snapshot: &ParameterSnapshot, parameter: Parameter) -> Option<Uncertain> {
    Some(Uncertain::new(snapshot.value(parameter)?, snapshot.std(parameter)?))
}

/// Returns the declared parameters with each usable answer in its place.
pub fn learned<'a>(
    declared: &Knowledge,
    declared_friction: f64,
    speed_mps: f64,
    usable: impl Fn(Quantity) -> Option<&'a ParameterSnapshot>,
) -> Knowledge {
    let mut known = *declared;
    if let Some(mass_t) = usable(Quantity::Mass).and_then(|it| value(it, Parameter::Mass)) {
        known.mass_kg = Uncertain::new(1e3 * mass_t.value, 1e3 * mass_t.std);
    }
    if let Some(snapshot) = usable(Quantity::Resistance)
        && let Some(at) = snapshot.resistance_at(speed_mps)
    {
        let davis = [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC];
        let [a, b, c] = davis.map(|parameter| snapshot.value(parameter).unwrap_or_default());
        // The resistance is that of still air; what the wind adds today is the unexplained force.
        let weight_kn = 1e-3 * known.mass_kg.value * STANDARD_GRAVITY_MPS2;
        let [unexplained, std] = [snapshot.unexplained_force_n, snapshot.unexplained_force_std_n]
            .map(|force_n| force_n / weight_kn);
        known.davis = Davis { a: a + unexplained, b, c };
        known.w0_std_n_per_kn = at.w0_std_n_per_kn.hypot(std);
    }
    // Where the rail carries less than the brake exerts, the brake shows nothing of itself.
    let rail = usable(Quantity::Adhesion).and_then(RailAdhesion::learned);
    let friction =
        usable(Quantity::BrakeFriction).and_then(|it| value(it, Parameter::DiscFriction));
    if rail.is_some() {
        known.rail = rail;
    } else if let Some(friction) = friction {
        // Only brake force over mass slows the train, and the friction presumes the declared mass.
        let share = known.mass_kg.value / (declared.mass_kg.value * declared_friction);
        known.brake_scale = Uncertain::new(share * friction.value, share * friction.std);
    }
    known
}

/// Answers of the last braking that a driver keeps for the next one: the daemon calls them stale once the train no
/// longer brakes, which is when the next braking is planned. No stop is bounded by them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AnswerMemory {
    brake_scale: Option<Uncertain>,
    rail: Option<RailAdhesion>,
    was_braking: bool,
    saw_rail: bool,
}

impl AnswerMemory {
    /// Returns the parameters by which the driver drives, from the answers usable now, by [`ASKED`].
    pub fn recall(
        &mut self,
        learned: &Knowledge,
        is_usable: [bool; 4],
        is_braking: bool,
    ) -> Knowledge {
        let mut known = *learned;
        if is_usable[2] && !is_usable[3] {
            self.brake_scale = Some(learned.brake_scale);
        } else if let Some(kept) = self.brake_scale {
            known.brake_scale = kept;
        }
        if is_usable[3] {
            (self.rail, self.saw_rail) = (learned.rail, true);
        } else {
            known.rail = self.rail;
        }
        if self.was_braking && !is_braking {
            // A whole braking that the rail did not limit.
            if !self.saw_rail {
                self.rail = None;
            }
            self.saw_rail = false;
        }
        self.was_braking = is_braking;
        known
    }
}

/// Takes in a cycle of the moving train: the declaration and the learned values, in the order of [`ASKED`]; brake and
/// adhesion count while the train brakes.
pub fn count(
    scores: &mut [QuantityScore; 4],
    train: &Train,
    is_braking: bool,
    declared: &Knowledge,
    learned: &Knowledge,
    is_usable: [bool; 4],
) {
    let speed_mps = train.speed_mps();
    if speed_mps < COUNTS_MPS {
        return;
    }
    let w0 = |davis: &Davis| davis.w0_n_per_kn(speed_mps);
    let adhesion = match learned.rail {
        Some(RailAdhesion::Law(law, scale)) => {
            let at = law.adhesion(speed_mps);
            Uncertain::new(at * scale.value, at * scale.std)
        }
        _ => Uncertain::exact(f64::NAN),
    };
    let w0_found = Uncertain::new(w0(&learned.davis), learned.w0_std_n_per_kn);
    let answers = [
        Answer::of(w0_found, w0(&declared.davis), w0(&train.davis())),
        Answer::of(learned.mass_kg, declared.mass_kg.value, train.mass_kg),
        Answer::of(learned.brake_scale, 1.0, train.brake_scale()),
        Answer::of(adhesion, f64::INFINITY, train.adhesion(speed_mps)),
    ];
    let cycle_ms = f64::from(train.service.cycle_ms);
    for (index, answer) in answers.into_iter().enumerate() {
        if index < 2 || is_braking {
            let score = &mut scores[index];
            let time_s = 1e-3 * (score.cycles + 1) as f64 * cycle_ms;
            score.push(time_s, 1e-3 * cycle_ms, is_usable[index].then_some(answer));
        }
    }
}
