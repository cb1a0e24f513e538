//! Settings: each with its key, default and range in one place.

/// A setting outside its allowed range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key} = {value}: expected {allowed}")]
pub struct SettingError {
    /// The setting's name.
    pub key: &'static str,
    /// The value it was given.
    pub value: f64,
    /// The allowed range, in words.
    pub allowed: &'static str,
}

/// Refuses a setting unless `is_allowed`.
///
/// # Errors
///
/// Names key, value and range.
pub fn require(
    is_allowed: bool,
    key: &'static str,
    value: f64,
    allowed: &'static str,
) -> Result<(), SettingError> {
    if is_allowed { Ok(()) } else { Err(SettingError { key, value, allowed }) }
}

/// A setting that has a range.
pub trait Ranged: Copy {
    /// Returns its value; `None` while it is absent, which any range allows.
    fn value(self) -> Option<f64>;
}

macro_rules! ranged_numbers {
    ($($number:ty)*) => { $( impl Ranged for $number {
        fn value(self) -> Option<f64> {
            Some(self as f64)
        }
    } )* };
}

ranged_numbers! { f64 u32 u64 usize }

impl Ranged for Option<f64> {
    fn value(self) -> Option<f64> {
        self
    }
}

/// Refuses a setting outside a range.
///
/// # Errors
///
/// Names key, value and range.
pub fn within(
    setting: impl Ranged,
    key: &'static str,
    (low, high): (f64, f64),
    allowed: &'static str,
) -> Result<(), SettingError> {
    setting
        .value()
        .map_or(Ok(()), |value| require((low..=high).contains(&value), key, value, allowed))
}

/// Declares settings as they stand in the daemon's configuration: key, type, default, and range
/// where the type alone does not say it. Gives the struct, its defaults and `check_ranges`, which names
/// keys after the prefix.
///
/// A range is `(low to high "unit")`, `(low or more)`, `(above 0)`, or `(each)` for settings of
/// their own.
#[macro_export]
macro_rules! settings {
    ($(#[$meta:meta])* $name:ident { $($fields:tt)* }) => {
        $crate::settings! { $(#[$meta])* $name in "" { $($fields)* } }
    };
    ($(#[$meta:meta])* $name:ident in $prefix:literal {
        $( $(#[$field_meta:meta])* $field:ident: $type:ty = $default:expr $(=> $range:tt)?; )*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name { $( $(#[$field_meta])* pub $field: $type, )* }

        impl Default for $name {
            fn default() -> Self {
                $name { $( $field: $default, )* }
            }
        }

        impl $name {
            /// Refuses settings outside their ranges.
            ///
            /// # Errors
            ///
            /// Names key, value and range.
            pub fn check_ranges(&self) -> Result<(), $crate::pipeline::settings::SettingError> {
                $( $( $crate::check_setting!(
                    self.$field, concat!($prefix, stringify!($field)), $range
                ); )? )*
                Ok(())
            }
        }
    };
}

/// Refuses one setting outside its range, in the words of [`settings!`]; returns from the function.
#[macro_export]
macro_rules! check_setting {
    ($setting:expr, $key:expr, (each)) => {
        $setting.check_ranges()?
    };
    ($setting:expr, $key:expr, (above 0)) => {
        $crate::pipeline::settings::within(
            $setting,
            $key,
            (f64::MIN_POSITIVE, f64::MAX),
            "a finite number above 0",
        )?
    };
    ($setting:expr, $key:expr, ($low:literal or more)) => {
        $crate::pipeline::settings::within(
            $setting,
            $key,
            ($low as f64, f64::MAX),
            concat!($low, " or more"),
        )?
    };
    ($setting:expr, $key:expr, ($low:literal to $high:literal $($unit:literal)?)) => {
        $crate::pipeline::settings::within(
            $setting,
            $key,
            ($low as f64, $high as f64),
            concat!($low, " to ", $high $(, " ", $unit)?),
        )?
    };
}
