//! Settings of the least-squares resistance pipelines.

use serde::Deserialize;

use crate::pipeline::settings::{SettingError, require};

/// Where the regression data come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DataSource {
    /// Momentum against the impulse of the measured forces, whatever the train does.
    #[default]
    Momentum,
    /// Half-overlapping coasting segments (Liu 2018, figure 2).
    Coasting,
}

/// How samples become regression data.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DataSettings {
    /// `momentum` (default) or `coasting`.
    pub source: DataSource,
    /// Shortest block of samples in s whose mean speed makes a row (momentum).
    pub block_s: f64,
    /// Change of speed in km/h over a coasting segment (0.5 in Liu 2018).
    pub segment_kmh: f64,
    /// Time in s after the forces ended before coasting is believed.
    pub coasting_settle_s: f64,
    /// Below this speed in m/s nothing is learned: static friction, holding brakes.
    pub speed_min_mps: f64,
    /// Deviation in m/s from the expected speed that is never called a spike.
    pub spike_mps: f64,
    /// Standard deviation of the scales of traction and brake force, found beside the
    /// resistance: 0.01 is 1 %.
    pub force_scale_std: f64,
    /// Standard deviation in s of the delay between report and force, found beside the
    /// resistance; a logger that writes means over a step is off by half a step.
    pub force_delay_std_s: f64,
    /// Standard deviation in m of the position against the gradient profile.
    pub position_std_m: f64,
}

impl Default for DataSettings {
    fn default() -> Self {
        DataSettings {
            source: DataSource::Momentum,
            block_s: 5.0,
            segment_kmh: 0.5,
            coasting_settle_s: 3.0,
            speed_min_mps: 1.0,
            spike_mps: 0.15,
            force_scale_std: 0.01,
            force_delay_std_s: 0.3,
            position_std_m: 3.0,
        }
    }
}

impl DataSettings {
    /// Checks every range.
    ///
    /// # Errors
    ///
    /// Names the setting, its value and the allowed range.
    pub fn check(&self) -> Result<(), SettingError> {
        let within = |key, value: f64, low: f64, high: f64, allowed| {
            require((low..=high).contains(&value), key, value, allowed)
        };
        within("data.block_s", self.block_s, 0.5, 120.0, "0.5 to 120 s")?;
        within("data.segment_kmh", self.segment_kmh, 0.1, 20.0, "0.1 to 20 km/h")?;
        within("data.coasting_settle_s", self.coasting_settle_s, 0.0, 60.0, "0 to 60 s")?;
        within("data.speed_min_mps", self.speed_min_mps, 0.1, 10.0, "0.1 to 10 m/s")?;
        within("data.spike_mps", self.spike_mps, 0.01, 10.0, "0.01 to 10 m/s")?;
        within("data.force_scale_std", self.force_scale_std, 1e-6, 0.5, "1e-6 to 0.5")?;
        within("data.force_delay_std_s", self.force_delay_std_s, 1e-6, 5.0, "1e-6 to 5 s")?;
        within("data.position_std_m", self.position_std_m, 0.0, 1000.0, "0 to 1000 m")
    }
}

macro_rules! least_squares_settings {
    ($(#[$meta:meta])* $name:ident { $( $(#[$field_meta:meta])* $field:ident : $ty:ty = $default:expr ),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $( $(#[$field_meta])* pub $field: $ty, )*
            /// How samples become regression data.
            pub data: DataSettings,
        }

        impl Default for $name {
            fn default() -> Self {
                $name { $( $field: $default, )* data: DataSettings::default() }
            }
        }
    };
}

least_squares_settings! {
    /// Settings of `ls`: all rows count alike.
    LsSettings {
        /// lambda of the criterion `lambda/2 |theta|^2`, theta scaled to (a, 20 b, 400 c) and
        /// rows to unit variance: a prior standard deviation of sqrt(2 / lambda) N/kN about 0.
        lambda: f64 = 0.005,
    }
}

least_squares_settings! {
    /// Settings of `rls`.
    RlsSettings {
        /// Weight that a row keeps at every new one; what the new row does not tell of is not
        /// forgotten. 1 forgets nothing.
        forgetting: f64 = 0.9998,
        /// Variance of the start, p0 in Liu 2018, in (N/kN)² of scaled parameters.
        start_variance: f64 = 1e4,
    }
}

least_squares_settings! {
    /// Settings of `regularised_rls`, `mils` and `v_mils`.
    MilsSettings {
        /// Innovation length p, 1 to 8; `regularised_rls` has 1 whatever is set here.
        innovation_length: u32 = 4,
        /// lambda of the criterion `lambda/2 |theta|^2`, see [`LsSettings::lambda`].
        lambda: f64 = 0.005,
        /// N: the rows over which the regularisation is spread.
        length: u32 = 100,
        /// True for the printed eq. 12-16: lambda instead of lambda/2, growing for ever.
        printed_penalty: bool = false,
        /// Variance of the start, p0 in Liu 2018, in (N/kN)² of scaled parameters.
        start_variance: f64 = 1e4,
        /// `v_mils`: rows beyond this many robust standard deviations are bad data.
        bad_beyond: f64 = 3.5,
    }
}

least_squares_settings! {
    /// Settings of `resistance_kalman`.
    KalmanSettings {
        /// Degrees of freedom of Student's t for the speed's noise.
        student_freedom: f64 = 5.0,
        /// Random walk of each scaled coefficient in N/kN over an hour of motion: weather, wear.
        drift_n_per_kn_per_sqrt_h: f64 = 0.003,
    }
}

/// The longest innovation length.
pub const INNOVATION_LENGTH_MAX: usize = 8;

fn check_lambda(lambda: f64) -> Result<(), SettingError> {
    require((0.0..=1e6).contains(&lambda), "lambda", lambda, "0 to 1e6")
}

fn check_start(variance: f64) -> Result<(), SettingError> {
    require((1e-3..=1e9).contains(&variance), "start_variance", variance, "1e-3 to 1e9")
}

impl LsSettings {
    /// Checks every range.
    ///
    /// # Errors
    ///
    /// Names the setting, its value and the allowed range.
    pub fn check(&self) -> Result<(), SettingError> {
        check_lambda(self.lambda)?;
        self.data.check()
    }
}

impl RlsSettings {
    /// Checks every range.
    ///
    /// # Errors
    ///
    /// Names the setting, its value and the allowed range.
    pub fn check(&self) -> Result<(), SettingError> {
        let forgetting = self.forgetting;
        require((0.5..=1.0).contains(&forgetting), "forgetting", forgetting, "0.5 to 1")?;
        check_start(self.start_variance)?;
        self.data.check()
    }
}

impl KalmanSettings {
    /// Checks every range.
    ///
    /// # Errors
    ///
    /// Names the setting, its value and the allowed range.
    pub fn check(&self) -> Result<(), SettingError> {
        let freedom = self.student_freedom;
        require((1.0..=1e6).contains(&freedom), "student_freedom", freedom, "1 to 1e6")?;
        let drift = self.drift_n_per_kn_per_sqrt_h;
        let key = "drift_n_per_kn_per_sqrt_h";
        require((0.0..=10.0).contains(&drift), key, drift, "0 to 10 N/kN")?;
        self.data.check()
    }
}

impl MilsSettings {
    /// Checks every range.
    ///
    /// # Errors
    ///
    /// Names the setting, its value and the allowed range.
    pub fn check(&self) -> Result<(), SettingError> {
        let p = self.innovation_length;
        let allowed = 1..=INNOVATION_LENGTH_MAX as u32;
        require(allowed.contains(&p), "innovation_length", f64::from(p), "1 to 8")?;
        check_lambda(self.lambda)?;
        let length = self.length;
        require(length >= 1, "length", f64::from(length), "1 or more rows")?;
        check_start(self.start_variance)?;
        let beyond = self.bad_beyond;
        require((1.0..=100.0).contains(&beyond), "bad_beyond", beyond, "1 to 100")?;
        self.data.check()
    }
}
