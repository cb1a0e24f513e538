//! Numbers of `train.toml`: one row declares a member of the train, its value where nothing is declared, and the key
//! by which every reader and writer of the file knows it.

use super::{EffortCurve, NumberRule};
use crate::terms::extra::ExtraResistance;

/// One number of a train, as `train.toml` declares it.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// The table that holds it.
    pub table: &'static str,
    /// Name of the number in that table.
    pub name: &'static str,
    /// Values that it may have.
    pub rule: NumberRule,
    /// Its member of a train.
    pub of: fn(&mut TrainModel) -> Member<'_>,
}

/// A member of a train that holds a number.
#[derive(Debug)]
pub enum Member<'t> {
    /// A member that has a value in any case.
    Number(&'t mut f64),
    /// A member that may be undeclared.
    Optional(&'t mut Option<f64>),
    /// A count.
    Count(&'t mut u32),
}

impl<'t> From<&'t mut f64> for Member<'t> {
    fn from(number: &'t mut f64) -> Self {
        Member::Number(number)
    }
}

impl<'t> From<&'t mut Option<f64>> for Member<'t> {
    fn from(number: &'t mut Option<f64>) -> Self {
        Member::Optional(number)
    }
}

impl<'t> From<&'t mut u32> for Member<'t> {
    fn from(count: &'t mut u32) -> Self {
        Member::Count(count)
    }
}

impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        (self.table, self.name) == (other.table, other.name)
    }
}

impl Key {
    /// Returns the number of a train, in the file's unit; `None` where it is undeclared.
    pub fn declared(&self, train: &TrainModel) -> Option<f64> {
        let number = match (self.of)(&mut train.clone()) {
            Member::Number(number) => Some(*number),
            Member::Optional(number) => *number,
            Member::Count(count) => Some((*count).into()),
        };
        number.map(|it| it / self.rule.factor)
    }

    /// Declares the number of a train, in the file's unit.
    pub fn set(&self, train: &mut TrainModel, value: f64) {
        let value = self.rule.factor * value;
        match (self.of)(train) {
            Member::Number(number) => *number = value,
            Member::Optional(number) => *number = Some(value),
            Member::Count(count) => *count = value as u32,
        }
    }
}

/// Declares the structs that hold numbers of a train. In front of a struct's rows stand the name of its value where
/// nothing is declared and how a train leads to it; a row is `member: type = that value => KEY, range`, with the
/// key's name where it is not the member's.
macro_rules! numbers {
    ($( $( #[$meta:meta] )* $name:ident ($none:ident) $at:tt {
        $( in $table:literal { $(
            $( #[doc = $doc:literal] )+
            $member:ident: $type:ty = $default:expr => $key:ident $( $as:literal )?, $rule:expr;
        )* } )*
        $( with { $(
            $( #[doc = $rest_doc:literal] )+
            $rest:ident: $rest_type:ty = $rest_default:expr;
        )* } )?
    } )*) => {
        $(
            $( #[$meta] )*
            pub struct $name {
                $( $( $( #[doc = $doc] )+ pub $member: $type, )* )*
                $( $( $( #[doc = $rest_doc] )+ pub $rest: $rest_type, )* )?
            }

            impl $name {
                /// Values where nothing is declared.
                pub const $none: $name = $name {
                    $( $( $member: $default, )* )*
                    $( $( $rest: $rest_default, )* )?
                };
            }

            impl Default for $name {
                fn default() -> Self {
                    $name::$none
                }
            }

            $( $(
                $( #[doc = $doc] )+
                pub const $key: Key = Key {
                    table: $table,
                    name: numbers!(@name $member $( $as )?),
                    rule: $rule,
                    of: |train| numbers!(@member train $at $member),
                };
            )* )*
        )*

        /// Every number of `train.toml`, table by table.
        pub const NUMBERS: &[&Key] = &[ $( $( $( &$key, )* )* )* ];
    };
    (@member $train:ident [$($at:tt)*] $member:ident) => { (&mut $train $($at)* .$member).into() };
    (@name $member:ident) => { stringify!($member) };
    (@name $member:ident $as:literal) => { $as };
}

numbers! {
    /// A train as declared: the content of a `train.toml`, in SI units.
    #[derive(Clone, Debug, PartialEq)]
    TrainModel (UNDECLARED) [] {
        in "train" {
            /// Nominal gross mass in kg, without the rotating part.
            mass_kg: f64 = 0.0 => MASS "mass_t",
                above(0.0, 1e5, "a mass in t above 0, at most 100000").times(1e3).required();
            /// Gross mass in kg with a full load, where it is declared; the nominal mass is the tare then.
            full_mass_kg: Option<f64> = None => FULL_MASS "mass_full_t",
                above(0.0, 1e5, "a mass in t above mass_t, at most 8 times that").times(1e3);
            /// Length in m.
            length_m: f64 = 0.0 => LENGTH,
                above(0.0, 1e4, "a length in m above 0, at most 10000").required();
            /// Number of cars.
            cars: u32 = 1 => CARS, within(1.0, 1e3, "a whole number from 1 to 1000").whole();
            /// Rotating-mass factor gamma: inertial mass = mass * (1 + gamma).
            rotating_mass_factor: f64 = 0.0 => ROTATING_MASS_FACTOR,
                within(0.0, 1.0, "a rotating-mass factor from 0 to 1").required();
            /// Mass of a passenger in kg, where passengers are counted; the nominal mass is empty then.
            passenger_mass_kg: f64 = 70.0 => PASSENGER_MASS, within(0.0, 200.0, "a mass in kg from 0 to 200");
        }
        in "resistance" {
            /// k in the declared curve resistance k/R in N/kN, R in m.
            curve_constant_n_per_kn_m: f64 = 600.0 => CURVE_CONSTANT, within(0.0, 5e3, "from 0 to 5000");
            /// Declared tunnel resistance in N/kN per metre of tunnel length while inside.
            tunnel_constant_n_per_kn_m: f64 = 0.0 => TUNNEL_CONSTANT, within(0.0, 1.0, "from 0 to 1").added();
        }
        with {
            /// Name for people.
            name: String = String::new();
            /// Declared basic resistance.
            resistance: Davis = Davis::NONE;
            /// Greatest traction force over speed.
            traction: Option<EffortCurve> = None;
            /// Greatest brake force over speed.
            brake: Option<EffortCurve> = None;
            /// The drive, where it is declared by its electric power.
            drive: Option<PowerTrain> = None;
            /// Brake gear, as far as declared.
            brake_gear: BrakeGear = BrakeGear::UNDECLARED;
            /// Corrections by measured runs.
            corrections: Corrections = Corrections::NONE;
            /// Resistances of forms of their own.
            extra: Vec<ExtraResistance> = Vec::new();
        }
    }

    /// Davis coefficients of the unit basic resistance w0(v) = a + b v + c v² in N/kN, v in m/s. Fitted ones may be
    /// negative one by one; forces in N instead of N/kN are far out.
    #[derive(Clone, Copy, Debug, PartialEq)]
    Davis (NONE) [.resistance] {
        in "resistance" {
            /// Speed-independent part in N/kN.
            a: f64 = 0.0 => DAVIS_A, within(-100.0, 100.0, "N/kN, from -100 to 100").required();
            /// Linear part in N/kN per m/s.
            b: f64 = 0.0 => DAVIS_B, within(-10.0, 10.0, "N/kN per m/s, from -10 to 10").required();
            /// Aerodynamic part in N/kN per (m/s)².
            c: f64 = 0.0 => DAVIS_C, within(-1.0, 1.0, "N/kN per (m/s)², from -1 to 1").required();
        }
    }

    /// A drive that is known by its electric power.
    ///
    /// Pulling, the wheels receive the efficiency's share of the drive's electric power; in regeneration the drive
    /// returns the same share of the wheels' power: force = efficiency P / v for P > 0 and P / (efficiency v) for P <
    /// 0.
    #[derive(Clone, Copy, Debug, PartialEq)]
    PowerTrain (USUAL) [.drive.get_or_insert(PowerTrain::USUAL)] {
        in "traction" {
            /// Mechanical power at the rims over the drive's electric power when it pulls, 0 to 1: unless a train
            /// says otherwise that of motors, converter and gear of the last decades, under load.
            efficiency: f64 = 0.85 => DRIVE_EFFICIENCY, within(0.3, 1.0, "a share from 0.3 to 1");
            /// Power in W that the vehicle takes in addition to its drive; 0 where the drive's own is recorded.
            auxiliary_power_w: f64 = 0.0 => AUXILIARY_POWER "auxiliary_power_kw",
                within(0.0, 2e3, "a power in kW from 0 to 2000").times(1e3);
            /// Speed in m/s below which no force is estimated: a drive that hardly turns turns most of its power
            /// into heat.
            speed_min_mps: f64 = 2.0 => POWER_SPEED_MIN "power_speed_min_mps",
                within(0.5, 20.0, "a speed in m/s from 0.5 to 20");
        }
    }

    /// Brake gear, for adhesion, disc friction and braking ratio (Xie 2019, Jin 2020).
    #[derive(Clone, Debug, PartialEq)]
    BrakeGear (UNDECLARED) [.brake_gear] {
        in "brake" {
            /// Diameter of a brake cylinder in mm.
            cylinder_diameter_mm: Option<f64> = None => CYLINDER_DIAMETER, SIZE_MM;
            /// Mean friction radius of a brake disc in mm.
            disc_radius_mm: Option<f64> = None => DISC_RADIUS, SIZE_MM;
            /// Wheel radius in mm.
            wheel_radius_mm: Option<f64> = None => WHEEL_RADIUS, SIZE_MM;
            /// Efficiency of the brake rigging, 0 to 1.
            efficiency: Option<f64> = None => RIGGING_EFFICIENCY, SHARE;
            /// Braking ratio: lever ratio from cylinder to pad.
            ratio: Option<f64> = None => BRAKING_RATIO, above(0.0, 100.0, "above 0, at most 100");
            /// Friction coefficient between pad and disc.
            friction: Option<f64> = None => FRICTION, SHARE;
            /// Number of brake pads on the train.
            pads: Option<f64> = None => PADS, within(1.0, 1e5, "from 1 to 100000");
        }
        with {
            /// Force of the friction brake from its pressure, where the force is not recorded.
            friction_brake: Option<FrictionBrake> = None;
            /// How its units differ and fail, where that is declared.
            components: Option<BrakeComponents> = None;
        }
    }

    /// A friction brake that is known by its pressure: force = gain * (pressure - release pressure).
    #[derive(Clone, Copy, Debug, PartialEq)]
    FrictionBrake (USUAL) [.brake_gear.friction_brake.get_or_insert(FrictionBrake::USUAL)] {
        in "brake" {
            /// Force of the whole train in N for each Pa above the release pressure.
            force_per_pressure_n_per_pa: f64 = 0.0 => FORCE_PER_PRESSURE, within(0.0, 1e3, "N/Pa from 0 to 1000");
            /// Pressure in Pa up to which the brake is released.
            release_pressure_pa: f64 = 20e3 => RELEASE_PRESSURE,
                within(0.0, 1e6, "a pressure in Pa from 0 to 1e6");
        }
    }

    /// The units of a brake, each of which gives the same share of its force: how they differ, from one to the
    /// next and from stop to stop, and how often one fails. Standard deviations are relative.
    #[derive(Clone, Copy, Debug, PartialEq)]
    BrakeComponents (NONE) [.brake_gear.components.get_or_insert(BrakeComponents::NONE)] {
        in "brake" {
            /// Number of units that fail one by one.
            units: u32 = 0 => BRAKE_UNITS, within(1.0, 1e4, "a number of units from 1 to 10000");
            /// Standard deviation of a unit's friction.
            friction_std: f64 = 0.0 => FRICTION_STD, RELATIVE_STD;
            /// Standard deviation of a unit's pressure.
            pressure_std: f64 = 0.0 => PRESSURE_STD, RELATIVE_STD;
            /// Standard deviation of a unit's efficiency.
            efficiency_std: f64 = 0.0 => EFFICIENCY_STD, RELATIVE_STD;
            /// Standard deviation of the errors that all units have in common, such as weather or a batch of pads.
            common_std: f64 = 0.0 => COMMON_STD, RELATIVE_STD;
            /// Standard deviation of the train's mass.
            mass_std: f64 = 0.0 => MASS_STD, RELATIVE_STD;
            /// Probability that a unit gives nothing in a stop.
            failure_probability: f64 = 0.0 => FAILURE_PROBABILITY, within(0.0, 0.5, "a probability from 0 to 0.5");
        }
    }

    /// Effects of a train and its sensors that a declared model usually lacks, as far as they are
    /// known.
    #[derive(Clone, Copy, Debug, PartialEq)]
    Corrections (NONE) [.corrections] {
        in "corrections" {
            /// Measured over true speed, by another wheel diameter than declared.
            speed_scale: f64 = 1.0 => SPEED_SCALE, within(0.8, 1.25, "from 0.8 to 1.25").multiplied();
            /// Delay of the measured speed in s.
            speed_delay_s: f64 = 0.0 => SPEED_DELAY, within(0.0, 5.0, "from 0 to 5 s").added();
            /// And then follows the true one with this time constant in s.
            speed_lag_s: f64 = 0.0 => SPEED_LAG, within(0.0, 5.0, "from 0 to 5 s").added();
            /// Reported over true traction force.
            traction_gain: f64 = 1.0 => TRACTION_GAIN, within(0.5, 2.0, "from 0.5 to 2").multiplied();
            /// Reported over true brake force.
            brake_gain: f64 = 1.0 => BRAKE_GAIN, within(0.5, 2.0, "from 0.5 to 2").multiplied();
            /// Delay of the reported brake force alone in s, beyond that of both forces.
            brake_delay_s: f64 = 0.0 => BRAKE_DELAY, within(0.0, 6.0, "from 0 to 6 s").added();
            /// And then builds up and releases with this time constant in s.
            brake_lag_s: f64 = 0.0 => BRAKE_LAG, within(0.0, 10.0, "from 0 to 10 s").added();
            /// Delay of the reported forces in s.
            actuator_delay_s: f64 = 0.0 => ACTUATOR_DELAY, within(0.0, 6.0, "from 0 to 6 s").added();
            /// And then build up with this time constant in s.
            actuator_lag_s: f64 = 0.0 => ACTUATOR_LAG, within(0.0, 10.0, "from 0 to 10 s").added();
            /// Factor on c v² for the part of the train in tunnels.
            tunnel_c_factor: f64 = 1.0 => TUNNEL_C_FACTOR, within(0.0, 100.0, "from 0 to 100").multiplied();
            /// Addition to c for the part of the train in tunnels, in N/kN per (m/s)²: found in this form, since c
            /// itself may hardly be known.
            tunnel_dc_n_per_kn_per_mps2: f64 = 0.0 => TUNNEL_DC,
                within(-0.2, 0.2, "from -0.2 to 0.2 N/kN per (m/s)²").added();
            /// Headwind in m/s for the direction of growing chainage, outside tunnels.
            wind_plus_mps: f64 = 0.0 => WIND_PLUS, within(-50.0, 50.0, "from -50 to 50 m/s").added();
            /// Further a in N/kN of cold bearings at the start.
            bearing_delta_a_n_per_kn: f64 = 0.0 => BEARING_DELTA_A, within(0.0, 50.0, "from 0 to 50 N/kN").added();
            /// Time constant in s with which they warm up.
            bearing_tau_s: f64 = 300.0 => BEARING_TAU, within(1.0, 1e5, "from 1 to 100000 s");
            /// Relative change of the basic resistance per kelvin.
            ambient_w0_per_k: f64 = 0.0 => AMBIENT_W0, within(-0.1, 0.1, "from -0.1 to 0.1 per kelvin").added();
            /// Temperature in K at which the basic resistance holds: the standard atmosphere's 15 °C.
            ambient_reference_k: f64 = 288.15 => AMBIENT_REFERENCE, within(200.0, 350.0, "from 200 to 350 K");
        }
    }
}

const fn within(least: f64, greatest: f64, allowed: &'static str) -> NumberRule {
    NumberRule::within(least, greatest, allowed)
}

const fn above(below: f64, greatest: f64, allowed: &'static str) -> NumberRule {
    NumberRule::above(below, greatest, allowed)
}

const SIZE_MM: NumberRule = above(0.0, 2e3, "a size in mm above 0, at most 2000");
const SHARE: NumberRule = above(0.0, 1.0, "above 0, at most 1");
const RELATIVE_STD: NumberRule = within(0.0, 0.5, "a relative standard deviation from 0 to 0.5");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_a_key_of_its_own_that_leads_to_its_member() {
        for (at, key) in NUMBERS.iter().enumerate() {
            assert!(!NUMBERS[..at].contains(key), "{}.{}", key.table, key.name);
            let mut train = TrainModel::UNDECLARED;
            key.set(&mut train, key.rule.range[1]);
            assert!(train != TrainModel::UNDECLARED, "{}", key.name);
            assert_eq!(key.declared(&train), Some(key.rule.range[1]), "{}", key.name);
        }
    }
}
