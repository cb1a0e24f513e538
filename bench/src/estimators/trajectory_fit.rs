//! Warm trajectory fits over windows, compared with the crate `levenberg-marquardt` (MINPACK's method).

use std::sync::Arc;

use dynocar_core::filter::random::Random;
use dynocar_estimators::xia::trajectory::fit::{
    DavisPrior, FitSettings, MotionSegment, TrajectoryFit, TrajectoryFitter,
};
use dynocar_estimators::xia::trajectory::step::{Step, StepRule};
use dynocar_model::force::balance::mps2_per_n_per_kn;
use dynocar_model::train::Davis;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::Vector3;
use nalgebra_of_peer as peer;

use super::measure::{Agreement, Case, Contender};

const TRUTH: Davis = Davis { a: 0.79, b: 0.0229, c: 0.001493 };
const SPEED_NOISE_MPS: f64 = 0.18;
const STEP_M: f64 = 100.0;
const PRIOR: DavisPrior = DavisPrior {
    davis: Davis { a: 1.0, b: 0.02, c: 0.0012 },
    std: Vector3::new(0.3, 0.008, 0.0004),
};
const WINDOWS: usize = 10;
/// Samples by which a window has moved on from the one before.
const SLIDE: usize = 10;
/// The decrease of half the sum of squares below which our fit ends; the peer's tolerance is a
/// share of that sum.
const DECREASE: f64 = 1e-8;

/// Windows over one trajectory, each with the coefficients that the window before gave.
struct Windows {
    steps: Vec<Step>,
    speeds_mps: Vec<f64>,
    samples: usize,
    warm: Vec<Davis>,
    /// Standard deviations of a, b and c, the unit of the answers.
    deviations: Vec<Vector3<f64>>,
}

fn settings() -> FitSettings {
    FitSettings {
        prior: Some(PRIOR),
        speed_noise_mps: Some(SPEED_NOISE_MPS),
        ..FitSettings::new(StepRule::Distance)
    }
}

impl Windows {
    fn new(samples: usize) -> Arc<Self> {
        let mut random = Random::new(samples as u64);
        let gain = mps2_per_n_per_kn(0.06);
        let mut speed_mps = 70.0;
        let (mut steps, mut speeds_mps) = (Vec::new(), vec![speed_mps]);
        for index in 0..samples + SLIDE * WINDOWS {
            let drive_mps2 = if (index / 15) % 2 == 0 { 0.25 } else { 0.0 };
            let step = Step { size: STEP_M, drive_mps2, resistance_gain: gain };
            let after = StepRule::Distance.advance(&step, &TRUTH, speed_mps).expect("it rolls");
            speed_mps = after.speed_mps;
            steps.push(step);
            // Of bounded size, so that nothing is an outlier: the peer weighs every residual alike.
            let shift = (random.uniform() - 0.5) * 12f64.sqrt();
            speeds_mps.push(speed_mps + SPEED_NOISE_MPS * shift);
        }
        let empty = Windows { steps, speeds_mps, samples, warm: vec![], deviations: vec![] };
        Arc::new(empty.warmed())
    }

    /// Fits the windows in turn for the coefficients to start from.
    fn warmed(mut self) -> Self {
        let mut fitter = TrajectoryFitter::with_capacity(1, self.samples);
        let mut start = PRIOR.davis;
        for window in 0..WINDOWS {
            self.warm.push(start);
            let fit = self.fit(&mut fitter, window);
            self.deviations.push(fit.covariance.diagonal().map(f64::sqrt));
            start = fit.davis;
        }
        self
    }

    fn segment(&self, window: usize) -> MotionSegment<'_> {
        let first = window * SLIDE;
        let last = first + self.samples - 1;
        MotionSegment {
            steps: &self.steps[first..last],
            speeds_mps: &self.speeds_mps[first..=last],
        }
    }

    fn fit(&self, fitter: &mut TrajectoryFitter, window: usize) -> TrajectoryFit {
        fitter
            .fit(&[self.segment(window)], Some(&self.warm[window]), &settings())
            .expect("the window determines the coefficients")
    }

    /// The coefficients of every window, in standard deviations.
    fn answers(&self, mut of_window: impl FnMut(usize) -> Davis) -> Vec<f64> {
        let answer = |(window, deviations): (usize, &Vector3<f64>)| {
            let Davis { a, b, c } = of_window(window);
            Vector3::new(a, b, c).component_div(deviations).data.0[0]
        };
        self.deviations.iter().enumerate().flat_map(answer).collect()
    }
}

/// The cases of this module.
pub fn cases() -> Vec<Case> {
    vec![case(20, 10_000.0), case(1000, 200_000.0)]
}

fn case(samples: usize, target_ns: f64) -> Case {
    let windows = Windows::new(samples);
    let mut fitter = TrajectoryFitter::with_capacity(1, samples);
    let ours = Contender::new("ours", WINDOWS, &windows, move |windows| {
        windows.answers(|window| windows.fit(&mut fitter, window).davis)
    });
    let peer = Contender::new("levenberg-marquardt", WINDOWS, &windows, |windows| {
        windows.answers(|window| peer_fit(windows.segment(window), &windows.warm[window]))
    });
    let name = format!("trajectory fit, warm, {samples} samples");
    // In standard deviations.
    Case::new(name, Agreement::Absolute(5e-3), ours).peer(peer).aim(target_ns)
}

fn peer_fit(segment: MotionSegment<'_>, start: &Davis) -> Davis {
    let point = peer::Vector4::new(start.a, start.b, start.c, segment.speeds_mps[0]);
    let samples = segment.speeds_mps.len();
    let share = DECREASE / (0.5 * samples as f64);
    let solver = LevenbergMarquardt::new().with_ftol(share);
    let (problem, report) = solver.minimize(PeerProblem { segment, point });
    assert!(report.termination.was_successful(), "{:?}", report.termination);
    problem.davis()
}

/// Residuals of the computed trajectory and of the prior, in standard deviations, over
/// (a, b, c, v_0).
struct PeerProblem<'a> {
    segment: MotionSegment<'a>,
    point: peer::Vector4<f64>,
}

impl PeerProblem<'_> {
    fn davis(&self) -> Davis {
        Davis { a: self.point[0], b: self.point[1], c: self.point[2] }
    }

    fn prior(&self) -> [(f64, f64); 3] {
        let DavisPrior { davis, std } = PRIOR;
        let expected = [davis.a, davis.b, davis.c];
        std::array::from_fn(|i| ((self.point[i] - expected[i]) / std[i], 1.0 / std[i]))
    }
}

impl LeastSquaresProblem<f64, peer::Dyn, peer::U4> for PeerProblem<'_> {
    type ResidualStorage = peer::VecStorage<f64, peer::Dyn, peer::U1>;
    type JacobianStorage = peer::VecStorage<f64, peer::Dyn, peer::U4>;
    type ParameterStorage = peer::ArrayStorage<f64, 4, 1>;

    fn set_params(&mut self, point: &peer::Vector4<f64>) {
        self.point = *point;
    }

    fn params(&self) -> peer::Vector4<f64> {
        self.point
    }

    fn residuals(&self) -> Option<peer::DVector<f64>> {
        let davis = self.davis();
        let mut speed_mps = self.point[3];
        let samples = self.segment.speeds_mps.len();
        let mut residuals = peer::DVector::zeros(samples + 3);
        for (i, measured_mps) in self.segment.speeds_mps.iter().enumerate() {
            if i > 0 {
                let step = &self.segment.steps[i - 1];
                speed_mps = StepRule::Distance.advance(step, &davis, speed_mps)?.speed_mps;
            }
            residuals[i] = (speed_mps - measured_mps) / SPEED_NOISE_MPS;
        }
        for (i, (residual, _)) in self.prior().into_iter().enumerate() {
            residuals[samples + i] = residual;
        }
        Some(residuals)
    }

    fn jacobian(&self) -> Option<peer::OMatrix<f64, peer::Dyn, peer::U4>> {
        let davis = self.davis();
        let (mut speed_mps, mut by_initial) = (self.point[3], 1.0);
        let mut by_davis = Vector3::zeros();
        let samples = self.segment.speeds_mps.len();
        let mut jacobian = peer::OMatrix::<f64, peer::Dyn, peer::U4>::zeros(samples + 3);
        for i in 0..samples {
            if i > 0 {
                let step = &self.segment.steps[i - 1];
                let advance = StepRule::Distance.advance(step, &davis, speed_mps)?;
                by_initial *= advance.by_speed;
                by_davis = by_davis * advance.by_speed + advance.by_davis;
                speed_mps = advance.speed_mps;
            }
            for parameter in 0..3 {
                jacobian[(i, parameter)] = by_davis[parameter] / SPEED_NOISE_MPS;
            }
            jacobian[(i, 3)] = by_initial / SPEED_NOISE_MPS;
        }
        for (i, (_, weight)) in self.prior().into_iter().enumerate() {
            jacobian[(samples + i, i)] = weight;
        }
        Some(jacobian)
    }
}
