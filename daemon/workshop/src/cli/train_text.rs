//! The text of a first `train.toml`: the known facts of a train, and a marked default for the rest.

use clap::Args;
use dynocar_analysis::dataset::keys::train::NAME;
use dynocar_analysis::dataset::keys::{self, FileKey, assign, brake, traction};
use dynocar_analysis::dataset::parse_train;
use dynocar_analysis::dataset::written::TomlText;
use dynocar_model::train::TrainModel;
use dynocar_model::train::numbers::{
    CARS, CURVE_CONSTANT, DAVIS_A, DAVIS_B, DAVIS_C, FULL_MASS, LENGTH, MASS, ROTATING_MASS_FACTOR,
};
use toml::Value;

use dynocar::cli::Failure;
use dynocar::cli::text::{WIDTH, wrap};

/// Mass of a metre of train in t/m, used where only mass or only length is known.
const MASS_PER_LENGTH_T_PER_M: f64 = 2.0;
/// Mass in t of a train of which nothing is known: a regional multiple unit.
const MASS_DEFAULT_T: f64 = 200.0;
/// Length of a car in m, from which the number of cars follows.
const CAR_LENGTH_M: f64 = 25.0;
/// Inertia of the rotating parts over the mass: 0.03 for a loaded freight train, 0.1 for a motor
/// coach, 0.2 for a light locomotive.
const ROTATING_MASS_DEFAULT: f64 = 0.06;
/// Resistance in N/kN over the speed in m/s, of a train of which nothing is known.
const DAVIS_DEFAULT: [f64; 3] = [1.5, 0.015, 0.0015];
/// The user's description of the train.
#[derive(Clone, Debug, Default, PartialEq, Args)]
pub struct TrainArguments {
    /// The train's name
    #[arg(long)]
    name: Option<String>,
    /// Gross mass in t
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    mass_t: Option<f64>,
    /// Gross mass with its full load in t, where the load changes; --mass-t is the tare then
    #[arg(long, value_name = "T", allow_negative_numbers = true, requires = "mass_t")]
    mass_full_t: Option<f64>,
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

/// A key that everybody is asked for.
pub struct Asked {
    /// Its name.
    pub key: &'static str,
    /// The question, with its unit.
    pub question: &'static str,
    /// Comment next to it in the file.
    note: &'static str,
}

/// The keys that everybody is asked for, in the order of the file.
pub const ASKED: [Asked; 8] = [
    asked(NAME.name, "Name of the train", ""),
    asked(MASS.name, "Gross mass with its load, t", "t, with its load"),
    asked(LENGTH.name, "Length over the couplers, m", "m, over the couplers"),
    asked(CARS.name, "Number of cars, with the locomotive", "with the locomotive"),
    asked(
        ROTATING_MASS_FACTOR.name,
        "Inertia of wheels, axles and motors, share of the mass",
        "inertia of wheels, axles and motors as a share of the mass",
    ),
    asked(DAVIS_A.name, "a of the resistance a + b v + c v² with v in m/s, N/kN", "N/kN"),
    asked(DAVIS_B.name, "b, N/kN per m/s", "N/kN per m/s"),
    asked(DAVIS_C.name, "c, N/kN per (m/s)²", "N/kN per (m/s)²"),
];

const fn asked(key: &'static str, question: &'static str, note: &'static str) -> Asked {
    Asked { key, question, note }
}

/// Values of the train from files.
#[derive(Clone, Debug, Default)]
pub struct TrainValues {
    /// Keys of `[train]` and `[resistance]`, each with its value and where that is from.
    pub figures: Vec<(&'static str, Value, String)>,
    /// Greatest traction force: (m/s, N), by speed.
    pub traction: Option<Vec<(f64, f64)>>,
    /// Deceleration by all of the brake: (m/s, m/s²), by speed.
    pub brake_mps2: Option<Vec<(f64, f64)>>,
}

impl TrainValues {
    fn number(&self, key: &str) -> Option<f64> {
        self.figures.iter().find(|figure| figure.0 == key)?.1.as_float()
    }
}

/// A `train.toml`.
pub struct TrainText {
    /// Its text.
    pub text: String,
    /// The keys that hold a default, with it.
    pub defaults: Vec<String>,
}

impl TrainArguments {
    /// Returns whether the mass is no default.
    pub fn knows_mass(&self) -> bool {
        self.mass_t.is_some()
    }

    /// Returns whether nothing is said.
    pub fn is_empty(&self) -> bool {
        *self == TrainArguments::default()
    }

    /// Returns whether a key is said.
    pub fn knows(&self, key: &str) -> bool {
        ASKED.iter().zip(self.said()).any(|(asked, value)| asked.key == key && value.is_some())
    }

    /// Returns the user's values, in the order of [`ASKED`].
    fn said(&self) -> [Option<Value>; 8] {
        let number = |it: Option<f64>| it.map(Value::Float);
        [
            self.name.clone().map(Value::String),
            number(self.mass_t),
            number(self.length_m),
            self.cars.map(|cars| Value::Integer(cars.into())),
            number(self.rotating_mass_factor),
            number(self.a),
            number(self.b),
            number(self.c),
        ]
    }

    /// Returns the default of a key, given these arguments, as `train.toml` writes it.
    ///
    /// # Errors
    ///
    /// The values are not those of a train.
    pub fn default_of(&self, key: &str) -> Result<String, Failure> {
        let defaults = self.text("", &TrainValues::default())?.defaults;
        let value = defaults.iter().find_map(|it| it.split_once(" = ").filter(|it| it.0 == key));
        Ok(value.map(|(_, value)| value.trim_matches('"').to_owned()).unwrap_or_default())
    }

    /// Returns the same with one key said in words.
    ///
    /// # Errors
    ///
    /// Describes the values that no train has.
    pub fn with_answer(&self, key: &str, answer: &str) -> Result<Self, String> {
        let mut answered = self.clone();
        let number = || answer.replace(',', ".").parse().ok();
        let refused = || format!("{answer}: expected a number");
        let figure = match key {
            _ if key == NAME.name => {
                answered.name = Some(answer.into());
                None
            }
            _ if key == CARS.name => {
                answered.cars = Some(answer.parse().map_err(|_| refused())?);
                None
            }
            _ if key == MASS.name => Some(&mut answered.mass_t),
            _ if key == LENGTH.name => Some(&mut answered.length_m),
            _ if key == ROTATING_MASS_FACTOR.name => Some(&mut answered.rotating_mass_factor),
            _ if key == DAVIS_A.name => Some(&mut answered.a),
            _ if key == DAVIS_B.name => Some(&mut answered.b),
            _ if key == DAVIS_C.name => Some(&mut answered.c),
            _ => None,
        };
        if let Some(figure) = figure {
            *figure = Some(number().ok_or_else(refused)?);
        }
        match answered.text("", &TrainValues::default()) {
            Ok(_) => Ok(answered),
            Err(failure) => Err(failure.answer().map(|it| it.message).unwrap_or_default()),
        }
    }

    /// Returns the `train.toml` that a command writes, each value from the arguments, else from the found values, else
    /// a marked default.
    ///
    /// # Errors
    ///
    /// A value that is impossible for a train is an input failure.
    pub fn text(&self, writer: &str, found: &TrainValues) -> Result<TrainText, Failure> {
        let known_length_m = self.length_m.or(found.number(LENGTH.name));
        let mass_t = self.mass_t.or(found.number(MASS.name)).unwrap_or_else(|| {
            let length_m = known_length_m.filter(|length| *length > 0.0);
            length_m.map_or(MASS_DEFAULT_T, |length_m| MASS_PER_LENGTH_T_PER_M * length_m)
        });
        let length_m = known_length_m.unwrap_or((mass_t / MASS_PER_LENGTH_T_PER_M).max(1.0));
        let cars = (length_m / CAR_LENGTH_M).round().clamp(1.0, 1000.0) as u32;
        let [a, b, c] = DAVIS_DEFAULT.map(Value::Float);
        let defaults = [
            Value::String("my train".into()),
            Value::Float(mass_t),
            Value::Float(length_m),
            Value::Integer(cars.into()),
            Value::Float(ROTATING_MASS_DEFAULT),
            a,
            b,
            c,
        ];
        let (mut text, mut marked) = (TomlText::new(&head(writer), keys::train::TABLE), Vec::new());
        for ((Asked { key, note, .. }, said), default) in
            ASKED.iter().zip(self.said()).zip(defaults)
        {
            let is_mass = *key == MASS.name;
            let words = if is_mass && self.mass_full_t.is_some() { "t, tare" } else { note };
            let from_files = found.figures.iter().find(|figure| figure.0 == *key);
            let (value, comment) = match (said, from_files) {
                (Some(value), _) => (value, words.into()),
                (None, Some((_, value, from))) => (value.clone(), on_one_line(from)),
                (None, None) => {
                    marked.push(assign(key, &default));
                    (default, format!("DEFAULT; {words}").trim_end_matches("; ").to_owned())
                }
            };
            if *key == DAVIS_A.name {
                text.lines(RESISTANCE);
                text.table(keys::resistance::TABLE);
            }
            text.lines(&noted(assign(key, value), &comment));
            if is_mass {
                text.lines(&match self.mass_full_t {
                    Some(full_t) => {
                        noted(assign(FULL_MASS.name, Value::Float(full_t)), "t, with its full load")
                    }
                    // For a train whose load changes.
                    None => noted(
                        format!("# {}", assign(FULL_MASS.name, "300.0")),
                        "t, where the load changes; mass_t is the tare then",
                    ),
                });
            }
        }
        let inertia = self.rotating_mass_factor.or(found.number(ROTATING_MASS_FACTOR.name));
        let inertial_kg = 1e3 * mass_t * (1.0 + inertia.unwrap_or(ROTATING_MASS_DEFAULT));
        efforts(&mut text, found, inertial_kg);
        let text = text.into_text();
        // The reader of the file checks the values; only given values can be wrong.
        parse_train("train", &text)
            .map_err(|error| Failure::Input(format!("the train as given: {}", error.words)))?;
        Ok(TrainText { text, defaults: marked })
    }
}

/// Returns a line of an assignment and a comment, if any.
fn noted(assignment: String, comment: &str) -> String {
    match comment {
        "" => format!("{assignment}\n"),
        comment => format!("{assignment:<31} # {comment}\n"),
    }
}

/// Returns a number that was converted, without the digits that only the conversion made.
pub fn converted(value: f64) -> Value {
    Value::Float(format!("{value:.8e}").parse().unwrap_or(value))
}

/// Adds the curve constant and the efforts, or how they are written.
fn efforts(text: &mut TomlText, found: &TrainValues, inertial_kg: f64) {
    let constant = Value::Float(TrainModel::UNDECLARED.curve_constant_n_per_kn_m);
    let constant = assign(CURVE_CONSTANT.name, constant);
    text.lines(&format!(
        "# {constant}     # k of the resistance k/R in curves that track.toml maps\n"
    ));
    let effort = |text: &mut TomlText, words: &str, key: &FileKey, points: &[(f64, f64)]| {
        text.lines(&format!("\n# The greatest {words} over the speed: {UNITS}.\n"));
        text.table(key.table);
        let point = |&(speed_mps, force_n): &(f64, f64)| {
            format!("{}, {}", converted(speed_mps), converted(force_n / 1000.0))
        };
        text.list(key, points.iter().map(point));
    };
    match &found.traction {
        Some(points) => effort(text, "force", &traction::EFFORT, points),
        None => {
            let example = traction::EFFORT.assign("[[0.0, 200.0], [15.0, 200.0], [45.0, 70.0]]");
            text.lines(&format!(
                "\n# The greatest force over the speed: {UNITS}. With it, handles of 0 to 1 can be\n\
                 # read as forces, and units that cannot be are reported.\n# [{}]\n# {example}\n",
                traction::TABLE
            ));
        }
    }
    match &found.brake_mps2 {
        Some(points) => {
            let forces: Vec<_> = points.iter().map(|it| (it.0, inertial_kg * it.1)).collect();
            effort(text, "brake force", &brake::EFFORT, &forces);
        }
        None => {
            let most = brake::MAX_FORCE.assign("200.0");
            text.lines(&format!("# [{}]\n# {most}\n", brake::TABLE));
        }
    }
}

/// Units of the points of an effort curve.
const UNITS: &str = "[speed in m/s, force in kN]";

fn head(writer: &str) -> String {
    let words = format!(
        "The train. Written by {writer}; what is marked DEFAULT is nobody's measurement: replace it \
         by what you know, and the estimators will find the rest. `dynocar check train.toml` reads it \
         back."
    );
    comment("", &words)
}

const RESISTANCE: &str = "
# Resistance on level, straight track: a + b v + c v² in N for each kN of weight, v in m/s.
";

/// Returns the words without line breaks and other marks that would end a line.
pub fn on_one_line(words: &str) -> String {
    words.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
}

/// Returns a comment of a TOML file, in lines that begin alike.
pub fn comment(indent: &str, words: &str) -> String {
    let lines = wrap(&on_one_line(words), WIDTH - indent.len());
    lines.iter().map(|line| format!("# {indent}{line}\n")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_marked_and_figures_as_given_are_not() {
        let given = TrainArguments {
            name: Some("a \"quoted\"\nname".into()),
            mass_t: Some(114.5),
            mass_full_t: Some(150.0),
            b: Some(-0.01),
            ..TrainArguments::default()
        };
        let made = given.text("x", &TrainValues::default()).unwrap();
        let train = parse_train("train.toml", &made.text).unwrap();
        assert_eq!((train.mass_kg, train.resistance.b), (114_500.0, -0.01));
        assert_eq!(train.full_mass_kg, Some(150_000.0));
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
        let from = "t, the middle of what the recordings hold".to_string();
        let figures = vec![("mass_t", Value::Float(321.5), from)];
        let found = TrainValues { figures, ..TrainValues::default() };
        let made = none.text("x", &found).unwrap();
        assert!(made.text.contains("mass_t = 321.5 ") && made.text.contains("recordings hold"));
        assert!(!made.defaults.iter().any(|it| it.starts_with("mass_t")));
        let given = TrainArguments { mass_t: Some(100.0), ..none };
        assert!(given.text("x", &found).unwrap().text.contains("mass_t = 100.0 "));
    }

    #[test]
    fn figures_that_no_train_has_are_refused_in_words() {
        let refused = |given: TrainArguments| match given.text("x", &TrainValues::default()) {
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
}
