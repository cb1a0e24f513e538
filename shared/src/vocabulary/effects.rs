//! Each kind of effect: one row with its number, its name, and the words for it in reports, the log, `dynocar watch`
//! and the answer of `explain`.

/// A kind of effect in words.
#[derive(Debug)]
pub struct KindRow {
    /// The kind.
    pub kind: EffectKind,
    /// Its name in a running text.
    pub title: &'static str,
    /// Recommended action where it acts, in one line without a full stop.
    pub to_do: &'static str,
    /// The quantity over which it is seen best, by its name in answers; `None` where there is none.
    pub seen_over: Option<&'static str>,
    /// Runs that would determine it, where it is one number of the train or the line.
    pub determined_by: &'static str,
    /// Kinds that it is easily confused with, and the run that separates the two.
    pub separated_from: &'static [(EffectKind, &'static str)],
}

/// Lists every kind once.
macro_rules! effects {
    ($( #[doc = $doc:literal] $kind:ident = $number:literal $name:literal {
        title: $title:expr, seen_over: $seen_over:expr, determined_by: $determined_by:expr,
        to_do: $to_do:expr,
        $( separated_from $other:ident: $run:literal, )*
    } )*) => {
        vocabulary! {
            /// An effect that a model may lack, as in the answers of `dynocar explain`.
            EffectKind: u32 { $( #[doc = $doc] $kind = $number $name ),* }
        }

        /// Every kind in words, in the order of its number.
        pub const KINDS: [KindRow; EffectKind::ALL.len()] = [ $( KindRow {
            kind: EffectKind::$kind,
            title: $title,
            to_do: $to_do,
            seen_over: $seen_over,
            determined_by: $determined_by,
            separated_from: &[ $( (EffectKind::$other, $run) ),* ],
        } ),* ];
    };
}

const MORE_RUNS: &str = "more runs";
const LET_EXPLAIN: &str = "record a run and let `dynocar explain` say which force the model lacks";
const DECLARE_IT: &str =
    "declare it: `dynocar explain` on a recorded run writes it into the line's files";
const WEATHER: &str = "nothing on the train: the weather passes; keep it apart from a, b and c";
const CHECK_PROFILE: &str = "check the line's gradient profile and where it begins";
const HARDER: &str = "harder accelerating and braking";

// A pair of kinds stands in the row of the first of them.
effects! {
    /// No suspicion.
    None = 0 "none" {
        title: "nothing undeclared", seen_over: None, determined_by: MORE_RUNS,
        to_do: LET_EXPLAIN,
    }
    /// Air drag in tunnels.
    TunnelDrag = 1 "tunnel_drag" {
        title: "tunnel drag", seen_over: Some("chainage_m"), determined_by: "fast passes of the tunnels",
        to_do: DECLARE_IT,
        separated_from Wind: "Pass the portals in both directions and on another day.",
        separated_from LocalResistance: "Pass the place at clearly different speeds.",
    }
    /// Resistance in curves.
    CurveResistance = 2 "curve_resistance" {
        title: "curve resistance", seen_over: Some("curvature_per_m"),
        determined_by: "more passes of the sharpest curves",
        to_do: DECLARE_IT,
        separated_from GradientShift: "Pass the curves in both directions: a gradient changes its sign.",
    }
    /// Wind along the line.
    Wind = 3 "wind" {
        title: "wind along the line", seen_over: Some("direction"),
        determined_by: "fast runs in both directions on one day",
        to_do: WEATHER,
    }
    /// A brake that does not release.
    DraggingBrake = 4 "dragging_brake" {
        title: "a dragging brake", seen_over: Some("run"), determined_by: MORE_RUNS,
        to_do: "at the next stop check that every brake releases, and feel every vehicle's wheels for heat",
        separated_from BearingTemperature: "Read the brake-cylinder pressure while released, and let the train run on.",
        separated_from LocalResistance: "Pass the place in further runs: a place stays, a brake moves with its train.",
        separated_from AmbientTemperature: "Read the brake-cylinder pressure while released, and record runs on a \
             mild day.",
    }
    /// A wrong wheel diameter, hence a wrong speed scale.
    WheelDiameter = 5 "wheel_diameter" {
        title: "a wrong wheel diameter", seen_over: Some("speed_mps"),
        determined_by: "positions over several kilometres",
        to_do: "measure the wheels, and set the diameter measured in the speed sensor",
    }
    /// A gradient profile moved along the line.
    GradientShift = 6 "gradient_shift" {
        title: "a gradient profile shifted along the line", seen_over: Some("chainage_m"),
        determined_by: "more passes of the steepest changes of gradient",
        to_do: CHECK_PROFILE,
    }
    /// Another mass than declared.
    MassChange = 7 "mass_change" {
        title: "a changed mass", seen_over: Some("acceleration_mps2"), determined_by: HARDER,
        to_do: "check the declared mass against the load",
        separated_from TractionGain: "Coast down a known gradient: a mass is felt there, a gain is not.",
        separated_from RotatingMass: "Pass a steep gradient at other loads: the rotating mass does not feel it.",
    }
    /// A reported force that is not the true one.
    TractionGain = 8 "traction_gain" {
        title: "a wrong scale of the reported traction force", seen_over: Some("traction_force_n"),
        determined_by: HARDER,
        to_do: "check the scale of the reported forces",
        separated_from BrakeGain: "Pull hard without braking, and brake hard without pulling.",
    }
    /// Forces that act later than reported.
    ActuatorDelay = 9 "actuator_delay" {
        title: "delayed forces", seen_over: Some("force_change_n_per_s"), determined_by: MORE_RUNS,
        to_do: "check how late forces act after they are reported",
        separated_from SpeedDelay: "Record a position of its own (GNSS, balises) on steep and changing gradients: the \
             line acts at once on a train, a late speed shows it late.",
    }
    /// Another rotating mass than declared.
    RotatingMass = 10 "rotating_mass" {
        title: "another rotating mass than declared", seen_over: Some("acceleration_mps2"), determined_by: HARDER,
        to_do: "check the declared rotating mass",
        separated_from TractionGain: "Compare accelerating with braking: a gain acts on traction only.",
        separated_from WheelDiameter: "Compare the odometer with balises over several kilometres.",
    }
    /// Cold bearings that warm up.
    BearingTemperature = 11 "bearing_temperature" {
        title: "cold bearings that warm up", seen_over: Some("time_since_start_s"), determined_by: MORE_RUNS,
        to_do: WEATHER,
    }
    /// Resistance that follows the outside temperature.
    AmbientTemperature = 12 "ambient_temperature" {
        title: "resistance that follows the outside temperature", seen_over: Some("ambient_temperature_degc"),
        determined_by: "runs on colder and warmer days",
        to_do: WEATHER,
        separated_from BearingTemperature: "Start warm on a cold day and cold on a warm one.",
    }
    /// Extra resistance at a place.
    LocalResistance = 13 "local_resistance" {
        title: "a local resistance", seen_over: Some("chainage_m"), determined_by: MORE_RUNS,
        to_do: "have the track and the overhead line looked at there; change nothing on the train",
    }
    /// A brake force that the rail does not carry.
    LowAdhesion = 14 "low_adhesion" {
        title: "low adhesion", seen_over: Some("traction_force_n"), determined_by: MORE_RUNS,
        to_do: "expect long braking distances: the rail carries less than the brake asks",
    }
    /// A real residual that no known effect explains.
    Unknown = 15 "unknown" {
        title: "something outside the library", seen_over: None, determined_by: MORE_RUNS,
        to_do: LET_EXPLAIN,
    }
    /// A declared gradient that is wrong by a smooth function of the chainage.
    GradientError = 16 "gradient_error" {
        title: "a gradient that is wrong along the line", seen_over: Some("chainage_m"), determined_by: MORE_RUNS,
        to_do: CHECK_PROFILE,
        separated_from LocalResistance: "Drive the line in the other direction: a gradient changes its sign there.",
    }
    /// A measured speed that is late.
    SpeedDelay = 17 "speed_delay" {
        title: "a measured speed that is late", seen_over: Some("acceleration_mps2"), determined_by: MORE_RUNS,
        to_do: "check how old a speed is when the controller reads it",
    }
    /// A brake that is weaker or stronger than reported.
    BrakeGain = 18 "brake_gain" {
        title: "a brake that is weaker or stronger than reported", seen_over: Some("brake_force_n"),
        determined_by: "harder braking on the level",
        to_do: "check what the brake exerts against what it reports: friction, pressure, brakes cut out",
        separated_from MassChange: "Pull hard at the same load: a mass is felt there, a brake is not.",
        separated_from LowAdhesion: "Brake gently and hard on a dry day: the rail limits hard braking only.",
    }
    /// A brake that acts later than reported, while traction does not.
    BrakeDelay = 19 "brake_delay" {
        title: "a brake that acts late", seen_over: Some("force_change_n_per_s"),
        determined_by: "more brakings that begin and end at speed",
        to_do: "check how long the brake takes to build up and to release after it is reported",
        separated_from ActuatorDelay: "Change traction quickly without braking: only where it is late too are both.",
    }
}

impl EffectKind {
    /// Returns the effect's bit in [`crate::ParameterSnapshot::suspected_alternatives`].
    pub const fn bit(self) -> u32 {
        1 << self as u32
    }
}

impl KindRow {
    /// Returns the row of a kind.
    pub const fn of(kind: EffectKind) -> &'static KindRow {
        &KINDS[kind as usize]
    }
}

/// Returns the run that separates a kind from the first of others that it is confused with; `None` where no row of
/// any of them names one.
pub fn separating_run(kind: EffectKind, others: &[EffectKind]) -> Option<&'static str> {
    let has = |wanted: EffectKind| kind == wanted || others.contains(&wanted);
    let rows = KINDS.iter().filter(|row| has(row.kind)).flat_map(|row| row.separated_from);
    rows.clone().find(|(other, _)| has(*other)).map(|(_, run)| *run)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_has_its_row_and_what_to_do_is_one_plain_line() {
        assert_eq!(KINDS.len(), EffectKind::ALL.len());
        for &kind in EffectKind::ALL {
            let row = KindRow::of(kind);
            assert_eq!(row.kind, kind);
            assert!((10..120).contains(&row.to_do.len()) && !row.to_do.ends_with('.'), "{row:?}");
        }
    }

    #[test]
    fn a_pair_stands_in_one_row_only() {
        let pairs: Vec<[EffectKind; 2]> = KINDS
            .iter()
            .flat_map(|row| row.separated_from.iter().map(|(other, _)| [row.kind, *other]))
            .collect();
        for (k, [one, other]) in pairs.iter().enumerate() {
            assert_ne!(one, other);
            assert!(!pairs[k + 1..].contains(&[*other, *one]), "{one:?} and {other:?}");
            assert_eq!(separating_run(*one, &[*other]), separating_run(*other, &[*one]));
        }
    }
}
