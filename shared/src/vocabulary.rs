//! The numbers on the wire and their meanings.
//!
//! A number, once given, keeps its meaning for a schema version. A peer that reads a number it
//! does not know gets `None`, never a guess.

/// Declares an enum with explicit wire numbers, a snake-case name and conversion from the number.
#[macro_export]
macro_rules! vocabulary {
    ($(#[$meta:meta])* $name:ident : $repr:ty { $( $(#[doc = $doc:literal])* $item:ident = $number:literal $text:literal ),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr($repr)]
        pub enum $name { $( $(#[doc = $doc])* $item = $number ),* }

        impl $name {
            /// Every member, in the order of its number.
            pub const ALL: &'static [$name] = &[ $( $name::$item ),* ];

            /// Returns the member's name in files, command lines and machine-readable results.
            pub const fn name(self) -> &'static str {
                match self { $( $name::$item => $text ),* }
            }

            /// Returns the meaning of the member, from its documentation.
            pub const fn meaning(self) -> &'static str {
                match self { $( $name::$item => concat!($($doc),*) ),* }
            }

            /// Returns the member with this wire number.
            pub const fn from_number(number: $repr) -> Option<Self> {
                match number { $( $number => Some($name::$item), )* _ => None }
            }

            /// Returns the member with this name.
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|member| member.name() == name)
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

// Behind the macro, which it uses.
mod effects;
mod use_state;
pub use effects::{EffectKind, KINDS, KindRow, separating_run};
pub use use_state::UseState;

vocabulary! {
    /// The kind of estimator behind a snapshot.
    PipelineKind: u32 {
        /// Regularised least squares over all windows (Liu 2018, eq. 7).
        Ls = 1 "ls",
        /// Recursive least squares (Liu 2018, eq. 9-11).
        Rls = 2 "rls",
        /// Regularised recursive least squares (Liu 2018, eq. 12-16).
        RegularisedRls = 3 "regularised_rls",
        /// Multi-innovation least squares, regularised (Liu 2018).
        Mils = 4 "mils",
        /// Interval-varying multi-innovation least squares, regularised (Liu 2018).
        VMils = 5 "v_mils",
        /// Trajectory fit by Wolfe-Newton over a sliding window (Xia 2023).
        TrajectoryNewton = 10 "trajectory_newton",
        /// Kalman filter [v, a, b, c] with jump hypotheses.
        TrajectoryKalman = 11 "trajectory_kalman",
        /// Robust resistance filter with a disturbance state.
        ResistanceKalman = 12 "resistance_kalman",
        /// Adhesion by sliding-window expectation maximisation (Xie 2019).
        AdhesionEm = 20 "adhesion_em",
        /// Adhesion by extended Kalman filter (the baseline of Xie 2019).
        AdhesionEkf = 21 "adhesion_ekf",
        /// Adhesion by fixed-lag smoothing of the effective deceleration.
        AdhesionSmoother = 22 "adhesion_smoother",
        /// Adhesion as the scale of a known law.
        AdhesionLaw = 23 "adhesion_law",
        /// Brake-disc friction times braking ratio by expectation maximisation (Jin 2020).
        BrakeEm = 30 "brake_em",
        /// Brake-disc friction times braking ratio by extended Kalman filter (Jin 2020's baseline).
        BrakeEkf = 31 "brake_ekf",
        /// Brake-disc friction times braking ratio by fixed-lag smoothing.
        BrakeSmoother = 32 "brake_smoother",
        /// Staged gradient descent for resistance and mass (Wang 2022).
        StagedDescent = 40 "staged_descent",
        /// Joint integral least squares for resistance and mass.
        JointLeastSquares = 41 "joint_least_squares",
        /// Kalman filter [v, 1/m, bias] for mass.
        MassKalman = 42 "mass_kalman",
        /// Kalman filters of resistance and mass together.
        TrainKalman = 43 "train_kalman",
        /// Watches the residual between model and measurement.
        ResidualMonitor = 50 "residual_monitor",
        /// Copies sample to snapshot without estimating: the latency floor.
        Echo = 60 "echo",
    }
}

vocabulary! {
    /// Quantity that a controller asks for; the daemon's configuration says which pipeline answers it, and each
    /// snapshot repeats that.
    Quantity: u32 {
        /// Basic resistance over speed: Davis a, b and c.
        Resistance = 0 "resistance",
        /// Gross mass.
        Mass = 1 "mass",
        /// Adhesion of wheel on rail.
        Adhesion = 2 "adhesion",
        /// Friction of the brake discs, the declared braking ratio held.
        BrakeFriction = 3 "brake_friction",
        /// Braking ratio, the declared friction held.
        BrakingRatio = 4 "braking_ratio",
    }
}

impl Quantity {
    /// Returns the quantity's bit in [`crate::ParameterSnapshot::quantities`].
    pub const fn bit(self) -> u32 {
        1 << self as u32
    }
}

vocabulary! {
    /// A number that a pipeline estimates; the unit is part of the name where it has one. The
    /// numbers 4, 11, 12 and 13 meant something once and stay unused.
    Parameter: u32 {
        /// Davis a in N/kN.
        DavisA = 1 "a",
        /// Davis b in N/kN per m/s.
        DavisB = 2 "b",
        /// Davis c in N/kN per (m/s)².
        DavisC = 3 "c",
        /// Mass in t.
        Mass = 5 "mass_t",
        /// Wheel-rail adhesion coefficient.
        Adhesion = 6 "adhesion",
        /// A lower bound of the adhesion coefficient.
        AdhesionLowerBound = 7 "adhesion_lower_bound",
        /// Scale of the known adhesion law.
        AdhesionLawScale = 8 "adhesion_law_scale",
        /// Brake-disc friction coefficient.
        DiscFriction = 9 "disc_friction",
        /// Braking ratio.
        BrakingRatio = 10 "braking_ratio",
        /// Acceleration bias in m/s².
        AccelerationBias = 14 "acceleration_bias_mps2",
        /// Unexplained force in N.
        UnexplainedForce = 15 "unexplained_force_n",
    }
}

vocabulary! {
    /// Where the mass in a snapshot comes from.
    MassSource: u32 {
        /// The pipeline estimates no mass.
        None = 0 "none",
        /// The train's file: nothing else is known of the load yet.
        Declared = 1 "declared",
        /// The controller's samples, which carry it.
        Weighed = 2 "weighed",
        /// Effect of forces on the train.
        Learned = 3 "learned",
    }
}

vocabulary! {
    /// State of the estimate of a pipeline as a whole; the state of use says which of its values may be used.
    Status: u32 {
        /// Some estimated values are not known yet; these are declared, kept or initial.
        Unestimated = 1 "unestimated",
        /// All that is estimated is known.
        Estimated = 2 "estimated",
        /// There are values, with a reservation named by the reason.
        Degraded = 3 "degraded",
        /// The values must not be used.
        Invalid = 4 "invalid",
    }
}

vocabulary! {
    /// Reason for a status. The number 10 had a meaning once and stays unused.
    Reason: u32 {
        /// Nothing to remark.
        None = 0 "none",
        /// Too few samples were used.
        TooFewSamples = 1 "too_few_samples",
        /// Some parameter directions were not excited by the data.
        WeakExcitation = 2 "weak_excitation",
        /// A parameter lies at a physical bound.
        AtBound = 3 "at_bound",
        /// The innovations are larger than their covariance says.
        InnovationsTooLarge = 4 "innovations_too_large",
        /// The innovations are correlated: the model lacks something.
        InnovationsNotWhite = 5 "innovations_not_white",
        /// A large share of the samples is rejected or lost.
        BadInput = 6 "bad_input",
        /// The samples lack a quantity that the pipeline needs.
        MissingQuantity = 7 "missing_quantity",
        /// No gradient is known: neither track nor sample gives one.
        GradientUnknown = 8 "gradient_unknown",
        /// A factorisation failed; the filter was reset.
        NumericalFailure = 9 "numerical_failure",
        /// The last manoeuvre that could excite the parameter lies too far back.
        EstimateStale = 11 "estimate_stale",
        /// Only a lower bound can be had from these data.
        OnlyLowerBound = 12 "only_lower_bound",
        /// The same data fit other values of the parameters as well.
        NotIdentifiable = 13 "not_identifiable",
        /// The daemon has not been heard of lately; set by the client, never by the daemon.
        DaemonSilent = 14 "daemon_silent",
        /// Forces that cannot be true: a wrong unit, exchanged, of the wrong sign, refreshed too seldom.
        ImplausibleForces = 15 "implausible_forces",
        /// Speed, position, time or direction that contradict each other: a wrong unit or sign.
        ImplausibleMotion = 16 "implausible_motion",
        /// A mass that cannot be true: a wrong unit.
        ImplausibleMass = 17 "implausible_mass",
        /// A gradient that cannot be true: a wrong unit or sign.
        ImplausibleGradient = 18 "implausible_gradient",
        /// A brake-cylinder pressure that cannot be true: a wrong unit.
        ImplausiblePressure = 19 "implausible_pressure",
        /// The train stood so long that the load may have changed; its interval allows for that.
        LoadMayHaveChanged = 20 "load_may_have_changed",
    }
}

vocabulary! {
    /// Why a sample was not used.
    RejectionReason: u32 {
        /// The time is not later than the last accepted one.
        TimeNotIncreasing = 0 "time_not_increasing",
        /// The time jumped ahead by more than a motion segment allows.
        TimeJump = 1 "time_jump",
        /// The sequence number repeats or runs backwards.
        SequenceNotIncreasing = 2 "sequence_not_increasing",
        /// The sample is of another train.
        WrongTrain = 3 "wrong_train",
        /// A quantity that is needed is missing.
        Missing = 4 "missing",
        /// A quantity is NaN or infinite.
        NotFinite = 5 "not_finite",
        /// The speed lies outside the train's range.
        SpeedOutOfRange = 6 "speed_out_of_range",
        /// The speed changed faster than a train can.
        SpeedJump = 7 "speed_jump",
        /// The position disagrees with the speed or lies off the line.
        PositionJump = 8 "position_jump",
        /// A force lies outside the range that the train can exert.
        ForceOutOfRange = 9 "force_out_of_range",
        /// The mass lies outside the train's range.
        MassOutOfRange = 10 "mass_out_of_range",
        /// The direction is neither +1 nor -1.
        BadDirection = 11 "bad_direction",
        /// The estimator's outlier test refused the window.
        Outlier = 12 "outlier",
        /// Wheel slide or wheel spin: the speed is not the train's.
        WheelSlide = 13 "wheel_slide",
        /// Another quantity lies outside its physical range.
        OutOfRange = 14 "out_of_range",
        /// The sample before once more, or the same speed, place and forces of a moving train for more than 2.5 s.
        Repeated = 15 "repeated",
    }
}

vocabulary! {
    /// A manoeuvre that would excite a direction the data have not excited; bits of
    /// [`crate::ParameterSnapshot::missing_manoeuvres`] are `1 << number`.
    Manoeuvre: u32 {
        /// Coasting at low speed, which determines Davis a.
        CoastSlow = 0 "coast_slow",
        /// Coasting at high speed, which determines Davis c.
        CoastFast = 1 "coast_fast",
        /// A wider range of speeds, which separates a, b and c.
        VarySpeed = 2 "vary_speed",
        /// Strong traction, which determines mass.
        Accelerate = 3 "accelerate",
        /// Strong braking, which determines adhesion and brake friction.
        Brake = 4 "brake",
        /// Any motion.
        Move = 5 "move",
    }
}

impl Reason {
    /// Returns whether the samples themselves cannot be true, so that no estimate from them is.
    pub const fn is_implausible_input(self) -> bool {
        matches!(
            self,
            Reason::ImplausibleForces
                | Reason::ImplausibleMotion
                | Reason::ImplausibleMass
                | Reason::ImplausibleGradient
                | Reason::ImplausiblePressure
        )
    }

    /// Returns whether the samples have to change before anything can be learned from them: they cannot be true, are
    /// refused or lack a quantity.
    pub const fn is_of_input(self) -> bool {
        self.is_implausible_input()
            || matches!(self, Reason::BadInput | Reason::MissingQuantity | Reason::GradientUnknown)
    }
}

impl Manoeuvre {
    /// Returns the manoeuvre's bit in [`crate::ParameterSnapshot::missing_manoeuvres`].
    pub const fn bit(self) -> u32 {
        1 << self as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_names_lead_back_to_the_member() {
        for &quantity in Quantity::ALL {
            assert_eq!(Quantity::from_name(quantity.name()), Some(quantity));
        }
        for &kind in PipelineKind::ALL {
            assert_eq!(PipelineKind::from_number(kind as u32), Some(kind));
            assert_eq!(PipelineKind::from_name(kind.name()), Some(kind));
        }
        for &reason in RejectionReason::ALL {
            assert_eq!(RejectionReason::from_number(reason as u32), Some(reason));
        }
    }

    #[test]
    fn an_unknown_number_is_none() {
        assert_eq!(Status::from_number(0), None);
        assert_eq!(PipelineKind::from_name("kalmann"), None);
    }

    #[test]
    fn rejection_reasons_fit_the_snapshot_counters() {
        let highest = RejectionReason::ALL.iter().map(|reason| *reason as usize).max();
        assert_eq!(highest, Some(crate::snapshot::REJECTION_REASONS - 1));
    }
}
