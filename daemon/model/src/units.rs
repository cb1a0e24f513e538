//! The units a quantity may be in.
//!
//! Every unit converts to its dimension's base unit: SI, except °C for temperature, since that
//! is what a sample holds.

/// What a unit measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dimension {
    /// Base unit s.
    Time,
    /// Base unit m.
    Length,
    /// Base unit m/s.
    Speed,
    /// Base unit m/s2.
    Acceleration,
    /// Base unit N.
    Force,
    /// Base unit Pa.
    Pressure,
    /// Base unit kg.
    Mass,
    /// Base unit degC.
    Temperature,
    /// Base unit 1.
    Ratio,
    /// Base unit deg.
    Angle,
    /// Base unit 1/m.
    Curvature,
    /// Base unit W.
    Power,
    /// Base unit V.
    Voltage,
    /// Base unit A.
    Current,
    /// Things counted, and yes or no; base unit 1.
    Count,
}

/// A unit: base value = (value + shift) * multiply / divide.
///
/// A factor below one is kept as a divisor, so that a value written with few decimals converts
/// to the nearest double.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    name: &'static str,
    dimension: Dimension,
    shift: f64,
    multiply: f64,
    divide: f64,
}

/// Newtons in a pound-force: 0.45359237 kg at 9.80665 m/s² (NIST SP 811, appendix B.8).
const POUND_FORCE_N: f64 = 4.4482216152605;
/// Joules in a kilowatt hour.
pub const J_PER_KWH: f64 = 3.6e6;
/// Metres per second in a mile per hour: 1609.344 m in 3600 s.
const MILE_PER_HOUR_MPS: f64 = 0.44704;

static UNITS: [Unit; 38] = {
    use Dimension::*;
    [
        unit("s", Time, 1.0, 1.0),
        unit("ms", Time, 1.0, 1e3),
        unit("us", Time, 1.0, 1e6),
        unit("ns", Time, 1.0, 1e9),
        unit("min", Time, 60.0, 1.0),
        unit("h", Time, 3600.0, 1.0),
        unit("m", Length, 1.0, 1.0),
        unit("km", Length, 1e3, 1.0),
        unit("mm", Length, 1.0, 1e3),
        unit("m/s", Speed, 1.0, 1.0),
        unit("km/h", Speed, 1.0, 3.6),
        unit("mph", Speed, MILE_PER_HOUR_MPS, 1.0),
        unit("m/s2", Acceleration, 1.0, 1.0),
        unit("N", Force, 1.0, 1.0),
        unit("kN", Force, 1e3, 1.0),
        unit("MN", Force, 1e6, 1.0),
        unit("lbf", Force, POUND_FORCE_N, 1.0),
        unit("Pa", Pressure, 1.0, 1.0),
        unit("kPa", Pressure, 1e3, 1.0),
        unit("bar", Pressure, 1e5, 1.0),
        unit("kg", Mass, 1.0, 1.0),
        unit("t", Mass, 1e3, 1.0),
        unit("degC", Temperature, 1.0, 1.0),
        shifted("K", -273.15, 1.0, 1.0),
        shifted("degF", -32.0, 5.0, 9.0),
        unit("permille", Ratio, 1.0, 1e3),
        unit("%", Ratio, 1.0, 1e2),
        unit("1", Ratio, 1.0, 1.0),
        unit("deg", Angle, 1.0, 1.0),
        unit("rad", Angle, 180.0, std::f64::consts::PI),
        unit("1/m", Curvature, 1.0, 1.0),
        unit("W", Power, 1.0, 1.0),
        unit("kW", Power, 1e3, 1.0),
        unit("V", Voltage, 1.0, 1.0),
        unit("kV", Voltage, 1e3, 1.0),
        unit("A", Current, 1.0, 1.0),
        unit("kA", Current, 1e3, 1.0),
        unit("1", Count, 1.0, 1.0),
    ]
};

/// Name, dimension, factor and divisor to the base unit.
const fn unit(name: &'static str, dimension: Dimension, multiply: f64, divide: f64) -> Unit {
    Unit { name, dimension, shift: 0.0, multiply, divide }
}

const fn shifted(name: &'static str, shift: f64, multiply: f64, divide: f64) -> Unit {
    Unit { name, dimension: Dimension::Temperature, shift, multiply, divide }
}

impl Unit {
    /// The unit of a dimension with this name.
    pub fn find(dimension: Dimension, name: &str) -> Option<Unit> {
        Self::of(dimension).find(|unit| unit.name == name)
    }

    /// Every unit.
    pub fn all() -> impl Iterator<Item = Unit> {
        UNITS.iter().copied()
    }

    /// The units of a dimension.
    pub fn of(dimension: Dimension) -> impl Iterator<Item = Unit> {
        Self::all().filter(move |unit| unit.dimension == dimension)
    }

    /// The base unit of a dimension: the one without shift and scale.
    pub fn base_of(dimension: Dimension) -> Unit {
        Self::of(dimension)
            .find(|unit| unit.shift == 0.0 && unit.multiply == 1.0 && unit.divide == 1.0)
            .expect("every dimension has its base unit")
    }

    /// One of this unit in units of another of the same dimension, shifts left out.
    pub fn in_terms_of(&self, other: &Unit) -> f64 {
        self.multiply / self.divide * other.divide / other.multiply
    }

    /// The name, as written in a dataset.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// What the unit measures.
    pub fn dimension(&self) -> Dimension {
        self.dimension
    }

    /// A value in this unit, in the dimension's base unit.
    pub fn to_base(&self, value: f64) -> f64 {
        (value + self.shift) * self.multiply / self.divide
    }

    /// A value in the dimension's base unit, in this unit.
    pub fn from_base(&self, base: f64) -> f64 {
        base * self.divide / self.multiply - self.shift
    }

    /// A value in this unit, in another unit of the same dimension; exact for the same unit.
    pub fn convert(&self, value: f64, to: &Unit) -> f64 {
        if self.name == to.name { value } else { to.from_base(self.to_base(value)) }
    }
}

#[cfg(test)]
mod tests {
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
        assert_eq!(cases.len(), UNITS.len(), "one case for every unit");
        for (dimension, name, value, expected) in cases {
            assert_eq!(base(dimension, name, value), expected, "{value} {name}");
        }
    }

    #[test]
    fn conversion_there_and_back_is_the_identity() {
        for unit in UNITS {
            for value in [-40.0, 0.0, 0.1, 7.3, 1e4] {
                let back = unit.from_base(unit.to_base(value));
                assert!((back - value).abs() <= 1e-12 * (1.0 + value.abs()), "{}", unit.name);
            }
        }
    }

    #[test]
    fn a_unit_belongs_to_one_dimension() {
        assert_eq!(Unit::find(Dimension::Speed, "kN"), None);
        let names: Vec<_> = Unit::of(Dimension::Speed).map(|unit| unit.name()).collect();
        assert_eq!(names, ["m/s", "km/h", "mph"]);
    }

    #[test]
    fn a_value_in_its_own_unit_stays_as_it_is() {
        let permille = Unit::find(Dimension::Ratio, "permille").unwrap();
        let percent = Unit::find(Dimension::Ratio, "%").unwrap();
        assert_eq!(permille.convert(0.7, &permille), 0.7);
        assert!((percent.convert(2.5, &permille) - 25.0).abs() < 1e-14);
    }
}
