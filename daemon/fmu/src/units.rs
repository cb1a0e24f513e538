//! The units of the variables, by the SI's base units.

/// A unit and what it is in base units, as the attributes of `BaseUnit`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FmiUnit {
    /// Its name; empty for a number without a unit.
    pub name: &'static str,
    /// Exponents of the base units, factor and offset.
    pub base: &'static str,
}

impl FmiUnit {
    const fn new(name: &'static str, base: &'static str) -> Self {
        FmiUnit { name, base }
    }
}

/// A number without a unit.
pub const NONE: FmiUnit = FmiUnit::new("", "");
/// Length.
pub const METRE: FmiUnit = FmiUnit::new("m", r#"m="1""#);
/// Speed.
pub const METRE_PER_SECOND: FmiUnit = FmiUnit::new("m/s", r#"m="1" s="-1""#);
/// Acceleration.
pub const METRE_PER_SECOND_2: FmiUnit = FmiUnit::new("m/s2", r#"m="1" s="-2""#);
/// Force.
pub const NEWTON: FmiUnit = FmiUnit::new("N", r#"kg="1" m="1" s="-2""#);
/// Pressure.
pub const PASCAL: FmiUnit = FmiUnit::new("Pa", r#"kg="1" m="-1" s="-2""#);
/// Mass.
pub const KILOGRAM: FmiUnit = FmiUnit::new("kg", r#"kg="1""#);
/// Mass, 1000 kg.
pub const TONNE: FmiUnit = FmiUnit::new("t", r#"kg="1" factor="1000""#);
/// Temperature.
pub const CELSIUS: FmiUnit = FmiUnit::new("degC", r#"K="1" offset="273.15""#);
/// Gradient, m of height per km.
pub const PERMILLE: FmiUnit = FmiUnit::new("permille", r#"factor="0.001""#);
/// Davis a, and resistance per weight.
pub const NEWTON_PER_KILONEWTON: FmiUnit = FmiUnit::new("N/kN", r#"factor="0.001""#);
/// Davis b.
pub const DAVIS_B: FmiUnit = FmiUnit::new("N.s/(kN.m)", r#"m="-1" s="1" factor="0.001""#);
/// Davis c.
pub const DAVIS_C: FmiUnit = FmiUnit::new("N.s2/(kN.m2)", r#"m="-2" s="2" factor="0.001""#);

/// Every unit that has a name.
pub const ALL: [FmiUnit; 12] = [
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
