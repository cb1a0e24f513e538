//! Braking distance and time for C; [`dynocar_shared::stopping`] does the mathematics.

use dynocar_shared::stopping::{BrakeResponse, EffortPoint, RailAdhesion, Stop, StoppingError};
use dynocar_shared::{RailCondition, Uncertain, vocabulary, wire_struct};

use super::error::{Code, guard};

/// Most points of a brake-effort curve.
pub const EFFORT_POINTS_MAX: usize = 1024;

vocabulary! {
    /// Adhesion of the rail; `DYNOCAR_RAIL_…` in C.
    Rail: u64 {
        /// Any brake force: adhesion and its standard deviation are not read.
        Unlimited = 0 "unlimited",
        /// Adhesion is one coefficient at all speeds, or a lower bound of it.
        Coefficient = 1 "coefficient",
        /// Adhesion is a scale of the dry rail's law (Xie 2019).
        DryLaw = 2 "dry_law",
        /// Adhesion is a scale of the wet rail's law (Xie 2019).
        WetLaw = 3 "wet_law",
    }
}

wire_struct! {
    /// The stop to be computed; `dynocar_stop` in C. All numbers finite.
    #[derive(Default)]
    pub struct StopRequest {
        /// Speed in m/s at which the brake is commanded.
        pub from_speed_mps: f64,
        /// Speed in m/s at which the stop is over; 0 for standstill.
        pub to_speed_mps: f64,
        /// Gross mass in kg, without the rotating part.
        pub mass_kg: f64,
        /// gamma: inertial mass = mass (1 + gamma).
        pub rotating_mass_factor: f64,
        /// Gradient in ‰ along the direction of travel, climbing positive.
        pub gradient_permille: f64,
        /// Davis a in N/kN.
        pub davis_a: f64,
        /// Davis b in N/kN per m/s.
        pub davis_b: f64,
        /// Davis c in N/kN per (m/s)².
        pub davis_c: f64,
        /// Standard deviation of w0 in N/kN.
        pub w0_std_n_per_kn: f64,
        /// Factor on the brake force, as estimated over declared friction; 1 for the declared.
        pub brake_scale: f64,
        /// Its standard deviation.
        pub brake_scale_std: f64,
        /// Time in s after the command until traction is cut off; it holds the speed till then.
        pub traction_cut_off_s: f64,
        /// Time in s after that without any force of traction or brake.
        pub dead_time_s: f64,
        /// Time in s over which the brake force then grows linearly to its full value.
        pub build_up_s: f64,
        /// Greatest growth in m/s³ of the deceleration by the brake; 0 for no limit.
        pub jerk_limit_mps3: f64,
        /// Standard deviation in s of the time that a stop loses until the brake acts in full.
        pub response_std_s: f64,
        /// Adhesion coefficient, or the scale of a law.
        pub adhesion: f64,
        /// Its standard deviation.
        pub adhesion_std: f64,
        /// Adhesion of the rail: a [`Rail`] by number.
        pub rail: u64,
    }
}

wire_struct! {
    /// A point of a brake-effort curve; `dynocar_effort_point` in C.
    #[derive(Default)]
    pub struct EffortPlace {
        /// Speed in m/s.
        pub speed_mps: f64,
        /// Brake force of the whole train in N.
        pub force_n: f64,
    }
}

const _: () = assert!(
    size_of::<EffortPlace>() == size_of::<EffortPoint>()
        && std::mem::offset_of!(EffortPlace, force_n) == std::mem::offset_of!(EffortPoint, force_n),
    "a curve from C is read as the shared one"
);

wire_struct! {
    /// Distance and time of a stop; `dynocar_stopping` in C.
    #[derive(Default)]
    pub struct Stopping {
        /// Distance in m with every quantity at its value.
        pub distance_m: f64,
        /// Time in s with every quantity at its value.
        pub time_s: f64,
        /// Distance in m that is not exceeded, with at least the chosen confidence.
        pub distance_bound_m: f64,
        /// Time in s that is not exceeded, with at least the chosen confidence.
        pub time_bound_s: f64,
    }
}

impl StopRequest {
    /// Distance and time of the stop with a bound; see [`Stop::estimate`].
    ///
    /// # Errors
    ///
    /// [`Code::BadNumber`] or [`Code::DoesNotStop`].
    pub fn estimate(&self, effort: &[EffortPoint], confidence: f64) -> Result<Stopping, Code> {
        if !(1..=EFFORT_POINTS_MAX).contains(&effort.len()) {
            return Err(Code::BadNumber);
        }
        let stop = self.stop(effort).ok_or(Code::BadNumber)?;
        let found = stop.estimate(confidence).map_err(|error| match error {
            StoppingError::BadInput { .. } => Code::BadNumber,
            StoppingError::DoesNotStop { .. } => Code::DoesNotStop,
        })?;
        Ok(Stopping {
            distance_m: found.distance_m,
            time_s: found.time_s,
            distance_bound_m: found.distance_bound_m,
            time_bound_s: found.time_bound_s,
        })
    }

    fn stop<'a>(&self, effort: &'a [EffortPoint]) -> Option<Stop<'a>> {
        let adhesion = Uncertain::new(self.adhesion, self.adhesion_std);
        let rail = Rail::from_number(self.rail)?;
        let davis = [self.davis_a, self.davis_b, self.davis_c];
        Some(Stop {
            to_speed_mps: self.to_speed_mps,
            rotating_mass_factor: self.rotating_mass_factor,
            w0_std_n_per_kn: self.w0_std_n_per_kn,
            gradient_permille: self.gradient_permille,
            brake_scale: Uncertain::new(self.brake_scale, self.brake_scale_std),
            response: BrakeResponse {
                traction_cut_off_s: self.traction_cut_off_s,
                dead_time_s: self.dead_time_s,
                build_up_s: self.build_up_s,
                jerk_limit_mps3: self.jerk_limit_mps3,
                std_s: self.response_std_s,
            },
            adhesion: match rail {
                Rail::Unlimited => RailAdhesion::Unlimited,
                Rail::Coefficient => RailAdhesion::Coefficient(adhesion),
                Rail::DryLaw => RailAdhesion::Law(RailCondition::Dry, adhesion),
                Rail::WetLaw => RailAdhesion::Law(RailCondition::Wet, adhesion),
            },
            ..Stop::level(self.from_speed_mps, self.mass_kg, davis, effort)
        })
    }
}

/// Distance and time of a stop with a bound that holds with at least `confidence`; see
/// [`Stop::estimate`].
///
/// # Safety
///
/// See [the module](super#safety); `effort` points to `effort_count` points.
///
/// # Real-time
///
/// Safe for the control cycle: some 800 evaluations of the deceleration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_stopping_estimate(
    stop: *const StopRequest,
    effort: *const EffortPlace,
    effort_count: usize,
    confidence: f64,
    stopping: *mut Stopping,
) -> i32 {
    guard(|| {
        // SAFETY: promised by the caller; every bit pattern is a stop.
        let request = unsafe { stop.as_ref() }.ok_or(Code::NullArgument)?;
        // SAFETY: promised by the caller; every bit pattern is a stopping.
        let place = unsafe { stopping.as_mut() }.ok_or(Code::NullArgument)?;
        if effort.is_null() {
            return Err(Code::NullArgument);
        }
        if !(1..=EFFORT_POINTS_MAX).contains(&effort_count) {
            return Err(Code::BadNumber);
        }
        // SAFETY: the caller promised `effort_count` points; the layouts are the same.
        let effort =
            unsafe { std::slice::from_raw_parts(effort.cast::<EffortPoint>(), effort_count) };
        *place = request.estimate(effort, confidence)?;
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const EFFORT: [EffortPlace; 2] = [
        EffortPlace { speed_mps: 0.0, force_n: 120_000.0 },
        EffortPlace { speed_mps: 60.0, force_n: 90_000.0 },
    ];

    fn request() -> StopRequest {
        StopRequest {
            from_speed_mps: 40.0,
            mass_kg: 100_000.0,
            davis_a: 1.5,
            brake_scale: 1.0,
            brake_scale_std: 0.05,
            traction_cut_off_s: 0.3,
            dead_time_s: 0.5,
            build_up_s: 1.5,
            jerk_limit_mps3: 0.7,
            response_std_s: 0.2,
            adhesion: 0.1,
            adhesion_std: 0.01,
            rail: Rail::Coefficient as u64,
            ..StopRequest::default()
        }
    }

    fn ask(request: &StopRequest, confidence: f64) -> (i32, Stopping) {
        let mut place = Stopping::default();
        // SAFETY: all pointers are to living values.
        let code = unsafe {
            dynocar_stopping_estimate(request, EFFORT.as_ptr(), 2, confidence, &mut place)
        };
        (code, place)
    }

    #[test]
    fn c_reads_what_rust_reads() {
        let effort =
            EFFORT.map(|EffortPlace { speed_mps, force_n }| EffortPoint { speed_mps, force_n });
        for &rail in Rail::ALL {
            let request = StopRequest { rail: rail as u64, ..request() };
            let expected = request.stop(&effort).unwrap().estimate(0.99).unwrap();
            let (code, found) = ask(&request, 0.99);
            assert_eq!(code, Code::Ok as i32);
            assert_eq!(found.distance_m, expected.distance_m);
            assert_eq!(found.distance_bound_m, expected.distance_bound_m);
            assert!(found.distance_bound_m > found.distance_m && found.time_bound_s > found.time_s);
        }
    }

    #[test]
    fn what_cannot_be_answered_has_its_code_and_writes_nothing() {
        let cases = [
            (StopRequest { mass_kg: f64::NAN, ..request() }, 0.99, Code::BadNumber),
            (StopRequest { rail: 9, ..request() }, 0.99, Code::BadNumber),
            (StopRequest { build_up_s: -1.0, ..request() }, 0.99, Code::BadNumber),
            (request(), 1.0, Code::BadNumber),
            (StopRequest { gradient_permille: -500.0, ..request() }, 0.99, Code::DoesNotStop),
        ];
        for (request, confidence, expected) in cases {
            assert_eq!(ask(&request, confidence), (expected as i32, Stopping::default()));
        }
        let mut place = Stopping::default();
        // SAFETY: NULL is refused, and no point is read of a curve without points.
        unsafe {
            let null = std::ptr::null();
            let code = dynocar_stopping_estimate(&request(), null, 2, 0.9, &mut place);
            assert_eq!(code, Code::NullArgument as i32);
            let code = dynocar_stopping_estimate(&request(), EFFORT.as_ptr(), 0, 0.9, &mut place);
            assert_eq!(code, Code::BadNumber as i32);
        }
    }
}
