//! Braking distance and time from a speed, with a bound at a chosen confidence.
//!
//! mass (1 + gamma) dv/dt = -min(brake force, adhesion * weight) - weight_kN (w0(v) + gradient)
//!
//! is integrated over time while the brake builds up ([`BrakeResponse`]), and over speed from then on, so
//! that a stop costs the same from any speed. The brake force and the adhesion limit are those of Xie
//! 2019, eq. (1)-(3), and of Jin 2020, eq. (2).

mod motion;

use crate::adhesion::{RailCondition, Uncertain};
use crate::quantile::normal_quantile;
use crate::resistance::GRAVITY_MPS2;
use crate::snapshot::ParameterSnapshot;
use crate::vocabulary::Parameter;

/// A point of a brake-effort curve.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct EffortPoint {
    /// Speed in m/s.
    pub speed_mps: f64,
    /// Brake force of the whole train at the wheel rim in N, as far as the rail carries it.
    pub force_n: f64,
}

/// Response of the brake to its command. All zero: full force, at once.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BrakeResponse {
    /// Time in s after the command until traction is cut off; it holds the speed till then.
    pub traction_cut_off_s: f64,
    /// Time in s after that without any force of traction or brake.
    pub dead_time_s: f64,
    /// Time in s over which the force then grows linearly to its full value.
    pub build_up_s: f64,
    /// Greatest growth in m/s³ of the deceleration by the brake; 0 for no limit.
    pub jerk_limit_mps3: f64,
    /// Standard deviation in s of the time that a stop loses until the brake acts in full.
    pub std_s: f64,
}

impl BrakeResponse {
    /// The brake acts in full with its command.
    pub const IMMEDIATE: Self = BrakeResponse {
        traction_cut_off_s: 0.0,
        dead_time_s: 0.0,
        build_up_s: 0.0,
        jerk_limit_mps3: 0.0,
        std_s: 0.0,
    };
}

/// Adhesion of the rail.
///
/// # Examples
///
/// ```
/// use dynocar_shared::{EffortPoint, RailAdhesion, RailCondition, Stop, Uncertain};
///
/// let effort = [EffortPoint { speed_mps: 0.0, force_n: 600e3 }];
/// let dry = Stop::level(20.0, 400e3, [1.5, 0.01, 0.0005], &effort);
/// let wet = RailAdhesion::Law(RailCondition::Wet, Uncertain::new(1.0, 0.1));
/// let on_wet_rail = Stop { adhesion: wet, ..dry };
/// assert!(on_wet_rail.estimate(0.99)?.distance_m > dry.estimate(0.99)?.distance_m);
/// # Ok::<(), dynocar_shared::StoppingError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RailAdhesion {
    /// The rail carries any brake force.
    Unlimited,
    /// One coefficient at all speeds; also for a lower bound of it.
    Coefficient(Uncertain),
    /// A known law times a scale.
    Law(RailCondition, Uncertain),
}

impl RailAdhesion {
    /// Returns the rail of a snapshot that gives `adhesion`; `None` for a lower bound, and without a speed.
    ///
    /// The coefficient is that of the last speed at which the braking was seen, the lowest one, and a rail carries less
    /// at higher speeds. Therefore it is extended along the wet law, the steeper of the two: a stop from a higher speed
    /// is not computed with the adhesion at the end of the last one.
    pub fn learned(snapshot: &ParameterSnapshot) -> Option<Self> {
        let value = snapshot.value(Parameter::Adhesion)?;
        let std = snapshot.std(Parameter::Adhesion)?;
        let speed_mps = snapshot.speed_min_mps;
        if !(speed_mps.is_finite() && speed_mps >= 0.0) {
            return None;
        }
        let share = 1.0 / RailCondition::Wet.adhesion(speed_mps);
        let scale = Uncertain::new(share * value, share * std);
        Some(RailAdhesion::Law(RailCondition::Wet, scale))
    }
}

/// The stop that is asked about.
///
/// # Examples
///
/// ```
/// use dynocar_shared::{EffortPoint, RailAdhesion, Stop, Uncertain};
///
/// let effort = [EffortPoint { speed_mps: 0.0, force_n: 400e3 }];
/// let known = Stop::level(20.0, 400e3, [1.5, 0.01, 0.0005], &effort);
/// let estimate = known.estimate(0.95)?;
/// assert!((195.0..200.0).contains(&estimate.distance_m));
/// // An uncertain brake makes the bound longer, and leaves the distance.
/// let uncertain = Stop { brake_scale: Uncertain::new(1.0, 0.05), ..known }.estimate(0.95)?;
/// assert_eq!(uncertain.distance_m, estimate.distance_m);
/// assert!(uncertain.distance_bound_m > 1.05 * estimate.distance_bound_m);
/// # Ok::<(), dynocar_shared::StoppingError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop<'a> {
    /// Speed in m/s at which the brake is commanded.
    pub from_speed_mps: f64,
    /// Speed in m/s at which the stop is over; 0 for standstill.
    pub to_speed_mps: f64,
    /// Gross mass in kg, without the rotating part.
    pub mass_kg: f64,
    /// gamma: inertial mass = mass (1 + gamma).
    pub rotating_mass_factor: f64,
    /// Davis a, b, c of w0 = a + b v + c v² in N/kN, v in m/s.
    pub davis: [f64; 3],
    /// Standard deviation of w0 in N/kN.
    pub w0_std_n_per_kn: f64,
    /// Gradient in ‰ along the direction of travel, climbing positive.
    pub gradient_permille: f64,
    /// Brake force over speed, piecewise linear, constant beyond the ends; speeds increasing.
    pub brake_effort: &'a [EffortPoint],
    /// Factor on the brake force, as the ratio of estimated to declared friction.
    pub brake_scale: Uncertain,
    /// How the brake comes after its command.
    pub response: BrakeResponse,
    /// Adhesion of the rail.
    pub adhesion: RailAdhesion,
    /// Gravity in m/s²: [`GRAVITY_MPS2`], but 9.8 in the papers.
    pub gravity_mps2: f64,
}

impl<'a> Stop<'a> {
    /// A stop to standstill on the level with a known brake on a rail that carries any force.
    pub const fn level(
        from_speed_mps: f64,
        mass_kg: f64,
        davis: [f64; 3],
        brake_effort: &'a [EffortPoint],
    ) -> Self {
        Stop {
            from_speed_mps,
            to_speed_mps: 0.0,
            mass_kg,
            rotating_mass_factor: 0.0,
            davis,
            w0_std_n_per_kn: 0.0,
            gradient_permille: 0.0,
            brake_effort,
            brake_scale: Uncertain::exact(1.0),
            response: BrakeResponse::IMMEDIATE,
            adhesion: RailAdhesion::Unlimited,
            gravity_mps2: GRAVITY_MPS2,
        }
    }
}

/// Distance and time of a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoppingEstimate {
    /// Distance in m with every quantity at its value.
    pub distance_m: f64,
    /// Time in s with every quantity at its value.
    pub time_s: f64,
    /// Distance in m that is not exceeded, with at least the chosen confidence.
    pub distance_bound_m: f64,
    /// Time in s that is not exceeded, with at least the chosen confidence.
    pub time_bound_s: f64,
}

/// Why there is no stopping distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StoppingError {
    /// An input lies outside its range.
    BadInput {
        /// The input's name.
        name: &'static str,
        /// The value it was given.
        value: f64,
    },
    /// The train does not slow down at a speed, though the brake is at its value (`in_bound`
    /// false) or at the edge of the confidence bound (`in_bound` true).
    DoesNotStop {
        /// The speed in m/s.
        speed_mps: f64,
        /// True when only the bound cannot be given.
        in_bound: bool,
    },
}

impl core::fmt::Display for StoppingError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            StoppingError::BadInput { name, value } => {
                write!(f, "{name} = {value} lies outside its range")
            }
            StoppingError::DoesNotStop { speed_mps, in_bound } => {
                let when = if *in_bound { " at the edge of the confidence bound" } else { "" };
                write!(f, "the train does not slow down at {speed_mps} m/s{when}")
            }
        }
    }
}

impl core::error::Error for StoppingError {}

/// Longest part of a response in s; a freight train of 2 km takes about 90.
const RESPONSE_MAX_S: f64 = 300.0;
/// No brake decelerates by more, on any track: the mass is in t, or the forces in another unit than N.
const DECELERATION_MAX_MPS2: f64 = 10.0;
/// A brake that decelerates by less, and is there at all, is stated in another unit than N.
const DECELERATION_MIN_MPS2: f64 = 0.01;
/// No rail carries more of the weight: the coefficient is in per cent.
const COEFFICIENT_MAX: f64 = 1.5;

/// How far each uncertain quantity is moved to its unfavourable side, in standard deviations.
#[derive(Clone, Copy)]
struct Shift {
    brake: f64,
    adhesion: f64,
    resistance: f64,
    response: f64,
}

impl Stop<'_> {
    /// Returns the distance and time, with a bound that holds with at least `confidence`.
    ///
    /// The bound moves every uncertain quantity to its unfavourable side. With one uncertain
    /// quantity it is the exact quantile, since distance and time are monotone in each; with k
    /// of them, taken as normal but in any way dependent, each is given (1 - confidence) / k of
    /// the risk (Bonferroni), which is never too optimistic.
    ///
    /// # Errors
    ///
    /// When an input is not finite or out of range, the mass is so small that the brake alone
    /// would decelerate it by more than 10 m/s² (a mass in t), `confidence` is not inside 0.5 to
    /// 1, or the train does not slow down.
    ///
    /// # Real-time
    ///
    /// Allocates nothing; 514 evaluations of the deceleration, and 320 of a brake that builds up.
    pub fn estimate(&self, confidence: f64) -> Result<StoppingEstimate, StoppingError> {
        self.check()?;
        if !(0.5..1.0).contains(&confidence) {
            return Err(StoppingError::BadInput { name: "confidence", value: confidence });
        }
        let adhesion_std = match self.adhesion {
            RailAdhesion::Unlimited => 0.0,
            RailAdhesion::Coefficient(coefficient) => coefficient.std,
            RailAdhesion::Law(_, scale) => scale.std,
        };
        let stds = [self.brake_scale.std, adhesion_std, self.w0_std_n_per_kn, self.response.std_s];
        let uncertain = stds.iter().filter(|&&std| std > 0.0).count();
        let risk = (1.0 - confidence) / uncertain.max(1) as f64;
        let z = normal_quantile(1.0 - risk)
            .ok_or(StoppingError::BadInput { name: "confidence", value: confidence })?;
        let value = Shift { brake: 0.0, adhesion: 0.0, resistance: 0.0, response: 0.0 };
        let edge = Shift { brake: z, adhesion: z, resistance: z, response: z };
        let (distance_m, time_s) = self
            .integrate(value)
            .map_err(|speed_mps| StoppingError::DoesNotStop { speed_mps, in_bound: false })?;
        if uncertain == 0 {
            let (distance_bound_m, time_bound_s) = (distance_m, time_s);
            return Ok(StoppingEstimate { distance_m, time_s, distance_bound_m, time_bound_s });
        }
        let (distance_bound_m, time_bound_s) = self
            .integrate(edge)
            .map_err(|speed_mps| StoppingError::DoesNotStop { speed_mps, in_bound: true })?;
        Ok(StoppingEstimate { distance_m, time_s, distance_bound_m, time_bound_s })
    }

    fn check(&self) -> Result<(), StoppingError> {
        let require = |is_allowed: bool, name, value| {
            if is_allowed { Ok(()) } else { Err(StoppingError::BadInput { name, value }) }
        };
        let is_not_negative = |value: f64| value.is_finite() && value >= 0.0;
        let is_positive = |value: f64| value.is_finite() && value > 0.0;
        require(is_not_negative(self.to_speed_mps), "to_speed_mps", self.to_speed_mps)?;
        let is_slowing =
            self.from_speed_mps.is_finite() && self.from_speed_mps >= self.to_speed_mps;
        require(is_slowing, "from_speed_mps", self.from_speed_mps)?;
        require(is_positive(self.mass_kg), "mass_kg", self.mass_kg)?;
        let gamma = self.rotating_mass_factor;
        require(is_not_negative(gamma), "rotating_mass_factor", gamma)?;
        for coefficient in self.davis {
            require(coefficient.is_finite(), "davis", coefficient)?;
        }
        require(is_not_negative(self.w0_std_n_per_kn), "w0_std_n_per_kn", self.w0_std_n_per_kn)?;
        require(self.gradient_permille.is_finite(), "gradient_permille", self.gradient_permille)?;
        require(is_positive(self.gravity_mps2), "gravity_mps2", self.gravity_mps2)?;
        require(is_positive(self.brake_scale.value), "brake_scale", self.brake_scale.value)?;
        require(is_not_negative(self.brake_scale.std), "brake_scale", self.brake_scale.std)?;
        let response = &self.response;
        let require_time =
            |name, time_s| require((0.0..=RESPONSE_MAX_S).contains(&time_s), name, time_s);
        require_time("traction_cut_off_s", response.traction_cut_off_s)?;
        require_time("dead_time_s", response.dead_time_s)?;
        require_time("build_up_s", response.build_up_s)?;
        require_time("response_std_s", response.std_s)?;
        let jerk_mps3 = response.jerk_limit_mps3;
        let is_allowed = jerk_mps3 == 0.0 || (1e-3..=1e3).contains(&jerk_mps3);
        require(is_allowed, "jerk_limit_mps3", jerk_mps3)?;
        if let RailAdhesion::Coefficient(given) | RailAdhesion::Law(_, given) = self.adhesion {
            require(is_not_negative(given.value), "adhesion", given.value)?;
            require(is_not_negative(given.std), "adhesion", given.std)?;
        }
        if let RailAdhesion::Coefficient(given) = self.adhesion {
            require(given.value <= COEFFICIENT_MAX, "adhesion", given.value)?;
        }
        require(!self.brake_effort.is_empty(), "brake_effort", f64::NAN)?;
        for point in self.brake_effort {
            require(point.speed_mps.is_finite(), "brake_effort", point.speed_mps)?;
            require(is_not_negative(point.force_n), "brake_effort", point.force_n)?;
        }
        for pair in self.brake_effort.windows(2) {
            let speed_mps = pair[1].speed_mps;
            require(pair[0].speed_mps < speed_mps, "brake_effort", speed_mps)?;
        }
        let forces_n = self.brake_effort.iter().map(|point| point.force_n);
        let greatest_n = self.brake_scale.value * forces_n.fold(0.0, f64::max);
        let is_brake = greatest_n == 0.0 || greatest_n >= DECELERATION_MIN_MPS2 * self.mass_kg;
        require(is_brake, "brake_effort", greatest_n)?;
        let is_possible = self.adhesion != RailAdhesion::Unlimited
            || greatest_n <= DECELERATION_MAX_MPS2 * self.mass_kg;
        require(is_possible, "mass_kg", self.mass_kg)
    }
}

#[cfg(test)]
mod tests;
