//! Sample that a controller writes each control cycle.

use crate::wire_struct;

const INFINITY: f64 = f64::INFINITY;

/// Identifies one train (one controller) on a host; chosen by the configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TrainId(pub u64);

impl core::fmt::Display for TrainId {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// Bit in [`TrainSample::flags`]: the controller's own wheel-slide protection is active.
pub const FLAG_WHEEL_SLIDE: u8 = 1;

/// Lists every measured quantity once: its documentation, its name as a member and as a field, and the range in which
/// it lies for every train.
macro_rules! measured {
    ($( $(#[doc = $doc:literal])* $item:ident = $field:ident [$low:expr, $high:expr]; )*) => {
        /// A measured quantity of a [`TrainSample`], with its bit in [`TrainSample::valid`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u16)]
        pub enum SampleField {
            $( #[doc = concat!("[`TrainSample::", stringify!($field), "`]")] $item ),*
        }

        impl SampleField {
            /// Every measured quantity, in the order of its bit.
            pub const ALL: [SampleField; [$( stringify!($item) ),*].len()] =
                [ $( SampleField::$item ),* ];

            /// Returns the name of the sample's field.
            pub const fn name(self) -> &'static str {
                match self { $( SampleField::$item => stringify!($field) ),* }
            }

            /// Returns the least and greatest value that can be true of any train, in the field's unit.
            pub const fn range(self) -> (f64, f64) {
                match self { $( SampleField::$item => ($low, $high) ),* }
            }

            /// Returns the field's bit in [`TrainSample::valid`].
            #[inline]
            pub const fn bit(self) -> u16 {
                1 << self as u16
            }
        }

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
                $( $(#[doc = $doc])* pub $field: f64, )*
            }
        }

        impl TrainSample {
            /// Returns a sample with no measured value.
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
                    $( $field: 0.0, )*
                }
            }

            /// Sets a measured value and its validity bit.
            pub const fn set(&mut self, field: SampleField, value: f64) {
                match field { $( SampleField::$item => self.$field = value ),* }
                self.valid |= field.bit();
            }

            /// Returns the value of a field, when its validity bit is set.
            #[inline]
            pub const fn get(&self, field: SampleField) -> Option<f64> {
                if self.valid & field.bit() == 0 {
                    return None;
                }
                Some(match field { $( SampleField::$item => self.$field ),* })
            }
        }
    };
}

// The order is that of the bits and of the memory: a new one comes last.
measured! {
    /// Chainage of the train's centre in m.
    Position = position_m [-INFINITY, INFINITY];
    /// Speed in m/s, never negative.
    Speed = speed_mps [0.0, INFINITY];
    /// Traction force in N, never negative.
    TractionForce = traction_force_n [0.0, INFINITY];
    /// Brake force in N, retarding, never negative.
    BrakeForce = brake_force_n [0.0, INFINITY];
    /// Brake-cylinder pressure in Pa.
    BrakeCylinderPressure = brake_cylinder_pressure_pa [-5e4, 2e6];
    /// dv/dt in m/s², as measured.
    Acceleration = acceleration_mps2 [-20.0, 20.0];
    /// Reading of an accelerometer along the track in m/s²: dv/dt + g * gradient.
    SpecificForce = specific_force_mps2 [-20.0, 20.0];
    /// The train's gross mass in kg, without the rotating part.
    Mass = mass_kg [0.0, INFINITY];
    /// Outside temperature in °C.
    AmbientTemperature = ambient_temperature_degc [-80.0, 80.0];
    /// Gradient in ‰, climbing positive as the chainage grows; for lines without a track file.
    Gradient = gradient_permille [-150.0, 150.0];
    /// Curve radius in m, for lines without a track file; 0 on straight track.
    CurveRadius = curve_radius_m [0.0, INFINITY];
}

const _: () = assert!(SampleField::ALL.len() <= u16::BITS as usize, "a bit of `valid` for each");

impl TrainSample {
    /// Sets a measured value and its validity bit.
    ///
    /// # Examples
    ///
    /// ```
    /// use dynocar_shared::{SampleField, TrainId, TrainSample};
    ///
    /// let sample = TrainSample::empty(TrainId(1))
    ///     .with(SampleField::Speed, 21.5)
    ///     .with(SampleField::TractionForce, 84_000.0);
    /// assert_eq!(sample.get(SampleField::Speed), Some(21.5));
    /// assert_eq!(sample.get(SampleField::BrakeForce), None);
    /// ```
    #[must_use]
    pub const fn with(mut self, field: SampleField, value: f64) -> Self {
        self.set(field, value);
        self
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
