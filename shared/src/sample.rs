//! What a controller writes each control cycle.

use crate::wire_struct;

/// Identifies one train (one controller) on a host; chosen by the configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TrainId(pub u64);

impl core::fmt::Display for TrainId {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// A measured quantity of a [`TrainSample`], with its bit in [`TrainSample::valid`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum SampleField {
    /// [`TrainSample::position_m`]
    Position = 0,
    /// [`TrainSample::speed_mps`]
    Speed = 1,
    /// [`TrainSample::traction_force_n`]
    TractionForce = 2,
    /// [`TrainSample::brake_force_n`]
    BrakeForce = 3,
    /// [`TrainSample::brake_cylinder_pressure_pa`]
    BrakeCylinderPressure = 4,
    /// [`TrainSample::acceleration_mps2`]
    Acceleration = 5,
    /// [`TrainSample::specific_force_mps2`]
    SpecificForce = 6,
    /// [`TrainSample::mass_kg`]
    Mass = 7,
    /// [`TrainSample::ambient_temperature_degc`]
    AmbientTemperature = 8,
    /// [`TrainSample::gradient_permille`]
    Gradient = 9,
    /// [`TrainSample::curve_radius_m`]
    CurveRadius = 10,
}

impl SampleField {
    /// Every measured quantity, in the order of its bit.
    pub const ALL: [SampleField; 11] = [
        SampleField::Position,
        SampleField::Speed,
        SampleField::TractionForce,
        SampleField::BrakeForce,
        SampleField::BrakeCylinderPressure,
        SampleField::Acceleration,
        SampleField::SpecificForce,
        SampleField::Mass,
        SampleField::AmbientTemperature,
        SampleField::Gradient,
        SampleField::CurveRadius,
    ];

    /// The name of the sample's field.
    pub const fn name(self) -> &'static str {
        match self {
            SampleField::Position => "position_m",
            SampleField::Speed => "speed_mps",
            SampleField::TractionForce => "traction_force_n",
            SampleField::BrakeForce => "brake_force_n",
            SampleField::BrakeCylinderPressure => "brake_cylinder_pressure_pa",
            SampleField::Acceleration => "acceleration_mps2",
            SampleField::SpecificForce => "specific_force_mps2",
            SampleField::Mass => "mass_kg",
            SampleField::AmbientTemperature => "ambient_temperature_degc",
            SampleField::Gradient => "gradient_permille",
            SampleField::CurveRadius => "curve_radius_m",
        }
    }

    /// The field's bit in [`TrainSample::valid`].
    #[inline]
    pub const fn bit(self) -> u16 {
        1 << self as u16
    }
}

/// Bit in [`TrainSample::flags`]: the controller's own wheel-slide protection is active.
pub const FLAG_WHEEL_SLIDE: u8 = 1;

wire_struct! {
    /// One cycle of a train, as its controller saw it. SI units throughout.
    ///
    /// A field counts only while its bit in `valid` is set; without the bit its value is never
    /// read. Forces are at the wheel rim of the whole train.
    pub struct TrainSample {
        /// When the values were measured, in ns of the controller's monotonic clock.
        pub time_ns: i64,
        /// When the sample was handed to the channel, in ns of the host's monotonic clock;
        /// the publisher writes it, and latency is counted from it.
        pub published_ns: i64,
        /// Counts the controller's samples, one by one; a gap means lost samples.
        pub sequence: u64,
        /// The train, see [`TrainId`].
        pub train_id: u64,
        /// One bit for each [`SampleField`] that holds a value.
        pub valid: u16,
        /// [`FLAG_WHEEL_SLIDE`].
        pub flags: u8,
        /// +1 while the chainage grows in the direction of travel, -1 while it falls.
        pub direction: i8,
        /// Number of the run (trip); filters start a new motion segment when it changes.
        pub run: u32,
        /// Chainage of the train's centre in m.
        pub position_m: f64,
        /// Speed in m/s, never negative.
        pub speed_mps: f64,
        /// Traction force in N, never negative.
        pub traction_force_n: f64,
        /// Brake force in N, retarding, never negative.
        pub brake_force_n: f64,
        /// Brake-cylinder pressure in Pa.
        pub brake_cylinder_pressure_pa: f64,
        /// dv/dt in m/s², as measured.
        pub acceleration_mps2: f64,
        /// What an accelerometer reads along the track in m/s²: dv/dt + g * gradient.
        pub specific_force_mps2: f64,
        /// The train's gross mass in kg, without the rotating part.
        pub mass_kg: f64,
        /// Outside temperature in °C.
        pub ambient_temperature_degc: f64,
        /// Gradient in ‰, climbing positive as the chainage grows; for lines without a track file.
        pub gradient_permille: f64,
        /// Curve radius in m, for lines without a track file; 0 on straight track.
        pub curve_radius_m: f64,
    }
}

// Two cache lines.
const _: () = assert!(core::mem::size_of::<TrainSample>() == 128);

impl TrainSample {
    /// A sample with no measured value.
    pub const fn empty(train: TrainId) -> Self {
        TrainSample {
            time_ns: 0,
            published_ns: 0,
            sequence: 0,
            train_id: train.0,
            valid: 0,
            flags: 0,
            direction: 1,
            run: 0,
            position_m: 0.0,
            speed_mps: 0.0,
            traction_force_n: 0.0,
            brake_force_n: 0.0,
            brake_cylinder_pressure_pa: 0.0,
            acceleration_mps2: 0.0,
            specific_force_mps2: 0.0,
            mass_kg: 0.0,
            ambient_temperature_degc: 0.0,
            gradient_permille: 0.0,
            curve_radius_m: 0.0,
        }
    }

    /// Sets a measured value and its validity bit.
    #[must_use]
    pub const fn with(mut self, field: SampleField, value: f64) -> Self {
        self.set(field, value);
        self
    }

    /// Sets a measured value and its validity bit.
    pub const fn set(&mut self, field: SampleField, value: f64) {
        match field {
            SampleField::Position => self.position_m = value,
            SampleField::Speed => self.speed_mps = value,
            SampleField::TractionForce => self.traction_force_n = value,
            SampleField::BrakeForce => self.brake_force_n = value,
            SampleField::BrakeCylinderPressure => self.brake_cylinder_pressure_pa = value,
            SampleField::Acceleration => self.acceleration_mps2 = value,
            SampleField::SpecificForce => self.specific_force_mps2 = value,
            SampleField::Mass => self.mass_kg = value,
            SampleField::AmbientTemperature => self.ambient_temperature_degc = value,
            SampleField::Gradient => self.gradient_permille = value,
            SampleField::CurveRadius => self.curve_radius_m = value,
        }
        self.valid |= field.bit();
    }

    /// The value of a field, when its validity bit is set.
    #[inline]
    pub const fn get(&self, field: SampleField) -> Option<f64> {
        if self.valid & field.bit() == 0 {
            return None;
        }
        Some(match field {
            SampleField::Position => self.position_m,
            SampleField::Speed => self.speed_mps,
            SampleField::TractionForce => self.traction_force_n,
            SampleField::BrakeForce => self.brake_force_n,
            SampleField::BrakeCylinderPressure => self.brake_cylinder_pressure_pa,
            SampleField::Acceleration => self.acceleration_mps2,
            SampleField::SpecificForce => self.specific_force_mps2,
            SampleField::Mass => self.mass_kg,
            SampleField::AmbientTemperature => self.ambient_temperature_degc,
            SampleField::Gradient => self.gradient_permille,
            SampleField::CurveRadius => self.curve_radius_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_is_absent_until_it_is_set() {
        for (index, field) in SampleField::ALL.into_iter().enumerate() {
            let sample = TrainSample::empty(TrainId(7));
            assert_eq!(sample.get(field), None);
            let sample = sample.with(field, 1.5 + index as f64);
            assert_eq!(sample.get(field), Some(1.5 + index as f64));
            assert_eq!(sample.valid.count_ones(), 1);
        }
    }
}
