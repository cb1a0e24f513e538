//! Spellings of units.

use super::*;

#[test]
fn every_spelling_leads_to_its_unit() {
    for unit in UNITS {
        assert_eq!(Unit::spelled(unit.dimension, unit.name), Some(unit));
        for text in unit.spellings.split(' ').filter(|text| !text.is_empty()) {
            assert_eq!(fold(text), text, "spellings are folded");
            let found = Unit::spelled(unit.dimension, text).map(|unit| unit.name);
            assert_eq!(found, Some(unit.name), "{text}");
        }
    }
}

#[test]
fn units_are_known_as_loggers_spell_them() {
    use Dimension::*;
    let cases = [
        (Speed, "KM/H", "km/h"),
        (Speed, "km h⁻¹", "km/h"),
        (Speed, "kmh", "km/h"),
        (Speed, "m s-1", "m/s"),
        (Speed, "meters per second", "m/s"),
        (Speed, "knots", "kn"),
        (Speed, "миль", ""),
        (Acceleration, "m/s²", "m/s2"),
        (Force, "kn", "kN"),
        (Force, "daN", "daN"),
        (Force, "kgf", "kp"),
        (Force, "kips", "klbf"),
        (Pressure, "MPa", "MPa"),
        (Pressure, "mbar", "mbar"),
        (Temperature, "°C", "degC"),
        (Ratio, "‰", "permille"),
        (Ratio, "%", "%"),
        (Ratio, "°", "deg"),
        (Angle, "°", "deg"),
        (Time, "µs", "us"),
        (Power, "MW", "MW"),
        (Power, "horsepower", "hp"),
        (Mass, "kilograms", "kg"),
    ];
    for (dimension, text, name) in cases {
        let found = Unit::spelled(dimension, text).map_or("", |unit| unit.name);
        assert_eq!(found, name, "{text}");
    }
}

#[test]
fn what_is_no_unit_of_the_dimension_is_none() {
    assert_eq!(Unit::spelled(Dimension::Speed, "kN·m"), None);
    assert_eq!(Unit::spelled(Dimension::Force, "mN"), None);
    assert_eq!(Unit::spelled(Dimension::Speed, "kN"), None);
    assert_eq!(Unit::spelled(Dimension::Time, ""), None);
    assert!(["A", "kV", "1/min", "kN", "km/h"].into_iter().all(is_unit));
    assert!(!is_unit("GPS") && !is_unit("front"));
}
