//! Times of recordings that count from 1970, as dates.

use dynocar::models::UtcSecond;

/// Times in s from 2000 to 2100 count from 1970; recordings with another origin are shorter.
const OF_EPOCH_S: std::ops::Range<f64> = 946_684_800.0..4_102_444_800.0;

/// Returns the second in UTC of a time in s that counts from 1970; `None` for one that counts from elsewhere.
pub fn moment(time_s: f64) -> Option<UtcSecond> {
    OF_EPOCH_S.contains(&time_s).then_some(UtcSecond { unix_s: time_s as u64 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_from_1970_are_dates_and_others_are_not() {
        let date = |time_s| moment(time_s).map(|it| it.to_string());
        assert_eq!(date(1_738_479_600.0).as_deref(), Some("2025-02-02T07:00:00Z"));
        assert_eq!(date(1_738_479_600.75).as_deref(), Some("2025-02-02T07:00:00Z"));
        assert_eq!([0.0, 86_400.0 * 31.0, f64::NAN, -1.0].map(date), [const { None }; 4]);
    }
}
