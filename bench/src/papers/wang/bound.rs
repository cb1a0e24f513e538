//! Cramér–Rao bounds of the scenario, from the sensitivities of the true motion.

use dynocar_core::filter::Gaussian;
use dynocar_estimators::wang::force_model::SpeedBasis;
use dynocar_model::train::Davis;
use dynocar_shared::resistance::GRAVITY_MPS2;
use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, Vector4};

use super::ride::{GUST_STD_MPS, GUST_TIME_S, MEAN_WIND_STD_MPS, speed_variance};
use super::shuttle::{PERIOD_S, Shuttle, ShuttleMoment};

/// Unknowns: inverse mass relative to the true one, then z1, z2, z3 in a basis.
const UNKNOWNS: usize = 10;
/// The unknowns and the speed at the start of a leg.
const WITH_START: usize = UNKNOWNS + 1;

/// Information of a drive on mass and resistance.
#[derive(Clone, Debug)]
pub struct FisherInformation {
    matrix: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    basis: SpeedBasis,
}

impl FisherInformation {
    /// Returns the Fisher information of a drive, every sample of which has white Gaussian noise of the
    /// sensor's variance; the speed at the start of each leg is unknown.
    ///
    /// The sensitivities S of the speed obey S' = ∂a/∂v S + ∂a/∂theta along the true motion.
    pub fn new(shuttle: &Shuttle, ride: &[ShuttleMoment]) -> Self {
        let basis = SpeedBasis::new(30.0);
        let mut total = SMatrix::zeros();
        for leg in ride.split(|instant| instant.speed_mps <= 0.0).filter(|leg| leg.len() > 1) {
            total += leg_information(shuttle, leg, &basis);
        }
        FisherInformation { matrix: total, basis }
    }

    /// Returns the least standard deviation of the mass, relative, when all resistances are known.
    pub fn mass_std(&self) -> f64 {
        self.matrix[(0, 0)].powf(-0.5)
    }

    /// Returns the same with a constant acceleration of unknown size besides the known forces.
    pub fn mass_std_with_bias(&self) -> f64 {
        // The constant is the coefficient of the first polynomial of z1.
        let (own, cross, other) = (self.matrix[(0, 0)], self.matrix[(0, 1)], self.matrix[(1, 1)]);
        (own - cross * cross / other).powf(-0.5)
    }

    /// Returns the least root mean square error in N/kN of z1, z2 or z3 over some speeds in m/s, the mass
    /// known.
    pub fn resistance_std(&self, section: usize, speeds_mps: &[f64]) -> f64 {
        let own = self.matrix.fixed_view::<9, 9>(1, 1).into_owned();
        let covariance = own.cholesky().expect("all sections are driven").inverse();
        let block: Matrix3<f64> =
            covariance.fixed_view::<3, 3>(3 * section, 3 * section).into_owned();
        let square = |&speed: &f64| {
            let phi = self.basis.at(speed);
            phi.dot(&(block * phi))
        };
        (speeds_mps.iter().map(square).sum::<f64>() / speeds_mps.len() as f64).sqrt()
    }
}

fn leg_information(
    shuttle: &Shuttle,
    leg: &[ShuttleMoment],
    basis: &SpeedBasis,
) -> SMatrix<f64, UNKNOWNS, UNKNOWNS> {
    let per_n_per_kn = 1e-3 * GRAVITY_MPS2;
    let mut sensitivity = SVector::<f64, WITH_START>::zeros();
    sensitivity[UNKNOWNS] = 1.0;
    let mut whole = SMatrix::<f64, WITH_START, WITH_START>::zeros();
    let mut before: Option<(SVector<f64, WITH_START>, f64)> = None;
    for instant in leg {
        let shares = shuttle.shares(instant.position_m);
        let phi = basis.at(instant.speed_mps) * per_n_per_kn;
        let mut direct = SVector::<f64, WITH_START>::zeros();
        direct[0] = instant.force_n / instant.mass_kg;
        for (i, share) in shares.into_iter().enumerate() {
            direct.fixed_rows_mut::<3>(1 + 3 * i).copy_from(&(phi * -share));
        }
        let slope = |davis: &Davis| davis.b + 2.0 * davis.c * instant.speed_mps;
        let damping = per_n_per_kn * shuttle.sum(instant.position_m, slope);
        if let Some((direct_before, damping_before)) = before {
            let mean_damping = 0.5 * (damping_before + damping);
            sensitivity *= (-PERIOD_S * mean_damping).exp();
            sensitivity += (direct_before + direct) * (0.5 * PERIOD_S);
        }
        before = Some((direct, damping));
        whole += sensitivity * sensitivity.transpose() / speed_variance();
    }
    // The start is nobody's question: its Schur complement is left.
    let cross = whole.fixed_view::<UNKNOWNS, 1>(0, UNKNOWNS).into_owned();
    whole.fixed_view::<UNKNOWNS, UNKNOWNS>(0, 0)
        - cross * cross.transpose() / whole[(UNKNOWNS, UNKNOWNS)]
}

/// Posterior Cramér–Rao bound of the mass, relative, under the scenario's wind: the covariance
/// of a Kalman filter that knows the law of the wind and linearises at the true motion.
///
/// State: speed, inverse mass, mean wind, gust.
pub fn mass_std_in_wind(shuttle: &Shuttle, leg: &[ShuttleMoment]) -> f64 {
    let per_n_per_kn = 1e-3 * GRAVITY_MPS2;
    let std = Vector4::new(10.0, 1.0, MEAN_WIND_STD_MPS, GUST_STD_MPS);
    let mut filter = Gaussian::independent(Vector4::zeros(), std);
    let keep = (-PERIOD_S / GUST_TIME_S).exp();
    let gusts = GUST_STD_MPS * GUST_STD_MPS * (1.0 - keep * keep);
    let noise = Matrix4::from_diagonal(&Vector4::new(0.0, 0.0, 0.0, gusts));
    for instant in leg.iter().filter(|instant| instant.speed_mps > 0.0) {
        filter.measure(0, 0.0, speed_variance()).expect("a sound covariance");
        let c = shuttle.truth[0].c;
        let wind = -PERIOD_S * per_n_per_kn * 2.0 * c * instant.speed_mps;
        let damping = per_n_per_kn * (shuttle.truth[0].b + 2.0 * c * instant.speed_mps);
        #[rustfmt::skip]
        let transition = Matrix4::new(
            1.0 - PERIOD_S * damping, PERIOD_S * instant.force_n / instant.mass_kg, wind, wind,
            0.0, 1.0, 0.0, 0.0,
            0.0, 0.0, 1.0, 0.0,
            0.0, 0.0, 0.0, keep,
        );
        filter.predict(Vector4::zeros(), &transition, &noise);
    }
    filter.covariance[(1, 1)].sqrt()
}
