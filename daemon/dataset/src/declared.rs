//! Whether the declaration of a train and a line can be true.

use dynocar_core::plausibility::Severity;
use dynocar_core::plausibility::Severity::Warning;
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_model::train::numbers::LENGTH;
use dynocar_shared::SampleField;
use toml::Value;

use super::diagnostic::Diagnostic;
use super::keys::assign;
use super::quantity::Quantity;
use super::resolved::Resolved;
use super::unusual_resistance::unusual_resistance;

/// Masses per metre of train in t/m: from a light rail car to a loaded ore train, with a margin.
const MASS_PER_LENGTH_T_PER_M: (f64, f64) = (0.1, 20.0);
/// Lengths in m of a vehicle or a train; 1 m stands for a train taken as a point.
const LENGTH_M: (f64, f64) = (1.0, 8000.0);
const POINT_LENGTH_M: f64 = 1.0;
/// Greatest accelerations in m/s² by the effort curves.
const EFFORT_MPS2: (f64, f64) = (0.01, 10.0);
/// Basic resistances in N/kN at any speed.
const RESISTANCE_N_PER_KN: (f64, f64) = (0.05, 200.0);

/// Returns the impossible declarations of a train and its line.
pub fn misdeclared(train: &TrainModel, track: Option<&Track>) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    let say = |found: &mut Vec<Diagnostic>, is_wrong: bool, code: &'static str, text: String| {
        if is_wrong {
            found.push(Diagnostic::new(code, Severity::Fundamental, text, []));
        }
    };
    let is_outside = |value: f64, (low, high): (f64, f64)| !(low..=high).contains(&value);
    let (mass_t, length_m) = (train.mass_kg / 1000.0, train.length_m);
    let is_length = is_outside(length_m, LENGTH_M);
    say(
        &mut found,
        is_length,
        "length_scale",
        format!("a train of {}: is the length in m?", assign(LENGTH.name, length_m)),
    );
    let per_m = mass_t / length_m;
    say(
        &mut found,
        !is_length && length_m > POINT_LENGTH_M && is_outside(per_m, MASS_PER_LENGTH_T_PER_M),
        "mass_per_length",
        format!(
            "{mass_t} t on {length_m} m are {per_m:.2e} t/m: is mass_t in t (not kg), length_m in m?"
        ),
    );
    for (name, curve) in [("traction", &train.traction), ("brake", &train.brake)] {
        let Some(greatest_n) = curve.as_ref().map(|curve| curve.force_max_n()) else { continue };
        let greatest_mps2 = greatest_n / train.mass_kg;
        say(
            &mut found,
            greatest_n > 0.0 && is_outside(greatest_mps2, EFFORT_MPS2),
            "effort_scale",
            format!(
                "the [{name}] effort of {:.4} kN would move {mass_t} t at {greatest_mps2:.1e} \
                 m/s²: is it in kN, and mass_t in t?",
                greatest_n / 1000.0
            ),
        );
    }
    let top_mps = train.speed_max_mps().unwrap_or(20.0);
    let w0 = train.resistance.w0_n_per_kn(top_mps);
    say(
        &mut found,
        w0 != 0.0 && is_outside(w0, RESISTANCE_N_PER_KN),
        "resistance_scale",
        format!(
            "a, b and c give {w0:.2e} N/kN at {top_mps:.0} m/s: are they per kN of weight, with v \
             in m/s?"
        ),
    );
    if let (false, Some(text)) = (
        found.iter().any(|it| it.code == "resistance_scale"),
        unusual_resistance(&train.resistance, top_mps),
    ) {
        let text = format!("the resistance is {text}");
        found.push(Diagnostic::new("unusual_resistance", Severity::Warning, text, []));
    }
    let line_m = track.and_then(|track| track.length_m);
    say(
        &mut found,
        line_m.is_some_and(|line_m| line_m < length_m),
        "line_length",
        format!(
            "a line of {} m is shorter than the train: is length_m in m?",
            line_m.unwrap_or(0.0)
        ),
    );
    found
}

/// The bounds of the sample, beyond which validation refuses it, and of places on the earth.
const PLAUSIBLE: [(Quantity, (f64, f64)); 7] = [
    (Quantity::Acceleration, SampleField::Acceleration.range()),
    (Quantity::SpecificForce, SampleField::SpecificForce.range()),
    (Quantity::BrakeCylinderPressure, SampleField::BrakeCylinderPressure.range()),
    (Quantity::AmbientTemperature, SampleField::AmbientTemperature.range()),
    (Quantity::Gradient, SampleField::Gradient.range()),
    (Quantity::Latitude, (-90.0, 90.0)),
    (Quantity::Longitude, (-180.0, 180.0)),
];

/// Returns a diagnostic for each column with values that are refused.
pub(super) fn implausible_columns(run: &Resolved) -> Vec<Diagnostic> {
    let mut diagnostics = Vec::new();
    for (quantity, (low, high)) in PLAUSIBLE {
        let Some(column) = run.table.column(quantity) else { continue };
        let is_outside = |value: &&f64| !value.is_nan() && !(low..=high).contains(*value);
        let count = column.iter().filter(is_outside).count();
        if count > 0 {
            let unit = quantity.unit().name();
            let text = format!(
                "{quantity} lies outside {low} to {high} {unit} in {count} rows, and those samples \
                 are refused: is the unit right?"
            );
            let figures = [
                ("quantity", quantity.name().into()),
                ("count", Value::Integer(count as i64)),
                ("low", low.into()),
                ("high", high.into()),
                ("unit", unit.into()),
            ];
            diagnostics.push(Diagnostic::new("implausible", Warning, text, figures));
        }
    }
    diagnostics
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar_model::train::{BrakeGear, Davis, EffortCurve};

    fn codes(change: impl Fn(&mut TrainModel)) -> Vec<&'static str> {
        let mut train = TrainModel {
            name: String::new(),
            mass_kg: 200e3,
            length_m: 100.0,
            cars: 4,
            full_mass_kg: None,
            passenger_mass_kg: 70.0,
            rotating_mass_factor: 0.06,
            resistance: Davis { a: 1.8, b: 0.03, c: 0.0035 },
            curve_constant_n_per_kn_m: 600.0,
            tunnel_constant_n_per_kn_m: 0.0,
            traction: EffortCurve::new(vec![(0.0, 200e3), (40.0, 60e3)]),
            brake: EffortCurve::new(vec![(0.0, 220e3)]),
            drive: None,
            brake_gear: BrakeGear::default(),
            corrections: Default::default(),
            extra: Vec::new(),
        };
        change(&mut train);
        misdeclared(&train, None).into_iter().map(|it| it.code).collect()
    }

    #[test]
    fn a_declared_train_in_wrong_units_is_reported_and_another_is_not() {
        let none: [&str; 0] = [];
        assert_eq!(codes(|_| {}), none);
        assert_eq!(codes(|train| train.length_m = 1.0), none, "a point");
        assert_eq!(codes(|train| train.length_m = 0.1), ["length_scale"]);
        let heavy = ["mass_per_length", "effort_scale", "effort_scale"];
        assert_eq!(codes(|train| train.mass_kg *= 1e3), heavy);
        let curve = EffortCurve::new(vec![(0.0, 200e6)]);
        assert_eq!(codes(|train| train.traction.clone_from(&curve)), ["effort_scale"]);
        assert_eq!(codes(|train| train.resistance.a = 2400.0), ["resistance_scale"]);
        assert_eq!(codes(|train| train.resistance.a = 0.0018), ["unusual_resistance"]);
        assert_eq!(codes(|train| train.resistance.c *= 12.96), ["unusual_resistance"]);
    }
}
