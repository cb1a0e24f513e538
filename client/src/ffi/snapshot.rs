//! Resistance, parameters and covariances from a copied snapshot.
//!
//! These functions need no handle: any thread may call them on its own copy.

use dynocar_shared::{Parameter, ParameterSnapshot, ResistanceEstimate, wire_struct};

use super::error::{Code, guard};

wire_struct! {
    /// Basic resistance at a speed, with its uncertainty; `dynocar_resistance` in C.
    #[derive(Default)]
    pub struct ResistanceAtSpeed {
        /// Unit basic resistance w0 in N per kN of train weight.
        pub w0_n_per_kn: f64,
        /// Standard deviation of `w0_n_per_kn`.
        pub w0_std_n_per_kn: f64,
        /// The same in N, for the mass the caller gave.
        pub force_n: f64,
        /// Standard deviation of `force_n`, the mass taken as exact.
        pub force_std_n: f64,
        /// 1 when the speed lies outside the speeds behind the estimate, else 0.
        pub is_extrapolated: u64,
    }
}

impl ResistanceAtSpeed {
    fn new(estimate: ResistanceEstimate, mass_kg: f64) -> Self {
        let (force_n, force_std_n) = estimate.force_n(mass_kg);
        ResistanceAtSpeed {
            w0_n_per_kn: estimate.w0_n_per_kn,
            w0_std_n_per_kn: estimate.w0_std_n_per_kn,
            force_n,
            force_std_n,
            is_extrapolated: u64::from(estimate.is_extrapolated),
        }
    }
}

/// Resistance at a speed for a train of `mass_kg`; see [`ParameterSnapshot::resistance_at`].
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_snapshot_resistance(
    snapshot: *const ParameterSnapshot,
    speed_mps: f64,
    mass_kg: f64,
    resistance: *mut ResistanceAtSpeed,
) -> i32 {
    guard(|| {
        // SAFETY: promised by the caller; every bit pattern is a snapshot.
        let snapshot = unsafe { snapshot.as_ref() }.ok_or(Code::NullArgument)?;
        // SAFETY: promised by the caller; every bit pattern is a resistance.
        let place = unsafe { resistance.as_mut() }.ok_or(Code::NullArgument)?;
        let is_sensible = speed_mps.is_finite() && mass_kg.is_finite() && mass_kg >= 0.0;
        if !is_sensible {
            return Err(Code::BadNumber);
        }
        let estimate = snapshot.resistance_at(speed_mps).ok_or(Code::NotInSnapshot)?;
        *place = ResistanceAtSpeed::new(estimate, mass_kg);
        Ok(())
    })
}

/// A parameter's value and standard deviation in its unit; `std` may be NULL.
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_snapshot_value(
    snapshot: *const ParameterSnapshot,
    parameter: u32,
    value: *mut f64,
    std: *mut f64,
) -> i32 {
    guard(|| {
        // SAFETY: promised by the caller; every bit pattern is a snapshot.
        let snapshot = unsafe { snapshot.as_ref() }.ok_or(Code::NullArgument)?;
        // SAFETY: promised by the caller.
        let value = unsafe { value.as_mut() }.ok_or(Code::NullArgument)?;
        let parameter = Parameter::from_number(parameter).ok_or(Code::BadNumber)?;
        *value = snapshot.value(parameter).ok_or(Code::NotInSnapshot)?;
        // SAFETY: promised by the caller.
        if let Some(std) = unsafe { std.as_mut() } {
            *std = snapshot.std(parameter).ok_or(Code::NotInSnapshot)?;
        }
        Ok(())
    })
}

/// Covariance of two parameters, in the product of their units.
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_snapshot_covariance(
    snapshot: *const ParameterSnapshot,
    parameter: u32,
    other: u32,
    covariance: *mut f64,
) -> i32 {
    guard(|| {
        // SAFETY: promised by the caller; every bit pattern is a snapshot.
        let snapshot = unsafe { snapshot.as_ref() }.ok_or(Code::NullArgument)?;
        // SAFETY: promised by the caller.
        let place = unsafe { covariance.as_mut() }.ok_or(Code::NullArgument)?;
        let index_of = |number| {
            let parameter = Parameter::from_number(number).ok_or(Code::BadNumber)?;
            snapshot.index_of(parameter).ok_or(Code::NotInSnapshot)
        };
        *place = snapshot.covariance_at(index_of(parameter)?, index_of(other)?);
        Ok(())
    })
}
