//! A value and how well it is known.

use dynocar_shared::HALF_95;

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// The interval; `None` where nothing gives one.
    pub interval: Option<[f64; 2]>,
}

impl Estimate {
    /// A value with 1.96 standard deviations to either side; none when that is no number.
    pub fn normal(value: f64, deviation: f64) -> Self {
        let half = HALF_95 * deviation;
        let is_known = half.is_finite() && half > 0.0;
        Estimate { value, interval: is_known.then_some([value - half, value + half]) }
    }
}
