//! The chainage of every row: the distance by the wheels, corrected by GNSS.
//!
//! The wheels measure the distance with a scale error that stays over a pass and with slips that add up like a random
//! walk. A fix lies `lag * speed` behind the train, since it is older than its time stamp, and has an error of some
//! metres that fades over seconds. A Kalman filter with a smoother (Rauch, Tung and Striebel 1965) over [offset, scale,
//! error of the fix, lag] separates these, robust to single wild fixes.

use nalgebra::{SMatrix, SVector};

use super::centring::{FIX_FADING_S, FIX_STD_M};
use super::recording::SurveyRecording;
use super::tracking::PlacedFix;
use crate::explain::answer::WithStd;

/// Standard deviation in m of the wheels' slip over 1 m; it grows with the root of the distance.
const SLIP_M: f64 = 0.05;
/// Part of a fix's error in m that is independent from fix to fix.
const FIX_WHITE_M: f64 = 0.7;
/// Number of rounds that lower the weight of wild fixes.
const ROUNDS: usize = 4;
/// Error in m of a fix that counts half.
const HALF_WEIGHT_M: f64 = 2.5;

type State = SVector<f64, 4>;
type Covariance = SMatrix<f64, 4, 4>;

/// Values common to all passes of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelsAndLag {
    /// True over counted distance, less 1.
    pub scale: WithStd,
    /// Age in s of a fix at its stamp.
    pub lag_s: WithStd,
}

impl WheelsAndLag {
    /// Before anything is known.
    pub const UNKNOWN: WheelsAndLag = WheelsAndLag {
        scale: WithStd { value: 0.0, std: 0.04 },
        lag_s: WithStd { value: 0.7, std: 0.7 },
    };

    /// Combines several passes; the scale may differ by `scale_spread` between them.
    pub fn together(passes: &[WheelsAndLag], scale_spread: f64) -> Option<WheelsAndLag> {
        let mean = |of: fn(&WheelsAndLag) -> WithStd, spread: f64| {
            let weight = |pass: &WheelsAndLag| 1.0 / (of(pass).std.powi(2) + spread * spread);
            let total: f64 = passes.iter().map(weight).sum();
            let value =
                passes.iter().map(|pass| weight(pass) * of(pass).value).sum::<f64>() / total;
            (total > 0.0).then_some(WithStd { value, std: (1.0 / total).sqrt() })
        };
        Some(WheelsAndLag {
            scale: mean(|pass| pass.scale, scale_spread)?,
            lag_s: mean(|pass| pass.lag_s, 0.05)?,
        })
    }
}

/// The chainage of a pass.
#[derive(Clone, Debug, PartialEq)]
pub struct Chained {
    /// First row of the recording.
    pub first_row: usize,
    /// Chainage in m of each row along the alignment.
    pub chainage_m: Vec<f64>,
    /// Wheels and lag of the pass.
    pub learned: WheelsAndLag,
}

/// Smooths the chainage of the rows from the first to the last placed fix; `None` with too few
/// fixes.
pub fn chain(
    recording: &SurveyRecording,
    rows: std::ops::Range<usize>,
    placed: &[PlacedFix],
    known: WheelsAndLag,
) -> Option<Chained> {
    if placed.len() < 20 {
        return None;
    }
    let start_m = recording.travelled_m[placed[0].row];
    let mut weights = vec![1.0; placed.len()];
    let mut smoothed = Vec::new();
    for _ in 0..ROUNDS {
        smoothed = smooth(recording, placed, start_m, known, &weights)?;
        for ((weight, fix), (state, _)) in weights.iter_mut().zip(placed).zip(&smoothed) {
            let row = fix.row;
            let travelled_m = recording.travelled_m[row] - start_m;
            let speed_mps = speed(recording, row);
            let expected =
                travelled_m * (1.0 + state[1]) + state[0] + state[2] - state[3] * speed_mps;
            let off = (fix.chainage_m - expected) / HALF_WEIGHT_M;
            *weight = 1.0 / (1.0 + off * off);
        }
    }
    let (last, covariance) = smoothed[smoothed.len() - 1];
    let std = |index: usize| covariance[(index, index)].max(0.0).sqrt();
    let learned = WheelsAndLag {
        scale: WithStd { value: last[1], std: std(1) },
        lag_s: WithStd { value: last[3], std: std(3) },
    };
    let mut chainage_m = Vec::with_capacity(rows.len());
    let mut next = 0;
    for row in rows.clone() {
        while next < placed.len() && placed[next].row < row {
            next += 1;
        }
        let (before, after) = (next.saturating_sub(1), next.min(placed.len() - 1));
        let travelled_m = recording.travelled_m[row];
        let (one_m, other_m) =
            (recording.travelled_m[placed[before].row], recording.travelled_m[placed[after].row]);
        let share = if other_m > one_m {
            ((travelled_m - one_m) / (other_m - one_m)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let (one, other) = (smoothed[before].0[0], smoothed[after].0[0]);
        let offset_m = one + share * (other - one);
        chainage_m.push((travelled_m - start_m) * (1.0 + last[1]) + offset_m);
    }
    Some(Chained { first_row: rows.start, chainage_m, learned })
}

fn speed(recording: &SurveyRecording, row: usize) -> f64 {
    let speed_mps = recording.raw.speed_mps[row];
    if speed_mps.is_nan() { 0.0 } else { speed_mps }
}

/// State and covariance at each placed fix.
fn smooth(
    recording: &SurveyRecording,
    placed: &[PlacedFix],
    start_m: f64,
    known: WheelsAndLag,
    weights: &[f64],
) -> Option<Vec<(State, Covariance)>> {
    let mut state = State::new(placed[0].chainage_m, known.scale.value, 0.0, known.lag_s.value);
    let variances = [50.0, known.scale.std, FIX_STD_M, known.lag_s.std].map(|std: f64| std * std);
    let mut covariance = Covariance::from_diagonal(&State::from(variances));
    let mut filtered = Vec::with_capacity(placed.len());
    let mut ahead = Vec::with_capacity(placed.len());
    for (k, fix) in placed.iter().enumerate() {
        let before = placed[k.saturating_sub(1)].row;
        let step_s = recording.raw.time_s[fix.row] - recording.raw.time_s[before];
        let step_m = recording.travelled_m[fix.row] - recording.travelled_m[before];
        let fade = (-step_s / FIX_FADING_S).exp();
        state[2] *= fade;
        for index in 0..4 {
            covariance[(index, 2)] *= fade;
            covariance[(2, index)] *= fade;
        }
        covariance[(0, 0)] += SLIP_M * SLIP_M * step_m;
        covariance[(2, 2)] += FIX_STD_M * FIX_STD_M * (1.0 - fade * fade);
        ahead.push((state, covariance, fade));
        let travelled_m = recording.travelled_m[fix.row] - start_m;
        let speed_mps = speed(recording, fix.row);
        let row = State::new(1.0, travelled_m, 1.0, -speed_mps);
        let expected = travelled_m + row.dot(&state);
        let spread = covariance * row;
        let gain = spread / (row.dot(&spread) + FIX_WHITE_M * FIX_WHITE_M / weights[k]);
        state += gain * (fix.chainage_m - expected);
        covariance -= gain * spread.transpose();
        covariance = 0.5 * (covariance + covariance.transpose());
        filtered.push((state, covariance));
    }
    for k in (0..placed.len() - 1).rev() {
        let (ahead_state, ahead_covariance, fade) = ahead[k + 1];
        let (next_state, next_covariance) = filtered[k + 1];
        let (here, mut cross) = (filtered[k].0, filtered[k].1);
        for index in 0..4 {
            cross[(index, 2)] *= fade;
        }
        let gain = cross * ahead_covariance.try_inverse()?;
        let state = here + gain * (next_state - ahead_state);
        let covariance =
            filtered[k].1 + gain * (next_covariance - ahead_covariance) * gain.transpose();
        filtered[k] = (state, covariance);
    }
    Some(filtered)
}
