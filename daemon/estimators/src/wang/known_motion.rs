//! Motion for the estimators of mass: the values taken from a sample, the effect of its forces on a train of a
//! reference mass, and which of the three resistances a piece of motion gives information on.

use dynocar_core::pipeline::Outcome;
use dynocar_core::pipeline::motion::BRIDGED_MAX_S;
use dynocar_model::force;
use dynocar_model::force::ResolvedSample;
use dynocar_model::terms::rotating;
use dynocar_model::train::TrainModel;
use dynocar_shared::RejectionReason;

/// The known quantities of a moving train at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownMotion {
    /// Measurement time in ns.
    pub time_ns: i64,
    /// Number of the motion segment.
    pub segment: u32,
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Traction minus brake in N.
    pub force_n: f64,
    /// Declared gross mass in kg, as far as it is known here.
    pub declared_kg: f64,
    /// Everything known that retards in proportion to the weight, in N/kN: see
    /// [`ResolvedSample::known_n_per_kn`].
    pub known_n_per_kn: f64,
    /// Standard deviation in ‰ of the gradient in it; 0 where none is declared.
    pub gradient_std_permille: f64,
    /// Mean of 1/R along the train in 1/m; 0 where no curves are known.
    pub curvature_per_m: f64,
    /// Share of the train inside tunnels; 0 where no tunnels are known.
    pub tunnel_share: f64,
}

impl KnownMotion {
    /// Returns the motion at a sample.
    ///
    /// # Errors
    ///
    /// `WheelSlide` while the speed is not the train's, `Missing` without force or gradient, `NotFinite` for a
    /// number that is not finite, `OutOfRange` for one that no train has.
    pub fn from_sample(sample: &ResolvedSample) -> Result<Self, RejectionReason> {
        if sample.is_sliding {
            return Err(RejectionReason::WheelSlide);
        }
        let force_n = sample.control_force_n().ok_or(RejectionReason::Missing)?;
        let known_n_per_kn = sample.known_n_per_kn().ok_or(RejectionReason::Missing)?;
        let motion = KnownMotion {
            time_ns: sample.time_ns,
            segment: sample.segment,
            speed_mps: sample.speed_mps,
            force_n,
            declared_kg: sample.mass_kg,
            known_n_per_kn,
            gradient_std_permille: sample.gradient_std_permille,
            curvature_per_m: sample.curvature_per_m.unwrap_or(0.0),
            tunnel_share: sample.tunnel_share.unwrap_or(0.0),
        };
        let bounds = [
            (motion.speed_mps, 0.0, 200.0),
            (motion.force_n, -1e8, 1e8),
            (motion.declared_kg, 1.0, 1e9),
            (motion.known_n_per_kn, -500.0, 500.0),
            (motion.gradient_std_permille, 0.0, 500.0),
            (motion.curvature_per_m, 0.0, 1.0),
            (motion.tunnel_share, 0.0, 1.0 + 1e-9),
        ];
        if bounds.iter().any(|(number, _, _)| !number.is_finite()) {
            return Err(RejectionReason::NotFinite);
        }
        let is_possible = bounds.iter().all(|&(number, low, high)| number >= low && number <= high);
        if is_possible { Ok(motion) } else { Err(RejectionReason::OutOfRange) }
    }

    /// Returns the motion at a sample that an estimator from a least speed in m/s on uses; without motion, the
    /// outcome of the sample. A step leads neither over a standstill nor over a slide: `last` is forgotten there.
    ///
    /// # Errors
    ///
    /// `Idle` for a train that stands, else the refusal with the reason of [`KnownMotion::from_sample`].
    pub fn seen<T>(
        sample: &ResolvedSample,
        speed_min_mps: f64,
        last: &mut Option<T>,
    ) -> Result<Self, Outcome> {
        if sample.speed_mps < speed_min_mps {
            *last = None;
            return Err(Outcome::Idle);
        }
        KnownMotion::from_sample(sample).map_err(|reason| {
            if reason == RejectionReason::WheelSlide {
                *last = None;
            }
            Outcome::Rejected(reason)
        })
    }

    /// Returns the time in s since an earlier sample of the same motion segment; `None` when forces and speed
    /// between the two are not known well enough to integrate.
    pub fn step_from(&self, earlier: &KnownMotion) -> Option<f64> {
        let step_s = self.time_ns.saturating_sub(earlier.time_ns) as f64 * 1e-9;
        (self.segment == earlier.segment && step_s > 0.0 && step_s <= BRIDGED_MAX_S)
            .then_some(step_s)
    }
}

/// A train's mass as declared, which the unknown inverse mass refers to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// Mass in kg that the inverse mass refers to.
    pub reference_mass_kg: f64,
    /// gamma.
    pub rotating_mass_factor: f64,
}

impl Inertia {
    /// Returns the inertia of a train as declared.
    pub fn from_train(train: &TrainModel) -> Self {
        let TrainModel { mass_kg, rotating_mass_factor, .. } = *train;
        Inertia { reference_mass_kg: mass_kg, rotating_mass_factor }
    }

    /// Returns the acceleration in m/s² of the force on the reference mass.
    #[inline]
    pub fn push_mps2(&self, motion: &KnownMotion) -> f64 {
        motion.force_n / self.inertial_mass_kg(self.reference_mass_kg)
    }

    /// m/s² of one N/kN.
    #[inline]
    pub fn mps2_per_n_per_kn(&self) -> f64 {
        force::mps2_per_n_per_kn(self.rotating_mass_factor)
    }

    /// Returns the mass in kg that a force accelerates when the train has a mass in kg.
    #[inline]
    pub fn inertial_mass_kg(&self, mass_kg: f64) -> f64 {
        rotating::inertial_mass_kg(mass_kg, self.rotating_mass_factor)
    }
}

/// A share at which the whole train counts as inside.
const WHOLE: f64 = 0.999;

/// The learning sets of Wang 2022, section 3.2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LearningSet {
    /// Neither curve nor tunnel: z1.
    Basic = 0,
    /// In a curve: z2.
    Curve = 1,
    /// In a tunnel: z3.
    Tunnel = 2,
}

impl LearningSet {
    /// Every section, in the order of its number.
    pub const ALL: [LearningSet; 3] = [LearningSet::Basic, LearningSet::Curve, LearningSet::Tunnel];

    /// Returns the set of a step between two samples.
    ///
    /// As in Algorithm 1, a step in a curve inside a tunnel belongs to the curve set. A train has
    /// a length, which the paper's mass point lacks: steps while a part of it is inside belong to
    /// no set.
    pub fn new(from: &KnownMotion, to: &KnownMotion) -> Option<LearningSet> {
        let is_curved = from.curvature_per_m > 0.0 || to.curvature_per_m > 0.0;
        if is_curved {
            let change = (to.curvature_per_m - from.curvature_per_m).abs();
            let is_steady = change <= (1.0 - WHOLE) * to.curvature_per_m;
            return is_steady.then_some(LearningSet::Curve);
        }
        let (low, high) = if from.tunnel_share < to.tunnel_share {
            (from.tunnel_share, to.tunnel_share)
        } else {
            (to.tunnel_share, from.tunnel_share)
        };
        if high <= 0.0 {
            Some(LearningSet::Basic)
        } else if low >= WHOLE {
            Some(LearningSet::Tunnel)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    #[test]
    fn a_correction_that_takes_resistance_away_is_no_reason_to_refuse_a_sample() {
        let warm = ResolvedSample { extra_n_per_kn: -1.7, ..ResolvedSample::coasting() };
        assert_eq!(KnownMotion::from_sample(&warm).unwrap().known_n_per_kn, -1.7);
        let absurd = ResolvedSample { extra_n_per_kn: -501.0, ..warm };
        assert_eq!(KnownMotion::from_sample(&absurd), Err(RejectionReason::OutOfRange));
    }

    #[test]
    fn forces_are_bridged_for_seconds_within_a_segment() {
        let motion = |time_ns, segment| KnownMotion {
            time_ns,
            segment,
            speed_mps: 10.0,
            force_n: 0.0,
            declared_kg: 1e5,
            known_n_per_kn: 0.0,
            gradient_std_permille: 0.0,
            curvature_per_m: 0.0,
            tunnel_share: 0.0,
        };
        let earlier = motion(0, 1);
        assert_eq!(motion(SECOND_NS / 2, 1).step_from(&earlier), Some(0.5));
        assert_eq!(motion(3 * SECOND_NS, 1).step_from(&earlier), None);
        assert_eq!(motion(SECOND_NS / 2, 2).step_from(&earlier), None);
        assert_eq!(motion(0, 1).step_from(&earlier), None);
    }
}

#[cfg(test)]
mod section_tests {
    use super::*;

    fn at(curvature_per_m: f64, tunnel_share: f64) -> KnownMotion {
        KnownMotion {
            time_ns: 0,
            segment: 1,
            speed_mps: 10.0,
            force_n: 0.0,
            declared_kg: 1e5,
            known_n_per_kn: 0.0,
            gradient_std_permille: 0.0,
            curvature_per_m,
            tunnel_share,
        }
    }

    fn steady(curvature_per_m: f64, tunnel_share: f64) -> Option<LearningSet> {
        LearningSet::new(&at(curvature_per_m, tunnel_share), &at(curvature_per_m, tunnel_share))
    }

    #[test]
    fn a_curve_inside_a_tunnel_belongs_to_the_curve_set() {
        assert_eq!(steady(0.0, 0.0), Some(LearningSet::Basic));
        assert_eq!(steady(0.002, 0.0), Some(LearningSet::Curve));
        assert_eq!(steady(0.002, 1.0), Some(LearningSet::Curve));
        assert_eq!(steady(0.0, 1.0), Some(LearningSet::Tunnel));
    }

    #[test]
    fn a_train_on_its_way_in_belongs_to_no_set() {
        assert_eq!(LearningSet::new(&at(0.0, 0.0), &at(0.0005, 0.0)), None);
        assert_eq!(LearningSet::new(&at(0.0005, 0.0), &at(0.0009, 0.0)), None);
        assert_eq!(LearningSet::new(&at(0.0, 0.4), &at(0.0, 0.6)), None);
        assert_eq!(steady(0.0, 0.4), None);
    }
}
