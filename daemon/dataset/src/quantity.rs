//! Quantities of a dataset.

use dynocar_model::named;
use dynocar_model::units::{Dimension, Unit};
use dynocar_shared::SampleField;
use serde::Serialize;

/// Declares the quantities: the description of each, its name in a dataset, the dimension of its units, and the field
/// of a sample that it fills, if any.
macro_rules! quantities {
    ($( #[doc = $doc:literal] $item:ident $name:literal $dimension:ident $(=> $field:ident)?; )*) => {
        named! {
            /// Quantity of a column of a run; in the order of the documentation.
            #[derive(Hash, PartialOrd, Ord, Serialize)]
            #[serde(rename_all = "snake_case")]
            Quantity ("in a dataset's `[columns]`") { $( #[doc = $doc] $item $name; )* }
        }

        impl Quantity {
            /// Returns the dimension of its units.
            pub const fn dimension(self) -> Dimension {
                match self { $( Quantity::$item => Dimension::$dimension ),* }
            }

            /// Returns the field of a sample that it fills.
            pub fn field(self) -> Option<SampleField> {
                match self { $( Quantity::$item => None$(.or(Some(SampleField::$field)))? ),* }
            }
        }
    };
}

quantities! {
    /// Time of the measurement, from any origin.
    Time "time" Time;
    /// Chainage of the train.
    Position "position" Length => Position;
    /// Speed in the direction of travel, never negative.
    Speed "speed" Speed => Speed;
    /// dv/dt.
    Acceleration "acceleration" Acceleration => Acceleration;
    /// Reading of an accelerometer along the track: dv/dt + g * gradient.
    SpecificForce "specific_force" Acceleration => SpecificForce;
    /// Traction force, never negative.
    TractionForce "traction_force" Force => TractionForce;
    /// Retarding force of the brakes, never negative.
    BrakeForce "brake_force" Force => BrakeForce;
    /// Traction minus brake force.
    ControlForce "control_force" Force;
    /// Share of the traction effort curve, 0 to 1.
    TractionHandle "traction_handle" Ratio;
    /// Share of the brake effort curve, 0 to 1.
    BrakeHandle "brake_handle" Ratio;
    /// Brake-cylinder pressure.
    BrakeCylinderPressure "brake_cylinder_pressure" Pressure => BrakeCylinderPressure;
    /// The train's gross mass.
    TrainMass "train_mass" Mass => Mass;
    /// Number of passengers.
    Passengers "passengers" Count;
    /// Outside temperature.
    AmbientTemperature "ambient_temperature" Temperature => AmbientTemperature;
    /// Relative humidity of the air.
    RelativeHumidity "relative_humidity" Ratio;
    /// Gradient, climbing positive as the chainage grows.
    Gradient "gradient" Ratio => Gradient;
    /// Height of the track.
    Altitude "altitude" Length;
    /// Radius of the curve; 0 or infinite on straight track, the sign does not count.
    CurveRadius "curve_radius" Length => CurveRadius;
    /// Speed of the wind.
    WindSpeed "wind_speed" Speed;
    /// 1 while the wheel-slide protection is active, else 0.
    WheelSlide "wheel_slide" Count;
    /// Geographical latitude by GNSS (WGS 84).
    Latitude "latitude" Angle;
    /// Geographical longitude by GNSS (WGS 84).
    Longitude "longitude" Angle;
    /// Course over ground by GNSS, clockwise from north.
    Course "course" Angle;
    /// Curvature of the way as measured by a yaw gyro or the steering; turning left is positive.
    Curvature "curvature" Curvature;
    /// 1 while a door is open, else 0.
    DoorOpen "door_open" Count;
    /// Power of the traction drive, regeneration negative.
    TractionPower "traction_power" Power;
    /// Power taken from the line, regeneration negative.
    LinePower "line_power" Power;
    /// Voltage of the line.
    LineVoltage "line_voltage" Voltage;
    /// Current taken from the line, regeneration negative.
    LineCurrent "line_current" Current;
}

impl Quantity {
    /// Returns the quantity that fills a field of a sample; `None` for a field that no column holds.
    pub fn of_field(field: SampleField) -> Option<Self> {
        Self::ALL.into_iter().find(|it| it.field() == Some(field))
    }

    /// Returns whether the parts of a train have each their own, which add up to the whole train's.
    pub fn adds_up(self) -> bool {
        use Quantity::*;
        matches!(
            self,
            TractionForce
                | BrakeForce
                | ControlForce
                | TractionPower
                | LinePower
                | LineCurrent
                | Passengers
                | TrainMass
        )
    }

    /// Returns the unit in which it is held once read: the base unit of its dimension, but ‰ for the
    /// gradient.
    pub fn unit(self) -> Unit {
        let name = match self {
            Quantity::Gradient => "permille",
            _ => return Unit::base_of(self.dimension()),
        };
        Unit::find(self.dimension(), name).expect("a unit of the quantity's dimension")
    }
}

impl std::fmt::Display for Quantity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_lead_back_to_their_quantity() {
        for quantity in Quantity::ALL {
            assert_eq!(Quantity::from_name(quantity.name()), Some(quantity));
        }
        assert_eq!(Quantity::from_name("velocity"), None);
    }

    #[test]
    fn the_held_unit_is_the_base_but_for_the_gradient() {
        for quantity in Quantity::ALL {
            let (unit, expected) =
                (quantity.unit(), if quantity == Quantity::Gradient { 5e-3 } else { 5.0 });
            assert_eq!(unit.to_base(5.0), expected, "{quantity}");
        }
    }
}
