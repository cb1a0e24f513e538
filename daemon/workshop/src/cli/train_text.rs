//! The text of a first `train.toml`: what is known of a train, and a marked default for the rest.

use clap::Args;
use dynocar_analysis::dataset::parse_train;
use toml::Value;

use super::text::{comment, on_one_line};
use dynocar::cli::Failure;

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
/// Key of the full load, for a train whose load changes.
const FULL: &str =
    "# mass_full_t = 300.0           # t, where the load changes; mass_t is the tare then\n";

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

/// Questions about keys that the user has not given: the key, and the question with its unit.
pub const QUESTIONS: [(&str, &str); 8] = [
    ("name", "Name of the train"),
    ("mass_t", "Gross mass with its load, t"),
    ("length_m", "Length over the couplers, m"),
    ("cars", "Number of cars, with the locomotive"),
    ("rotating_mass_factor", "Inertia of wheels, axles and motors, share of the mass"),
    ("a", "a of the resistance a + b v + c v² with v in m/s, N/kN"),
    ("b", "b, N/kN per m/s"),
    ("c", "c, N/kN per (m/s)²"),
];

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
    /// True where the mass is no default.
    pub fn knows_mass(&self) -> bool {
        self.mass_t.is_some()
    }

    /// True where nothing is said.
    pub fn is_empty(&self) -> bool {
        *self == TrainArguments::default()
    }

    /// True where a key is said.
    pub fn knows(&self, key: &str) -> bool {
        self.said().into_iter().any(|(said, value)| said == key && value.is_some())
    }

    /// Returns the user's values, by key, in the order of the file.
    fn said(&self) -> [(&'static str, Option<Value>); 8] {
        let number = |it: Option<f64>| it.map(Value::Float);
        [
            ("name", self.name.clone().map(Value::String)),
            ("mass_t", number(self.mass_t)),
            ("length_m", number(self.length_m)),
            ("cars", self.cars.map(|cars| Value::Integer(cars.into()))),
            ("rotating_mass_factor", number(self.rotating_mass_factor)),
            ("a", number(self.a)),
            ("b", number(self.b)),
            ("c", number(self.c)),
        ]
    }

    fn figure(&mut self, key: &str) -> Option<&mut Option<f64>> {
        Some(match key {
            "mass_t" => &mut self.mass_t,
            "length_m" => &mut self.length_m,
            "rotating_mass_factor" => &mut self.rotating_mass_factor,
            "a" => &mut self.a,
            "b" => &mut self.b,
            "c" => &mut self.c,
            _ => return None,
        })
    }

    /// The default of a key beside what is said, as `train.toml` writes it.
    ///
    /// # Errors
    ///
    /// The values are not those of a train.
    pub fn default_of(&self, key: &str) -> Result<String, Failure> {
        let defaults = self.text("", &TrainValues::default())?.defaults;
        let value = defaults.iter().find_map(|it| it.split_once(" = ").filter(|it| it.0 == key));
        Ok(value.map(|(_, value)| value.trim_matches('"').to_owned()).unwrap_or_default())
    }

    /// The same with one key said in words.
    ///
    /// # Errors
    ///
    /// Describes the values that no train has.
    pub fn with_answer(&self, key: &str, answer: &str) -> Result<Self, String> {
        let mut answered = self.clone();
        match key {
            "name" => answered.name = Some(answer.into()),
            "cars" => {
                let cars = answer.parse().map_err(|_| format!("{answer}: expected a number"))?;
                answered.cars = Some(cars);
            }
            key => {
                let number = answer.replace(',', ".").parse();
                let number = number.map_err(|_| format!("{answer}: expected a number"))?;
                if let Some(figure) = answered.figure(key) {
                    *figure = Some(number);
                }
            }
        }
        match answered.text("", &TrainValues::default()) {
            Ok(_) => Ok(answered),
            Err(failure) => Err(failure.answer().map(|it| it.message).unwrap_or_default()),
        }
    }

    /// The `train.toml` by a command: what is said, else what was found, else a marked default.
    ///
    /// # Errors
    ///
    /// A figure that no train has is an input failure.
    pub fn text(&self, writer: &str, found: &TrainValues) -> Result<TrainText, Failure> {
        let known_length_m = self.length_m.or(found.number("length_m"));
        let mass_t = self.mass_t.or(found.number("mass_t")).unwrap_or_else(|| {
            let length_m = known_length_m.filter(|length| *length > 0.0);
            length_m.map_or(MASS_DEFAULT_T, |length_m| MASS_PER_LENGTH_T_PER_M * length_m)
        });
        let length_m = known_length_m.unwrap_or((mass_t / MASS_PER_LENGTH_T_PER_M).max(1.0));
        let cars = (length_m / CAR_LENGTH_M).round().clamp(1.0, 1000.0) as u32;
        let [a, b, c] = DAVIS_DEFAULT.map(Value::Float);
        let inertia = "inertia of wheels, axles and motors as a share of the mass";
        let defaults = [
            (Value::String("my train".into()), ""),
            (Value::Float(mass_t), self.mass_full_t.map_or("t, with its load", |_| "t, tare")),
            (Value::Float(length_m), "m, over the couplers"),
            (Value::Integer(cars.into()), "with the locomotive"),
            (Value::Float(ROTATING_MASS_DEFAULT), inertia),
            (a, "N/kN"),
            (b, "N/kN per m/s"),
            (c, "N/kN per (m/s)²"),
        ];
        let (mut text, mut marked) = (head(writer), Vec::new());
        for ((key, said), (default, words)) in self.said().into_iter().zip(defaults) {
            let from_files = found.figures.iter().find(|figure| figure.0 == key);
            let (value, comment) = match (said, from_files) {
                (Some(value), _) => (value, words.into()),
                (None, Some((_, value, from))) => (value.clone(), on_one_line(from)),
                (None, None) => {
                    marked.push(format!("{key} = {default}"));
                    (default, format!("DEFAULT; {words}").trim_end_matches("; ").to_owned())
                }
            };
            let assignment = format!("{key} = {value}");
            text += if key == "a" { RESISTANCE } else { "" };
            text += &match &comment[..] {
                "" => format!("{assignment}\n"),
                comment => format!("{assignment:<31} # {comment}\n"),
            };
            if key == "mass_t" {
                text += &self.mass_full_t.map_or(FULL.into(), |full_t| {
                    let assignment = format!("mass_full_t = {}", Value::Float(full_t));
                    format!("{assignment:<31} # t, with its full load\n")
                });
            }
        }
        text += CURVES;
        text += &found.traction.as_deref().map_or(TRACTION.into(), |it| effort(EFFORT, it));
        let inertia = self.rotating_mass_factor.or(found.number("rotating_mass_factor"));
        let inertial_kg = 1e3 * mass_t * (1.0 + inertia.unwrap_or(ROTATING_MASS_DEFAULT));
        text += &found.brake_mps2.as_deref().map_or(BRAKE.into(), |points| {
            let forces = points.iter().map(|it| (it.0, inertial_kg * it.1));
            effort(BRAKE_EFFORT, &forces.collect::<Vec<_>>())
        });
        // The file's own reader judges the figures; only what was given can be wrong.
        parse_train("train", &text)
            .map_err(|error| Failure::Input(format!("the train as given: {}", error.words)))?;
        Ok(TrainText { text, defaults: marked })
    }
}

/// A number that was converted, without the digits that only the conversion made.
pub fn converted(value: f64) -> Value {
    Value::Float(format!("{value:.8e}").parse().unwrap_or(value))
}

fn effort(head: &str, points: &[(f64, f64)]) -> String {
    let mut text = String::from(head);
    for &(speed_mps, force_n) in points {
        text += &format!("  [{}, {}],\n", converted(speed_mps), converted(force_n / 1000.0));
    }
    text + "]\n"
}

fn head(writer: &str) -> String {
    let words = format!(
        "The train. Written by {writer}; what is marked DEFAULT is nobody's measurement: replace it \
         by what you know, and the estimators will find the rest. `dynocar check train.toml` reads it \
         back."
    );
    comment("", &words) + "[train]\n"
}

const RESISTANCE: &str = "
# Resistance on level, straight track: a + b v + c v² in N for each kN of weight, v in m/s.
[resistance]
";

const CURVES: &str = "\
# curve_constant_n_per_kn_m = 600.0     # k of the resistance k/R in curves that track.toml maps
";

const TRACTION: &str = "
# The greatest force over the speed: [speed in m/s, force in kN]. With it, handles of 0 to 1 can be
# read as forces, and units that cannot be are reported.
# [traction]
# effort = [[0.0, 200.0], [15.0, 200.0], [45.0, 70.0]]
";

const EFFORT: &str = "
# The greatest force over the speed: [speed in m/s, force in kN].
[traction]
effort = [
";

const BRAKE_EFFORT: &str = "
# The greatest brake force over the speed: [speed in m/s, force in kN].
[brake]
effort = [
";

const BRAKE: &str = "\
# [brake]
# max_force_kn = 200.0
";

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
