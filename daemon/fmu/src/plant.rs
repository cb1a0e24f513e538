//! The driven train, with the effects found: force in, speed out; and its variables.

use dynocar_analysis::driven::{Beginning, DrivenTrain, ForcePart};
use dynocar_model::simulate::motion::SPEED_MAX_MPS;
use dynocar_shared::SampleField;

use crate::error::ModelError;
use crate::files::Inputs;
use crate::variables;
use crate::variables::{
    Begins, DrivenValue, Interface, Meaning, ModelFile, Variable, digits, guid, measured, row,
};

/// The train itself.
pub const PLANT: Interface = Interface {
    identifier: "dynocar_train",
    name: "DynocarTrain",
    about: "A train with all that was found of it: traction and brake force in, speed out",
    step: "Each step moves the train by the law of dynocar explain, from the inputs at its \
        beginning and, where the simulator gives them, their slopes.",
    guid: digits(&GUID_DIGITS),
    variables: VARIABLES,
    takes_slopes: true,
};

pub(crate) const GUID_DIGITS: [u8; 16] =
    guid::<{ VARIABLES.len() }>(concat!("dynocar_train ", env!("CARGO_PKG_VERSION")), VARIABLES);

const fn force(name: &'static str, part: ForcePart, description: &'static str) -> Variable {
    row(name, Meaning::Driven(DrivenValue::Force(part)), variables::NEWTON, description)
}

#[rustfmt::skip]
const VARIABLES: &[Variable] = &[
    row("train_file", Meaning::File(ModelFile::Train), variables::NONE, "Path of the train's file; empty: the one inside the FMU"),
    row("track_file", Meaning::File(ModelFile::Track), variables::NONE, "Path of the line's file; empty: the one inside the FMU, if any"),
    row("initial_speed_mps", Meaning::Begins(Begins::Speed), variables::METRE_PER_SECOND, "True speed at the beginning, never negative"),
    row("initial_position_m", Meaning::Begins(Begins::Position), variables::METRE, "Chainage of the train's centre at the beginning"),
    row("held_at_rest", Meaning::Begins(Begins::HeldAtRest), variables::NONE, "Whether a brake, reported or not, holds the train while it stands and is not pulled"),

    measured("traction_force_n", SampleField::TractionForce, variables::NEWTON, "Traction force at the wheel rims as the controller reports it; missing: none"),
    measured("brake_force_n", SampleField::BrakeForce, variables::NEWTON, "Brake force, retarding, as the controller reports it; missing: none"),
    measured("mass_kg", SampleField::Mass, variables::KILOGRAM, "Gross mass without the rotating part; missing: the declared one"),
    measured("ambient_temperature_degc", SampleField::AmbientTemperature, variables::CELSIUS, "Outside temperature; missing: the last one, at first none is corrected for"),
    measured("position_m", SampleField::Position, variables::METRE, "Chainage at which the line is looked up; missing: the train's own, motion.position_m"),
    measured("gradient_permille", SampleField::Gradient, variables::PERMILLE, "Gradient, climbing positive as the chainage grows; for lines without a file; missing: level"),
    measured("curve_radius_m", SampleField::CurveRadius, variables::METRE, "Curve radius, 0 on straight track; for lines without a file"),
    row("direction", Meaning::Direction, variables::NONE, "+1 while the chainage grows in the direction of travel, -1 while it falls"),

    row("motion.speed_mps", Meaning::Driven(DrivenValue::Speed), variables::METRE_PER_SECOND, "True speed, never negative"),
    row("motion.measured_speed_mps", Meaning::Driven(DrivenValue::MeasuredSpeed), variables::METRE_PER_SECOND, "Speed as the train's own sensor shows it, by the scale of the speed that was found"),
    row("motion.position_m", Meaning::Driven(DrivenValue::Position), variables::METRE, "Chainage of the train's centre by its own motion"),
    row("motion.acceleration_mps2", Meaning::Driven(DrivenValue::Acceleration), variables::METRE_PER_SECOND_2, "dv/dt, 0 at rest"),
    row("motion.mass_kg", Meaning::Driven(DrivenValue::Mass), variables::KILOGRAM, "Gross mass, with what was found of it"),

    force("force.traction_n", ForcePart::Traction, "Traction force that acts, after the gain and the delay that were found"),
    force("force.brake_n", ForcePart::Brake, "Brake force that acts, after the delay that was found, retarding"),
    force("force.gradient_n", ForcePart::Gradient, "Weight along the gradient, retarding"),
    row("force.resistance_n", Meaning::Driven(DrivenValue::Resistance), variables::NEWTON, "Sum of all that follow, retarding"),
    force("force.basic_n", ForcePart::Basic, "Basic resistance by a, b and c"),
    force("force.curve_n", ForcePart::Curve, "Resistance of curves"),
    force("force.tunnel_n", ForcePart::Tunnel, "Resistance of tunnels"),
    force("force.wind_n", ForcePart::Wind, "What wind adds to the air resistance"),
    force("force.ambient_n", ForcePart::Ambient, "What the temperature adds to the basic resistance"),
    force("force.bearing_n", ForcePart::Bearing, "Resistance of cold bearings"),
    force("force.place_n", ForcePart::Location, "Resistance at places of the line"),
    force("force.other_n", ForcePart::Other, "Resistances of forms of their own"),
];

/// The beginning that nobody has set: at rest, where the line begins.
pub(crate) const BEGINNING: Beginning =
    Beginning { position_m: 0.0, speed_mps: 0.0, is_held_at_rest: true };

/// Returns the beginning with another value; `None` for a value that no train can begin with.
pub(crate) fn with_beginning(beginning: Beginning, what: Begins, value: f64) -> Option<Beginning> {
    match what {
        Begins::Speed if (0.0..=SPEED_MAX_MPS).contains(&value) => {
            Some(Beginning { speed_mps: value, ..beginning })
        }
        Begins::Position if value.is_finite() => Some(Beginning { position_m: value, ..beginning }),
        _ => None,
    }
}

/// A train is driven by numbers, has a mass, and goes one way or the other.
pub(crate) fn require_drivable(inputs: &Inputs) -> Result<(), ModelError> {
    let bad = |name, value, expected| Err(ModelError::BadValue { name, value, expected });
    let direction = inputs.sample.direction;
    if direction != 1 && direction != -1 {
        return bad("direction", direction.into(), "1 or -1");
    }
    for Variable { name, meaning, .. } in VARIABLES {
        let Meaning::Measured(field) = *meaning else { continue };
        match inputs.sample.get(field) {
            Some(value) if !value.is_finite() => return bad(name, value, "a finite number"),
            Some(value) if field == SampleField::Mass && value <= 0.0 => {
                return bad(name, value, "a mass in kg above 0");
            }
            _ => {}
        }
    }
    Ok(())
}

/// A longer step in s is refused: a simulator that skips hours has lost its way.
pub const STEP_MAX_S: f64 = 3600.0;

/// Returns the least step in s: with a shorter one, numbers that a dead time still needs would leave the memory.
pub(crate) fn least_step_s(train: &DrivenTrain) -> f64 {
    train.dead_time_s() / 1000.0
}

/// Returns a value of the train's motion; NaN where nothing has been balanced yet.
pub(crate) fn reported(train: &DrivenTrain, what: DrivenValue) -> f64 {
    let balance = train.balance();
    match what {
        DrivenValue::Speed => train.speed_mps(),
        DrivenValue::MeasuredSpeed => train.measured_speed_mps(),
        DrivenValue::Position => train.position_m(),
        DrivenValue::Acceleration => balance.map_or(f64::NAN, |it| it.acceleration_mps2()),
        DrivenValue::Mass => balance.map_or(f64::NAN, |it| it.mass_kg()),
        DrivenValue::Force(part) => balance.map_or(f64::NAN, |it| it.force_n(part)),
        DrivenValue::Resistance => balance.map_or(f64::NAN, |it| it.resistance_n()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_force_is_reported_under_one_name() {
        for part in ForcePart::ALL {
            let is_it = |it: &&Variable| it.meaning == Meaning::Driven(DrivenValue::Force(part));
            assert_eq!(VARIABLES.iter().filter(is_it).count(), 1, "{part:?}");
        }
    }
}
