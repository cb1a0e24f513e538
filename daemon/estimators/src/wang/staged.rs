//! Staged learning of resistance and then mass, as Wang 2022.

use std::sync::Arc;

use dynocar_core::pipeline::judge::{InputState, Judgement, StatusInputs};
use dynocar_core::pipeline::motion::{MOVING_MPS, SpeedRange, StopWatch};
use dynocar_core::pipeline::output::{DAVIS_AND_MASS, write_parameters};
use dynocar_core::pipeline::settings::SettingError;
use dynocar_core::pipeline::{Estimator, Outcome};
use dynocar_core::settings;
use dynocar_model::force::ResolvedSample;
use dynocar_model::train::{Davis, TrainModel};
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::{Manoeuvre, ParameterSnapshot, PipelineKind, Reason, Status};
use nalgebra::{Matrix4, SVector, Vector4};
use serde::Deserialize;

use super::descent::MeanSquare;
use super::force_model::{DEFAULT_REFERENCE_RADIUS_M, LineResistance, SpeedBasis};
use super::known_motion::{Inertia, KnownMotion, LearningSet};

/// Number of used samples below which no estimate is reported.
const SAMPLES_MIN: f64 = 50.0;
/// Samples under force from which a mass is published.
const MASS_SAMPLES_MIN: f64 = 25.0;

/// One stage: its samples and its coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stage<const N: usize> {
    sums: MeanSquare<N>,
    coefficients: SVector<f64, N>,
}

impl<const N: usize> Stage<N> {
    fn new(coefficients: SVector<f64, N>) -> Self {
        Stage { sums: MeanSquare::default(), coefficients }
    }
}

/// Share by which the mass may differ between the regression of force on acceleration and its
/// reverse while it is called known.
const BRACKET_MAX: f64 = 0.02;

/// Learns z1 on open track, z2 in curves, z3 in tunnels at the declared mass, and then the mass.
///
/// The acceleration is the differentiated speed, as in the paper's section 3. z2 and z3 are fitted to the residuals of
/// their samples beyond z1 (Algorithm 1, lines 11 to 13).
#[derive(Clone, Debug)]
pub struct StagedDescent {
    settings: StagedDescentSettings,
    basis: SpeedBasis,
    inertia: Inertia,
    /// z1 on the open track.
    basic: Stage<3>,
    /// z1, which is known by then, and z2.
    curve: Stage<6>,
    /// z1, which is known by then, and z3.
    tunnel: Stage<6>,
    mass: Stage<1>,
    learned: u64,
    stops: StopWatch,
    last: Option<KnownMotion>,
    speeds: SpeedRange,
}

impl StagedDescent {
    /// Returns an estimator for a train.
    ///
    /// # Errors
    ///
    /// When a setting lies outside its range.
    pub fn new(
        settings: StagedDescentSettings,
        train: &Arc<TrainModel>,
    ) -> Result<Self, SettingError> {
        settings.check_ranges()?;
        let basis = SpeedBasis::new(train.speed_max_mps().filter(|&v| v > 5.0).unwrap_or(40.0));
        Ok(StagedDescent {
            settings,
            basis,
            inertia: Inertia::from_train(train),
            basic: Stage::new(basis.of_davis(&train.resistance)),
            curve: Stage::new(SVector::zeros()),
            tunnel: Stage::new(SVector::zeros()),
            mass: Stage::new(SVector::from([1.0])),
            learned: 0,
            stops: StopWatch::new(settings.stop_min_s),
            last: None,
            speeds: SpeedRange::default(),
        })
    }

    /// z1, z2 and z3 as learned so far, the latter two beyond the declaration.
    pub fn resistance(&self) -> LineResistance {
        let [basic, curve, tunnel] = LearningSet::ALL.map(|section| self.davis(section));
        LineResistance {
            basic,
            curve: Some(curve),
            tunnel: Some(tunnel),
            reference_radius_m: self.settings.reference_radius_m,
        }
    }

    /// Takes over resistances that were learned before; the mass is learned from the next
    /// sample on.
    pub fn resume(&mut self, resistance: &LineResistance) {
        let zero = Davis { a: 0.0, b: 0.0, c: 0.0 };
        let rest = |davis: Option<Davis>| self.basis.of_davis(&davis.unwrap_or(zero));
        let (curve, tunnel) = (rest(resistance.curve), rest(resistance.tunnel));
        self.basic.coefficients = self.basis.of_davis(&resistance.basic);
        self.curve.coefficients.fixed_rows_mut::<3>(3).copy_from(&curve);
        self.tunnel.coefficients.fixed_rows_mut::<3>(3).copy_from(&tunnel);
        self.settings.reference_radius_m = resistance.reference_radius_m;
        self.learned = self.settings.resistance_samples;
    }

    /// Returns the mass in kg; the declared one before the last stage.
    pub fn mass_kg(&self) -> f64 {
        match self.settings.mass_regression {
            MassRegression::ForceOnAcceleration => {
                self.inertia.reference_mass_kg * self.mass.coefficients[0]
            }
            MassRegression::AccelerationOnForce => {
                self.inertia.reference_mass_kg / self.mass.coefficients[0]
            }
        }
    }

    fn davis(&self, section: LearningSet) -> Davis {
        let rest = |stage: &Stage<6>| stage.coefficients.fixed_rows::<3>(3).into_owned();
        self.basis.to_davis(&match section {
            LearningSet::Basic => self.basic.coefficients,
            LearningSet::Curve => rest(&self.curve),
            LearningSet::Tunnel => rest(&self.tunnel),
        })
    }

    fn learn(&mut self, from: &KnownMotion, to: &KnownMotion, step_s: f64) -> Outcome {
        let speed_mps = 0.5 * (from.speed_mps + to.speed_mps);
        let force_n = 0.5 * (from.force_n + to.force_n);
        let known = 0.5 * (from.known_n_per_kn + to.known_n_per_kn);
        let acceleration_mps2 = (to.speed_mps - from.speed_mps) / step_s;
        let inertia_mps2 = self.inertia.inertial_mass_kg(1.0) * acceleration_mps2;
        self.speeds.push(speed_mps);
        if self.learned >= self.settings.resistance_samples {
            let at = KnownMotion { speed_mps, known_n_per_kn: known, ..*to };
            let w = self.resistance().w_n_per_kn(&at, speed_mps);
            return self.learn_mass(force_n, inertia_mps2 + 1e-3 * GRAVITY_MPS2 * w);
        }
        self.learned += 1;
        let Some(section) = LearningSet::new(from, to) else { return Outcome::Used };
        // Eq. (11), (12) and (18), uphill positive where the text has it negative, G in N and
        // the resistance per kN of it, and the rotating mass that (18) leaves out.
        let specific_mps2 = force_n / to.declared_kg - inertia_mps2;
        let target = 1e3 * specific_mps2 / GRAVITY_MPS2 - known;
        self.descend(section, speed_mps, target, to);
        Outcome::Updated
    }

    fn descend(&mut self, section: LearningSet, speed_mps: f64, target: f64, at: &KnownMotion) {
        let (steps, rate) = (self.settings.steps_per_sample, self.settings.rate);
        let phi = self.basis.at(speed_mps);
        let (stage, share) = match section {
            LearningSet::Basic => {
                self.basic.sums.add(&phi, target);
                for _ in 0..steps {
                    self.basic.sums.step(&mut self.basic.coefficients, 0, rate);
                }
                return;
            }
            LearningSet::Curve => {
                (&mut self.curve, self.settings.reference_radius_m * at.curvature_per_m)
            }
            LearningSet::Tunnel => (&mut self.tunnel, at.tunnel_share),
        };
        let mut features = SVector::<f64, 6>::zeros();
        features.fixed_rows_mut::<3>(0).copy_from(&phi);
        features.fixed_rows_mut::<3>(3).copy_from(&(phi * share));
        stage.sums.add(&features, target);
        stage.coefficients.fixed_rows_mut::<3>(0).copy_from(&self.basic.coefficients);
        for _ in 0..steps {
            stage.sums.step(&mut stage.coefficients, 3, rate);
        }
    }

    /// `specific_mps2` is force over mass as the motion shows it.
    fn learn_mass(&mut self, force_n: f64, specific_mps2: f64) -> Outcome {
        let push_mps2 = force_n / self.inertia.reference_mass_kg;
        if push_mps2.abs() < 1e-3 * GRAVITY_MPS2 * self.settings.force_min_n_per_kn {
            return Outcome::Used;
        }
        match self.settings.mass_regression {
            MassRegression::ForceOnAcceleration => {
                self.mass.sums.add(&SVector::from([specific_mps2]), push_mps2);
            }
            MassRegression::AccelerationOnForce => {
                self.mass.sums.add(&SVector::from([push_mps2]), specific_mps2);
            }
        }
        for _ in 0..self.settings.steps_per_sample {
            self.mass.sums.step(&mut self.mass.coefficients, 0, self.settings.rate);
        }
        Outcome::Updated
    }
}

impl StagedDescent {
    /// Returns the standard deviation of the mass in kg by the textbook formula.
    fn mass_std_kg(&self) -> Option<f64> {
        if self.mass.sums.count < MASS_SAMPLES_MIN {
            return None;
        }
        let variance = self.mass.sums.covariance(&self.mass.coefficients)?[0];
        Some(self.mass_kg() * variance.sqrt() / self.mass.coefficients[0].abs())
    }

    /// Returns how far the regression of force on acceleration and its reverse lie apart, as a share of
    /// the mass.
    ///
    /// Either is biased by the noise of its regressor, in opposite directions, so that the true
    /// mass lies between them (Frisch 1934); a textbook standard deviation does not show it.
    fn mass_bracket(&self) -> f64 {
        1.0 / self.mass.sums.explained_share() - 1.0
    }

    fn case(&self, input: &InputState, is_mass_known: bool) -> StatusInputs {
        let is_begun = self.basic.sums.count >= SAMPLES_MIN || is_mass_known;
        let is_bracketed = self.mass_bracket() <= BRACKET_MAX;
        StatusInputs {
            fault: None,
            input: input.doubt,
            is_ready: self.learned >= self.settings.resistance_samples,
            is_known: is_mass_known,
            lacking: if is_begun { Status::Degraded } else { Status::Unestimated },
            contradiction: (!is_bracketed).then_some(Reason::NotIdentifiable),
            caveat: Reason::None,
        }
    }
}

impl Estimator for StagedDescent {
    fn kind(&self) -> PipelineKind {
        PipelineKind::StagedDescent
    }

    fn update(&mut self, sample: &ResolvedSample) -> Outcome {
        if self.stops.departs(sample.time_ns, sample.segment, sample.speed_mps) {
            self.mass.sums = MeanSquare::default();
        }
        let motion = match KnownMotion::seen(sample, self.settings.speed_min_mps, &mut self.last) {
            Ok(motion) => motion,
            Err(outcome) => return outcome,
        };
        let step = self.last.and_then(|last| Some((last, motion.step_from(&last)?)));
        self.last = Some(motion);
        match step {
            Some((last, step_s)) => self.learn(&last, &motion, step_s),
            None => Outcome::Used,
        }
    }

    fn write(&self, input: &InputState, snapshot: &mut ParameterSnapshot) -> Judgement {
        let davis = self.davis(LearningSet::Basic);
        let mass_std_kg = self.mass_std_kg();
        let mut covariance = Matrix4::zeros();
        let basic = self.basic.sums.covariance(&self.basic.coefficients);
        if let Some(own) = basic {
            let to_davis = self.basis.to_davis_matrix();
            let block = to_davis * own * to_davis.transpose();
            covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&block);
        }
        covariance[(3, 3)] = mass_std_kg.map_or(0.0, |std| std * std);
        write_parameters(
            snapshot,
            DAVIS_AND_MASS,
            &Vector4::new(davis.a, davis.b, davis.c, self.mass_kg()),
            &covariance,
        );
        let is_basic_known = basic.is_some() && self.basic.sums.count >= SAMPLES_MIN;
        snapshot.excited = if is_basic_known { 0b111 } else { 0 };
        snapshot.excited |= u32::from(mass_std_kg.is_some()) << 3;
        snapshot.missing_manoeuvres =
            if mass_std_kg.is_some() { 0 } else { Manoeuvre::Accelerate.bit() };
        self.speeds.write(snapshot);
        self.case(input, mass_std_kg.is_some()).verdict().into()
    }
}

/// Regression of the mass; the paper does not say which.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MassRegression {
    /// Force on the differentiated speed. Its noise is in the regressor and pulls the mass down:
    /// the shortfall that Table 3 shows.
    #[default]
    ForceOnAcceleration,
    /// The differentiated speed on force, as eq. (27) has it: unbiased.
    AccelerationOnForce,
}

settings! {
    /// Settings of [`super::StagedDescent`].
    #[derive(Copy)]
    StagedDescentSettings {
        /// Regression of the mass.
        mass_regression: MassRegression = MassRegression::ForceOnAcceleration;
        /// Samples of the first stages, driven at the declared mass; the mass is learned after.
        resistance_samples: u64 = 28_000 => (0 to 1000000000);
        /// Steps down the gradient with each sample.
        steps_per_sample: u32 = 4 => (1 to 100);
        /// Length of a step relative to the inverse trace of the second derivative.
        rate: f64 = 1.0 => (0.001 to 1.9);
        /// Shortest stop in s at which the mass may change.
        stop_min_s: f64 = 5.0 => (0 to 3600);
        /// Lowest speed in m/s that is used.
        speed_min_mps: f64 = MOVING_MPS => (0.3 to 20);
        /// Least force in N/kN on which mass is learned.
        force_min_n_per_kn: f64 = 5.0 => (0 to 100);
        /// Radius in m that the curve resistance refers to.
        reference_radius_m: f64 = DEFAULT_REFERENCE_RADIUS_M => (50 to 10000);
    }
}
