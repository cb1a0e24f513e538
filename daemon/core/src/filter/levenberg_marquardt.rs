//! Small nonlinear least squares in a box.
//!
//! Gauss-Newton steps with the damping of Levenberg and Marquardt (Moré 1978, in scaled
//! variables), taken as the exact minimiser of the damped quadratic model within the box
//! (active set). Clipping an unbounded step instead would ruin it where parameters are
//! correlated, as Davis a and b are in cruise. JᵀJ is never formed.

use nalgebra::SVector;

use super::triangular::TriangularSystem;

/// A sum of squared residuals over `N` parameters.
pub trait LeastSquares<const N: usize> {
    /// Returns the cost and linear model at a point; `None` where the residuals are not defined.
    fn linearise(&mut self, point: &SVector<f64, N>) -> Option<Linearisation<N>>;

    /// Called after the newest linearised point has become the current one.
    fn accept(&mut self) {}
}

/// Cost ½ Σ r² at a point, with its linear model: ½ ‖R δ + z‖² is the cost after a step δ, up
/// to a constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linearisation<const N: usize> {
    /// Half the sum of squared residuals.
    pub cost: f64,
    /// R and z.
    pub system: TriangularSystem<N>,
    /// Decrease of the cost that the next linearisation promises by parameters which the problem has eliminated and
    /// moves itself; 0 when there are no such parameters.
    pub nested_decrease: f64,
}

/// The lowest and highest values of the parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterBox<const N: usize> {
    /// Lowest values; may be -infinity.
    pub low: SVector<f64, N>,
    /// Highest values, none below the lowest; may be infinity.
    pub high: SVector<f64, N>,
}

impl<const N: usize> ParameterBox<N> {
    /// Returns the point of the box nearest to a point.
    pub fn clamp(&self, point: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::from_fn(|i, _| point[i].max(self.low[i]).min(self.high[i]))
    }

    /// Returns true for a point in the box or on its faces.
    pub fn contains(&self, point: &SVector<f64, N>) -> bool {
        (0..N).all(|i| (self.low[i]..=self.high[i]).contains(&point[i]))
    }
}

/// When to stop, and in which units to measure a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverSettings<const N: usize> {
    /// Typical sizes of the parameters.
    pub scales: SVector<f64, N>,
    /// Most linearisations after the first.
    pub iterations_max: u32,
    /// Converged when the linear model promises less than this decrease of the cost. With
    /// residuals in standard deviations, ε stands for a step of √(2 ε) standard deviations.
    pub decrease_tolerance: f64,
    /// Converged likewise when it promises less than this share of the cost.
    pub relative_tolerance: f64,
}

/// How the solver ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Termination {
    /// No step promises a decrease worth taking.
    Converged,
    /// No step decreases the cost although the model promises one; at the limit of round-off.
    Stalled,
    /// The iterations ran out.
    IterationsExhausted,
}

/// Where the solver ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeastSquaresSolution<const N: usize> {
    /// The parameters.
    pub point: SVector<f64, N>,
    /// Cost and linear model there.
    pub linearisation: Linearisation<N>,
    /// Linearisations after the first.
    pub iterations: u32,
    /// Why it ended.
    pub stop: Termination,
}

/// Damping below which a step is Gauss-Newton's; keeps unexcited directions where they are.
const DAMPING_MIN: f64 = 1e-13;
const DAMPING_FIRST_FAILURE: f64 = 1e-3;
const DAMPING_MAX: f64 = 1e6;

/// Minimises a sum of squares in a box from a start, which is moved into the box.
///
/// `None` when the residuals are not defined at the start.
///
/// # Real-time
///
/// Allocates nothing.
pub fn minimise<const N: usize>(
    problem: &mut impl LeastSquares<N>,
    start: &SVector<f64, N>,
    bounds: &ParameterBox<N>,
    settings: &SolverSettings<N>,
) -> Option<LeastSquaresSolution<N>> {
    let mut point = bounds.clamp(start);
    let mut current = problem.linearise(&point)?;
    problem.accept();
    let mut damping = DAMPING_MIN;
    let mut iterations = 0;
    let stop = loop {
        let (step, decrease) = bounded_step(&current.system, &point, bounds, settings, damping);
        let decrease = decrease + current.nested_decrease;
        let enough = settings.decrease_tolerance.max(settings.relative_tolerance * current.cost);
        // Also ends on a step that is not finite.
        if !(decrease > enough) {
            break if damping > DAMPING_FIRST_FAILURE {
                Termination::Stalled
            } else {
                Termination::Converged
            };
        }
        if iterations == settings.iterations_max {
            break Termination::IterationsExhausted;
        }
        iterations += 1;
        let trial_point = bounds.clamp(&(point + step));
        let trial = problem.linearise(&trial_point);
        match trial.filter(|trial| trial.cost < current.cost) {
            Some(trial) => {
                let is_as_promised = current.cost - trial.cost > 0.25 * decrease;
                damping = if is_as_promised { damping * 0.3 } else { damping * 2.0 };
                damping = damping.max(DAMPING_MIN);
                (point, current) = (trial_point, trial);
                problem.accept();
            }
            None if damping >= DAMPING_MAX => break Termination::Stalled,
            None => damping = (damping * 4.0).max(DAMPING_FIRST_FAILURE),
        }
    };
    Some(LeastSquaresSolution { point, linearisation: current, iterations, stop })
}

/// Returns the minimiser of the damped model within the box, and the decrease of the undamped model.
fn bounded_step<const N: usize>(
    system: &TriangularSystem<N>,
    point: &SVector<f64, N>,
    bounds: &ParameterBox<N>,
    settings: &SolverSettings<N>,
    damping: f64,
) -> (SVector<f64, N>, f64) {
    let scales = &settings.scales;
    let mut scaled = *system;
    for (j, mut column) in scaled.factor.column_iter_mut().enumerate() {
        column *= scales[j];
    }
    let largest = scaled.factor.column_iter().map(|column| column.norm()).fold(0.0, f64::max);
    let weight = damping * largest;
    let model = DampedModel { system: scaled, weight };
    let low = (bounds.low - point).component_div(scales);
    let high = (bounds.high - point).component_div(scales);
    let step = model.minimise_within(&low, &high);
    let before = 0.5 * system.residual.norm_squared();
    let after = 0.5 * (scaled.factor * step + scaled.residual).norm_squared();
    (step.component_mul(scales), before - after)
}

struct DampedModel<const N: usize> {
    system: TriangularSystem<N>,
    weight: f64,
}

impl<const N: usize> DampedModel<N> {
    /// Minimises ‖R u + z‖² + weight² ‖u‖² for low <= u <= high, where low <= 0 <= high.
    fn minimise_within(&self, low: &SVector<f64, N>, high: &SVector<f64, N>) -> SVector<f64, N> {
        let mut step = SVector::<f64, N>::zeros();
        let gradient = self.gradient(&step);
        let mut is_held: [bool; N] = std::array::from_fn(|i| {
            (low[i] == 0.0 && gradient[i] > 0.0) || (high[i] == 0.0 && gradient[i] < 0.0)
        });
        // Each round holds or releases one parameter; a convex model needs few.
        for _ in 0..4 * N + 1 {
            let Some(target) = self.minimise_free(&step, &is_held) else { break };
            match first_bound(&step, &target, low, high, &is_held) {
                Some((parameter, share)) => {
                    step += (target - step) * share;
                    let is_low = target[parameter] < step[parameter];
                    step[parameter] = if is_low { low[parameter] } else { high[parameter] };
                    is_held[parameter] = true;
                }
                None => {
                    step = target;
                    let gradient = self.gradient(&step);
                    let pull = |i: usize| match is_held[i] {
                        true if step[i] == low[i] => -gradient[i],
                        true => gradient[i],
                        false => 0.0,
                    };
                    let release = (0..N).max_by(|&i, &j| pull(i).total_cmp(&pull(j)));
                    match release.filter(|&i| pull(i) > 0.0) {
                        Some(parameter) => is_held[parameter] = false,
                        None => break,
                    }
                }
            }
        }
        step
    }

    fn gradient(&self, step: &SVector<f64, N>) -> SVector<f64, N> {
        let residual = self.system.factor * step + self.system.residual;
        self.system.factor.tr_mul(&residual) + step * (self.weight * self.weight)
    }

    /// The minimiser over the parameters that are not held.
    fn minimise_free(
        &self,
        step: &SVector<f64, N>,
        is_held: &[bool; N],
    ) -> Option<SVector<f64, N>> {
        let mut free = self.system;
        for i in 0..N {
            if is_held[i] {
                free.residual += free.factor.column(i) * step[i];
                free.factor.column_mut(i).fill(0.0);
            }
        }
        for i in 0..N {
            let mut row = SVector::<f64, N>::zeros();
            row[i] = if is_held[i] { 1.0 } else { self.weight };
            free.append(row, if is_held[i] { -step[i] } else { 0.0 });
        }
        free.minimiser()
    }
}

/// The first bound on the way from a step to a target: parameter and share of the way.
fn first_bound<const N: usize>(
    step: &SVector<f64, N>,
    target: &SVector<f64, N>,
    low: &SVector<f64, N>,
    high: &SVector<f64, N>,
    is_held: &[bool; N],
) -> Option<(usize, f64)> {
    let mut first: Option<(usize, f64)> = None;
    for i in (0..N).filter(|&i| !is_held[i]) {
        let bound = if target[i] < low[i] {
            low[i]
        } else if target[i] > high[i] {
            high[i]
        } else {
            continue;
        };
        let share = (bound - step[i]) / (target[i] - step[i]);
        if first.is_none_or(|(_, least)| share < least) {
            first = Some((i, share));
        }
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::triangular::TriangularAccumulator;

    /// Rosenbrock's valley as residuals 10 (y - x²) and 1 - x.
    struct Valley;

    impl LeastSquares<2> for Valley {
        fn linearise(&mut self, point: &SVector<f64, 2>) -> Option<Linearisation<2>> {
            let (x, y) = (point[0], point[1]);
            let residuals = [10.0 * (y - x * x), 1.0 - x];
            let mut rows = TriangularAccumulator::<3>::default();
            rows.push(&[-20.0 * x, 10.0, residuals[0]]);
            rows.push(&[-1.0, 0.0, residuals[1]]);
            let cost = 0.5 * residuals.iter().map(|r| r * r).sum::<f64>();
            let system = TriangularSystem::from_rows(&mut rows);
            Some(Linearisation { cost, system, nested_decrease: 0.0 })
        }
    }

    /// min ‖R x - target‖², linear.
    struct Linear(TriangularSystem<2>);

    impl LeastSquares<2> for Linear {
        fn linearise(&mut self, point: &SVector<f64, 2>) -> Option<Linearisation<2>> {
            let mut system = self.0;
            system.residual += system.factor * point;
            let cost = 0.5 * system.residual.norm_squared();
            Some(Linearisation { cost, system, nested_decrease: 0.0 })
        }
    }

    fn settings() -> SolverSettings<2> {
        SolverSettings {
            scales: SVector::<f64, 2>::repeat(1.0),
            iterations_max: 100,
            decrease_tolerance: 1e-24,
            relative_tolerance: 0.0,
        }
    }

    fn everywhere() -> ParameterBox<2> {
        ParameterBox {
            low: SVector::repeat(f64::NEG_INFINITY),
            high: SVector::repeat(f64::INFINITY),
        }
    }

    #[test]
    fn the_curved_valley_is_followed_to_its_minimum() {
        let start = SVector::<f64, 2>::new(-1.2, 1.0);
        let solution = minimise(&mut Valley, &start, &everywhere(), &settings()).unwrap();
        assert!((solution.point - SVector::<f64, 2>::new(1.0, 1.0)).norm() < 1e-9);
        assert!(solution.iterations < 60);
    }

    #[test]
    fn a_minimum_outside_the_box_is_found_on_its_face() {
        // Strongly correlated: clipping the free minimiser (1, 1) to x <= 0.5 would give y = 1.
        let factor = nalgebra::Matrix2::new(1.0, 1.0, 0.0, 0.01);
        let free = SVector::<f64, 2>::new(1.0, 1.0);
        let mut problem = Linear(TriangularSystem { factor, residual: -factor * free });
        let bounds = ParameterBox {
            low: SVector::<f64, 2>::new(0.0, 0.0),
            high: SVector::<f64, 2>::new(0.5, 10.0),
        };
        let solution = minimise(&mut problem, &SVector::zeros(), &bounds, &settings()).unwrap();
        // With x = 0.5 held: y minimises (0.5 + y - 2)² + 0.0001 (y - 1)².
        let y = (1.5 + 0.0001) / 1.0001;
        assert!((solution.point - SVector::<f64, 2>::new(0.5, y)).norm() < 1e-9);
        assert_eq!(solution.stop, Termination::Converged);
    }

    #[test]
    fn a_parameter_leaves_its_bound_when_the_cost_falls_inwards() {
        let factor = nalgebra::Matrix2::new(1.0, 0.2, 0.0, 1.0);
        let free = SVector::<f64, 2>::new(0.4, 0.3);
        let mut problem = Linear(TriangularSystem { factor, residual: -factor * free });
        let bounds = ParameterBox { low: SVector::zeros(), high: SVector::repeat(1.0) };
        let start = SVector::<f64, 2>::new(0.0, 1.0);
        let solution = minimise(&mut problem, &start, &bounds, &settings()).unwrap();
        assert!((solution.point - free).norm() < 1e-9);
    }

    #[test]
    fn an_undetermined_direction_stays_where_it_is() {
        let factor = nalgebra::Matrix2::new(1.0, 0.0, 0.0, 0.0);
        let residual = SVector::<f64, 2>::new(-3.0, 0.0);
        let mut problem = Linear(TriangularSystem { factor, residual });
        let start = SVector::<f64, 2>::new(0.0, 0.7);
        let solution = minimise(&mut problem, &start, &everywhere(), &settings()).unwrap();
        assert!((solution.point - SVector::<f64, 2>::new(3.0, 0.7)).norm() < 1e-9);
    }

    #[test]
    fn an_undefined_start_is_said_so() {
        struct Nowhere;
        impl LeastSquares<2> for Nowhere {
            fn linearise(&mut self, _: &SVector<f64, 2>) -> Option<Linearisation<2>> {
                None
            }
        }
        let start = SVector::<f64, 2>::zeros();
        assert_eq!(minimise(&mut Nowhere, &start, &everywhere(), &settings()), None);
    }
}
