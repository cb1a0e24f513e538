//! How wrong what is declared of a train and its day is.

use dynocar_core::pipeline::train_kalman::TrainKalmanSettings;
use dynocar_model::terms::{adhesion, wind};
use dynocar_tests::simulator::TrueDeviations;

/// Standard deviations of the ordinary mistakes, all at once; none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mistakes {
    /// Of a, b, c as a share of what is declared.
    pub coefficient_share: f64,
    /// Of the traction and the brake force as reported, as a share.
    pub force_share: f64,
    /// Of the brake's force from train to train, as a share.
    pub brake_share: f64,
    /// Of the brake's force from stop to stop, as a share.
    pub stop_to_stop_share: f64,
    /// Of the delay of forces in s, and its mean; later than reported, never before.
    pub delay_s: f64,
    /// See `delay_s`.
    pub mean_delay_s: f64,
    /// Of the wheel diameter as a share.
    pub wheel_share: f64,
    /// Of the rotating mass as a share of the mass.
    pub rotating_mass: f64,
    /// Of the wind of the day along the line in m/s.
    pub wind_mps: f64,
    /// Of its gusts in m/s.
    pub gust_mps: f64,
}

impl Mistakes {
    /// Those of careful declarations.
    pub const USUAL: Mistakes = Mistakes {
        coefficient_share: 0.3,
        force_share: TrueDeviations::ROUGH.force_share,
        brake_share: 0.02,
        stop_to_stop_share: 0.015,
        delay_s: 0.05,
        mean_delay_s: 0.1,
        wheel_share: TrueDeviations::ROUGH.wheel_share,
        rotating_mass: 0.002,
        wind_mps: TrueDeviations::ROUGH.day_wind_mps,
        gust_mps: TrueDeviations::ROUGH.gust_mps,
    };

    /// Returns the mistakes that the estimator's default settings assume.
    pub fn expected() -> Mistakes {
        let settings = TrainKalmanSettings::default();
        Mistakes {
            coefficient_share: settings.prior_relative_std,
            force_share: settings.force_scale_std,
            brake_share: adhesion::DECLARED_BRAKE_STD,
            delay_s: settings.force_delay_std_s,
            mean_delay_s: 0.0,
            wind_mps: settings.wind_std_mps,
            gust_mps: wind::GUST_SHARE * settings.wind_std_mps,
            ..Mistakes::USUAL
        }
    }
}
