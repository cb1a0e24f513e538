//! Settings of the least-squares resistance pipelines.

use dynocar_core::pipeline::momentum::DataSettings;
use dynocar_core::settings;

settings! {
    /// Settings of `ls`: all rows count alike.
    #[derive(Copy)]
    LsSettings {
        /// lambda of the criterion `lambda/2 |theta|^2`, theta scaled to (a, 20 b, 400 c) and
        /// rows to unit variance: a prior standard deviation of sqrt(2 / lambda) N/kN about 0.
        lambda: f64 = 0.005 => (0 to 1000000);
        /// How samples become regression data.
        data: DataSettings = DataSettings::default() => (each);
    }
}

settings! {
    /// Settings of `rls`.
    #[derive(Copy)]
    RlsSettings {
        /// Weight that a row keeps at every new one, in the direction of the new row only. 1 forgets nothing.
        forgetting: f64 = 0.9998 => (0.5 to 1);
        /// Variance of the start, p0 in Liu 2018, in (N/kN)² of scaled parameters.
        start_variance: f64 = 1e4 => (0.001 to 1000000000);
        /// How samples become regression data.
        data: DataSettings = DataSettings::default() => (each);
    }
}

settings! {
    /// Settings of `regularised_rls`, `mils` and `v_mils`.
    #[derive(Copy)]
    MilsSettings {
        /// Innovation length p, 1 to 8; `regularised_rls` always has 1.
        innovation_length: u32 = 4 => (1 to 8);
        /// lambda of the criterion `lambda/2 |theta|^2`, see [`LsSettings::lambda`].
        lambda: f64 = 0.005 => (0 to 1000000);
        /// N: the rows over which the regularisation is spread.
        length: u32 = 100 => (1 or more);
        /// True for the printed eq. 12-16: lambda instead of lambda/2, growing for ever.
        printed_penalty: bool = false;
        /// Variance of the start, p0 in Liu 2018, in (N/kN)² of scaled parameters.
        start_variance: f64 = 1e4 => (0.001 to 1000000000);
        /// `v_mils`: rows beyond this many robust standard deviations are bad data.
        bad_beyond: f64 = 3.5 => (1 to 100);
        /// How samples become regression data.
        data: DataSettings = DataSettings::default() => (each);
    }
}

settings! {
    /// Settings of `resistance_kalman`.
    #[derive(Copy)]
    KalmanSettings {
        /// Degrees of freedom of Student's t for the speed's noise.
        student_freedom: f64 = 5.0 => (1 to 1000000);
        /// Random walk of each scaled coefficient in N/kN over an hour of motion: weather, wear.
        drift_n_per_kn_per_sqrt_h: f64 = 0.003 => (0 to 10 "N/kN");
        /// How samples become regression data.
        data: DataSettings = DataSettings::default() => (each);
    }
}

/// The longest innovation length.
pub const INNOVATION_LENGTH_MAX: usize = 8;
