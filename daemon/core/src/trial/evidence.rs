//! Evidence that one model predicts better than another, valid at every look.
//!
//! Each trip gives a score between -1 and 1: (e0² - e1²) / (e0² + e1²) with the open-loop errors
//! of the model in force, e0, and of its rival, e1. The hypothesis to be refuted is that the rival reduces the error by
//! less than the least gain that is worth a change.
//!
//! The evidence against it is an e-process: the factor by which a bet of a fixed share on each trip grows. While the
//! hypothesis holds no bet grows on average, regardless of the trips before, so that one may look after every trip
//! (Waudby-Smith, Ramdas: *Estimating means of bounded random variables by betting*, 2024). A new bet begins at each
//! trip, so that a rival which becomes better only in winter is found in winter; the sum of all bets reaches M no
//! earlier than after M trips on average while the hypothesis holds (Shin, Ramdas, Rinaldo: *E-detectors*, 2024). M is
//! `trips_between_mistakes` in the configuration.

use serde::{Deserialize, Serialize};

/// Shares that are bet on each trip; the e-process values are averaged over them.
const BETS: [f64; 9] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
/// E-process value beyond which further counting adds nothing.
const E_VALUE_MAX: f64 = 1e100;
/// Probability that the confidence sequence ever misses the truth: the sequence holds with 95 %.
const MISS: f64 = 0.05;
/// The largest weight of a trip in the confidence sequence.
const WEIGHT_MAX: f64 = 0.5;

/// A greater ratio of two errors says only that nothing bounds it.
pub const RATIO_MAX: f64 = 100.0;

/// Returns the score of a trip: 1 when the rival leaves nothing of the error, -1 when the model in force
/// leaves nothing of the rival's, 0 when they are alike. Arguments are mean squares.
pub fn score(in_force: f64, rival: f64) -> f64 {
    let sum = in_force + rival;
    if sum > 0.0 { ((in_force - rival) / sum).clamp(-1.0, 1.0) } else { 0.0 }
}

/// Returns the score of a rival whose error is this part of that of the model in force.
fn score_of_ratio(ratio: f64) -> f64 {
    score(1.0, ratio * ratio)
}

/// Returns the error of the rival over that of the model in force, at a score; at most [`RATIO_MAX`].
fn ratio_of_score(score: f64) -> f64 {
    ((1.0 - score).max(0.0) / (1.0 + score).max(f64::MIN_POSITIVE)).sqrt().min(RATIO_MAX)
}

/// Evidence of the trips so far for a rival.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RivalEvidence {
    /// Share of the error that the rival must take away to count as better.
    least_gain: f64,
    /// E-process value by bet.
    #[serde(rename = "capital")]
    e_value: [f64; BETS.len()],
    /// Trips that were compared.
    trips: u64,
    /// Of the confidence sequence: sums of the weights, of the weighted scores and of their spread.
    weights: f64,
    weighted: f64,
    spread: f64,
    /// Sum of the scores, and of their squared differences from the mean before each.
    scores: f64,
    squares: f64,
}

impl RivalEvidence {
    /// Before the first trip; the rival must take away a share `least_gain` of the error, 0 to 1.
    pub fn new(least_gain: f64) -> Self {
        RivalEvidence {
            least_gain,
            e_value: [0.0; BETS.len()],
            trips: 0,
            weights: 0.0,
            weighted: 0.0,
            spread: 0.0,
            scores: 0.0,
            squares: 0.0,
        }
    }

    /// Returns the least gain that it asks for.
    pub fn least_gain(&self) -> f64 {
        self.least_gain
    }

    /// Returns the trips that were compared.
    pub fn trips(&self) -> u64 {
        self.trips
    }

    /// Takes a trip's score into account, see [`score`].
    pub fn take(&mut self, score: f64) {
        let asked = score_of_ratio(1.0 - self.least_gain);
        let won = (score - asked) / (1.0 + asked);
        for (e_value, bet) in self.e_value.iter_mut().zip(BETS) {
            *e_value = ((*e_value + 1.0) * (1.0 + bet * won)).min(E_VALUE_MAX);
        }
        self.widen(score);
        self.trips += 1;
    }

    /// The predictable empirical-Bernstein confidence sequence of Waudby-Smith and Ramdas (2024,
    /// theorem 2), for scores moved to 0 … 1.
    fn widen(&mut self, score: f64) {
        let (unit, before) = (0.5 * (score + 1.0), self.trips as f64);
        let mean = (0.5 + self.scores) / (1.0 + before);
        let variance = (0.25 + self.squares) / (1.0 + before);
        let trip = before + 1.0;
        let weight = (2.0 * (2.0 / MISS).ln() / (variance * trip * (1.0 + trip).ln())).sqrt();
        let weight = weight.min(WEIGHT_MAX);
        self.weights += weight;
        self.weighted += weight * unit;
        self.spread += (unit - mean).powi(2) * (-(1.0 - weight).ln() - weight);
        self.scores += unit;
        let mean_after = (0.5 + self.scores) / (1.0 + trip);
        self.squares += (unit - mean_after).powi(2);
    }

    /// Returns the wealth of all gamblers together. While the rival is no better than required, it reaches M after
    /// no fewer than M trips on average.
    pub fn e_value(&self) -> f64 {
        self.e_value.iter().sum::<f64>() / BETS.len() as f64
    }

    /// Returns the rival's error over that of the model in force in a typical trip: lower and upper end of
    /// an interval that holds the truth at all times at once with 95 %; [`RATIO_MAX`] where nothing
    /// bounds it above, `None` before the first trip.
    pub fn error_ratio(&self) -> Option<[f64; 2]> {
        if self.trips == 0 {
            return None;
        }
        let (centre, half) =
            (self.weighted / self.weights, ((2.0 / MISS).ln() + self.spread) / self.weights);
        let end = |unit: f64| ratio_of_score((2.0 * unit - 1.0).clamp(-1.0, 1.0));
        Some([end(centre + half), end(centre - half)])
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Returns the trips whose scores lie around a mean, each anywhere within `spread` of it.
    fn e_value_reaches(
        mean: f64,
        spread: f64,
        level: f64,
        trips: usize,
        seed: u64,
    ) -> Option<usize> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut evidence = RivalEvidence::new(0.1);
        (1..=trips).find(|_| {
            evidence.take((mean + spread * random.random_range(-1.0..1.0)).clamp(-1.0, 1.0));
            evidence.e_value() >= level
        })
    }

    #[test]
    fn a_rival_that_gains_no_more_than_asked_for_is_found_no_oftener_than_promised() {
        let (level, most) = (100.0, 100_000);
        let asked = score_of_ratio(0.9);
        let found = |seed| e_value_reaches(asked, 0.8, level, most, seed).unwrap_or(most);
        let mean = (0..400).map(found).sum::<usize>() as f64 / 400.0;
        assert!(mean >= level, "after {mean} trips on average");
    }

    #[test]
    fn a_rival_that_halves_the_error_is_found_within_some_fifty_trips() {
        let halved = score_of_ratio(0.5);
        for seed in 0..50 {
            let found = e_value_reaches(halved, 0.3, 200_000.0, 200, seed);
            assert!(found.is_some_and(|trips| trips < 90), "{seed}: {found:?}");
        }
    }

    #[test]
    fn a_rival_that_becomes_better_later_is_found_later_all_the_same() {
        let mut evidence = RivalEvidence::new(0.1);
        for _ in 0..2000 {
            evidence.take(score_of_ratio(2.0));
        }
        assert!(evidence.e_value() < 10.0);
        let found = (1..100).find(|_| {
            evidence.take(score_of_ratio(0.5));
            evidence.e_value() >= 200_000.0
        });
        assert!(found.is_some_and(|trips| trips < 60), "{found:?}");
    }

    #[test]
    fn the_interval_holds_the_truth_at_all_times_at_once() {
        let mean = score_of_ratio(0.7);
        let missed = (0..300)
            .filter(|&seed| {
                let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
                let mut evidence = RivalEvidence::new(0.1);
                (0..500).any(|_| {
                    evidence.take(mean + 0.3 * random.random_range(-1.0..1.0));
                    evidence.error_ratio().is_some_and(|[low, high]| !(low..=high).contains(&0.7))
                })
            })
            .count();
        assert!(missed <= 15, "{missed} of 300");
    }

    #[test]
    fn the_interval_narrows() {
        let mut evidence = RivalEvidence::new(0.1);
        assert_eq!(evidence.error_ratio(), None);
        evidence.take(score_of_ratio(0.6));
        assert_eq!(evidence.error_ratio(), Some([0.0, RATIO_MAX]), "one trip shows nothing");
        for trip in 0..400 {
            evidence.take(score_of_ratio(0.6) + if trip % 2 == 0 { 0.1 } else { -0.1 });
        }
        let [low, high] = evidence.error_ratio().unwrap();
        assert!(low < 0.6 && high > 0.6 && high - low < 0.1, "{low} {high}");
    }
}
