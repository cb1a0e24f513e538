//! The friction brake's force from its pressure, from what the balance lacks under it.

use super::chainage::Estimate;
use super::quantile::{middle, share_of};
use super::recording::RawRecording;

/// Fewer observations under pressure say nothing.
const OBSERVATIONS_MIN: usize = 30;
/// A gain below so many standard deviations is none.
const SIGNIFICANT: f64 = 8.0;
/// Margin in Pa above the pressure of a released brake.
const MARGIN_PA: f64 = 5e3;

/// A friction brake as it was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundBrake {
    /// Force in N for each Pa.
    pub gain_n_per_pa: Estimate,
    /// Pressure in Pa from which on it acts.
    pub release_pa: f64,
}

/// The pressure in Pa above which a friction brake may act in some recordings: by those under strong traction.
pub fn acting_from_pa<'r>(raws: impl Iterator<Item = &'r RawRecording>) -> f64 {
    let mut under_traction = Vec::new();
    for raw in raws.filter(|raw| !raw.friction_pa.is_empty()) {
        let most_n = raw.control_n.iter().copied().fold(0.0, f64::max);
        for row in 0..raw.time_s.len() {
            let pulls = raw.control_n[row] > 0.2 * most_n && raw.speed_mps[row] > 1.0;
            if pulls && raw.friction_pa[row].is_finite() {
                under_traction.push(raw.friction_pa[row]);
            }
        }
    }
    share_of(&under_traction, 0.95).max(0.0) + MARGIN_PA
}

/// A straight line through (pressure in Pa, missing retarding force in N), robust to single
/// wild ones; `None` where no brake shows.
pub fn found_brake(points: &[(f64, f64)]) -> Option<FoundBrake> {
    if points.len() < OBSERVATIONS_MIN {
        return None;
    }
    let mut weights = vec![1.0; points.len()];
    let (mut gain, mut offset, mut std) = (0.0, 0.0, f64::INFINITY);
    for _ in 0..20 {
        let total: f64 = weights.iter().sum();
        let mean = |of: fn(&(f64, f64)) -> f64| {
            points.iter().zip(&weights).map(|(point, weight)| weight * of(point)).sum::<f64>()
                / total
        };
        let (pressure, force) = (mean(|it| it.0), mean(|it| it.1));
        let (mut top, mut bottom) = (0.0, 0.0);
        for ((p, f), weight) in points.iter().zip(&weights) {
            top += weight * (p - pressure) * (f - force);
            bottom += weight * (p - pressure) * (p - pressure);
        }
        if !(bottom > 0.0) {
            return None;
        }
        gain = top / bottom;
        offset = force - gain * pressure;
        let mut sizes: Vec<f64> =
            points.iter().map(|(p, f)| (f - gain * p - offset).abs()).collect();
        let scale = (1.4826 * middle(&mut sizes)?).max(1e-9);
        std = scale / bottom.sqrt();
        for ((p, f), weight) in points.iter().zip(&mut weights) {
            let ratio = (f - gain * p - offset) / scale;
            *weight = 5.0 / (4.0 + ratio * ratio);
        }
    }
    let release_pa = (-offset / gain).max(0.0);
    let is_clear = gain > SIGNIFICANT * std && release_pa.is_finite();
    let gain_n_per_pa = Estimate { value: gain, std };
    is_clear.then_some(FoundBrake { gain_n_per_pa, release_pa })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_brake_is_found_with_its_release_pressure_and_none_where_none_acts() {
        let noise = |k: usize| 800.0 * ((k * 7919 % 100) as f64 / 50.0 - 1.0);
        let pressure = |k: usize| 25e3 + 1000.0 * (k % 150) as f64;
        let acting: Vec<(f64, f64)> =
            (0..400).map(|k| (pressure(k), 0.25 * (pressure(k) - 20e3) + noise(k))).collect();
        let found = found_brake(&acting).unwrap();
        assert!((found.gain_n_per_pa.value - 0.25).abs() < 4.0 * found.gain_n_per_pa.std);
        assert!((found.release_pa - 20e3).abs() < 1500.0, "{found:?}");
        let idle: Vec<(f64, f64)> = (0..400).map(|k| (pressure(k), noise(k))).collect();
        assert_eq!(found_brake(&idle), None);
    }
}
