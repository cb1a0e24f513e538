//! Resistance and mass together, by least squares on integrals of motion.

use std::sync::Arc;

use dynocar_core::filter::bank::Bank;
use dynocar_core::filter::drifting_level::BIAS;
use dynocar_core::pipeline::judge::{InputState, Judgement, LackOfFit};
use dynocar_core::pipeline::motion::{
    MOVING_MPS, OutlierRow, SpeedNoise, SpeedRange, StopWatch, Trust, kink_variance,
};
use dynocar_core::pipeline::settings::SettingError;
use dynocar_core::pipeline::{Estimator, InnovationMonitor, Outcome};
use dynocar_core::settings;
use dynocar_model::force::ResolvedSample;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::{ParameterSnapshot, PipelineKind, RejectionReason};
use nalgebra::{Matrix3, SMatrix};

use super::force_model::{BiasModel, DEFAULT_REFERENCE_RADIUS_M, LineResistance, MapError};
use super::integrals::{
    BiasHypothesis, INVERSE_MASS, IntegralStep, Integrals, POLYNOMIALS, RegressorRow, Regressors,
    UNKNOWNS,
};
use super::known_motion::{KnownMotion, LearningSet};

/// Updates between two calculations of the slope of the resistance.
const REFRESH_EVERY: u32 = 50;

/// Learns z1, z2, z3 and the mass together, see [`super::integrals`].
///
/// Levels and, at stops, the mass are marginalised exactly; the information of the legs between stops on the
/// resistances adds up. Several assumptions on the unexplained acceleration run side by side, and the one with the most
/// evidence is published.
#[derive(Clone, Debug)]
pub struct JointLeastSquares {
    pub(super) settings: JointLeastSquaresSettings,
    pub(super) regressors: Regressors,
    initial: Bank<BiasHypothesis, JOINT_MODELS>,
    pub(super) bank: Bank<BiasHypothesis, JOINT_MODELS>,
    stops: StopWatch,
    last: Option<(KnownMotion, Integrals)>,
    integrals: Integrals,
    /// Change of the tied acceleration in the last step, in m/s².
    tied_change: f64,
    /// The resistance a while ago, for its slope.
    latest: LineResistance,
    /// True until a motion begins after the mass was opened: nothing is known of the bias.
    is_opened: bool,
    updates_since_refresh: u32,
    noise: SpeedNoise,
    outliers: OutlierRow,
    pub(super) monitor: InnovationMonitor,
    pub(super) fit: LackOfFit,
    pub(super) speed_mps: f64,
    pub(super) speeds: SpeedRange,
    pub(super) is_fresh_reset: bool,
    pub(super) generation: u64,
}

impl JointLeastSquares {
    /// Returns an estimator for a train.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn new(
        settings: JointLeastSquaresSettings,
        train: &Arc<TrainModel>,
    ) -> Result<Self, SettingError> {
        settings.check_ranges()?;
        let regressors = Regressors::new(train, settings.reference_radius_m);
        let mut mean = RegressorRow::zeros();
        mean[INVERSE_MASS] = 1.0;
        let basic = regressors.basis.of_davis(&train.resistance);
        mean.fixed_rows_mut::<3>(POLYNOMIALS[0]).copy_from(&basic);
        let mut std = RegressorRow::repeat(settings.resistance_std_n_per_kn);
        std[INVERSE_MASS] = 0.01 * settings.mass_std_percent;
        let models = settings.bias_models();
        let initial = Bank::even(models.map(|model| BiasHypothesis::new(model, &mean, &std)), 0.0);
        Ok(JointLeastSquares {
            settings,
            regressors,
            bank: initial.clone(),
            initial,
            stops: StopWatch::new(settings.stop_min_s),
            last: None,
            integrals: Integrals::zero(),
            tied_change: 0.0,
            latest: LineResistance::declared(train),
            is_opened: true,
            updates_since_refresh: 0,
            noise: SpeedNoise::guessed(settings.speed_noise_mps),
            outliers: OutlierRow::default(),
            monitor: InnovationMonitor::new(500),
            fit: LackOfFit::default(),
            speed_mps: 0.0,
            speeds: SpeedRange::default(),
            is_fresh_reset: false,
            generation: 0,
        })
    }
    /// z1, z2 and z3, the latter two beyond the declaration; `None` when the regression is not sound.
    pub fn resistance(&self) -> Option<LineResistance> {
        let solution = self.bank.likeliest().regression.solve()?;
        let [basic, curve, tunnel] = LearningSet::ALL.map(|section| self.davis(&solution, section));
        Some(LineResistance {
            basic,
            curve: Some(curve),
            tunnel: Some(tunnel),
            reference_radius_m: self.regressors.reference_radius_m,
        })
    }

    /// Returns the covariance of [a, b, c] of one polynomial; `None` when the regression is not sound.
    pub fn resistance_covariance(&self, section: LearningSet) -> Option<Matrix3<f64>> {
        let places = [0, 1, 2].map(|i| POLYNOMIALS[section as usize] + i);
        let own = self.covariance(&self.covariance_root()?, places);
        let to_davis = self.regressors.basis.to_davis_matrix();
        Some(to_davis * own * to_davis.transpose())
    }

    /// Returns the mass in kg and its standard deviation; `None` when the regression is not sound.
    pub fn mass_kg(&self) -> Option<(f64, f64)> {
        let inverse = self.bank.likeliest().regression.solve()?[INVERSE_MASS];
        let std = self.covariance_root()?.row(INVERSE_MASS).norm();
        let mass_kg = self.regressors.inertia.reference_mass_kg / inverse;
        Some((mass_kg, mass_kg / inverse * std))
    }

    /// Returns the standard deviation of the measured speed in m/s, as learned.
    pub fn speed_noise_mps(&self) -> f64 {
        self.noise.variance().sqrt()
    }

    pub(super) fn davis(&self, solution: &RegressorRow, section: LearningSet) -> Davis {
        let at = POLYNOMIALS[section as usize];
        self.regressors.basis.to_davis(&solution.fixed_rows::<3>(at).into_owned())
    }

    pub(super) fn covariance_root(&self) -> Option<SMatrix<f64, UNKNOWNS, UNKNOWNS>> {
        self.bank.likeliest().regression.covariance_root()
    }

    /// Covariance of some unknowns from the square root of the whole.
    pub(super) fn covariance<const K: usize>(
        &self,
        root: &SMatrix<f64, UNKNOWNS, UNKNOWNS>,
        places: [usize; K],
    ) -> SMatrix<f64, K, K> {
        SMatrix::from_fn(|i, j| root.row(places[i]).dot(&root.row(places[j])))
    }

    fn begin(&mut self, motion: KnownMotion) -> Outcome {
        self.integrals = Integrals::zero();
        self.tied_change = 0.0;
        let (row, value) = self.integrals.equation(motion.speed_mps);
        let is_opened = std::mem::take(&mut self.is_opened);
        let map = MapError::over(&motion, 0.0, self.regressors.inertia.mps2_per_n_per_kn());
        for (hypothesis, weight) in self.bank.weighed_mut() {
            if is_opened && map.std_mps2 > 0.0 {
                hypothesis.begin_on_map(&map, motion.speed_mps);
            }
            hypothesis.regression.free_level();
            *weight += hypothesis.absorb(&row, value, 1.0 / self.noise.variance());
        }
        self.monitor.break_here();
        self.last = Some((motion, self.regressors.rates(&motion)));
        Outcome::Used
    }

    fn advance(
        &mut self,
        last: (KnownMotion, Integrals),
        motion: KnownMotion,
        step_s: f64,
    ) -> Outcome {
        let rates = self.regressors.rates(&motion);
        self.integrals.add(&last.1, &rates, step_s);
        let (row, value) = self.integrals.equation(motion.speed_mps);
        let step = self.step(&last, &rates, step_s);
        self.bank.hypotheses_mut().iter_mut().for_each(|hypothesis| hypothesis.propagate(&step));
        let variance = self.noise.variance();
        let mut expected = self.bank.likeliest().expect(&row, value, variance);
        if Trust::from_normalised(expected.normalised).is_outlier() {
            // Impossible to one assumption, as a force that jumps to one that knows of none: it gives
            // way to one under which the speed is possible.
            let mut place = self.bank.likeliest_index();
            for (index, hypothesis) in self.bank.hypotheses().iter().enumerate() {
                let other = hypothesis.expect(&row, value, variance);
                let is_possible = !Trust::from_normalised(other.normalised).is_outlier();
                if is_possible && other.normalised.abs() < expected.normalised.abs() {
                    (expected, place) = (other, index);
                }
            }
            self.bank.believe(place);
        }
        if !expected.normalised.is_finite() {
            self.reset();
            return self.begin(motion);
        }
        let trust = Trust::from_normalised(expected.normalised);
        let is_believed = self.outliers.push(trust.is_outlier());
        if trust.is_outlier() {
            if is_believed {
                return self.begin(motion);
            }
            self.bridge(motion, &rates, expected.error_mps, step_s);
            return Outcome::Rejected(RejectionReason::Outlier);
        }
        self.monitor.push(expected.normalised);
        for (hypothesis, weight) in self.bank.weighed_mut() {
            *weight += hypothesis.absorb(&row, value, trust.weight / variance);
        }
        self.noise.take_residual(expected.residual_mps, expected.filtered_variance, trust.weight);
        self.bank.settle();
        self.refresh();
        self.speeds.push(motion.speed_mps);
        self.last = Some((motion, rates));
        Outcome::Updated
    }

    /// Ends a step at the expected speed in place of one that is not believed.
    fn bridge(&mut self, motion: KnownMotion, measured: &Integrals, error_mps: f64, step_s: f64) {
        let expected = KnownMotion { speed_mps: (motion.speed_mps - error_mps).max(0.0), ..motion };
        let rates = self.regressors.rates(&expected);
        self.integrals.correct(measured, &rates, step_s);
        self.last = Some((expected, rates));
    }

    /// Returns a step with the noise of the level in addition to the bias: the error of the trapezoid, and the effect
    /// of the speed's noise on the features, where it moves the resistance, and with it the integral, by a random walk.
    fn step(
        &mut self,
        last: &(KnownMotion, Integrals),
        rates: &Integrals,
        step_s: f64,
    ) -> IntegralStep {
        let [tied, push] = Integrals::changes(&last.1, rates);
        let tied_before = std::mem::replace(&mut self.tied_change, tied);
        let slope = self.latest.slope(&last.0, last.0.speed_mps);
        let walk_mps =
            step_s * self.regressors.inertia.mps2_per_n_per_kn() * slope * self.speed_noise_mps();
        IntegralStep {
            step_s,
            speed_mps: last.0.speed_mps,
            push_change_mps2: push,
            map: MapError::over(&last.0, step_s, self.regressors.inertia.mps2_per_n_per_kn()),
            noise_variance: kink_variance(tied - tied_before, step_s) + walk_mps * walk_mps,
        }
    }

    /// Takes the latest resistance over once in a while; it changes slowly.
    fn refresh(&mut self) {
        self.updates_since_refresh += 1;
        if self.updates_since_refresh >= REFRESH_EVERY {
            self.updates_since_refresh = 0;
            self.latest = self.resistance().unwrap_or(self.latest);
            self.look();
        }
    }

    /// Looks at the force that the bias has to take up.
    fn look(&mut self) {
        let best = self.bank.likeliest();
        let (Some(solution), Some(root)) = (best.regression.solve(), self.covariance_root()) else {
            return;
        };
        let per_bias = best.shape(self.speed_mps) / self.regressors.inertia.mps2_per_n_per_kn();
        self.fit.look(
            per_bias * solution[BIAS],
            per_bias * root.row(BIAS).norm(),
            self.latest.basic.w0_n_per_kn(self.speed_mps),
        );
    }

    fn reset(&mut self) {
        self.bank.clone_from(&self.initial);
        self.noise.reset();
        self.is_opened = true;
        self.is_fresh_reset = true;
        self.generation += 1;
    }
}

impl Estimator for JointLeastSquares {
    fn kind(&self) -> PipelineKind {
        PipelineKind::JointLeastSquares
    }

    fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        if self.stops.departs(sample.time_ns, sample.segment, sample.speed_mps) {
            let relative_std = 0.01 * self.settings.mass_change_std_percent;
            self.bank
                .hypotheses_mut()
                .iter_mut()
                .for_each(|hypothesis| hypothesis.reopen(relative_std));
            self.is_opened = true;
            self.last = None;
        }
        let motion = match KnownMotion::seen(sample, self.settings.speed_min_mps, &mut self.last) {
            Ok(motion) => motion,
            Err(outcome) => return outcome,
        };
        self.speed_mps = motion.speed_mps;
        let step = self.last.and_then(|last| Some((last, motion.step_from(&last.0)?)));
        match step {
            Some((last, step_s)) => self.advance(last, motion, step_s),
            None => self.begin(motion),
        }
    }

    fn write(&self, input: &InputState, snapshot: &mut ParameterSnapshot) -> Judgement {
        self.write_snapshot(input, snapshot).into()
    }
}

/// Number of behaviours of the unexplained acceleration.
pub const JOINT_MODELS: usize = 6;

settings! {
    /// Settings of [`super::JointLeastSquares`].
    #[derive(Copy)]
    JointLeastSquaresSettings {
        /// Standard deviation of the declared mass in %.
        mass_std_percent: f64 = 20.0 => (0.0001 to 50);
        /// Standard deviation in % of a change of mass at a stop; 0 when it never changes.
        mass_change_std_percent: f64 = 10.0 => (0 to 50);
        /// Shortest stop in s at which the mass may change.
        stop_min_s: f64 = 5.0 => (0 to 3600);
        /// Standard deviation in N/kN of the declared resistances.
        resistance_std_n_per_kn: f64 = 5.0 => (0.001 to 100);
        /// Standard deviation of the measured speed in m/s to start with; it is learned.
        speed_noise_mps: f64 = 0.02 => (0.001 to 1);
        /// Standard deviation in m/s² of an acceleration that no parameter explains.
        bias_std_mps2: f64 = 0.01 => (0.0001 to 0.5);
        /// Lowest speed in m/s that is used.
        speed_min_mps: f64 = MOVING_MPS => (0.3 to 20);
        /// Radius in m that the curve resistance refers to.
        reference_radius_m: f64 = DEFAULT_REFERENCE_RADIUS_M => (50 to 10000);
        /// Standard deviation of the mass in % up to which it may be used.
        usable_std_percent: f64 = 2.0 => (0.01 to 50);
        /// Standard deviation in N/kN of the basic resistance up to which it may be used.
        usable_std_n_per_kn: f64 = 0.3 => (0.001 to 10);
    }
}

impl JointLeastSquaresSettings {
    /// Returns the behaviours of the unexplained acceleration: none; slow in proportion to speed; small and large, each
    /// slow and gusty. A constant is z1's to explain, so that 'none' stays far below the accuracy of a leg's
    /// acceleration, 1e-5 m/s²: otherwise every leg would have a constant of its own, and the joint evidence of the
    /// legs would count as less than it is.
    pub fn bias_models(&self) -> [BiasModel; JOINT_MODELS] {
        let model =
            |share: f64, time_s, grows| BiasModel::new(share * self.bias_std_mps2, time_s, grows);
        [
            model(1e-4, f64::INFINITY, false),
            model(1.0, 60.0, true),
            model(0.3, 60.0, false),
            model(0.3, 10.0, false),
            model(1.0, 60.0, false),
            model(1.0, 10.0, false),
        ]
    }
}
