//! Basic, curve and tunnel resistance as functions of speed.

use dynocar_model::train::{Davis, TrainModel};

use super::motion::Motion;

/// Resistance of a train on a line, in N/kN: Wang 2022, eq. (5), (9), (10), each polynomial
/// weighted by how much of it acts.
///
/// The paper's curve resistance z2 knows no radius. Here it holds at a reference radius and
/// goes with 1/R, as all curve formulas do; on a line of equal radii the two are the same.
/// All of it comes in addition to what is declared of curves, tunnels and the rest
/// ([`Motion::known_n_per_kn`]), which acts in any case: the paper declares none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineResistance {
    /// z1: basic resistance.
    pub basic: Davis,
    /// z2: curve resistance with the whole train at the reference radius, beyond the declared.
    pub curve: Option<Davis>,
    /// z3: tunnel resistance with the whole train in a tunnel, beyond the declared.
    pub tunnel: Option<Davis>,
    /// Radius in m that z2 holds at.
    pub reference_radius_m: f64,
}

impl LineResistance {
    /// What is declared of a train.
    pub fn declared(train: &TrainModel) -> Self {
        LineResistance {
            basic: train.resistance,
            curve: None,
            tunnel: None,
            reference_radius_m: DEFAULT_REFERENCE_RADIUS_M,
        }
    }

    /// All that retards in N/kN at a speed in m/s: this resistance plus what is known.
    #[inline]
    pub fn w_n_per_kn(&self, motion: &Motion, speed_mps: f64) -> f64 {
        let curve = self.curve.map_or(0.0, |curve| {
            self.reference_radius_m * motion.curvature_per_m * curve.w0_n_per_kn(speed_mps)
        });
        let tunnel =
            self.tunnel.map_or(0.0, |tunnel| motion.tunnel_share * tunnel.w0_n_per_kn(speed_mps));
        self.basic.w0_n_per_kn(speed_mps) + curve + tunnel + motion.known_n_per_kn
    }

    /// Derivative of the resistance after speed, in N/kN per m/s.
    #[inline]
    pub fn slope(&self, motion: &Motion, speed_mps: f64) -> f64 {
        let slope = |davis: Davis| davis.b + 2.0 * davis.c * speed_mps;
        let curve = self
            .curve
            .map_or(0.0, |curve| self.reference_radius_m * motion.curvature_per_m * slope(curve));
        let tunnel = self.tunnel.map_or(0.0, |tunnel| motion.tunnel_share * slope(tunnel));
        slope(self.basic) + curve + tunnel
    }
}

/// Radius in m that curve resistance refers to unless set otherwise.
pub const DEFAULT_REFERENCE_RADIUS_M: f64 = 500.0;
