//! The pipeline `residual_monitor`: the force that the model does not explain, and its likely causes.
//!
//! Momentum blocks make a linear regression in a, b, c and the errors of the forces, as in
//! [`crate::pipeline::momentum`]. Each suspect adds one column: the momentum that one unit of it would take away. All
//! columns go through one whitener and into one information matrix, from which the likelihood ratio of every suspect
//! against the base model follows at any time, with a, b and c refitted together with the suspect. The distance by
//! position against the distance by speed adds the wheels' diameter.
//!
//! # Layout, in the order a sample takes
//!
//! - `suspects`: the effects that are looked for, the time since which a brake may drag, and the pressure that shows it
//! - `covariates`, `wheel_scale`: evidence that a sample gives on each suspect
//! - `rows`: blocks to independent rows of unit variance
//! - `information`: the uncertainty of every parameter, and the likelihood ratios
//! - `verdict`: the evidence for each suspect
//! - `naming`: the suspect, its alternatives, and the end of the suspicion
//! - `estimator`: the pipeline around these parts

use dynocar_model::terms::{bearings, curve, masses};

use crate::pipeline::momentum::DataSettings;
use crate::settings;

pub use estimator::ResidualMonitor;

mod covariates;
mod estimator;
mod information;
mod naming;
mod rows;
mod suspects;
mod verdict;
mod wheel_scale;

settings! {
    /// Settings of `residual_monitor`.
    #[derive(Copy)]
    MonitorSettings {
        /// Evidence, less the price of the search, from which a suspect is named.
        evidence_min: f64 = 20.0 => (1 to 1000000);
        /// Share of the resistance below which an unexplained force is no matter.
        share_min: f64 = 0.08 => (0 to 1);
        /// Standard deviation of each declared Davis coefficient, as a share of it.
        davis_std_share: f64 = 0.1 => (0.001 to 1);
        /// Small slow forces that are no effect: standard deviation in N/kN.
        disturbance_n_per_kn: f64 = 0.05 => (0.001 to 10 "N/kN");
        /// The same as a share of the resistance; both count.
        disturbance_share: f64 = 0.03 => (0 to 1);
        /// How long such a force lasts, in s.
        disturbance_time_s: f64 = 60.0 => (1 to 10000 "s");
        /// Standard deviation in % of the scales of traction and brake force; it stands in the place of
        /// `data.force_scale_std`.
        force_std_percent: f64 = 0.6 => (0.0001 to 50 "%");
        /// Standard deviation in % of the mass that samples or the train's file give, from run to run and
        /// at every stop where another is given.
        mass_std_percent: f64 = 100.0 * masses::WEIGHED_STD => (0.01 to 50 "%");
        /// Standard deviation in m/s of the wind from run to run; gusts have half of it.
        wind_std_mps: f64 = 1.5 => (0.01 to 20 "m/s");
        /// Standard deviation in permille of the map's gradient, smooth over some hundred metres.
        map_std_permille: f64 = 0.03 => (0 to 10 "permille");
        /// Standard deviation of the declared curve constant, as a share of it.
        curve_constant_std: f64 = curve::USUAL_STD => (0.001 to 1);
        /// Standard deviation of the resistance that bearings add at the start of a run before they are warm, as a
        /// share of the basic resistance.
        warming_std: f64 = bearings::USUAL_STD => (0.0001 to 1);
        /// Standard deviation of the wheels' diameter, as a share of it.
        wheel_std: f64 = 0.0015 => (0.0001 to 0.1);
        /// Standard deviation by which the scales of traction and brake force differ from run to run.
        force_run_std: f64 = 0.003 => (0.000001 to 0.5);
        /// Time of motion in h over which evidence is forgotten.
        memory_h: f64 = 4.0 => (0.1 to 10000 "h");
        /// How samples become regression data; the source is always momentum.
        data: DataSettings = DataSettings::default() => (each);
    }
}
