//! Settings of the residual monitor.

use crate::pipeline::resistance::settings::DataSettings;
use crate::pipeline::settings::settings;

settings! {
    /// Settings of `residual_monitor`.
    #[derive(Copy)]
    MonitorSettings {
        /// Evidence, less what the search costs, from which a suspect is named.
        evidence_min: f64 = 20.0 => (1 to 1000000);
        /// Share of the resistance below which an unexplained force is no matter.
        share_min: f64 = 0.08 => (0 to 1);
        /// Standard deviation of each declared Davis coefficient, as a share of it.
        davis_std_share: f64 = 0.1 => (0.001 to 1);
        /// Small slow forces that are no effect (wind, survey of the gradient): standard deviation
        /// in N/kN.
        disturbance_n_per_kn: f64 = 0.05 => (0.001 to 10 "N/kN");
        /// The same as a share of the resistance; both count.
        disturbance_share: f64 = 0.03 => (0 to 1);
        /// How long such a force lasts, in s.
        disturbance_time_s: f64 = 60.0 => (1 to 10000 "s");
        /// Standard deviation by which the scales of traction and brake force differ from run to run.
        force_run_std: f64 = 0.003 => (0.000001 to 0.5);
        /// Time of motion in h over which evidence is forgotten.
        memory_h: f64 = 4.0 => (0.1 to 10000 "h");
        /// How samples become regression data; the source is always momentum.
        data: DataSettings = DataSettings::default() => (each);
    }
}
