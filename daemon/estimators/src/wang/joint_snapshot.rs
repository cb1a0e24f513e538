//! Contents of a snapshot by [`JointLeastSquares`].

use dynocar_core::filter::drifting_level::BIAS;
use dynocar_core::pipeline::judge::{InputState, StatusInputs};
use dynocar_core::pipeline::output::{
    DAVIS_AND_MASS, excitation, write_innovations, write_parameters,
};
use dynocar_shared::{ParameterSnapshot, Reason, Status};
use nalgebra::{Matrix4, SMatrix, Vector3, Vector4};

use super::integrals::{INVERSE_MASS, POLYNOMIALS, RegressorRow, UNKNOWNS};
use super::joint::JointLeastSquares;
use super::known_motion::LearningSet;

/// Number of used samples below which no estimate is reported.
const SAMPLES_MIN: u64 = 50;
/// Shares of the highest speed at which a, b and c are judged.
const JUDGED_AT: [f64; 3] = [0.1, 0.5, 0.9];

impl JointLeastSquares {
    /// Writes estimate, excitation and unexplained force; returns status and reason.
    pub(super) fn write_snapshot(
        &self,
        input: &InputState,
        snapshot: &mut ParameterSnapshot,
    ) -> (Status, Reason) {
        snapshot.generation = self.generation;
        write_innovations(snapshot, &self.monitor);
        let best = self.bank.likeliest();
        let (Some(solution), Some(root)) = (best.regression.solve(), self.covariance_root()) else {
            snapshot.parameter_count = 0;
            return (Status::Invalid, Reason::NumericalFailure);
        };
        let mass_std = self.write_estimate(&solution, &root, snapshot);
        let is_mass_known = mass_std <= 0.01 * self.settings.usable_std_percent;
        let usable = self.settings.usable_std_n_per_kn;
        let known = self.resistance_stds(&root).map(|std| std <= usable);
        (snapshot.excited, snapshot.missing_manoeuvres) =
            excitation([known[0], known[1], known[2], is_mass_known]);
        let inertia = &self.regressors.inertia;
        let mass_kg = inertia.reference_mass_kg / solution[INVERSE_MASS];
        let inertia_kg = inertia.inertial_mass_kg(mass_kg);
        let shape = best.shape(self.speed_mps);
        snapshot.unexplained_force_n = -shape * solution[BIAS] * inertia_kg;
        snapshot.unexplained_force_std_n = shape * root.row(BIAS).norm() * inertia_kg;
        self.speeds.write(snapshot);
        self.case(input, is_mass_known, known[1]).verdict()
    }

    fn case(
        &self,
        input: &InputState,
        is_mass_known: bool,
        is_resistance_known: bool,
    ) -> StatusInputs {
        let some = is_mass_known || is_resistance_known;
        let failure = (Status::Invalid, Reason::NumericalFailure);
        let lasting = self.fit.is_lasting().then_some(Reason::InnovationsNotWhite);
        StatusInputs {
            fault: (self.is_fresh_reset && !is_mass_known).then_some(failure),
            input: input.doubt,
            is_ready: input.used >= SAMPLES_MIN,
            is_known: is_mass_known && is_resistance_known,
            lacking: if some { Status::Degraded } else { Status::Unestimated },
            contradiction: lasting.or_else(|| self.monitor.contradiction()),
            caveat: Reason::None,
        }
    }

    /// Writes values and covariance of [a, b, c, mass]; gives the relative standard
    /// deviation of the mass.
    fn write_estimate(
        &self,
        solution: &RegressorRow,
        root: &SMatrix<f64, UNKNOWNS, UNKNOWNS>,
        snapshot: &mut ParameterSnapshot,
    ) -> f64 {
        let davis = self.davis(solution, LearningSet::Basic);
        let inverse = solution[INVERSE_MASS];
        let mass_kg = self.regressors.inertia.reference_mass_kg / inverse;
        let first = POLYNOMIALS[LearningSet::Basic as usize];
        let own = self.covariance(root, [first, first + 1, first + 2, INVERSE_MASS]);
        let mut to_units = Matrix4::zeros();
        let to_davis = self.regressors.basis.to_davis_matrix();
        to_units.fixed_view_mut::<3, 3>(0, 0).copy_from(&to_davis);
        to_units[(3, 3)] = -mass_kg / inverse;
        write_parameters(
            snapshot,
            DAVIS_AND_MASS,
            &Vector4::new(davis.a, davis.b, davis.c, mass_kg),
            &(to_units * own * to_units.transpose()),
        );
        own[(3, 3)].sqrt() / inverse.abs()
    }

    /// Returns the standard deviations of the basic resistance in N/kN at low, middle and high speed.
    fn resistance_stds(&self, root: &SMatrix<f64, UNKNOWNS, UNKNOWNS>) -> [f64; 3] {
        let first = POLYNOMIALS[LearningSet::Basic as usize];
        let own = self.covariance(root, [first, first + 1, first + 2]);
        JUDGED_AT.map(|share| {
            let phi: Vector3<f64> =
                self.regressors.basis.at(share * self.regressors.basis.scale_mps);
            phi.dot(&(own * phi)).max(0.0).sqrt()
        })
    }
}
