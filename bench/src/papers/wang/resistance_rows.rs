//! Table 1 and 2: z1, z2 and z3 from one crossing of 28,000 samples, and the descent as Wang 2022 prints it (raw
//! features, one step a sample, learning rate 1e-7).

use dynocar_core::pipeline::Estimator;
use dynocar_estimators::wang::force_model::LineResistance;
use dynocar_estimators::wang::known_motion::{KnownMotion, LearningSet};
use dynocar_estimators::wang::{
    JointLeastSquares, JointLeastSquaresSettings, StagedDescent, StagedDescentSettings,
};
use dynocar_model::force::ResolvedSample;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_tests::chance::Chance;
use nalgebra::Vector3;

use super::bound::FisherInformation;
use super::ride::measure;
use super::shuttle::{Shuttle, ShuttleMoment, calm};
use crate::papers::row::{PaperRow, PaperScore, Seeds, WANG, w0_errors};
use crate::statistics::{mean, root_mean_square};

/// Samples of one crossing.
pub const CROSSING: usize = 28_000;

const NAMES: [&str; 3] = ["basic resistance z1", "curve resistance z2", "tunnel resistance z3"];

/// Returns the rows for resistance.
pub fn rows(seeds: Seeds) -> Vec<PaperRow> {
    let shuttle = Shuttle::new(false);
    let ride = shuttle.crossing(CROSSING, &mut calm);
    let speeds = LearningSet::ALL.map(|section| driven_speeds(&shuttle, &ride, section));
    let information = FisherInformation::new(&shuttle, &ride);
    let scores = run(&shuttle, &ride, &speeds, seeds);
    let mut rows: Vec<PaperRow> = (0..3)
        .map(|i| {
            let bound = Some(information.resistance_std(i, &speeds[i]));
            let what = format!("{}: one crossing of 28,000 samples", NAMES[i]);
            PaperRow { bound, ..scores[i].row(row(&what, seeds)) }
        })
        .collect();
    let empirical = Davis { a: 2.7551, b: 0.014 * 3.6, c: 0.00075 * 12.96 };
    let empirical = w0_errors(&empirical, &shuttle.truth[0], &speeds[0]);
    rows[0].baseline = Some(root_mean_square(&empirical));
    rows.push(curve_in_tunnel_row(seeds.at_most(20)));
    rows.extend(printed_rows(&shuttle, &ride, seeds.at_most(20)));
    rows
}

/// With curves inside tunnels, which Algorithm 1 puts into the curve set.
fn curve_in_tunnel_row(seeds: Seeds) -> PaperRow {
    let shuttle = Shuttle::new(true);
    let ride = shuttle.crossing(CROSSING, &mut calm);
    let speeds = LearningSet::ALL.map(|section| driven_speeds(&shuttle, &ride, section));
    let curve = LearningSet::Curve as usize;
    let bound = FisherInformation::new(&shuttle, &ride).resistance_std(curve, &speeds[curve]);
    let score = &run(&shuttle, &ride, &speeds, seeds)[curve];
    let what = format!("{}: with two curves inside tunnels", NAMES[curve]);
    PaperRow { bound: Some(bound), ..score.row(row(&what, seeds)) }
}

/// Returns a row without figures.
fn row(what: &str, seeds: Seeds) -> PaperRow {
    let quantity = format!("{what}, error over the speeds driven there");
    PaperRow::new(WANG, "Table 2", quantity, "N/kN", seeds).noted(
        "paper's method: staged descent, features normalised; baseline: Table 1's empirical values",
    )
}

fn run(
    shuttle: &Shuttle,
    ride: &[ShuttleMoment],
    speeds: &[Vec<f64>; 3],
    seeds: Seeds,
) -> [PaperScore; 3] {
    let truths = &shuttle.truth;
    let mut scores: [PaperScore; 3] = Default::default();
    for seed in seeds.range() {
        let samples = measure(shuttle, ride, &mut Chance::new(seed));
        let settings = StagedDescentSettings::default();
        let mut staged = StagedDescent::new(settings, &shuttle.train).expect("default settings");
        let mut joint = joint_least_squares(shuttle);
        for sample in &samples {
            staged.update(sample);
            joint.update(sample);
        }
        let ours = polynomials(&joint.resistance().expect("a sound regression"));
        let theirs = polynomials(&staged.resistance());
        for section in LearningSet::ALL {
            let i = section as usize;
            let covariance = joint.resistance_covariance(section).expect("a sound regression");
            scores[i].paper.extend(w0_errors(&theirs[i], &truths[i], &speeds[i]));
            scores[i].take_resistance((&ours[i], &covariance), &truths[i], &speeds[i]);
        }
    }
    scores
}

/// Returns our estimator with its default settings: the mass is not known to it.
pub fn joint_least_squares(shuttle: &Shuttle) -> JointLeastSquares {
    let settings = JointLeastSquaresSettings::default();
    JointLeastSquares::new(settings, &shuttle.train).expect("default settings")
}

/// Returns the rows that show the printed learning rate to fail.
fn printed_rows(shuttle: &Shuttle, ride: &[ShuttleMoment], seeds: Seeds) -> [PaperRow; 2] {
    let (mut until, mut moved) = (Vec::new(), Vec::new());
    for seed in seeds.range() {
        let samples = measure(shuttle, ride, &mut Chance::new(seed));
        let mut in_kmh = PrintedDescent::new(3.6, &shuttle.train);
        let mut in_mps = PrintedDescent::new(1.0, &shuttle.train);
        let start = in_mps.weights[0][0];
        for sample in &samples {
            in_kmh.update(sample);
            in_mps.update(sample);
        }
        until.extend(in_kmh.diverged_after.map(|count| count as f64));
        moved.push((in_mps.weights[0][0] - start).abs());
    }
    let row = |quantity: &str, unit, value| PaperRow {
        paper_method: Some(value),
        ..PaperRow::new(WANG, "section 3.1", quantity, unit, seeds)
    };
    [
        row("learning rate 1e-7, speed in km/h: samples until it has diverged", "1", mean(&until)),
        row(
            "learning rate 1e-7, speed in m/s: change of alpha_1 in 28,000 samples",
            "N/kN",
            mean(&moved),
        ),
    ]
}

fn polynomials(resistance: &LineResistance) -> [Davis; 3] {
    [Some(resistance.basic), resistance.curve, resistance.tunnel]
        .map(|davis| davis.expect("all three are learned"))
}

/// Twenty speeds in m/s over the middle 90 % of those driven in a section.
fn driven_speeds(shuttle: &Shuttle, ride: &[ShuttleMoment], section: LearningSet) -> Vec<f64> {
    let mut speeds: Vec<f64> = ride
        .iter()
        .filter(|instant| instant.speed_mps > 1.0)
        .filter(|instant| {
            let [_, curve, tunnel] = shuttle.shares(instant.position_m);
            match section {
                LearningSet::Basic => curve == 0.0 && tunnel == 0.0,
                LearningSet::Curve => curve > 0.999,
                LearningSet::Tunnel => tunnel > 0.999,
            }
        })
        .map(|instant| instant.speed_mps)
        .collect();
    speeds.sort_by(f64::total_cmp);
    let at = |share: f64| speeds[(share * (speeds.len() - 1) as f64) as usize];
    let (low, high) = (at(0.05), at(0.95));
    (0..20).map(|k| low + (high - low) * f64::from(k) / 19.0).collect()
}

/// Learning rate of section 3.1.
const RATE: f64 = 1e-7;
/// A coefficient beyond this has diverged; the printed ones lie below 3.
const DIVERGED: f64 = 1e6;
/// Lowest speed in m/s that is used.
const SPEED_MIN_MPS: f64 = 1.0;

/// z1, z2 and z3 as the weights of the network, in powers of the raw speed.
struct PrintedDescent {
    /// How many of the network's unit of speed are 1 m/s: 3.6 for km/h; the paper does not say.
    per_mps: f64,
    /// z1, z2, z3 in N/kN.
    weights: [Vector3<f64>; 3],
    steps: u64,
    /// The number of steps after which a coefficient had diverged; the last ones before that stay.
    diverged_after: Option<u64>,
    last: Option<KnownMotion>,
}

impl PrintedDescent {
    /// Starts at a train's basic resistance and at z2 = z3 = (1, 1, 1), as Table 1.
    fn new(per_mps: f64, train: &TrainModel) -> Self {
        let basic = train.resistance;
        let first = Vector3::new(basic.a, basic.b / per_mps, basic.c / (per_mps * per_mps));
        PrintedDescent {
            per_mps,
            weights: [first, Vector3::repeat(1.0), Vector3::repeat(1.0)],
            steps: 0,
            diverged_after: None,
            last: None,
        }
    }

    /// Learns from the step to a sample, the acceleration being the differentiated speed.
    fn update(&mut self, sample: &ResolvedSample) {
        let motion =
            KnownMotion::from_sample(sample).ok().filter(|now| now.speed_mps >= SPEED_MIN_MPS);
        let Some((from, to)) = std::mem::replace(&mut self.last, motion).zip(motion) else {
            return;
        };
        let (Some(step_s), Some(section)) = (to.step_from(&from), LearningSet::new(&from, &to))
        else {
            return;
        };
        let mean = |value: fn(&KnownMotion) -> f64| 0.5 * (value(&from) + value(&to));
        let acceleration_mps2 = (to.speed_mps - from.speed_mps) / step_s;
        let specific_mps2 = mean(|at| at.force_n) / to.declared_kg - acceleration_mps2;
        let target = 1e3 * specific_mps2 / GRAVITY_MPS2 - mean(|at| at.known_n_per_kn);
        self.learn(section, mean(|at| at.speed_mps), target);
    }

    /// One step on one sample: eq. (27) with E = (O - target)².
    ///
    /// The network of eq. (19)-(25) computes z · (1, v, v²); with b_j subtracted in (19), the
    /// threshold is -alpha_j, where (22) prints alpha_j. Force and gradient are not among its
    /// inputs: the target is the resistance in N/kN that they leave.
    fn learn(&mut self, section: LearningSet, speed_mps: f64, target_n_per_kn: f64) {
        if self.diverged_after.is_some() {
            return;
        }
        let speed = speed_mps * self.per_mps;
        let features = Vector3::new(1.0, speed, speed * speed);
        let mut weights = self.weights[section as usize];
        let known = match section {
            LearningSet::Basic => 0.0,
            LearningSet::Curve | LearningSet::Tunnel => self.weights[0].dot(&features),
        };
        let error = known + weights.dot(&features) - target_n_per_kn;
        weights -= features * (2.0 * error * RATE);
        self.steps += 1;
        if weights.iter().all(|weight| weight.abs() < DIVERGED) {
            self.weights[section as usize] = weights;
        } else {
            self.diverged_after = Some(self.steps);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pulling away on the straight, with a target that the differentiated speed scatters by
    /// 10 N/kN either way.
    fn pulled_away(per_mps: f64, samples: u32) -> PrintedDescent {
        let table_1 = Davis { a: 2.7551, b: 0.014 * 3.6, c: 0.00075 * 12.96 };
        let mut descent = PrintedDescent::new(per_mps, &TrainModel::bare("", 110e3, table_1));
        for k in 0..samples {
            let speed_mps = (0.2 * f64::from(k)).min(27.0);
            let scatter = if k.is_multiple_of(2) { 10.0 } else { -10.0 };
            let target = table_1.w0_n_per_kn(speed_mps) + 0.5 + scatter;
            descent.learn(LearningSet::Basic, speed_mps, target);
        }
        descent
    }

    #[test]
    fn the_printed_rate_diverges_within_a_minute_in_kilometres_per_hour() {
        let descent = pulled_away(3.6, 300);
        let after = descent.diverged_after.expect("diverged");
        assert!((60..300).contains(&after) && descent.weights[0][0].is_finite(), "{after}");
    }

    #[test]
    fn the_printed_rate_moves_nothing_in_metres_per_second() {
        let descent = pulled_away(1.0, 28_000);
        assert_eq!(descent.diverged_after, None);
        let moved = (descent.weights[0][0] - 2.7551).abs();
        assert!(moved > 0.0 && moved < 0.01, "of the 0.5 N/kN to learn: {moved}");
    }
}
