//! Conversions and spellings of units.

use super::*;

fn base(dimension: Dimension, name: &str, value: f64) -> f64 {
    Unit::find(dimension, name).unwrap().to_base(value)
}

#[test]
fn every_unit_converts_to_its_base() {
    use Dimension::*;
    let cases = [
        (Time, "s", 7.0, 7.0),
        (Time, "ms", 200.0, 0.2),
        (Time, "us", 5.0, 5e-6),
        (Time, "ns", 3.0, 3e-9),
        (Time, "min", 2.0, 120.0),
        (Time, "h", 0.5, 1800.0),
        (Length, "m", 12.5, 12.5),
        (Length, "km", 10.5788, 10578.8),
        (Length, "mm", 12.5, 0.0125),
        (Speed, "m/s", 3.0, 3.0),
        (Speed, "km/h", 72.0, 20.0),
        (Speed, "mph", 100.0, 44.704),
        (Acceleration, "m/s2", -0.7, -0.7),
        (Force, "N", 4.0, 4.0),
        (Force, "kN", 35.3, 35_300.0),
        (Force, "MN", 0.25, 250_000.0),
        (Force, "lbf", 1.0, 4.4482216152605),
        (Pressure, "Pa", 9.0, 9.0),
        (Pressure, "kPa", 103.2, 103_200.0),
        (Pressure, "bar", 1.046, 104_600.0),
        (Mass, "kg", 70.0, 70.0),
        (Mass, "t", 114.5, 114_500.0),
        (Temperature, "degC", 7.9, 7.9),
        (Temperature, "K", 273.15, 0.0),
        (Temperature, "degF", 212.0, 100.0),
        (Ratio, "permille", 3.0, 0.003),
        (Ratio, "%", 93.0, 0.93),
        (Ratio, "1", 0.4, 0.4),
        (Ratio, "deg", 180.0, std::f64::consts::PI),
        (Angle, "deg", 47.4, 47.4),
        (Angle, "rad", std::f64::consts::PI, 180.0),
        (Curvature, "1/m", -0.01, -0.01),
        (Power, "W", 5.0, 5.0),
        (Power, "kW", 1.5, 1500.0),
        (Voltage, "V", 750.0, 750.0),
        (Voltage, "kV", 1.5, 1500.0),
        (Current, "A", -40.0, -40.0),
        (Current, "kA", 0.5, 500.0),
        (Count, "1", 250.0, 250.0),
    ];
    let usual = UNITS.iter().filter(|unit| unit.is_usual).count();
    assert_eq!(cases.len(), usual, "one case for every usual unit");
    for (dimension, name, value, expected) in cases {
        assert_eq!(base(dimension, name, value), expected, "{value} {name}");
    }
}

#[test]
fn conversion_there_and_back_is_the_identity() {
    for &unit in UNITS {
        for value in [-40.0, 0.0, 0.1, 7.3, 1e4] {
            let back = unit.from_base(unit.to_base(value));
            assert!((back - value).abs() <= 1e-12 * (1.0 + value.abs()), "{}", unit.name);
        }
    }
}

#[test]
fn a_unit_belongs_to_one_dimension() {
    assert_eq!(Unit::find(Dimension::Speed, "kN"), None);
    let names: Vec<_> = Unit::usual_of(Dimension::Speed).map(|unit| unit.name()).collect();
    assert_eq!(names, ["m/s", "km/h", "mph"]);
}

#[test]
fn a_value_in_its_own_unit_stays_as_it_is() {
    let permille = Unit::find(Dimension::Ratio, "permille").unwrap();
    let percent = Unit::find(Dimension::Ratio, "%").unwrap();
    assert_eq!(permille.convert(0.7, &permille), 0.7);
    assert!((percent.convert(2.5, &permille) - 25.0).abs() < 1e-14);
}

#[test]
fn rare_units_convert_to_their_base() {
    use Dimension::*;
    let cases = [
        (Time, "d", 0.5, 43_200.0),
        (Time, "100ns", 2e6, 0.2),
        (Length, "ft", 10.0, 3.048),
        (Length, "mi", 1.0, 1609.344),
        (Speed, "kn", 100.0, 185.2 / 3.6),
        (Speed, "ft/s", 100.0, 30.48),
        (Acceleration, "g", 0.1, 0.980665),
        (Acceleration, "km/h/s", 3.6, 1.0),
        (Force, "kp", 1000.0, 9806.65),
        (Force, "tf", 1.0, 9806.65),
        (Force, "klbf", 1.0, 4448.2216152605),
        (Pressure, "psi", 14.5037737730, 1e5),
        (Pressure, "kgf/cm2", 3.8, 372_652.7),
        (Mass, "short ton", 100.0, 90_718.474),
        (Ratio, "deg", 1.0, 0.0174532925),
        (Power, "hp", 1000.0, 745_699.871582),
        (Power, "PS", 1000.0, 735_498.75),
    ];
    for (dimension, name, value, expected) in cases {
        let found = base(dimension, name, value);
        assert!((found / expected - 1.0).abs() < 1e-8, "{value} {name} = {found}");
    }
}

#[test]
fn every_spelling_leads_to_its_unit() {
    for &unit in UNITS {
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
