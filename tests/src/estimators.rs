//! Every estimator, where a test asks each of them again and again.

use dynocar_analysis::identify::default_estimators;
use dynocar_estimators::EstimatorSettings;

/// Observations by which the windows of expectation maximisation slide: half of a window. By default they slide
/// so far that each observation is looked at eight times, which takes most of the time of all estimators together.
const SLIDE: usize = 20;

/// The default estimators, with windows of expectation maximisation that overlap by half.
pub fn frugal_estimators() -> Vec<EstimatorSettings> {
    let mut all = default_estimators();
    for settings in &mut all {
        if let EstimatorSettings::AdhesionEm(own) | EstimatorSettings::BrakeEm(own) = settings {
            own.slide = SLIDE;
        }
    }
    all
}
