//! Accuracy of the model of brake components, and the number of plain Monte Carlo draws as accurate as one tilted draw.

use std::time::Instant;

use clap::Args;
use dynocar_analysis::brakes::{Weakest, weakest, weakest_plain};
use dynocar_model::train::BrakeComponents;
use dynocar_shared::quantile::normal_quantile;

use crate::ending::until_due;
use crate::output::{BenchError, OutputArguments, Record, expect, table};

/// Error and cost of Kdry_rst from components at one stop in a million, by turns with plain Monte Carlo.
#[derive(Debug, Args)]
pub struct BrakesBenchArguments {
    /// Tilted draws of an answer, as `dynocar brakes` takes them
    #[arg(long, default_value_t = 1 << 14)]
    draws: usize,
    /// Plain draws of an answer
    #[arg(long, default_value_t = 1 << 21)]
    plain_draws: usize,
    /// Answers of each kind, each with its own seed
    #[arg(long, default_value_t = 8)]
    seeds: u64,
    #[command(flatten)]
    output: OutputArguments,
}

/// Share of the stops with weaker brakes than the computed strength.
const PROBABILITY: f64 = 1e-6;
/// Answers of several seeds: their mean, their variance, and the time of one answer in s.
struct Answers {
    mean: f64,
    variance: f64,
    each_s: f64,
}

impl Answers {
    fn of(seeds: u64, answer: impl Fn(u64) -> Weakest) -> Self {
        let start = Instant::now();
        let shares: Vec<f64> = (1..=seeds).map(|seed| answer(seed).share).collect();
        let each_s = start.elapsed().as_secs_f64() / seeds as f64;
        let mean = shares.iter().sum::<f64>() / seeds as f64;
        let squares = shares.iter().map(|it| (it - mean).powi(2)).sum::<f64>();
        Answers { mean, variance: squares / (seeds as f64 - 1.0), each_s }
    }
}

impl BrakesBenchArguments {
    /// Measures three brakes, two of which have an exact answer.
    ///
    /// # Errors
    ///
    /// When there are fewer than two seeds, or the result cannot be given.
    pub fn run(&self) -> Result<(), BenchError> {
        expect(self.seeds >= 2, || format!("--seeds {}: expected 2 or more", self.seeds))?;
        let quantile = normal_quantile(PROBABILITY).unwrap_or(f64::NAN);
        let of_units = |units| BrakeComponents { units, ..BrakeComponents::default() };
        let differ = BrakeComponents { friction_std: 0.1, ..of_units(24) };
        let fails = BrakeComponents { failure_probability: 2e-7, ..of_units(1) };
        let all = BrakeComponents {
            friction_std: 0.06,
            pressure_std: 0.02,
            efficiency_std: 0.02,
            common_std: 0.02,
            mass_std: 0.01,
            failure_probability: 1e-3,
            ..of_units(24)
        };
        let cases = [
            ("24 that differ by 10 %", differ, Some(1.0 + 0.1 * quantile / 24_f64.sqrt())),
            ("one that fails in 2e-7", fails, Some(1.0)),
            ("24 with all of it", all, None),
        ];
        let mut records = Vec::new();
        for (name, brake, exact) in until_due(cases) {
            let tilted =
                Answers::of(self.seeds, |seed| weakest(&brake, PROBABILITY, self.draws, seed));
            let plain = Answers::of(self.seeds, |seed| {
                weakest_plain(&brake, PROBABILITY, self.plain_draws, seed)
            });
            let cost = |it: &Answers, draws: usize| it.variance * draws as f64;
            let worth = cost(&plain, self.plain_draws) / cost(&tilted, self.draws);
            let exact = exact.unwrap_or(f64::NAN);
            let rms = (tilted.variance + (tilted.mean - exact).powi(2)).sqrt();
            records.push(
                Record::default()
                    .with("units", name)
                    .number("exact", exact, 4)
                    .number("share", tilted.mean, 4)
                    .number("plain", plain.mean, 4)
                    .number("std %", 100.0 * tilted.variance.sqrt() / tilted.mean, 3)
                    .number("rms off %", 100.0 * rms / exact, 3)
                    .number("s", tilted.each_s, 3)
                    .number("plain s", plain.each_s, 3)
                    .number("plain draws for one", worth, 0),
            );
        }
        self.output.give(&records, || table(&records))
    }
}
