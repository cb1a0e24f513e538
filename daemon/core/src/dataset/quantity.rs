//! The canonical quantities of a dataset.

use serde::Serialize;

use super::units::{Dimension, Unit};

/// What a column of a run may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Time of the measurement, from any origin.
    Time,
    /// Chainage of the train.
    Position,
    /// Speed in the direction of travel, never negative.
    Speed,
    /// dv/dt.
    Acceleration,
    /// What an accelerometer reads along the track: dv/dt + g * gradient.
    SpecificForce,
    /// Traction force, never negative.
    TractionForce,
    /// Retarding force of the brakes, never negative.
    BrakeForce,
    /// Traction minus brake force.
    ControlForce,
    /// Share of the traction effort curve, 0 to 1.
    TractionHandle,
    /// Share of the brake effort curve, 0 to 1.
    BrakeHandle,
    /// Brake-cylinder pressure.
    BrakeCylinderPressure,
    /// The train's gross mass.
    TrainMass,
    /// Number of passengers.
    Passengers,
    /// Outside temperature.
    AmbientTemperature,
    /// Relative humidity of the air.
    RelativeHumidity,
    /// Gradient, climbing positive as the chainage grows.
    Gradient,
    /// Height of the track.
    Altitude,
    /// Radius of the curve; 0 or infinite on straight track, the sign does not count.
    CurveRadius,
    /// Speed of the wind.
    WindSpeed,
    /// 1 while the wheel-slide protection is active, else 0.
    WheelSlide,
    /// Geographical latitude by GNSS (WGS 84).
    Latitude,
    /// Geographical longitude by GNSS (WGS 84).
    Longitude,
    /// Course over ground by GNSS, clockwise from north.
    Course,
    /// Curvature of the way as measured by a yaw gyro or the steering; turning left is positive.
    Curvature,
    /// 1 while a door is open, else 0.
    DoorOpen,
    /// Power of the traction drive, regeneration negative.
    TractionPower,
    /// Power taken from the line, regeneration negative.
    LinePower,
    /// Voltage of the line.
    LineVoltage,
    /// Current taken from the line, regeneration negative.
    LineCurrent,
}

impl Quantity {
    /// Every quantity, in the order of the documentation.
    pub const ALL: [Quantity; 29] = {
        use Quantity::*;
        [
            Time,
            Position,
            Speed,
            Acceleration,
            SpecificForce,
            TractionForce,
            BrakeForce,
            ControlForce,
            TractionHandle,
            BrakeHandle,
            BrakeCylinderPressure,
            TrainMass,
            Passengers,
            AmbientTemperature,
            RelativeHumidity,
            Gradient,
            Altitude,
            CurveRadius,
            WindSpeed,
            WheelSlide,
            Latitude,
            Longitude,
            Course,
            Curvature,
            DoorOpen,
            TractionPower,
            LinePower,
            LineVoltage,
            LineCurrent,
        ]
    };

    /// The name in a dataset's `[columns]`.
    pub const fn name(self) -> &'static str {
        match self {
            Quantity::Time => "time",
            Quantity::Position => "position",
            Quantity::Speed => "speed",
            Quantity::Acceleration => "acceleration",
            Quantity::SpecificForce => "specific_force",
            Quantity::TractionForce => "traction_force",
            Quantity::BrakeForce => "brake_force",
            Quantity::ControlForce => "control_force",
            Quantity::TractionHandle => "traction_handle",
            Quantity::BrakeHandle => "brake_handle",
            Quantity::BrakeCylinderPressure => "brake_cylinder_pressure",
            Quantity::TrainMass => "train_mass",
            Quantity::Passengers => "passengers",
            Quantity::AmbientTemperature => "ambient_temperature",
            Quantity::RelativeHumidity => "relative_humidity",
            Quantity::Gradient => "gradient",
            Quantity::Altitude => "altitude",
            Quantity::CurveRadius => "curve_radius",
            Quantity::WindSpeed => "wind_speed",
            Quantity::WheelSlide => "wheel_slide",
            Quantity::Latitude => "latitude",
            Quantity::Longitude => "longitude",
            Quantity::Course => "course",
            Quantity::Curvature => "curvature",
            Quantity::DoorOpen => "door_open",
            Quantity::TractionPower => "traction_power",
            Quantity::LinePower => "line_power",
            Quantity::LineVoltage => "line_voltage",
            Quantity::LineCurrent => "line_current",
        }
    }

    /// The quantity with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|quantity| quantity.name() == name)
    }

    /// What its units measure.
    pub const fn dimension(self) -> Dimension {
        match self {
            Quantity::Time => Dimension::Time,
            Quantity::Position | Quantity::Altitude | Quantity::CurveRadius => Dimension::Length,
            Quantity::Speed | Quantity::WindSpeed => Dimension::Speed,
            Quantity::Acceleration | Quantity::SpecificForce => Dimension::Acceleration,
            Quantity::TractionForce | Quantity::BrakeForce | Quantity::ControlForce => {
                Dimension::Force
            }
            Quantity::TractionHandle
            | Quantity::BrakeHandle
            | Quantity::RelativeHumidity
            | Quantity::Gradient => Dimension::Ratio,
            Quantity::BrakeCylinderPressure => Dimension::Pressure,
            Quantity::TrainMass => Dimension::Mass,
            Quantity::AmbientTemperature => Dimension::Temperature,
            Quantity::Passengers | Quantity::WheelSlide | Quantity::DoorOpen => Dimension::Count,
            Quantity::Latitude | Quantity::Longitude | Quantity::Course => Dimension::Angle,
            Quantity::Curvature => Dimension::Curvature,
            Quantity::TractionPower | Quantity::LinePower => Dimension::Power,
            Quantity::LineVoltage => Dimension::Voltage,
            Quantity::LineCurrent => Dimension::Current,
        }
    }

    /// The unit in which it is held once read: the base unit of its dimension, but ‰ for the
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
