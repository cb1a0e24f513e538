//! How units are spelled in headers.

use dynocar_model::units::{Dimension, Unit};

/// A unit that a header names: one of the dataset's units, and the factor that leads to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spelled {
    /// The unit that a dataset takes.
    pub unit: Unit,
    /// Cells times this are in the unit; 1 for the unit itself.
    pub scale: f64,
}

impl From<Unit> for Spelled {
    fn from(unit: Unit) -> Self {
        Spelled { unit, scale: 1.0 }
    }
}

/// How headers spell a dataset's units besides their names, with or without the marks in them, and multiples of these
/// units: dimension, name, the factor that leads to it, spellings in small letters and digits.
const SPELLINGS: &[(Dimension, &str, f64, &str)] = {
    use Dimension::*;
    &[
        (Time, "s", 1.0, "sec secs second seconds sek sekunden sekunde"),
        (Time, "ms", 1.0, "msec millis millisec milliseconds millisekunden"),
        (Time, "us", 1.0, "usec micros microseconds mikrosekunden"),
        (Time, "ns", 1.0, "nsec nanos nanoseconds"),
        (Time, "min", 1.0, "mins minute minutes minuten"),
        (Time, "h", 1.0, "hr hour hours std stunden"),
        (Length, "m", 1.0, "meter meters metre metres mtr"),
        (Length, "km", 1.0, "kilometer kilometers kilometre kilometres"),
        (Length, "mm", 1.0, "millimeter millimetre millimeters"),
        (Speed, "m/s", 1.0, "mps mpers ms1 mpersec metrespersecond msec"),
        (Speed, "km/h", 1.0, "kph kmph kmperh kmh1 kmhr kmperhour kmstd"),
        (Speed, "mph", 1.0, "miph milesperhour mih"),
        (Acceleration, "m/s2", 1.0, "mps2 mss mpss mpers2 ms msec2"),
        (Force, "N", 1.0, "newton newtons"),
        (Force, "kN", 1.0, "kilonewton kilonewtons"),
        (Force, "MN", 1.0, "meganewton"),
        (Force, "lbf", 1.0, "lb lbs"),
        (Pressure, "Pa", 1.0, "pascal"),
        (Pressure, "kPa", 1.0, "kilopascal"),
        (Pressure, "bar", 1.0, "bars barg"),
        (Mass, "kg", 1.0, "kilogram kilograms kgs"),
        (Mass, "t", 1.0, "to ton tons tonne tonnes tonnen"),
        (Temperature, "degC", 1.0, "c celsius gradc grad cel"),
        (Temperature, "K", 1.0, "kelvin"),
        (Temperature, "degF", 1.0, "f fahrenheit"),
        (Ratio, "permille", 1.0, "promille permil mmm mperkm mkm"),
        (Ratio, "%", 1.0, "pct percent prozent perc pc"),
        (Ratio, "1", 1.0, "pu ratio rad mm"),
        (Angle, "deg", 1.0, "degree degrees grad"),
        (Angle, "rad", 1.0, "radian radians"),
        (Curvature, "1/m", 1.0, "perm m1"),
        (Power, "W", 1.0, "watt watts"),
        (Power, "kW", 1.0, "kilowatt"),
        (Count, "1", 1.0, "bool flag count pax persons"),
        (Length, "m", 0.01, "cm"),
        (Length, "m", 0.3048, "ft feet foot"),
        (Length, "km", 1.609344, "mi mile miles"),
        (Speed, "m/s", 0.01, "cms cmps"),
        (Speed, "km/h", 1.852, "kn kt kts knot knots"),
        (Acceleration, "m/s2", 9.80665, "g gn"),
        (Force, "N", 10.0, "dan"),
        (Pressure, "Pa", 100.0, "hpa mbar"),
        (Pressure, "kPa", 1000.0, "mpa"),
        (Pressure, "kPa", 6.894757, "psi"),
        (Power, "kW", 1000.0, "mw megawatt"),
    ]
};

/// Units of things that a dataset has no quantity for.
const FOREIGN: &str = "ma mv hz khz rpm umin 1min nm knm kwh wh mwh j kj mj l lmin db ppm kva ohm";

/// The unit of a dimension that is spelled so. The dataset's own names come first, then case
/// distinguishes nothing (but mN is no MN).
pub fn find(dimension: Dimension, text: &str) -> Option<Spelled> {
    let text = text.trim();
    let plain = |unit: Unit| Some(Spelled::from(unit));
    match (dimension, text) {
        (Dimension::Ratio, "‰" | "0/00" | "o/oo") => return plain(unit(dimension, "permille")),
        (Dimension::Ratio | Dimension::Count, "-" | "") => return plain(unit(dimension, "1")),
        (Dimension::Angle, "°") => return plain(unit(dimension, "deg")),
        (Dimension::Pressure, "MPa") | (Dimension::Power, "MW") => {
            return spelled(dimension, &text.to_lowercase());
        }
        // Nobody's train pulls with thousandths of a newton or a watt.
        (Dimension::Force, "mN") | (Dimension::Power, "mW") => return None,
        _ => {}
    }
    let exact = Unit::of(dimension).find(|unit| unit.name() == text);
    // kN are no knots: capitals distinguish units of different things.
    let has_capital = text.chars().any(char::is_uppercase);
    if exact.is_none() && has_capital && Unit::all().any(|unit| unit.name() == text) {
        return None;
    }
    let folded = fold(text);
    if folded.is_empty() {
        return exact.and_then(plain);
    }
    let like = || Unit::of(dimension).find(|unit| fold(unit.name()) == folded);
    exact.or_else(like).and_then(plain).or_else(|| spelled(dimension, &folded))
}

fn spelled(dimension: Dimension, folded: &str) -> Option<Spelled> {
    let is_it = |&&(of, .., list): &&(Dimension, &str, f64, &str)| {
        of == dimension && list.split(' ').any(|spelling| spelling == folded)
    };
    let (_, name, scale, _) = SPELLINGS.iter().find(is_it)?;
    Some(Spelled { unit: unit(dimension, name), scale: *scale })
}

fn unit(dimension: Dimension, name: &str) -> Unit {
    Unit::find(dimension, name).unwrap_or_else(|| Unit::base_of(dimension))
}

/// True for the spelling of any unit, of a dataset's or of another thing's.
pub fn is_unit(text: &str) -> bool {
    FOREIGN.split(' ').any(|unit| unit == fold(text))
        || Unit::all().any(|unit| find(unit.dimension(), text).is_some())
}

/// Small letters and digits only.
fn fold(text: &str) -> String {
    let digits = |letter: char| match letter {
        '¹' => '1',
        '²' => '2',
        '³' => '3',
        'µ' | 'μ' => 'u',
        letter => letter,
    };
    let letters = text.chars().map(digits).flat_map(char::to_lowercase);
    letters.filter(|letter| letter.is_alphanumeric()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_leads_to_a_unit_of_its_dimension() {
        for &(dimension, name, scale, spellings) in SPELLINGS {
            assert!(Unit::find(dimension, name).is_some(), "{name}");
            assert!(scale > 0.0);
            for text in spellings.split(' ') {
                assert_eq!(fold(text), text, "spellings are folded");
                let found = find(dimension, text).expect(text);
                assert_eq!((found.unit.name(), found.scale), (name, scale), "{text}");
            }
        }
        for unit in Unit::all() {
            let found = find(unit.dimension(), unit.name()).unwrap();
            assert_eq!((found.unit, found.scale), (unit, 1.0));
        }
    }

    #[test]
    fn common_spellings_are_known() {
        use Dimension::*;
        let cases = [
            (Speed, "KM/H", "km/h", 1.0),
            (Speed, "km h⁻¹", "km/h", 1.0),
            (Speed, "kmh", "km/h", 1.0),
            (Speed, "m s-1", "m/s", 1.0),
            (Acceleration, "m/s²", "m/s2", 1.0),
            (Force, "kn", "kN", 1.0),
            (Force, "daN", "N", 10.0),
            (Pressure, "MPa", "kPa", 1000.0),
            (Pressure, "mbar", "Pa", 100.0),
            (Temperature, "°C", "degC", 1.0),
            (Ratio, "‰", "permille", 1.0),
            (Ratio, "%", "%", 1.0),
            (Angle, "°", "deg", 1.0),
            (Time, "µs", "us", 1.0),
            (Power, "MW", "kW", 1000.0),
        ];
        for (dimension, text, name, scale) in cases {
            let found = find(dimension, text).map(|it| (it.unit.name(), it.scale));
            assert_eq!(found, Some((name, scale)), "{text}");
        }
    }

    #[test]
    fn what_is_no_unit_of_the_dimension_is_none() {
        assert_eq!(find(Dimension::Speed, "kN·m"), None);
        assert_eq!(find(Dimension::Force, "mN"), None);
        assert_eq!(find(Dimension::Speed, "kN"), None);
        assert_eq!(find(Dimension::Time, ""), None);
        assert!(["A", "kV", "1/min", "kN", "km/h"].into_iter().all(is_unit));
        assert!(!is_unit("GPS") && !is_unit("front"));
    }
}
