//! Settings of [`super::MassKalman`].

use dynocar_core::pipeline::motion::MOVING_MPS;
use dynocar_core::pipeline::settings::{SettingError, within};
use dynocar_core::settings;
use dynocar_model::train::{Davis, TrainModel};

use super::bias_bank::MODELS;
use super::force_model::{BiasModel, DEFAULT_REFERENCE_RADIUS_M, LineResistance};

settings! {
    /// Settings of [`super::MassKalman`].
    #[derive(Copy)]
    MassKalmanSettings {
        /// Standard deviation of the declared mass in %.
        mass_std_percent: f64 = 20.0 => (0.1 to 50);
        /// Standard deviation in % of a change of mass at a stop; 0 when it never changes.
        mass_change_std_percent: f64 = 10.0 => (0 to 50);
        /// Shortest stop in s at which the mass may change.
        stop_min_s: f64 = 5.0 => (0 to 3600);
        /// Standard deviation of the measured speed in m/s to start with; it is learned.
        speed_noise_mps: f64 = 0.02 => (0.001 to 1);
        /// Standard deviation in m/s² of an acceleration that the model lacks.
        bias_std_mps2: f64 = 0.01 => (0.0001 to 0.5);
        /// Least force in N/kN that counts as traction or braking.
        force_min_n_per_kn: f64 = 5.0 => (0 to 100);
        /// Lowest speed in m/s that is used.
        speed_min_mps: f64 = MOVING_MPS => (0.3 to 20);
        /// Basic resistance [a, b, c] in place of the declared one, speeds in m/s.
        basic_resistance: Option<[f64; 3]> = None;
        /// Curve resistance [a, b, c] at the reference radius beyond the declared one.
        curve_resistance: Option<[f64; 3]> = None;
        /// Tunnel resistance [a, b, c] beyond the declared one.
        tunnel_resistance: Option<[f64; 3]> = None;
        /// Radius in m that the curve resistance refers to.
        reference_radius_m: f64 = DEFAULT_REFERENCE_RADIUS_M => (50 to 10000);
        /// Standard deviation of the mass in % up to which the estimate may be used.
        usable_std_percent: f64 = 2.0 => (0.01 to 50);
    }
}

impl MassKalmanSettings {
    /// Refuses settings outside their ranges.
    ///
    /// # Errors
    ///
    /// Names key, value and range.
    pub fn check(&self) -> Result<(), SettingError> {
        self.check_ranges()?;
        let polynomials = [
            ("basic_resistance", self.basic_resistance),
            ("curve_resistance", self.curve_resistance),
            ("tunnel_resistance", self.tunnel_resistance),
        ];
        for (key, polynomial) in polynomials {
            for coefficient in polynomial.unwrap_or_default() {
                within(coefficient, key, (-100.0, 100.0), "three numbers from -100 to 100")?;
            }
        }
        Ok(())
    }

    /// Returns the resistance that the filters use.
    pub fn line_resistance(&self, train: &TrainModel) -> LineResistance {
        let davis = |[a, b, c]: [f64; 3]| Davis { a, b, c };
        LineResistance {
            basic: self.basic_resistance.map_or(train.resistance, davis),
            curve: self.curve_resistance.map(davis),
            tunnel: self.tunnel_resistance.map(davis),
            reference_radius_m: self.reference_radius_m,
        }
    }

    /// Takes a learned resistance in place of the declared one.
    #[must_use]
    pub fn with_resistance(mut self, resistance: &LineResistance) -> Self {
        let list = |davis: Davis| [davis.a, davis.b, davis.c];
        self.basic_resistance = Some(list(resistance.basic));
        self.curve_resistance = resistance.curve.map(list);
        self.tunnel_resistance = resistance.tunnel.map(list);
        self.reference_radius_m = resistance.reference_radius_m;
        self
    }

    /// Returns the behaviours of the bias: none; constant; constant and slow in proportion to speed;
    /// small and large, each slow and gusty.
    pub fn bias_models(&self) -> [BiasModel; MODELS] {
        let model =
            |share: f64, time_s, grows| BiasModel::new(share * self.bias_std_mps2, time_s, grows);
        [
            model(1e-3, f64::INFINITY, false),
            model(1.0, f64::INFINITY, false),
            model(1.0, f64::INFINITY, true),
            model(1.0, 60.0, true),
            model(0.3, 60.0, false),
            model(0.3, 10.0, false),
            model(1.0, 60.0, false),
            model(1.0, 10.0, false),
        ]
    }
}
