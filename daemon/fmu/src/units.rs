//! The units of the variables, by the SI's base units.

/// A unit and what it is in base units, as the attributes of `BaseUnit`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Its name; empty for a number without a unit.
    pub name: &'static str,
    /// Exponents of the base units, factor and offset.
    pub base: &'static str,
}

impl Unit {
    const fn new(name: &'static str, base: &'static str) -> Self {
        Unit { name, base }
    }
}

/// A number without a unit.
pub const NONE: Unit = Unit::new("", "");
/// Length.
pub const METRE: Unit = Unit::new("m", r#"m="1""#);
/// Speed.
pub const METRE_PER_SECOND: Unit = Unit::new("m/s", r#"m="1" s="-1""#);
/// Acceleration.
pub const METRE_PER_SECOND_2: Unit = Unit::new("m/s2", r#"m="1" s="-2""#);
/// Force.
pub const NEWTON: Unit = Unit::new("N", r#"kg="1" m="1" s="-2""#);
/// Pressure.
pub const PASCAL: Unit = Unit::new("Pa", r#"kg="1" m="-1" s="-2""#);
/// Mass.
pub const KILOGRAM: Unit = Unit::new("kg", r#"kg="1""#);
/// Mass, 1000 kg.
pub const TONNE: Unit = Unit::new("t", r#"kg="1" factor="1000""#);
/// Temperature.
pub const CELSIUS: Unit = Unit::new("degC", r#"K="1" offset="273.15""#);
/// Gradient, m of height per km.
pub const PERMILLE: Unit = Unit::new("permille", r#"factor="0.001""#);
/// Davis a, and resistance per weight.
pub const NEWTON_PER_KILONEWTON: Unit = Unit::new("N/kN", r#"factor="0.001""#);
/// Davis b.
pub const DAVIS_B: Unit = Unit::new("N.s/(kN.m)", r#"m="-1" s="1" factor="0.001""#);
/// Davis c.
pub const DAVIS_C: Unit = Unit::new("N.s2/(kN.m2)", r#"m="-2" s="2" factor="0.001""#);

/// Every unit that has a name.
pub const ALL: [Unit; 12] = [
    METRE,
    METRE_PER_SECOND,
    METRE_PER_SECOND_2,
    NEWTON,
    PASCAL,
    KILOGRAM,
    TONNE,
    CELSIUS,
    PERMILLE,
    NEWTON_PER_KILONEWTON,
    DAVIS_B,
    DAVIS_C,
];
