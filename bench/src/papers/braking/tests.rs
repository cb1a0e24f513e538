//! The M-step as printed, with the uniform process noise: the tests show why it cannot work.
//!
//! ln p(x_{t+1} | x_t) of Xie 2019, eq. (22) and (31), is constant where the noise that a pair of
//! particles implies lies within its bounds, and minus infinity elsewhere. Q is therefore
//! constant on an interval around the present value and minus infinity outside: its gradient,
//! eq. (33), is zero, and the search never moves. The interval is the intersection over all
//! pairs of particles of a window and is narrower the more pairs there are.

use std::cell::Cell;

use dynocar_core::filter::particle::{ParticleError, ParticleModel, ParticleSmoother};
use dynocar_core::filter::random::Random;
use dynocar_core::pipeline::braking::law::BrakingLaw;
use dynocar_core::pipeline::braking::motion::{self, StepInputs};
use dynocar_model::train::TrainModel;

use super::{
    BrakingMoment, POSITION_NOISE_M, POSITION_STD_M, SPEED_NOISE_MPS, STEP_S, WINDOW, XIE_TABLE_2,
    train,
};

/// Particles of the papers.
const PARTICLES: usize = 20;

struct UniformWindow<'a> {
    moments: &'a [BrakingMoment],
    inputs: StepInputs,
    adhesion: f64,
    /// Changes of the adhesion that keep every pair of particles possible.
    allowed: Cell<(f64, f64)>,
}

impl UniformWindow<'_> {
    /// Narrows the allowed changes to those under which a deviation stays within its bounds.
    fn narrow(&self, deviation: f64, half_width: f64, by_adhesion: f64) {
        // The deviation falls by `by_adhesion` per unit of change.
        let one = (deviation - half_width) / by_adhesion;
        let other = (deviation + half_width) / by_adhesion;
        let (low, high) = self.allowed.get();
        self.allowed.set((low.max(one.min(other)), high.min(one.max(other))));
    }
}

fn uniform(half_width: f64, random: &mut Random) -> f64 {
    half_width * (2.0 * random.uniform() - 1.0)
}

impl ParticleModel<2> for UniformWindow<'_> {
    fn draw_initial(&self, random: &mut Random) -> [f64; 2] {
        let first = &self.moments[0];
        [
            first.measured_m + POSITION_STD_M * random.normal(),
            first.measured_mps + uniform(SPEED_NOISE_MPS, random),
        ]
    }

    fn advance(&self, _step: usize) -> impl Fn([f64; 2]) -> [f64; 2] {
        |[distance_m, speed_mps]| {
            let moved =
                motion::advance(&self.inputs, &BrakingLaw::Constant, speed_mps, self.adhesion);
            [distance_m + moved.travelled_m, moved.speed_mps]
        }
    }

    fn draw_noise(&self, _step: usize) -> impl Fn(&mut Random) -> [f64; 2] {
        |random| [uniform(POSITION_NOISE_M, random), uniform(SPEED_NOISE_MPS, random)]
    }

    fn transition_densities(
        &self,
        _step: usize,
        advanced: [&[f64]; 2],
        successors: [&[f64]; 2],
        densities: &mut [f64],
    ) {
        let speed_by_adhesion = -STEP_S * self.inputs.gain_mps2;
        let count = advanced[0].len();
        for (index, density) in densities.iter_mut().enumerate() {
            let (from, to) = (index / count, index % count);
            let off_m = successors[0][to] - advanced[0][from];
            let off_mps = successors[1][to] - advanced[1][from];
            let is_possible = off_m.abs() <= POSITION_NOISE_M && off_mps.abs() <= SPEED_NOISE_MPS;
            *density = f64::from(u8::from(is_possible));
            if is_possible {
                self.narrow(off_mps, SPEED_NOISE_MPS, speed_by_adhesion);
                self.narrow(off_m, POSITION_NOISE_M, 0.5 * STEP_S * speed_by_adhesion);
            }
        }
    }

    fn log_likelihood(&self, step: usize) -> impl Fn([f64; 2]) -> f64 {
        let measured_m = self.moments[step].measured_m;
        move |[distance_m, _]| {
            let off = (measured_m - distance_m) / POSITION_STD_M;
            -0.5 * off * off
        }
    }
}

/// Returns the changes of the adhesion, from lowest to highest, under which Q of the first window stays
/// finite.
fn finite_changes(
    moments: &[BrakingMoment],
    adhesion: f64,
    seed: u64,
) -> Result<(f64, f64), ParticleError> {
    let train = train();
    let gravity_mps2 = 1000.0 * TrainModel::weight_kn(1.0);
    let davis = train.resistance;
    let model = UniformWindow {
        moments,
        inputs: StepInputs {
            step_s: STEP_S,
            gain_mps2: gravity_mps2,
            demand: f64::INFINITY,
            tied_mps2: 0.0,
            basic_mps2: [davis.a, davis.b, davis.c].map(|c| 1e-3 * gravity_mps2 * c),
        },
        adhesion,
        allowed: Cell::new((f64::NEG_INFINITY, f64::INFINITY)),
    };
    let mut smoother = ParticleSmoother::new(PARTICLES, WINDOW);
    smoother.filter(&model, WINDOW, &mut Random::new(seed))?;
    smoother.smooth(&model)?;
    Ok(model.allowed.get())
}

#[test]
fn q_is_finite_only_next_to_the_present_value() {
    for seed in 0..5 {
        let moments = XIE_TABLE_2.simulate(seed);
        // Even from the true value of the window's middle.
        let (low, high) = finite_changes(&moments, moments[20].truth, seed).unwrap();
        assert!(low <= 0.0 && high >= 0.0, "{low} to {high}");
        assert!(high - low < 5e-4, "{low} to {high}");
    }
}
