//! `train.toml` and `daemon.toml` of a first description.

use clap::Args;
use dynocar_core::dataset::parse_train;
use toml::Value;

use crate::cli::Failure;

/// The daemon's configuration as shipped: the recommended set.
const SHIPPED: &str = include_str!("../../../../config/daemon.toml");
/// Lines of the shipped configuration that are another train's, and what stands instead.
const REPLACED: [(&str, &str); 5] = [
    (
        "# Dynocar's daemon: which trains it serves, and which estimators learn what.",
        "# Dynocar's daemon: which trains it serves, and which estimators learn what. Written by\n\
         # dynocar init from the recommended set.",
    ),
    (
        "# dynocar check config/daemon.toml says what this file means.",
        "# dynocar check daemon.toml says what this file means.",
    ),
    ("file = \"demo/train.toml\"    # relative", "file = \"train.toml\"         # relative"),
    ("track = \"demo/track.toml\"   # optional", "# track = \"track.toml\"      # optional"),
    (
        "# the train file; the demo's train has neither.",
        "# the train file, table [brake]; add them before you switch it on.",
    ),
];

/// Mass of a metre of train in t/m, where only one of mass and length is known.
const MASS_PER_LENGTH_T_PER_M: f64 = 2.0;
/// Mass in t of a train of which nothing is known: a regional multiple unit.
const MASS_DEFAULT_T: f64 = 200.0;
/// Length of a car in m, for their number.
const CAR_LENGTH_M: f64 = 25.0;
/// Inertia of the rotating parts over the mass: 0.03 for a loaded freight train, 0.1 for a motor
/// coach, 0.2 for a light locomotive.
const ROTATING_MASS_DEFAULT: f64 = 0.06;
/// Resistance in N/kN over the speed in m/s, of a train of which nothing is known.
const DAVIS_DEFAULT: [f64; 3] = [1.5, 0.015, 0.0015];

/// What is known of the train.
#[derive(Clone, Debug, Default, Args)]
pub struct TrainArguments {
    /// The train's name
    #[arg(long)]
    name: Option<String>,
    /// Gross mass in t
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    mass_t: Option<f64>,
    /// Length in m
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    length_m: Option<f64>,
    /// Number of cars, with the locomotive
    #[arg(long, value_name = "N")]
    cars: Option<u32>,
    /// Inertia of wheels, axles and motors as a share of the mass
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    rotating_mass_factor: Option<f64>,
    /// a of the resistance a + b v + c v² in N/kN, v in m/s
    #[arg(long, value_name = "N/kN", allow_negative_numbers = true)]
    a: Option<f64>,
    /// b in N/kN per m/s
    #[arg(long, value_name = "N/kN/(m/s)", allow_negative_numbers = true)]
    b: Option<f64>,
    /// c in N/kN per (m/s)²
    #[arg(long, value_name = "N/kN/(m/s)²", allow_negative_numbers = true)]
    c: Option<f64>,
}

/// A `train.toml`.
pub struct TrainText {
    /// Its text.
    pub text: String,
    /// The keys that hold a default, with it.
    pub defaults: Vec<String>,
}

impl TrainArguments {
    /// True where the mass is no default.
    pub fn knows_mass(&self) -> bool {
        self.mass_t.is_some()
    }

    /// The `train.toml`; a mass that was recorded takes the place of a default.
    ///
    /// # Errors
    ///
    /// A figure that no train has is an input failure.
    pub fn text(&self, recorded_mass_t: Option<f64>) -> Result<TrainText, Failure> {
        let recorded = self.mass_t.is_none().then_some(recorded_mass_t).flatten();
        let known_mass = self.mass_t.or(recorded);
        let mass_t = known_mass
            .or_else(|| {
                let length_m = self.length_m.filter(|length| *length > 0.0);
                length_m.map(|length_m| MASS_PER_LENGTH_T_PER_M * length_m)
            })
            .unwrap_or(MASS_DEFAULT_T);
        let length_m = self.length_m.unwrap_or((mass_t / MASS_PER_LENGTH_T_PER_M).max(1.0));
        let cars = (length_m / CAR_LENGTH_M).round().clamp(1.0, 1000.0) as u32;
        let mut lines = Lines { text: HEAD.into(), defaults: Vec::new() };
        let name = self.name.clone();
        lines.push("name", name.map(Value::String), Value::String("my train".into()), "");
        match recorded {
            Some(mass_t) => {
                let comment = "t, the middle of the mass that the recordings hold";
                lines.known("mass_t", &Value::Float(mass_t), comment);
            }
            None => lines.number("mass_t", self.mass_t, mass_t, "t, with its load"),
        }
        lines.number("length_m", self.length_m, length_m, "m, over the couplers");
        let given = self.cars.map(|cars| Value::Integer(cars.into()));
        lines.push("cars", given, Value::Integer(cars.into()), "with the locomotive");
        let comment = "inertia of wheels, axles and motors as a share of the mass";
        let gamma = self.rotating_mass_factor;
        lines.number("rotating_mass_factor", gamma, ROTATING_MASS_DEFAULT, comment);
        lines.text += RESISTANCE;
        let units = ["N/kN", "N/kN per m/s", "N/kN per (m/s)²"];
        let given = [("a", self.a), ("b", self.b), ("c", self.c)];
        for (((key, given), default), unit) in given.into_iter().zip(DAVIS_DEFAULT).zip(units) {
            lines.number(key, given, default, unit);
        }
        lines.text += TAIL;
        // The file's own reader judges the figures; only the command line can be wrong.
        parse_train("train", &lines.text)
            .map_err(|error| Failure::Input(format!("the train as given: {}", error.problem)))?;
        Ok(TrainText { text: lines.text, defaults: lines.defaults })
    }
}

const HEAD: &str = "\
# The train. Written by dynocar init; what is marked DEFAULT is nobody's measurement: replace it by
# what you know, and the estimators will find the rest. `dynocar check train.toml` reads it back.
[train]
";

const RESISTANCE: &str = "
# Resistance on level, straight track: a + b v + c v² in N for each kN of weight, v in m/s.
[resistance]
";

const TAIL: &str = "\
# curve_constant_n_per_kn_m = 600.0     # k of the resistance k/R in curves that track.toml maps

# The greatest force over the speed: [speed in m/s, force in kN]. With it, handles of 0 to 1 can be
# read as forces, and units that cannot be are told.
# [traction]
# effort = [[0.0, 200.0], [15.0, 200.0], [45.0, 70.0]]
# [brake]
# max_force_kn = 200.0
";

struct Lines {
    text: String,
    defaults: Vec<String>,
}

impl Lines {
    fn number(&mut self, key: &str, given: Option<f64>, default: f64, comment: &str) {
        self.push(key, given.map(Value::Float), Value::Float(default), comment);
    }

    fn push(&mut self, key: &str, given: Option<Value>, default: Value, comment: &str) {
        match given {
            Some(value) => self.known(key, &value, comment),
            None => {
                self.defaults.push(format!("{key} = {default}"));
                let comment = format!("DEFAULT; {comment}");
                self.known(key, &default, comment.trim_end_matches("; "));
            }
        }
    }

    fn known(&mut self, key: &str, value: &Value, comment: &str) {
        let assignment = format!("{key} = {value}");
        self.text += &match comment {
            "" => format!("{assignment}\n"),
            comment => format!("{assignment:<32}# {comment}\n"),
        };
    }
}

/// The daemon's configuration: the recommended set for the train beside it.
pub fn daemon(has_track: bool) -> String {
    let text = REPLACED
        .iter()
        .fold(String::from(SHIPPED), |text, (shipped, own)| text.replace(shipped, own));
    if has_track {
        text.replace("# track = \"track.toml\" ", "track = \"track.toml\"   ")
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DaemonConfig;

    #[test]
    fn defaults_are_marked_and_figures_as_given_are_not() {
        let given = TrainArguments {
            name: Some("a \"quoted\"\nname".into()),
            mass_t: Some(114.5),
            b: Some(-0.01),
            ..TrainArguments::default()
        };
        let made = given.text(None).unwrap();
        let train = parse_train("train.toml", &made.text).unwrap();
        assert_eq!((train.mass_kg, train.resistance.b), (114_500.0, -0.01));
        assert_eq!(train.name, "a \"quoted\"\nname");
        assert_eq!((train.length_m, train.cars), (57.25, 2));
        let marked = made.text.lines().filter(|line| line.contains("# DEFAULT")).count();
        assert_eq!(marked, made.defaults.len());
        let keys: Vec<_> = made.defaults.iter().filter_map(|it| it.split(' ').next()).collect();
        assert_eq!(keys, ["length_m", "cars", "rotating_mass_factor", "a", "c"]);
    }

    #[test]
    fn a_recorded_mass_takes_the_place_of_the_default_only() {
        let none = TrainArguments::default();
        let made = none.text(Some(321.5)).unwrap();
        assert!(made.text.contains("mass_t = 321.5 ") && made.text.contains("recordings hold"));
        assert!(!made.defaults.iter().any(|it| it.starts_with("mass_t")));
        let given = TrainArguments { mass_t: Some(100.0), ..none };
        assert!(given.text(Some(321.5)).unwrap().text.contains("mass_t = 100.0 "));
    }

    #[test]
    fn figures_that_no_train_has_are_refused_in_words() {
        let refused = |given: TrainArguments| match given.text(None) {
            Err(Failure::Input(message)) => message,
            _ => panic!("an input failure"),
        };
        let base = TrainArguments::default();
        let message = refused(TrainArguments { mass_t: Some(-3.0), ..base.clone() });
        assert_eq!(
            message,
            "the train as given: train.mass_t = -3: expected a mass in t above 0, at most 100000"
        );
        let message = refused(TrainArguments { length_m: Some(f64::NAN), ..base.clone() });
        assert!(message.contains("train.length_m = NaN"), "{message}");
        assert!(refused(TrainArguments { cars: Some(0), ..base.clone() }).contains("train.cars"));
        assert!(refused(TrainArguments { a: Some(4e3), ..base }).contains("resistance.a"));
    }

    #[test]
    fn the_configuration_is_the_shipped_one_for_the_train_beside_it() {
        for (shipped, _) in REPLACED {
            assert_eq!(SHIPPED.matches(shipped).count(), 1, "{shipped}");
        }
        let folder = tempfile::tempdir().unwrap();
        let train = TrainArguments::default().text(None).unwrap();
        std::fs::write(folder.path().join("train.toml"), train.text).unwrap();
        std::fs::write(folder.path().join("track.toml"), "[track]\n").unwrap();
        let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/daemon.toml");
        let shipped = DaemonConfig::load(std::path::Path::new(shipped)).unwrap();
        for has_track in [false, true] {
            let text = daemon(has_track);
            assert!(!text.contains("demo"), "{text}");
            let path = folder.path().join("daemon.toml");
            std::fs::write(&path, text).unwrap();
            let config = DaemonConfig::load(&path).unwrap();
            assert_eq!(config.pipelines.len(), shipped.pipelines.len());
            assert_eq!(config.trains[0].track.is_some(), has_track);
        }
    }
}
