//! How samples become regression data.

use serde::Deserialize;

use crate::pipeline::motion::MOVING_MPS;
use crate::settings;

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

settings! {
    /// How samples become regression data.
    #[derive(Copy)]
    DataSettings in "data." {
        /// `momentum` (default) or `coasting`.
        source: DataSource = DataSource::Momentum;
        /// Shortest block of samples in s whose mean speed makes a row (momentum).
        block_s: f64 = 5.0 => (0.5 to 120 "s");
        /// Change of speed in km/h over a coasting segment (0.5 in Liu 2018).
        segment_kmh: f64 = 0.5 => (0.1 to 20 "km/h");
        /// Time in s after the forces ended before coasting is believed.
        coasting_settle_s: f64 = 3.0 => (0 to 60 "s");
        /// Below this speed in m/s nothing is learned: static friction, holding brakes.
        speed_min_mps: f64 = MOVING_MPS => (0.1 to 10 "m/s");
        /// Deviation in m/s from the expected speed that is never called a spike.
        spike_mps: f64 = 0.15 => (0.01 to 10 "m/s");
        /// Standard deviation of the scales of traction and brake force, found jointly with the
        /// resistance: 0.01 is 1 %.
        force_scale_std: f64 = 0.01 => (0.000001 to 0.5);
        /// Standard deviation in s of the delay between report and force, found jointly with the
        /// resistance; a logger that writes means over a step is off by half a step.
        force_delay_std_s: f64 = 0.3 => (0.000001 to 5 "s");
        /// Standard deviation in m of the position against the gradient profile.
        position_std_m: f64 = 3.0 => (0 to 1000 "m");
    }
}
