//! Alignment of a line from the fixes of many passes.

use super::alignment::Alignment;
use super::banded::Banded;
use super::recording::SurveyRecording;
use super::tracking::{GAP_MAX_M, PlacedFix, follow};
use crate::statistics::median;

/// Standard deviation in m of a fix, which fades slowly.
pub const FIX_STD_M: f64 = 4.0;
/// Time constant in s with which the error of fixes fades.
pub const FIX_FADING_S: f64 = 12.0;
/// Part of a fix's error in m that is independent from fix to fix.
const FIX_WHITE_M: f64 = 0.3;
/// Typical second difference in m of an alignment's nodes: a curve of 5 km. Its distribution has long tails, so that a
/// street corner is possible too.
const BEND_M: f64 = 0.02;
/// Number of rounds that place the fixes and move the alignment.
const ROUNDS: usize = 4;

/// Rows of a recording that run along an alignment.
#[derive(Clone, Debug, PartialEq)]
pub struct SurveyPass {
    /// Number of the recording.
    pub recording: usize,
    /// The rows.
    pub rows: std::ops::Range<usize>,
    /// 1 along it, while the chainage grows, -1 against it.
    pub direction: i8,
}

/// Moves a first alignment into the middle of the passes.
pub fn align(first: Alignment, passes: &[SurveyPass], recordings: &[SurveyRecording]) -> Alignment {
    let mut alignment = first;
    for _ in 0..ROUNDS {
        let Some(back) = alignment.reversed() else { return alignment };
        let place = |pass: &SurveyPass| {
            let recording = &recordings[pass.recording];
            if pass.direction > 0 {
                return follow(recording, pass.rows.clone(), &alignment);
            }
            let mut placed = follow(recording, pass.rows.clone(), &back);
            placed.reverse();
            for fix in &mut placed {
                fix.chainage_m = alignment.length_m() - fix.chainage_m;
                fix.left_m = -fix.left_m;
            }
            placed
        };
        let placed: Vec<Vec<PlacedFix>> = passes.iter().map(place).collect();
        let speed_mps = mean_speed(passes, recordings);
        let Some(moved) = moved(&alignment, &placed, speed_mps) else { return alignment };
        alignment = moved;
    }
    alignment
}

/// Returns the mean speed in m/s while moving.
fn mean_speed(passes: &[SurveyPass], recordings: &[SurveyRecording]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for pass in passes {
        let speeds = &recordings[pass.recording].raw.speed_mps[pass.rows.clone()];
        for &speed in speeds.iter().filter(|speed| **speed > 1.0) {
            sum += speed;
            count += 1.0;
        }
    }
    if count > 0.0 { sum / count } else { 10.0 }
}

/// Returns the alignment moved sideways to the middle of the passes, and smoothed.
fn moved(alignment: &Alignment, placed: &[Vec<PlacedFix>], speed_mps: f64) -> Option<Alignment> {
    let count = alignment.nodes_m().len();
    let mut left_m: Vec<Vec<f64>> = vec![Vec::new(); count];
    for pass in placed {
        for pair in pass.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            let span_m = to.chainage_m - from.chainage_m;
            if !(span_m > 0.0 && span_m < GAP_MAX_M) {
                continue;
            }
            let nodes = (from.chainage_m / alignment.step_m()).ceil().max(0.0) as usize
                ..((to.chainage_m / alignment.step_m()).ceil().max(0.0) as usize).min(count);
            for node in nodes {
                let share = (node as f64 * alignment.step_m() - from.chainage_m) / span_m;
                left_m[node].push(from.left_m + share * (to.left_m - from.left_m));
            }
        }
    }
    let targets: Vec<Option<([f64; 2], f64)>> = left_m
        .iter_mut()
        .enumerate()
        .map(|(node, lefts)| {
            let [x, y] = alignment.direction(node as f64 * alignment.step_m());
            let middle_m = median(lefts)?;
            let at = alignment.nodes_m()[node];
            Some(([at[0] - middle_m * y, at[1] + middle_m * x], lefts.len() as f64))
        })
        .collect();
    let kept_share = (-alignment.step_m() / (FIX_FADING_S * speed_mps)).exp();
    Alignment::through(&smoothed(&targets, alignment.nodes_m(), kept_share)?)
}

/// Nodes that bend little and differ from their targets by an error that fades along the alignment by
/// `kept_share` from node to node.
fn smoothed(
    targets: &[Option<([f64; 2], f64)>],
    nodes: &[[f64; 2]],
    kept_share: f64,
) -> Option<Vec<[f64; 2]>> {
    let count = nodes.len();
    let mut smooth = nodes.to_vec();
    let mut bend_weights = vec![1.0 / (BEND_M * BEND_M); count];
    for _ in 0..8 {
        let mut matrix = Banded::zeros(count, 2);
        let mut right = [vec![0.0; count], vec![0.0; count]];
        for node in 0..count {
            matrix.add_row(&[(node, 1.0)], 1e-9);
            for axis in 0..2 {
                right[axis][node] += 1e-9 * nodes[node][axis];
            }
            let Some((target, passes)) = targets[node] else { continue };
            let new_share = 1.0 - kept_share * kept_share;
            let variance = (FIX_STD_M * FIX_STD_M * new_share + FIX_WHITE_M * FIX_WHITE_M) / passes;
            // The error is compared with the rest of the one before.
            match node.checked_sub(1).and_then(|before| targets[before]) {
                Some((last, _)) => {
                    matrix.add_row(&[(node - 1, -kept_share), (node, 1.0)], 1.0 / variance);
                    for axis in 0..2 {
                        let seen = (target[axis] - kept_share * last[axis]) / variance;
                        right[axis][node] += seen;
                        right[axis][node - 1] -= kept_share * seen;
                    }
                }
                None => {
                    let weight = passes / (FIX_STD_M * FIX_STD_M);
                    matrix.add_row(&[(node, 1.0)], weight);
                    for axis in 0..2 {
                        right[axis][node] += weight * target[axis];
                    }
                }
            }
        }
        for node in 1..count - 1 {
            matrix.add_row(&[(node - 1, 1.0), (node, -2.0), (node + 1, 1.0)], bend_weights[node]);
        }
        let factor = matrix.factor().ok()?;
        for axis in 0..2 {
            factor.solve(&mut right[axis]);
            for node in 0..count {
                smooth[node][axis] = right[axis][node];
            }
        }
        for node in 1..count - 1 {
            let bend = |axis: usize| {
                smooth[node - 1][axis] - 2.0 * smooth[node][axis] + smooth[node + 1][axis]
            };
            let squared = bend(0) * bend(0) + bend(1) * bend(1);
            bend_weights[node] = 1.0 / (BEND_M * BEND_M + squared);
        }
    }
    Some(smooth)
}
