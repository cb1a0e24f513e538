//! Conversion of the daemon's usable answers into the driver's parameters, and the errors of these answers.

use dynocar_model::train::Davis;
use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use dynocar_shared::stopping::RailAdhesion;
use dynocar_shared::{Parameter, ParameterSnapshot, Quantity, Uncertain};

use super::knowledge::Knowledge;
use super::train::Train;
use crate::scenarios::score::{Answer, COUNTS_MPS, QuantityScore};

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
        // The estimated resistance is that of still air; the wind of the day is part of the unexplained force.
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

/// Adds a cycle of the moving train to the scores of the declared and the learned parameters, in the order of
/// [`ASKED`]; brake and adhesion count while the train brakes.
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
